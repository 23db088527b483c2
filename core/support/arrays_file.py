"""Files of numpy arrays (.npz) that are read whole or not at all.

numpy reads what a member's head announces, and the checksum of a member is compared at its end alone: where a damaged head
announces less, nothing is compared. Here each member is read to its end before numpy sees it.
"""

from __future__ import annotations

import errno
import io
import lzma
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MEMBER = ".npy"
# What Python's zip module raises of damaged files. RuntimeError: where a bit says that a member is encrypted.
NOT_WHOLE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError)
NOWHERE = (errno.EINVAL, errno.EOVERFLOW)  # of a damaged place in the file, where nothing can be
DAMAGE = (*NOT_WHOLE, ValueError, KeyError, RuntimeError, OverflowError, MemoryError)


class ArraysFileError(ValueError):
    """The file is no file of arrays, or is damaged."""


def read_arrays(path: Path, wanted: Callable[[str], bool] = lambda name: True) -> dict[str, NDArray[Any]]:
    """The arrays by their names, of those that are `wanted`. Raises ArraysFileError, and OSError where it cannot be read."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if name.endswith(MEMBER) and wanted(name.removesuffix(MEMBER))]
            members = {name.removesuffix(MEMBER): archive.read(name) for name in names}
        return {name: np.lib.format.read_array(io.BytesIO(data), allow_pickle=False) for name, data in members.items()}
    except (*DAMAGE, OSError) as error:
        if isinstance(error, OSError) and error.errno not in NOWHERE:
            raise
        raise ArraysFileError(f"no file of arrays, or a damaged one ({error})") from error
