"""What it costs to keep a batch's results: the journal, and for comparison a results file that is written whole after every
photo, as the first version of this project did. Records are as long as a refined photo's.

    .venv/bin/python benchmarks/store.py [--counts 1000 10000] [--folder DIR]

Both make sure of every record with fsync. Bytes are those handed to the system.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from core.batch.keys import key_of
from core.batch.store import ResultStore
from core.support.atomic import atomic_write


def record(index: int) -> dict:
    """As long as what a refinement of two iterations leaves behind, 1.5 KB."""
    pose = {"R": [[0.1234567890123456, -0.1234567890123456, 0.9876543210123456]] * 3, "t": [1.2345678901234567] * 3}
    iteration = {"views_used": 7, "matches": 1234, "inliers": 987, "epipolar_rms_px": 0.4567890123456789, **pose}
    lens = {"width": 4000, "height": 3000, "fx": 3210.123456789, "fy": 3210.123456789, "cx": 2000.0, "cy": 1500.0}
    reasons = ["7 of 7 views agree, 6543 inliers cover 87 % of the photo."]
    found = {"verdict": "trusted", "reasons": reasons, "iterations": [iteration] * 2, "seconds": 6.543}
    return {"file": f"IMG_{index:05d}.jpg", **lens, "dist": [0.0123] * 4, **pose, **found, "start": pose}


def journal(path: Path, count: int) -> int:
    with ResultStore(path, [key_of(k) for k in range(count)]) as store:
        for k in range(count):
            store.put(k, record(k))
    return 2 * path.stat().st_size  # once in the journal, once in the results


def whole_file(path: Path, count: int) -> int:
    texts, written = [], 0
    for k in range(count):
        texts.append(json.dumps({**record(k), "key": key_of(k)}))
        with atomic_write(path) as file:
            file.write('{"frames": [\n' + ",\n".join(texts) + "\n]}\n")
        written += path.stat().st_size
    return written


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", type=int, nargs="+", default=[1000, 10_000])
    parser.add_argument("--folder", type=Path, help="on the disk to be measured (the system's temporary files)")
    parser.add_argument("--only", choices=("journal", "whole file"), help="one of the two (the second takes long)")
    options = parser.parse_args()
    print("| store | records | seconds | ms per record | written, MB | KB per record |")
    print("|---|---|---|---|---|---|")
    for name, store in (("journal", journal), ("whole file", whole_file)):
        for count in options.counts if options.only in (None, name) else ():
            with tempfile.TemporaryDirectory(dir=options.folder) as folder:
                began = time.perf_counter()
                written = store(Path(folder) / "results.json", count)
                seconds = time.perf_counter() - began
            row = f"{seconds:.1f} | {1e3 * seconds / count:.2f} | {written / 1e6:.0f} | {written / 1e3 / count:.1f}"
            print(f"| {name} | {count} | {row} |", flush=True)


if __name__ == "__main__":
    main()
