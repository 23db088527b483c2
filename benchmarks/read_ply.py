"""Reading a large splat file: seconds and peak memory, each measurement in a process of its own.

python benchmarks/read_ply.py [--gaussians 1000000] [--rounds 3]

Compares core.splats with plyfile's bare read of the same file (no activation, no checks) in the same run; the page cache is
warm for both. Peak is the most that the whole process held (ru_maxrss: interpreter, numpy and OpenCV included), against the
file's size.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

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
if reader != "core.splats" and form == "binary":
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


def measure(path: Path, reader: str, form: str) -> tuple[float, float]:
    """Seconds and peak bytes of one reading in a fresh process."""
    env = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", CHILD, str(ROOT), str(path), reader, form]
    seconds, peak = json.loads(subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout)
    return float(seconds), float(peak)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gaussians", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    print(f"Aims for the binary file: 2 s, peak 3x the file. This machine: {os.cpu_count()} cores; readers use one thread.\n")
    print("| file | MB | reader | s, median | s, least | peak / file | time / plyfile |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for form, count in (("binary", options.gaussians), ("ascii", max(1, options.gaussians // 20))):
            path = Path(folder) / f"{form}.ply"
            write_scan(path, count, form)
            size = path.stat().st_size
            runs: dict[str, list[tuple[float, float]]] = {"core.splats": [], "plyfile": []}
            for _ in range(options.rounds):
                for reader, found in runs.items():
                    found.append(measure(path, reader, form))
            base = statistics.median(s for s, _ in runs["plyfile"])
            for reader, found in runs.items():
                seconds = [s for s, _ in found]
                median = statistics.median(seconds)
                print(
                    f"| {count:,} SH3, {form} | {size / 1e6:.0f} | {reader} | {median:.2f} | {min(seconds):.2f} "
                    f"| {max(p for _, p in found) / size:.2f} | {median / base:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
