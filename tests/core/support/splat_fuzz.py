"""Seeded damage to splat files, and the one rule that every reader keeps: a scene, or one named error, in bounded memory.

The memory of a reading is what tracemalloc sees at its peak (Python's and numpy's allocations) above what it saw before. It may
be 2 times the larger of the file and of the decoded Gaussians that an undamaged file of that length would hold, plus ALLOWANCE
for buffers whose size does not depend on the file. Decoded means float32 arrays of GaussianScene: packed formats grow when they
are read, by what their own Gaussians need.
"""

import gzip
import struct
import time
import tracemalloc
import zlib
from dataclasses import dataclass

import numpy as np
from ply_files import ply_bytes, raw_table
from splat_files import random_chunk_ply, splat_bytes, splat_records, spz4_bytes, spz_bytes, spz_rows

from core.errors import SplatFormatError
from core.splats import read_splats

ALLOWANCE = 384 << 10  # Python's gzip alone keeps two buffers of 128 KiB
SLOWEST_S = 5.0
COUNT = 300
NUMBERS = (0, 1, 255, 256, 65535, 1 << 31, (1 << 32) - 1)
WORDS = (b"0", b"-1", b"1e9", b"nan", b"inf", b"99999999999", b"property", b"element", b"list", b"end_header\n", b"\n", b" ")


@dataclass(frozen=True)
class Sample:
    """An undamaged file of one format, and the bytes of the decoded scene per byte of file."""

    name: str
    data: bytes
    growth: float
    inner: bool = False  # damage what gzip holds, too


def samples():
    """One of every format and of every variant that is read by code of its own."""
    table = raw_table(COUNT, 1)
    flat = {name: values for name, values in table.items() if name != "scale_2"}
    rows = {degree: spz_rows(COUNT, degree) for degree in (0, 1, 3)}
    files = {
        "ply, little endian, SH 1": (ply_bytes(table), 1),
        "ply, big endian, SH 1": (ply_bytes(table, "binary_big_endian"), 1),
        "ply, ascii, SH 1": (ply_bytes(table, "ascii"), 1),
        "ply, half, SH 1": (ply_bytes(table, types=dict.fromkeys(table, "half")), 1),
        "2DGS ply": (ply_bytes(flat), 1),
        "Mip-Splatting ply": (ply_bytes(table | {"filter_3D": table["x"] ** 2}), 1),
        "compressed ply, SH 1": (random_chunk_ply(COUNT, 1)[0], 1),
        "compressed ply, no SH": (random_chunk_ply(COUNT, 0, colours=False)[0], 0),
        "splat": (splat_bytes(splat_records(COUNT)), 0),
        "spz 1": (spz_bytes(rows[1], 1, 1), 1),
        "spz 2": (spz_bytes(rows[1], 2, 1), 1),
        "spz 3": (spz_bytes(rows[3], 3, 3), 3),
        "spz 4": (spz4_bytes(rows[0], 0), 0),
    }
    size = {degree: COUNT * 4 * (3 + 3 + 4 + 1 + 3 * (degree + 1) ** 2) for degree in (0, 1, 3)}
    return [
        Sample(name, data, max(1, size[degree] / len(data)), data.startswith(b"\x1f\x8b"))
        for name, (data, degree) in files.items()
    ]


def damaged(sample, rng):
    """A changed copy of the sample's bytes; every other one of a gzip file is changed inside and packed again."""
    if sample.inner and rng.random() < 0.5:
        return gzip.compress(change(zlib.decompress(sample.data, 31), rng), 1, mtime=0)
    return change(sample.data, rng)


def change(data, rng):
    """One to four changes: bytes, numbers and words written over, pieces cut, doubled or moved; the beginning more often."""
    data = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        at = int(rng.integers(0, max(1, len(data)) if rng.random() < 0.5 else min(max(1, len(data)), 600)))
        kind = rng.integers(0, 8)
        if kind == 0 and data:
            data[at] ^= 1 << int(rng.integers(0, 8))
        elif kind == 1:
            data[at : at + 4] = struct.pack("<I", NUMBERS[rng.integers(0, len(NUMBERS))])
        elif kind == 2:
            word = WORDS[rng.integers(0, len(WORDS))]
            data[at : at + len(word)] = word
        elif kind == 3:
            data[at:at] = WORDS[rng.integers(0, len(WORDS))]
        elif kind == 4:
            del data[at : at + int(rng.integers(1, 200))]
        elif kind == 5:
            del data[at:]
        elif kind == 6:
            piece = data[at : at + int(rng.integers(1, 400))]
            data[at:at] = piece
        else:
            data[at : at + 8] = rng.bytes(8)
    return bytes(data)


def judge(sample, data, path):
    """Reads `data` as a file: ("scene" or "error", share of the allowed memory used). AssertionError where a rule is broken."""
    path.write_bytes(data)
    allowed = 2 * len(data) * sample.growth + ALLOWANCE
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    began = time.monotonic()
    try:
        scene = read_splats(path)
        outcome = "scene"
    except SplatFormatError as error:
        outcome, scene = "error", None
        sentence = str(error)
    peak = tracemalloc.get_traced_memory()[1] - before
    assert time.monotonic() - began < SLOWEST_S
    assert peak <= allowed, f"{peak} bytes of {allowed:.0f}"
    if scene is None:
        assert "\n" not in sentence
        assert sentence.endswith(".")
        assert len(sentence) < 400 + len(str(path))
    else:
        arrays = (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh)
        assert all(a.dtype == np.float32 and np.isfinite(a).all() for a in arrays)
        assert len(scene) > 0
        assert np.abs(np.linalg.norm(scene.rotations, axis=1) - 1).max() < 1e-5
        assert scene.scales.min() >= 0
        assert scene.opacities.min() >= 0
        assert scene.opacities.max() <= 1
    return outcome, peak / allowed
