"""Damaged splat files by the thousand: each reader must end in a scene or one named error, soon and in bounded memory.

python benchmarks/fuzz_formats.py [--files 10000] [--seed 0] [--only NAME]

Each sample runs in a process of its own, so that a crash is seen as one. The rule, and how memory is measured, stand in
tests/core/support/splat_fuzz.py, which the test suite uses with fewer files.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
import tracemalloc
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "core" / "support")]

import numpy as np
from splat_fuzz import Sample, damaged, judge, samples


def run(sample: Sample, files: int, seed: int) -> str:
    """One row of the table. Raises AssertionError with the file's number when a rule is broken."""
    rng = np.random.default_rng(seed)
    counts = {"scene": 0, "error": 0}
    most = slowest = 0.0
    tracemalloc.start()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.bin"
        judge(sample, sample.data, path)  # imports and caches
        for number in range(files):
            data = damaged(sample, rng)
            began = time.perf_counter()
            try:
                outcome, share = judge(sample, data, path)
            except BaseException as error:
                raise AssertionError(f"file {number} of seed {seed}: {type(error).__name__}: {error}") from error
            slowest = max(slowest, time.perf_counter() - began)
            counts[outcome] += 1
            most = max(most, share)
    return (
        f"| {sample.name} | {len(sample.data)} | {files} | {counts['scene']} | {counts['error']} | {most:.2f} | {slowest:.2f} |"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="the one sample to run, in this process")
    options = parser.parse_args()
    if options.only:
        print(run(next(s for s in samples() if s.name == options.only), options.files, options.seed))
        return 0
    print("| sample | bytes | damaged files | scene | named error | memory used of allowed, most | slowest, s |")
    print("|---|---|---|---|---|---|---|")
    broken = 0
    for sample in samples():
        command = [sys.executable, __file__, "--files", str(options.files), "--seed", str(options.seed), "--only", sample.name]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        broken += done.returncode != 0
        fault = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no word"
        print(done.stdout.strip() or f"| {sample.name} | BROKEN, exit {done.returncode}: {fault} |", flush=True)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
