"""Seeded damage to splat files, and the one rule that every reader keeps: a scene, or one named error, in bounded memory.

The memory of a reading is what tracemalloc sees at its peak (Python's and numpy's allocations) above what it saw before. It may
be 2 times the larger of the file and of the decoded Gaussians that an undamaged file of that length would hold, plus ALLOWANCE
for buffers whose size does not depend on the file. Decoded means float32 arrays of GaussianScene: packed formats grow when they
are read, by what their own Gaussians need.
"""

import gzip
import importlib
import importlib.util
import io
import json
import shutil
import struct
import time
import tracemalloc
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from ply_files import ply_bytes, raw_table
from splat_files import random_chunk_ply, splat_bytes, splat_records, spz4_bytes, spz_bytes, spz_rows

from core.errors import SplatFormatError
from core.splats import read_splats
from core.splats.sog.write import write_sog
from core.splats.spz.write import write_spz

ALLOWANCE = 384 << 10  # Python's gzip alone keeps two buffers of 128 KiB
DATA = Path(__file__).parents[2] / "data"
SLOWEST_S = 5.0
COUNT = 300
NUMBERS = (0, 1, 255, 256, 65535, 1 << 31, (1 << 32) - 1)
WORDS = (b"0", b"-1", b"1e9", b"nan", b"inf", b"99999999999", b"property", b"element", b"list", b"end_header\n", b"\n", b" ")


@dataclass(frozen=True)
class Sample:
    """An undamaged file of one format, and the bytes of the decoded scene per byte of file.

    `packed`: "gzip" or "zip": what is inside is damaged, too; "folder": the files of a zip, one of which is damaged, are a
    scene beside each other. `suffix`: how its name ends.
    """

    name: str
    data: bytes
    growth: float
    packed: str = ""
    suffix: str = ".bin"


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
    plain = [
        Sample(name, data, max(1, SIZE[degree] / len(data)), "gzip" if data.startswith(b"\x1f\x8b") else "")
        for name, (data, degree) in files.items()
    ]
    return plain + _packed_samples() + ([_usd_sample(table)] if importlib.util.find_spec("pxr") else [])


SIZE = {degree: COUNT * 4 * (3 + 3 + 4 + 1 + 3 * (degree + 1) ** 2) for degree in (0, 1, 3)}


def _packed_samples():
    """Formats of several files, or with a file inside: other programs' own small ones, and ours of COUNT Gaussians."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "a.ply").write_bytes(ply_bytes(raw_table(COUNT, 1)))
        scene = read_splats(Path(folder) / "a.ply")
        write_sog(Path(folder) / "a.sog", scene)
        write_spz(Path(folder) / "a.spz", scene, 2)
        sog, spz = ((Path(folder) / name).read_bytes() for name in ("a.sog", "a.spz"))
    growth = SIZE[1] / len(sog)
    # The 24 Gaussians of these are small beside what surrounds them.
    found = [Sample("sog", sog, max(1, growth), "zip"), Sample("sog, streamed", _zipped_folder(), 8, "folder")]
    found += [Sample(f"ksplat {n}", (DATA / f"by_gaussian_splats_3d_level_{n}.ksplat").read_bytes(), 1) for n in range(3)]
    found.append(Sample("glTF", (DATA / "by_splat_transform.glb").read_bytes(), 1))
    inside = glb({"bufferViews": [{"buffer": 0, "byteLength": len(spz)}], "meshes": [{"primitives": [SPZ_PRIMITIVE]}]}, spz)
    return [*found, Sample("glTF, spz inside", inside, SIZE[1] / len(inside))]


SPZ_PRIMITIVE = {
    "attributes": {},
    "extensions": {"KHR_gaussian_splatting": {"extensions": {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}}},
}


def glb(model, data):
    """A .glb of a model's JSON and the numbers of its one buffer."""
    data += bytes(-len(data) % 4)
    text = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(data)}], **model}).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    return head + text + struct.pack("<II", len(data), 0x004E4942) + data


def _zipped_folder():
    folder, out = DATA / "streamed_by_splat_transform", io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, file.relative_to(folder).as_posix())
    return out.getvalue()


def _usd_sample(table):
    """A stage in the library's text, whose parser is its own."""
    # The library's modules are no part of what a reading may hold.
    importlib.import_module("pxr.Usd")
    importlib.import_module("pxr.UsdGeom")
    count = len(table["x"])

    def tuples(names):
        rows = np.stack([table[name] for name in names], axis=1)
        return "[" + ", ".join("(" + ", ".join(f"{v:.6g}" for v in row) + ")" for row in rows) + "]"

    lines = [
        f"point3f[] positions = {tuples('xyz')}",
        f"float3[] scales = [{', '.join(['(0.1, 0.2, 0.3)'] * count)}]",
        f"quatf[] orientations = {tuples([f'rot_{i}' for i in range(4)])}",
        f"float[] opacities = [{', '.join(['0.5'] * count)}]",
        f"float3[] radiance:sphericalHarmonicsCoefficients = {tuples([f'f_dc_{i}' for i in range(3)])}",
        "uniform int radiance:sphericalHarmonicsDegree = 0",
    ]
    text = '#usda 1.0\ndef ParticleField3DGaussianSplat "A"\n{\n' + "\n".join(lines) + "\n}\n"
    return Sample("OpenUSD, text", text.encode(), max(1, SIZE[0] / len(text)), suffix=".usda")


def damaged(sample, rng):
    """A changed copy of the sample's bytes; every other one of a packed file is changed inside and packed again."""
    if not sample.packed or (sample.packed != "folder" and rng.random() < 0.5):
        return change(sample.data, rng)
    if sample.packed == "gzip":
        return gzip.compress(change(zlib.decompress(sample.data, 31), rng), 1, mtime=0)
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(sample.data)) as archive, zipfile.ZipFile(out, "w") as changed:
        names = archive.namelist()
        hurt = names[rng.integers(0, len(names))]
        for name in names:
            changed.writestr(name, change(archive.read(name), rng) if name == hurt else archive.read(name))
    return out.getvalue()


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


def _measured(path):
    """The scene in a file, or None and the sentence, and the most bytes that its reading held."""
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    began = time.monotonic()
    scene, sentence = None, ""
    try:
        scene = read_splats(path)
    except SplatFormatError as error:
        sentence = str(error)
    assert time.monotonic() - began < SLOWEST_S
    return scene, sentence, tracemalloc.get_traced_memory()[1] - before


def judge(sample, data, path):
    """Reads `data` as a file: ("scene" or "error", share of the allowed memory used). AssertionError where a rule is broken."""
    path = path.with_suffix(sample.suffix)
    if sample.packed == "folder":
        shutil.rmtree(path, ignore_errors=True)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            archive.extractall(path)
    else:
        path.write_bytes(data)
    allowed = 2 * len(data) * sample.growth + ALLOWANCE
    scene, sentence, peak = _measured(path)
    if peak > allowed:
        # Once in thousands of files a table of the interpreter's own grows just then; what a reading holds it holds again.
        scene, sentence, peak = _measured(path)
    outcome = "error" if scene is None else "scene"
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
