"""What is stored and read again tells whether it was damaged in between: records with a checksum, files of arrays."""

import json

import numpy as np
import pytest

from core.support.arrays_file import ArraysFileError, read_arrays
from core.support.sealed import is_sound, sealed

pytestmark = pytest.mark.unit

RECORD = {"file": "ü.jpg", "t": [0.1, 1e-300, -3.0], "nested": {"b": None, "a": [True, "x"]}, "nothing": float("inf")}


def test_a_record_is_sound_as_it_was_sealed_however_it_is_laid_out():
    again = json.loads(json.dumps(sealed(RECORD), indent=3))
    assert is_sound(again)
    assert is_sound(dict(reversed(again.items())))
    assert sealed(again) == again == sealed(sealed(RECORD))
    assert not is_sound(RECORD)


@pytest.mark.parametrize("change", [{"t": [0.1, 1e-300, -3.1]}, {"file": "u.jpg"}, {"more": 1}, {"sum": "0"}])
def test_a_changed_record_is_not_sound(change):
    assert not is_sound(sealed(RECORD) | change)


def test_no_flipped_bit_of_a_file_of_arrays_gives_other_numbers(tmp_path):
    path = tmp_path / "a.npz"
    arrays = {"a": np.arange(12.0).reshape(3, 4), "b": np.arange(5, dtype=np.uint8)}
    np.savez(path, **arrays)
    data = path.read_bytes()
    refused = 0
    for at in range(len(data)):
        path.write_bytes(data[:at] + bytes([data[at] ^ (1 << at % 8)]) + data[at + 1 :])
        try:
            found = read_arrays(path)
        except ArraysFileError:
            refused += 1
            continue
        for name, array in found.items():  # one whose name was hit is missing, which its reader notices
            assert name not in arrays or (array.dtype == arrays[name].dtype and (array == arrays[name]).all()), at
    assert refused > 0.7 * len(data)


def test_a_file_of_arrays_that_is_cut_short_or_another_is_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, a=np.arange(100.0))
    data = path.read_bytes()
    for other in (b"", b"words", data[:-1], data[: len(data) // 2], bytes(len(data))):
        path.write_bytes(other)
        with pytest.raises(ArraysFileError):
            read_arrays(path)
    with pytest.raises(OSError):
        read_arrays(tmp_path / "missing.npz")
