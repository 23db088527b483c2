"""Moving plates tracked: seconds a frame, and how far the cameras, and points fixed in the scan, are off and jump.

    .venv/bin/python benchmarks/plates.py [--shots plain zoom ...] [--frames 120] [--pictures DIR]

"plain", "walker" (somebody crosses the picture) and "rolling" (a frame is read out in 0.6 of the time to the next) are
hand-held shots of the procedural room with exact cameras, 640 x 480, with distortion, motion blur and noise; their pictures are
drawn once and kept in DIR. Of 60 frames each are "zoom" (to 1.3 times the focal length), "breathing" (to 1.03 times),
"covered" (20 frames in the middle are hidden by a patterned card) and "cut" (the second half is seen from elsewhere; frames
that were lost are searched for). "real" is the walk-through in ../shared/scenes/room/plate, whose truth is good to some tenths
of a per cent. The lens is given, and the camera of the middle frame (of "covered" that at a quarter) from 0.1 % and 0.05
degrees off. One thread.

Slip: how far fixed points of the scan are off in the picture; jitter: the second difference of that from frame to frame; both
RMS, pixels of the plate, over frames that are not lost. "off": of frames called good, the largest slip of a frame; "focal
length": how far that of the frames is off, RMS, where it changes.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT)]

from core.cameras.files import camera_from_dict
from core.geometry.camera import Camera, pose_error
from core.locate import LandmarkMap, MapSettings, PhotoLens, build_map, find_camera
from core.photos.photo import Photo, read_photo
from core.pose.refine import refine
from core.render import Renderer, RenderSettings
from core.splats import GaussianScene, read_splats
from core.synthetic import make_scene
from core.synthetic.plate import HandHeld
from core.synthetic.sample import perturb_camera
from core.track import FocalKind, Shot, Track, TrackSettings, iterate_track

SHARED = ROOT.parent / "shared" / "scenes" / "room"
READOUT = 0.6
SHORT = 60
SHOTS = {
    "plain": HandHeld(),
    "walker": HandHeld(walker=True),
    "rolling": HandHeld(readout=READOUT),
    "zoom": HandHeld(SHORT, zoom=1.3),
    "breathing": HandHeld(SHORT, zoom=1.03),
    "covered": HandHeld(SHORT, covered=range(1021, 1041)),
    "cut": HandHeld(SHORT, cut=1031),
}
GAUSSIANS = 40_000
POINTS = 300
NEAR = 0.2  # of the median depth
COLUMNS = ("shot", "frames", "good, weak, lost", "s a frame", "position RMS, max", "rotation RMS, max")
COLUMNS += ("slip", "jitter", "off", "focal length", "read-out")


@dataclass(frozen=True)
class Plate:
    """A shot to measure: scan, true camera of each frame, how its photos are read, and the frame that the track begins at."""

    scene: GaussianScene
    truth: dict[int, Camera]
    read: Callable[[int], Photo]
    rolling: bool = False
    focal: FocalKind = "fixed"
    start: int = 0


def procedural(name: str, count: int, folder: Path) -> Plate:
    """The pictures are drawn where `folder` lacks them."""
    shot, scene = SHOTS[name], make_scene(0, GAUSSIANS)
    renderer = Renderer(scene, RenderSettings(threads=1))
    frames = list(shot.frames)[:count]
    files = {frame: folder / name / f"plate.{frame:04d}.png" for frame in frames}
    (folder / name).mkdir(parents=True, exist_ok=True)
    for frame, file in files.items():
        if not file.exists():
            cv2.imwrite(str(file), shot.photo(renderer, frame).pixels[:, :, ::-1])
    start = frames[len(frames) // (4 if shot.covered else 2)]
    focal: FocalKind = "fixed" if shot.zoom == 1 else "breathing" if name == "breathing" else "zoom"
    return Plate(scene, {f: shot.camera(f) for f in frames}, lambda f: read_photo(files[f]), shot.readout > 0, focal, start)


def real(count: int) -> Plate:
    records = json.loads((SHARED / "plate.json").read_text())
    cameras = [camera_from_dict(record) for record in records["frames"]][:count]
    truth = {int(Path(camera.file).stem): camera for camera in cameras}
    start = list(truth)[len(truth) // 2]
    return Plate(read_splats(SHARED / "scene.ply"), truth, lambda f: read_photo(SHARED / truth[f].file), start=start)


class Recovery:
    """A frame behind a gap: refined from the last known camera, else searched for in the scan's map."""

    def __init__(self, renderer: Renderer, scene: GaussianScene) -> None:
        self._renderer, self._scene = renderer, scene
        self._map: LandmarkMap | None = None

    def __call__(self, photo: Photo, last: Camera) -> Camera | None:
        report = refine(self._renderer, photo, last)
        if report.verdict != "failed":
            return report.camera
        if self._map is None:
            for step in build_map(self._scene, MapSettings(threads=1)):
                self._map = step.map
        found = find_camera(self._renderer, PhotoLens(photo, last.intrinsics), self._map)
        return found.camera


def tracked(plate: Plate) -> tuple[Track, float]:
    """The track, and the median of the seconds between frames."""
    frames = list(plate.truth)
    middle = plate.truth[plate.start]
    renderer = Renderer(plate.scene, RenderSettings(threads=1))
    depth = float(np.median(middle.pose.transform(plate.scene.means)[:, 2]))
    start = perturb_camera(middle, 0.001 * abs(depth), 0.05)
    steps = iterate_track(
        renderer,
        Shot(plate.read, frames, Recovery(renderer, plate.scene)),
        {plate.start: start},
        TrackSettings(rolling_shutter=plate.rolling, focal=plate.focal),
    )
    seconds, last = [], time.process_time()
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value, float(np.median(seconds))
        now = time.process_time()
        seconds.append(now - last)
        last = now


def row(name: str, plate: Plate, track: Track, seconds: float) -> str:
    tied = [frame for frame in track.frames if frame.state != "lost"]
    errors = np.array([pose_error(f.camera.pose, plate.truth[f.frame].pose) for f in tied]) * (100 / track.median_depth, 1)
    slips = np.stack([_slip(plate, frame.frame, frame.camera) for frame in tied])
    rms = [float(np.sqrt(np.nanmean((s**2).sum(-1)))) for s in (slips, np.diff(slips, 2, axis=0))]
    good = [float(np.sqrt(np.nanmean((s**2).sum(-1)))) for s, f in zip(slips, tied, strict=True) if f.state == "good"]
    states = ", ".join(str(sum(f.state == state for f in track.frames)) for state in ("good", "weak", "lost"))
    position, rotation = np.sqrt((errors**2).mean(0)), errors.max(0)
    focal = np.array([f.camera.intrinsics.focal / plate.truth[f.frame].intrinsics.focal - 1 for f in tied])
    changes = f"{100 * np.sqrt((focal**2).mean()):.3f} %" if plate.focal != "fixed" else "-"
    readout = f"{track.readout:.3f}" if plate.rolling else "-"
    place, turn = f"{position[0]:.3f} %, {rotation[0]:.3f}", f"{position[1]:.4f}, {rotation[1]:.4f} deg"
    pixels = [f"{value:.3f} px" for value in (*rms, max(good, default=0.0))]
    return line(name, str(len(track.frames)), states, f"{seconds:.2f}", place, turn, *pixels, changes, readout)


def line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _slip(plate: Plate, frame: int, found: Camera) -> np.ndarray:
    """How far points of the scan that the true camera sees lie from their places, (N, 2) pixels, NaN behind a camera."""
    middle = plate.truth[list(plate.truth)[len(plate.truth) // 2]]
    k, points = middle.intrinsics, plate.scene.means
    inside = k.project(middle.pose.transform(points))
    with np.errstate(invalid="ignore"):
        seen = np.flatnonzero(((inside > 0) & (inside < (k.width, k.height))).all(1))
    chosen = points[np.random.default_rng(0).choice(seen, min(POINTS, len(seen)), replace=False)]
    true = plate.truth[frame]
    # Points beside or behind a camera have no place in its picture.
    far = NEAR * float(np.median(true.pose.transform(chosen)[:, 2]))
    ahead = (found.pose.transform(chosen)[:, 2] > far) & (true.pose.transform(chosen)[:, 2] > far)
    places = true.intrinsics.project(true.pose.transform(chosen))
    # Far outside of the picture, a polynomial of distortion is no lens any more.
    with np.errstate(invalid="ignore"):
        near = (np.abs(places / (k.width, k.height) - 0.5) < 1).all(1)
    off = found.intrinsics.project(found.pose.transform(chosen)) - places
    return np.where((ahead & near)[:, None], off, np.nan)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shots", nargs="+", choices=[*SHOTS, "real"], default=[*SHOTS, "real"])
    parser.add_argument("--frames", type=int, default=120, help="how many of each shot's frames are tracked")
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "gssmc-plates")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    print(line(*COLUMNS) + "\n" + "|---" * len(COLUMNS) + "|")
    for name in args.shots:
        if name == "real" and not SHARED.is_dir():
            print(f"no plate at {SHARED}", file=sys.stderr)
            continue
        plate = real(args.frames) if name == "real" else procedural(name, args.frames, args.pictures)
        print(row(name, plate, *tracked(plate)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
