"""Splat files of the packed formats, put together number by number with struct: not by the code under test."""

import gzip
import math
import struct

import numpy as np

SH_C0 = 1 / (2 * math.sqrt(math.pi))
REST = (0, 3, 8, 15, 24)


def splat_bytes(records):
    """`records`: (position, scale, rgba bytes, quaternion bytes w x y z) each."""
    return b"".join(struct.pack("<6f8B", *p, *s, *c, *q) for p, s, c, q in records)


def splat_records(count, seed=0):
    rng = np.random.default_rng(seed)
    records = []
    for _ in range(count):
        q = rng.normal(size=4)
        q = [min(255, round(v * 128 + 128)) for v in q / np.linalg.norm(q)]
        rgba = [int(v) for v in rng.integers(0, 256, 4)]
        records.append((rng.normal(size=3).tolist(), rng.uniform(0.01, 0.1, 3).tolist(), rgba, q))
    return records


class SpzRow:
    """One Gaussian of an .spz file as the integers that are stored."""

    def __init__(self, rng, degree):
        self.position = [int(v) for v in rng.integers(-(1 << 23), 1 << 23, 3)]
        self.half = [float(np.float16(v)) for v in rng.normal(size=3)]
        self.alpha = int(rng.integers(0, 256))
        self.colour = [int(v) for v in rng.integers(0, 256, 3)]
        self.scale = [int(v) for v in rng.integers(0, 256, 3)]
        q = rng.normal(size=4)
        q = q / np.linalg.norm(q) * (1 if q[3] >= 0 else -1)
        self.xyz = [round(v * 127.5 + 127.5) for v in q[:3]]
        self.largest = int(rng.integers(0, 4))
        self.small = [(int(rng.integers(0, 2)), int(rng.integers(0, 256))) for _ in range(3)]  # sign bit, magnitude of 511
        self.sh = [[int(v) for v in rng.integers(0, 256, 3)] for _ in range(REST[degree])]

    @property
    def packed_rotation(self):
        word = self.largest
        for sign, size in self.small:
            word = word << 10 | sign << 9 | size
        return word


def spz_rows(count, degree, seed=0):
    rng = np.random.default_rng(seed)
    return [SpzRow(rng, degree) for _ in range(count)]


def spz_attributes(rows, version):
    """The six attributes' bytes, in the file's order."""
    if version == 1:
        positions = b"".join(struct.pack("<3e", *r.half) for r in rows)
    else:
        positions = b"".join(v.to_bytes(3, "little", signed=True) for r in rows for v in r.position)
    rotations = b"".join(struct.pack("<I", r.packed_rotation) if version >= 3 else bytes(r.xyz) for r in rows)
    return [
        positions,
        bytes(r.alpha for r in rows),
        bytes(v for r in rows for v in r.colour),
        bytes(v for r in rows for v in r.scale),
        rotations,
        bytes(v for r in rows for coefficient in r.sh for v in coefficient),
    ]


def spz_header(version, count, degree, bits=12, flags=0, last=0):
    return b"NGSP" + struct.pack("<IIBBBB", version, count, degree, bits, flags, last)


def spz_bytes(rows, version, degree, bits=12, count=None, flags=0, trailer=b""):
    """Versions 1 to 3."""
    plain = spz_header(version, len(rows) if count is None else count, degree, bits, flags)
    return gzip.compress(plain + b"".join(spz_attributes(rows, version)) + trailer, mtime=0)


def spz4_bytes(rows, degree, bits=12, records=b"", count=None, streams=None):
    """Version 4: header in the open, extension records, table, one zstd stream for each attribute."""
    import zstandard

    plain = [a for a in spz_attributes(rows, 4) if a]
    packed = [zstandard.ZstdCompressor().compress(a) for a in plain]
    sizes = [(len(p), len(a)) for p, a in zip(packed, plain, strict=True)] if streams is None else streams
    head = spz_header(4, len(rows) if count is None else count, degree, bits, 2 if records else 0, len(sizes))
    head += struct.pack("<I12x", 32 + len(records)) + records
    return head + b"".join(struct.pack("<QQ", *size) for size in sizes) + b"".join(packed)


def chunk_ply_bytes(chunks, words, sh=None, colours=True, order="little", count=None):
    """A compressed .ply: 18 (12 without colours) numbers a chunk, 4 integers a Gaussian, `sh` bytes a Gaussian."""
    ends = ("min", "max")
    names = [f"{e}_{a}" for e in ends for a in "xyz"] + [f"{e}_scale_{a}" for e in ends for a in "xyz"]
    names += [f"{e}_{a}" for e in ends for a in "rgb"] if colours else []
    head = ["ply", f"format binary_{order}_endian 1.0", "comment made for a test", f"element chunk {len(chunks)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element vertex {len(words) if count is None else count}"]
    head += [f"property uint packed_{name}" for name in ("position", "rotation", "scale", "color")]
    if sh is not None:
        head += [f"element sh {len(sh)}", *(f"property uchar f_rest_{i}" for i in range(len(sh[0])))]
    mark = "<" if order == "little" else ">"
    body = b"".join(struct.pack(f"{mark}{len(names)}f", *c) for c in chunks)
    body += b"".join(struct.pack(f"{mark}4I", *w) for w in words)
    return "\n".join([*head, "end_header", ""]).encode() + body + b"".join(bytes(row) for row in sh or ())


def random_chunk_ply(count, degree=0, seed=0, **options):
    """Such a file of random content, with what it was made of: (bytes, chunks, words, sh)."""
    rng = np.random.default_rng(seed)
    chunks = []
    for _ in range(math.ceil(count / 256)):
        low, size = rng.normal(size=(3, 3)), rng.uniform(0.5, 2, (3, 3))
        chunks.append([float(np.float32(v)) for pair in zip(low, low + size, strict=True) for ends in pair for v in ends])
    if not options.get("colours", True):
        chunks = [c[:12] for c in chunks]
    words = []
    for _ in range(count):
        rotation = int(rng.integers(0, 4))
        for _ in range(3):
            rotation = rotation << 10 | int(rng.integers(512 - 290, 512 + 290))  # within +-0.4, so that a unit one exists
        position, scale, color = (int(v) for v in rng.integers(0, 1 << 32, 3, dtype=np.uint64))
        words.append((position, rotation, scale, color))
    sh = [[int(v) for v in rng.integers(0, 256, 3 * REST[degree])] for _ in range(count)] if degree else None
    return chunk_ply_bytes(chunks, words, sh, **options), chunks, words, sh
