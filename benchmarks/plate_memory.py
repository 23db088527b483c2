"""Memory of a long track: the hand-held shot of plates.py walked to and fro until it has as many frames as are asked for.

    .venv/bin/python benchmarks/plate_memory.py [--frames 2000] [--pictures DIR]

Frames are read from their files one at a time and matched at a long side of 200 pixels, for the memory that is kept of a frame
does not depend on that. The memory is that of the process, with interpreter, libraries and scan (Linux).
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import plates

from core.photos.photo import Photo
from core.render import Renderer, RenderSettings
from core.synthetic.sample import DEPTH, perturb_camera
from core.track import PartialTrack, Shot, TrackSettings, iterate_track

PICTURES = 120
LONG_SIDE_PX = 200


def memory() -> str:
    """What the process holds now, and the most that it held, in MB."""
    now = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20
    return f"{now:.0f} MB now, {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB at most"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=2000)
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "gssmc-plates")
    args = parser.parse_args()
    plates.cv2.setNumThreads(1)
    plate = plates.procedural("plain", PICTURES, args.pictures)
    numbers = list(plate.truth)

    def picture(frame: int) -> int:
        """To and fro: the number of the picture that stands for a frame."""
        at = frame % (2 * PICTURES - 2)
        return numbers[min(at, 2 * PICTURES - 2 - at)]

    def read(frame: int) -> Photo:
        return plate.read(picture(frame))

    renderer, found = Renderer(plate.scene, RenderSettings(threads=1)), PartialTrack()
    start = perturb_camera(plate.truth[picture(0)], 0.001 * DEPTH, 0.05)
    began, done, told = time.process_time(), 0, [100, 200, 500, 1000, 1500, 2000]
    print(f"before: {memory()}", flush=True)
    steps = iterate_track(renderer, Shot(read, range(args.frames)), {0: start}, TrackSettings(LONG_SIDE_PX), found)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            track = end.value
            break
        done += 1
        if done in told:
            seconds = (time.process_time() - began) / done
            print(f"{done} frames: {memory()}, {seconds:.2f} s a frame", flush=True)
    good = sum(frame.state == "good" for frame in track.frames)
    print(f"at the end: {memory()}, {good} of {args.frames} frames good, {time.process_time() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
