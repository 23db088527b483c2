"""Reading large splat files, every format: seconds and peak memory, each measurement in a process of its own.

python benchmarks/read_formats.py [--gaussians 1000000] [--rounds 3] [--only NAME ...]

The files hold random Gaussians, SH degree 3 where the format has so much, written by the project's own writers (the INRIA .ply,
glTF and .ksplat by hand). OpenUSD is measured where this Python has the USD library. For the .ply that plyfile can read, its
bare read of the same file (no activation, no checks) is measured in the same run. The page cache is warm for all. Peak is the
most that the whole process held (ru_maxrss: interpreter, numpy and OpenCV included), against the scene's arrays: 236 bytes a
Gaussian with SH 3, 152 with SH 2, 56 without.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from core.splats import GaussianScene

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
DECODED_BYTES = {0: 56, 2: 152, 3: 236}
ASCII_SHARE = 20  # an ascii file has a 20th of the Gaussians

CHILD = """
import json, resource, sys, time
sys.path.insert(0, sys.argv[1])
path, reader, form = sys.argv[2:5]
if reader == "core.splats":
    from core.splats import read_splats as read
else:
    import plyfile
    read = plyfile.PlyData.read
began = time.perf_counter()
scene = read(path)
if reader != "core.splats" and form == "ply":
    [scene["vertex"][p.name].sum() for p in scene["vertex"].properties]  # plyfile maps the file; touch it once
seconds = time.perf_counter() - began
unit = 1 if sys.platform == "darwin" else 1024
print(json.dumps([seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit]))
"""


def write_scan(path: Path, count: int, form: str) -> None:
    """Random Gaussians in INRIA's layout, SH degree 3, written without the code under test."""
    import numpy as np

    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(45))]
    names += ["opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
    kind = "ascii" if form == "ascii" else "binary_little_endian"
    head = ["ply", f"format {kind} 1.0", f"element vertex {count}", *(f"property float {n}" for n in names), "end_header", ""]
    rng = np.random.default_rng(0)
    with open(path, "wb") as file:
        file.write("\n".join(head).encode())
        for start in range(0, count, 10_000):
            rows = rng.standard_normal((min(10_000, count - start), len(names)), dtype=np.float32)
            if form == "ascii":
                np.savetxt(file, rows, fmt="%.6g")
            else:
                file.write(rows.tobytes())


def scan(count: int, degree: int) -> GaussianScene:
    """Random Gaussians that every format can hold."""
    import numpy as np

    from core.splats import GaussianScene

    rng = np.random.default_rng(0)
    means = rng.standard_normal((count, 3), dtype=np.float32) * 3
    scales = np.exp(rng.standard_normal((count, 3), dtype=np.float32) - 4)
    rotations = rng.standard_normal((count, 4), dtype=np.float32)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    sh = rng.standard_normal((count, (degree + 1) ** 2, 3), dtype=np.float32) * np.float32(0.15)
    return GaussianScene(means, scales, rotations, np.full(count, 0.2, np.float32), sh)


def writers() -> dict[str, tuple[int, Callable[[Path, GaussianScene], None]]]:
    """Format name to SH degree and writer."""
    from dataclasses import replace

    from core.splats import splat
    from core.splats.ply import compressed_write as ply_compressed_write
    from core.splats.ply import mip as ply_mip
    from core.splats.ply import reader as ply
    from core.splats.ply import two_dgs as ply_2dgs
    from core.splats.sog import write as sog_write
    from core.splats.spz import write as spz_write

    def flat(path: Path, scene: GaussianScene) -> None:
        scales = scene.scales.copy()
        scales[:, 2] = scales[:, :2].min(axis=1) * 1e-3
        ply_2dgs.write_2dgs(path, replace(scene, scales=scales))

    return {
        "ply, half": (3, lambda path, scene: ply.write_ply(path, scene, "half")),
        "ply, double": (3, lambda path, scene: ply.write_ply(path, scene, "double")),
        "2DGS ply": (3, flat),
        "Mip-Splatting ply": (3, lambda path, scene: ply_mip.write_mip(path, scene, scene.scales.min(axis=1) * 0.3)),
        "compressed ply": (3, ply_compressed_write.write_compressed),
        "splat": (0, splat.write_splat),
        "spz 2": (3, lambda path, scene: spz_write.write_spz(path, scene, 2)),
        "spz 3": (3, lambda path, scene: spz_write.write_spz(path, scene, 3)),
        "spz 4": (3, _spz4),
        "sog": (3, sog_write.write_sog),
        "sog, streamed": (3, _streamed),
        "glTF": (3, _glb),
        "glTF, spz inside": (3, _glb_spz),
        "ksplat 0": (2, lambda path, scene: _ksplat(path, scene, 0)),
        "ksplat 1": (2, lambda path, scene: _ksplat(path, scene, 1)),
        "ksplat 2": (2, lambda path, scene: _ksplat(path, scene, 2)),
        **({"OpenUSD": (3, _usd)} if importlib.util.find_spec("pxr") else {}),
    }


def _streamed(path: Path, scene: GaussianScene) -> None:
    """One level in one part."""
    import zipfile

    from core.splats.sog import write as sog_write

    sog_write.write_sog(path.with_suffix(".sog"), scene)
    path.mkdir()
    with zipfile.ZipFile(path.with_suffix(".sog")) as archive:
        archive.extractall(path / "0_0")
    tree = {"lods": {"0": {"file": 0, "offset": 0, "count": len(scene)}}}
    (path / "lod-meta.json").write_text(json.dumps({"lodLevels": 1, "filenames": ["0_0/meta.json"], "tree": tree}))


def _glb(path: Path, scene: GaussianScene) -> None:
    import numpy as np

    arrays = {"POSITION": scene.means}
    own = {"ROTATION": scene.rotations[:, [1, 2, 3, 0]], "SCALE": scene.scales, "OPACITY": scene.opacities[:, None]}
    for degree in range(scene.sh_degree + 1):
        own |= {f"SH_DEGREE_{degree}_COEF_{n}": scene.sh[:, degree**2 + n] for n in range(2 * degree + 1)}
    arrays |= {f"KHR_gaussian_splatting:{name}": values for name, values in own.items()}
    views, accessors, at = [], [], 0
    for number, values in enumerate(arrays.values()):
        views.append({"buffer": 0, "byteOffset": at, "byteLength": values.nbytes})
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[values.shape[1]]
        accessors.append({"bufferView": number, "componentType": 5126, "count": len(values), "type": kind})
        at += values.nbytes
    data = b"".join(np.ascontiguousarray(values, np.float32).tobytes() for values in arrays.values())
    primitive = {"attributes": {name: n for n, name in enumerate(arrays)}, "extensions": {"KHR_gaussian_splatting": {}}}
    _put_glb(path, {"bufferViews": views, "accessors": accessors, "meshes": [{"primitives": [primitive]}]}, data)


def _glb_spz(path: Path, scene: GaussianScene) -> None:
    from core.splats.spz import write as spz_write

    spz_write.write_spz(path.with_suffix(".spz"), scene, 2)
    data = path.with_suffix(".spz").read_bytes()
    inner = {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}
    primitive = {"attributes": {}, "extensions": {"KHR_gaussian_splatting": {"extensions": inner}}}
    views = [{"buffer": 0, "byteLength": len(data)}]
    _put_glb(path, {"bufferViews": views, "meshes": [{"primitives": [primitive]}]}, data)


def _put_glb(path: Path, model: dict[str, object], data: bytes) -> None:
    import struct

    data += b"\0" * (-len(data) % 4)
    text = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(data)}], **model}).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    path.write_bytes(head + text + struct.pack("<II", len(data), 0x004E4942) + data)


def _ksplat(path: Path, scene: GaussianScene, level: int) -> None:
    """One section; above level 0 buckets of 256 Gaussians, all around one centre."""
    import struct

    import numpy as np

    count, size, block = len(scene), 256, 64.0
    number, place, value = ("<f4", "<f4", "<f4") if level == 0 else ("<f2", "<u2", "<f2" if level == 1 else "u1")
    rest = 3 * (scene.sh.shape[1] - 1)
    fields = [("mean", place, 3), ("scale", number, 3), ("rotation", number, 4), ("rgba", "u1", 4), ("sh", value, rest)]
    rows = np.zeros(count, fields)
    steps = np.clip(scene.means / (block / 2) * 32767 + 32767, 0, 65535)
    rows["mean"], rows["scale"], rows["rotation"] = steps if level else scene.means, scene.scales, scene.rotations
    rows["rgba"] = 99
    values = scene.sh[:, 1:].reshape(count, rest)
    rows["sh"] = np.clip((values + 1.5) * 85, 0, 255) if level == 2 else values
    buckets, lengths = (-(-count // size), count % size) if level else (0, 0)
    partial = [lengths] if lengths else []
    head = struct.pack("<BB2xIIIIH2x3fff", 0, 1, 1, 1, count, count, level, 0, 0, 0, -1.5, 1.5).ljust(4096, b"\0")
    told = (count, count, size, buckets, block, 12, 32767, buckets - len(partial), len(partial), scene.sh_degree)
    section = struct.pack("<IIIIfH2xI4xIIH", *told).ljust(1024, b"\0")
    path.write_bytes(head + section + np.array(partial, "<u4").tobytes() + bytes(12 * buckets) + rows.tobytes())


def _usd(path: Path, scene: GaussianScene) -> None:
    import numpy as np
    from pxr import Sdf, Usd, Vt

    stage = Usd.Stage.CreateNew(str(path))
    prim = stage.DefinePrim("/A", "ParticleField3DGaussianSplat")
    types, coefficients = Sdf.ValueTypeNames, "radiance:sphericalHarmonicsCoefficients"
    prim.CreateAttribute("positions", types.Point3fArray).Set(scene.means)
    prim.CreateAttribute("scales", types.Float3Array).Set(scene.scales)
    prim.CreateAttribute("opacities", types.FloatArray).Set(scene.opacities)
    turns = Vt.QuatfArray.FromNumpy(np.ascontiguousarray(scene.rotations[:, [1, 2, 3, 0]]))
    prim.CreateAttribute("orientations", types.QuatfArray).Set(turns)
    prim.CreateAttribute(coefficients, types.Float3Array).Set(scene.sh.reshape(-1, 3))
    prim.CreateAttribute("radiance:sphericalHarmonicsDegree", types.Int).Set(scene.sh_degree)
    stage.Save()


def _spz4(path: Path, scene: GaussianScene) -> None:
    """Version 4 out of version 3: the same attributes, each in a zstd stream of its own."""
    import gzip
    import struct

    import zstandard

    from core.splats.spz import write as spz_write

    spz_write.write_spz(path, scene, 3)
    plain = gzip.decompress(path.read_bytes())
    pieces, at = [], 16
    for width in (9, 1, 3, 3, 4, 45):
        pieces.append(plain[at : at + width * len(scene)])
        at += width * len(scene)
    packed = [zstandard.ZstdCompressor(level=9).compress(piece) for piece in pieces]
    head = plain[:4] + struct.pack("<I", 4) + plain[8:15] + bytes([len(pieces)]) + struct.pack("<I12x", 32)
    table = b"".join(struct.pack("<QQ", len(p), len(a)) for p, a in zip(packed, pieces, strict=True))
    path.write_bytes(head + table + b"".join(packed))


def measure(path: Path, reader: str, form: str) -> tuple[float, float]:
    """Seconds and peak bytes of one reading in a fresh process."""
    env = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", CHILD, str(ROOT), str(path), reader, form]
    seconds, peak = json.loads(subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout)
    return float(seconds), float(peak)


def report(form: str, path: Path, count: int, degree: int, rounds: int) -> None:
    """The rows of one file."""
    readers = ["core.splats", "plyfile"] if form in ("ply", "ply, ascii") else ["core.splats"]
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    size, decoded = sum(file.stat().st_size for file in files), count * DECODED_BYTES[degree]
    runs: dict[str, list[tuple[float, float]]] = {reader: [] for reader in readers}
    for _ in range(rounds):
        for reader, found in runs.items():
            found.append(measure(path, reader, form))
    for reader, found in runs.items():
        seconds = [s for s, _ in found]
        print(
            f"| {form} | {count:,} | {degree} | {size / 1e6:.0f} | {reader} | {statistics.median(seconds):.2f} "
            f"| {min(seconds):.2f} | {max(p for _, p in found) / 1e6:.0f} | {decoded / 1e6:.0f} |",
            flush=True,
        )


def write(form: str, path: Path, count: int) -> None:
    """A file of that format."""
    if form in writers():
        degree, writer = writers()[form]
        writer(path, scan(count, degree))
    else:
        write_scan(path, count, form.removeprefix("ply, "))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gaussians", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="*", help="formats to measure (all)")
    parser.add_argument("--write", type=Path, metavar="FILE", help="only write the one format of --only")
    options = parser.parse_args()
    if options.write:
        write(options.only[0], options.write, options.gaussians)
        return
    print(f"Aim: 1,000,000 Gaussians in 3 s. This machine: {os.cpu_count()} cores; readers use one thread.\n")
    print("| format | Gaussians | SH | MB | reader | s, median | s, least | peak MB | scene MB |")
    print("|---|---|---|---|---|---|---|---|---|")
    for form in options.only or ("ply", "ply, ascii", *writers()):
        count = options.gaussians if form != "ply, ascii" else max(1, options.gaussians // ASCII_SHARE)
        degree = writers()[form][0] if form in writers() else 3
        with tempfile.TemporaryDirectory() as folder:
            # The USD library goes by the ending.
            path = Path(folder) / ("scan.usdc" if form == "OpenUSD" else "scan")
            # in a process of its own: a child's peak begins with what its parent holds
            command = [sys.executable, __file__, "--write", str(path), "--gaussians", str(count), "--only", form]
            subprocess.run(command, check=True)
            report(form, path, count, degree, options.rounds)


if __name__ == "__main__":
    main()
