"""Bytes damaged as disks, networks and killed machines do it: some bits flipped, the end cut off, a block zeroed."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

WAYS = ("flipped", "truncated", "zeroed")
BLOCK = 4096


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` with one such damage; never the same as it was."""
    way = WAYS[rng.integers(len(WAYS))]
    while True:
        if way == "truncated":
            out = bytearray(data[: rng.integers(len(data))])
        else:
            out = bytearray(data)
            at = int(rng.integers(len(data)))
            if way == "flipped":
                for place in {at, *rng.integers(len(data), size=rng.integers(0, 4)).tolist()}:
                    out[place] ^= 1 << int(rng.integers(8))
            else:
                size = min(int(rng.integers(1, BLOCK)), len(data) - at)
                out[at : at + size] = bytes(size)
        if out != data:
            return bytes(out)


def damage_file(path: Path, rng: np.random.Generator) -> None:
    """Damages the file where it lies; its time stays, as a disk's fault leaves it."""
    state = path.stat()
    path.write_bytes(damaged(path.read_bytes(), rng))
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
