"""Find Camera without any start: maps, hypotheses, verdicts, other places' photos, spoilt photos, random views.

    .venv/bin/python benchmarks/locate.py [--quick] [--parts signs map photos guessed known cross ...] [--maps FOLDER]

Needs the scans in ../shared/scenes for all parts but sample and repeats. Errors: per cent of the scan's median depth, degrees;
seconds are CPU time of this process (one thread). In the basin: within 30 % and 20 deg. --quick takes every third photo.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from large_scans import copies, scale_rows, split, town
from real_scenes import SCENES, Scan

from core.cameras.files import read_cameras
from core.features.extractors.sift import RootSift
from core.geometry.camera import Camera, Intrinsics, Pose, pose_error
from core.locate import (
    LandmarkMap,
    MapFileError,
    MapSettings,
    PhotoLens,
    build_map,
    find_camera,
    locate,
    map_key,
    read_map,
    scan_digest,
    write_map,
)
from core.locate.viewpoints.candidates import measured_ratio
from core.locate.viewpoints.surface import sample_surface
from core.photos.photo import Photo, read_photo
from core.pose.settings import RefineSettings
from core.render import Renderer, RenderSettings
from core.splats.scene import GaussianScene
from core.synthetic import buildings
from core.synthetic.room import make_scene
from core.synthetic.sample import DEPTH, make_photo, sample_cameras

BASIN = (30.0, 20.0)
HOME = {"room": (1.0, 0.5)}  # whose truth is weak; the others':
HOME_ELSEWHERE = (0.3, 0.2)
PARTS = ("signs", "map", "photos", "guessed", "known", "cross", "spoilt", "sample", "town", "repeats", "scale")
OWN_MAPS = {"map", "photos", "guessed", "cross", "spoilt"}  # the parts that need the map of each scan
OTHERS = {"fox": ("monstree", "room"), "monstree": ("room", "fox"), "room": ("fox", "monstree")}
SETTINGS = RefineSettings(threads=1)
TOWN_VIEWS = 120
PLAIN = 150  # features; a view of the room with fewer shows little but bare walls


@dataclass(frozen=True)
class Place:
    """A scan with its map, the photos to be found in it and their depth."""

    scan: Scan
    landmarks: LandmarkMap

    @property
    def name(self) -> str:
        return self.scan.name

    def errors(self, pose: Pose, truth: Pose) -> tuple[float, float]:
        distance, degrees = pose_error(pose, truth)
        return 100 * distance / self.scan.depth, degrees


def within(errors: tuple[float, float], bounds: tuple[float, float]) -> bool:
    return errors[0] <= bounds[0] and errors[1] <= bounds[1]


def mapped(name: str, scene: GaussianScene, views: int, known: list[Camera], folder: Path) -> LandmarkMap:
    """The map from the folder, or made anew, with its cost printed."""
    settings = MapSettings(views=views)
    key = map_key(scan_digest(scene), settings, known)
    path = folder / f"{name}-{views}{'-known' if known else ''}.map"
    try:
        return read_map(path, key)
    except MapFileError:
        pass
    began, first, landmarks = time.process_time(), float("nan"), LandmarkMap(key)
    for step in build_map(scene, settings, known, key):
        landmarks = step.map
        if len(landmarks) == 10 and np.isnan(first):
            first = time.process_time() - began
    spent = time.process_time() - began
    write_map(path, landmarks)
    print(
        f"| {name}{' with its cameras' if known else ''} | {len(scene)} | {len(landmarks)} | {landmarks.landmarks} "
        f"| {first:.1f} | {spent:.1f} | {path.stat().st_size / 1e6:.1f} |",
        flush=True,
    )
    return landmarks


def photos_of(scan: Scan, quick: bool) -> Iterator[tuple[Camera, Photo]]:
    for truth in scan.cameras[1::3] if quick else scan.cameras:
        yield truth, read_photo(SCENES / scan.name / truth.file)


def photo_row(place: Place, label: str, guessed: bool, quick: bool, verbose: bool) -> str:
    """Hypotheses and refined cameras of the scan's own photos."""
    basin, home, lost, before, after, spent, whole = 0, 0, 0, [], [], [], []
    verdicts = []
    for truth, photo in photos_of(place.scan, quick):
        target = PhotoLens(photo, None if guessed else truth.intrinsics)
        began = time.process_time()
        located = locate(place.scan.renderer, target, place.landmarks)
        spent.append(time.process_time() - began)
        first = place.errors(located.hypotheses[0].pose, truth.pose) if located.hypotheses else (np.inf, np.inf)
        basin += within(first, BASIN)
        before.append(first)
        began = time.process_time()
        report = find_camera(place.scan.renderer, target, place.landmarks, SETTINGS)
        whole.append(time.process_time() - began)
        verdicts.append(report.verdict)
        last = place.errors(report.camera.pose, truth.pose) if report.camera else (np.inf, np.inf)
        bounds = HOME.get(place.name, HOME_ELSEWHERE)
        home += within(last, bounds)
        lost += report.verdict == "trusted" and not within(last, (1.0, 1.0))
        after.append(last)
        if verbose:
            best = located.hypotheses[0] if located.hypotheses else None
            print(
                f"   {Path(truth.file).stem} {best and (best.inliers, best.cells)} {first[0]:.2f} % {first[1]:.2f} deg ->",
                end=" ",
            )
            print(
                f"{last[0]:.3f} % {last[1]:.3f} deg {report.verdict} of {report.views} views.", *report.reasons[:1], flush=True
            )
    d, r = np.median(before, axis=0)
    e, s = np.median(after, axis=0)
    return (
        f"| {label} | {'guessed' if guessed else 'known'} | {basin} of {len(before)} | {d:.2f} / {r:.2f} | {e:.3f} / {s:.3f} "
        f"| {home} | {verdicts.count('trusted')} / {verdicts.count('check')} / {verdicts.count('failed')} | {lost} "
        f"| {np.median(spent):.1f} | {np.median(whole):.1f} |"
    )


PHOTO_HEADER = (
    "\n| scan | lens | hypothesis in basin | its median error (% / deg) | refined (% / deg) | home | trusted / check / failed "
    "| lost but trusted | s to hypothesis | s in all |\n|---|---|---|---|---|---|---|---|---|---|"
)


def cross_rows(places: dict[str, Place], quick: bool) -> Iterator[str]:
    """Photos of other places, which must not be found."""
    yield "\n| photos of | in the scan | lens | trials | trusted | check | failed | s median / most |\n" + "|---" * 8 + "|"
    for name, place in places.items():
        for other in OTHERS[name]:
            if other not in places:
                continue
            for guessed in (False, True):
                verdicts, spent = [], []
                for truth, photo in list(photos_of(places[other].scan, True))[: 2 if quick else None]:
                    began = time.process_time()
                    target = PhotoLens(photo, None if guessed else truth.intrinsics)
                    verdicts.append(find_camera(place.scan.renderer, target, place.landmarks, SETTINGS).verdict)
                    spent.append(time.process_time() - began)
                counts = " | ".join(str(verdicts.count(v)) for v in ("trusted", "check", "failed"))
                yield (
                    f"| {other} | {name} | {'guessed' if guessed else 'known'} | {len(spent)} | {counts} "
                    f"| {np.median(spent):.1f} / {max(spent):.1f} |"
                )


def sign_rows(scenes: list[str]) -> Iterator[str]:
    """What the scan remembers of its photographs, against the cameras that it was trained from."""
    yield "\n| scan | surface points seen | faced the right way | mean cosine | distance / width, measured | of the cameras |"
    yield "|---|---|---|---|---|---|"
    for name in scenes:
        scan, rng = Scan.load(name), np.random.default_rng(0)
        surface = sample_surface(scan.scene, 20_000, rng)
        towards, nearest = np.zeros((len(surface), 3)), np.full(len(surface), np.inf)
        cameras = read_cameras(SCENES / name / "train.json")
        for camera in cameras[:: max(1, len(cameras) // 20)]:
            lens = camera.intrinsics.pinhole().with_long_side(128)
            depth = scan.renderer.render(lens, camera.pose).depth
            p = camera.pose.transform(surface.points)
            pixel = np.nan_to_num(lens.project(p), nan=-1.0)
            index = np.flatnonzero(((pixel >= 0) & (pixel < (lens.width, lens.height))).all(axis=1))
            column, row = pixel[index].astype(int).T
            index = index[np.abs(depth[row, column] - p[index, 2]) < 0.08 * p[index, 2]]
            ray = camera.pose.centre - surface.points[index]
            distance = np.linalg.norm(ray, axis=1)
            towards[index] += ray / distance[:, None]
            nearest[index] = np.minimum(nearest[index], distance)
        seen = np.linalg.norm(towards, axis=1) > 0.5
        cosine = np.einsum("ij,ij->i", surface.facing, towards)[seen]
        cosine /= np.linalg.norm(towards[seen], axis=1) * np.linalg.norm(surface.facing[seen], axis=1)
        ratio = measured_ratio(surface, 24, rng)
        true = np.median(nearest[seen] / surface.width[seen])
        share = f"{100 * seen.mean():.0f} % | {100 * (cosine > 0).mean():.1f} % | {cosine.mean():.2f}"
        yield f"| {name} | {share} | {ratio:.0f} | {true:.0f} |"


def half_hidden(image: np.ndarray) -> np.ndarray:
    out = image.copy()
    out[:, : image.shape[1] // 2] = 127
    return out


SPOILERS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "blurred": lambda image: cv2.GaussianBlur(image, (0, 0), max(image.shape) / 400),
    "12 % exposure": lambda image: (image * 0.12).astype(np.uint8),
    "cropped to half": lambda image: image[
        image.shape[0] // 4 : -(image.shape[0] // 4), image.shape[1] // 4 : -(image.shape[1] // 4)
    ],
    "half hidden": half_hidden,
    "turned by 90 deg": lambda image: np.rot90(image, -1),
}


def spoilt_lens(name: str, k: Intrinsics, image: np.ndarray) -> tuple[Intrinsics, np.ndarray]:
    """The lens of a spoilt photo, and the rotation (3, 3) from the true camera to its camera."""
    h, w = image.shape[:2]
    if name == "cropped to half":
        return replace(k, width=w, height=h, cx=k.cx - k.width // 4, cy=k.cy - k.height // 4), np.eye(3)
    if name == "turned by 90 deg":  # clockwise: a pixel (x, y) goes to (height - y, x)
        p1, p2 = k.dist[2], k.dist[3]
        turned = replace(k, width=w, height=h, fx=k.fy, fy=k.fx, cx=k.height - k.cy, cy=k.cx)
        return replace(turned, dist=(k.dist[0], k.dist[1], p2, -p1, k.dist[4])), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    return k, np.eye(3)


def spoilt_rows(places: dict[str, Place], quick: bool) -> Iterator[str]:
    yield "\n| photo | hypothesis in basin | least inliers |\n|---|---|---|"
    for name, spoil in SPOILERS.items():
        good, trials, least = 0, 0, []
        for place in places.values():
            if place.name == "room":
                continue
            for truth, photo in photos_of(place.scan, quick):
                image = np.ascontiguousarray(spoil(photo.pixels))
                lens, turn = spoilt_lens(name, truth.intrinsics, image)
                located = locate(place.scan.renderer, PhotoLens(Photo(image), lens), place.landmarks)
                trials += 1
                if located.hypotheses:
                    best = located.hypotheses[0]
                    true = Pose(turn @ truth.pose.R, turn @ truth.pose.t)
                    good += within(place.errors(best.pose, true), BASIN)
                    least.append(best.inliers)
        yield f"| {name} | {good} of {trials} | {min(least, default=0)} |"


def sample_rows(views: int, folder: Path) -> Iterator[str]:
    """Random views inside the sample room, which nobody chose."""
    scene = make_scene()
    renderer = Renderer(scene, RenderSettings(threads=1))
    landmarks = mapped("sample room", scene, views, [], folder)
    rng, lens = np.random.default_rng(5), Intrinsics(640, 480, 505, 505, 320, 240)
    good, trials, found, plain = 0, 14, [], 0
    for k in range(trials):
        centre = rng.uniform((-1.6, -0.9, -0.3), (1.6, 0.5, 2.2))
        z = rng.normal(size=3) * (1, 0.3, 1)
        z /= np.linalg.norm(z)
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        pose = Pose.from_centre(np.stack([x, np.cross(z, x), z]), centre)
        photo = make_photo(renderer, Camera(lens, pose), k)
        located = locate(renderer, PhotoLens(photo, lens), landmarks)
        plain += len(RootSift().extract(cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY))) < PLAIN and not located.hypotheses
        if located.hypotheses:
            distance, degrees = pose_error(located.hypotheses[0].pose, pose)
            right = distance < 0.3 * located.hypotheses[0].depth and degrees < 20
            good += right
            found.append(located.hypotheses[0].inliers)
    least = min(found, default=0)
    yield (
        f"\nrandom views in the sample room: {good} of {trials} in basin, {len(found)} found, {least} inliers at least; "
        f"of the others {plain} have fewer than {PLAIN} features"
    )


def town_rows(places: dict[str, Place], folder: Path) -> Iterator[str]:
    """All places and the sample room in one scan, among floaters, inside of a shell."""
    room = make_scene()
    scans = [place.scan for place in places.values()]
    made = town([*(scan.scene for scan in scans), room], [*(scan.depth for scan in scans), DEPTH])
    landmarks, renderer = mapped("town", made.scene, TOWN_VIEWS, [], folder), Renderer(made.scene, RenderSettings(threads=1))
    photos = [list(photos_of(scan, False)) for scan in scans]
    photos.append([(c, make_photo(Renderer(room, RenderSettings(threads=1)), c)) for c in sample_cameras()])
    yield "\n| place of the town | views | hypothesis in basin |\n|---|---|---|"
    for name, own, offset, scale in zip([*places, "sample room"], photos, made.offset, made.scale, strict=True):
        for views in (TOWN_VIEWS // 3, TOWN_VIEWS):
            good = 0
            for truth, photo in own:
                part = LandmarkMap(landmarks.key, landmarks.views[:views])
                located = locate(renderer, PhotoLens(photo, truth.intrinsics), part)
                if located.hypotheses:
                    centre = scale * truth.pose.centre + offset
                    distance, degrees = pose_error(located.hypotheses[0].pose, Pose.from_centre(truth.pose.R, centre))
                    good += within((100 * distance, degrees), BASIN)
            yield f"| {name} | {views} | {good} of {len(own)} |"


def repeat_rows() -> Iterator[str]:
    """Places that repeat themselves, whose cameras are known exactly."""
    yield "\n| place | photo | verdict | error (scene units / deg) | reason |\n|---|---|---|---|---|"
    doors = [*(buildings.door_camera(bay) for bay in range(buildings.BAYS)), buildings.end_camera()]
    for name, scene, cameras in (
        ("courtyard", buildings.courtyard(), buildings.courtyard_cameras(16)),
        ("corridor", buildings.corridor(), doors),
    ):
        renderer = Renderer(scene, RenderSettings(threads=1))
        *_, last = build_map(scene, MapSettings(views=40))
        for camera in cameras:
            photo = make_photo(renderer, camera)
            report = find_camera(renderer, PhotoLens(photo, camera.intrinsics), last.map, SETTINGS)
            error = pose_error(report.camera.pose, camera.pose) if report.camera else (np.nan, np.nan)
            yield f"| {name} | {camera.file} | {report.verdict} | {error[0]:.3f} / {error[1]:.2f} | {report.reasons[0]} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="*", default=["fox", "monstree", "room"])
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--views", type=int, default=80)
    parser.add_argument("--maps", type=Path, default=Path("/tmp/gssmc-maps"), help="folder that keeps the maps")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    print("| scan | Gaussians | views | landmarks | s to 10 views | s in all | MB |\n|---|---|---|---|---|---|---|", flush=True)
    places: dict[str, Place] = {}
    for name in args.scenes if SCENES.is_dir() else []:
        scan = Scan.load(name)
        own = OWN_MAPS.intersection(args.parts)
        places[name] = Place(scan, mapped(name, scan.scene, args.views, [], args.maps) if own else LandmarkMap(""))
    for row in rows(places, args):
        print(row, flush=True)
    return 0


def rows(places: dict[str, Place], args: argparse.Namespace) -> Iterator[str]:
    """The rows of all parts that were asked for."""
    if "signs" in args.parts:
        yield from sign_rows(list(places))
    for part, guessed in (("photos", False), ("guessed", True)):
        if part in args.parts and places:
            yield PHOTO_HEADER
            yield from (photo_row(place, place.name, guessed, args.quick, args.verbose) for place in places.values())
    if "known" in args.parts and "room" in places:
        scan = places["room"].scan
        cameras = read_cameras(SCENES / "room" / "train.json")
        place = Place(scan, mapped("room", scan.scene, args.views, cameras, args.maps))
        yield PHOTO_HEADER
        yield photo_row(place, "room with its cameras", False, args.quick, args.verbose)
    yield from more_rows(places, args)


def more_rows(places: dict[str, Place], args: argparse.Namespace) -> Iterator[str]:
    """The rows of the parts that ask for more than the scans' own photos."""
    fox = places["fox"].scan.scene if "fox" in places else make_scene()
    large = {
        f"fox, {what} by {count}": partial(make, fox, count)
        for count in (10, 34)
        for what, make in (("split", split), ("copied", copies))
    }
    makers: dict[str, Callable[[], Iterator[str]]] = {
        "cross": lambda: cross_rows(places, args.quick),
        "spoilt": lambda: spoilt_rows(places, args.quick),
        "sample": lambda: sample_rows(min(args.views, 40), args.maps),
        "town": lambda: town_rows(places, args.maps),
        "repeats": repeat_rows,
        "scale": lambda: scale_rows(large, args.maps, 40),
    }
    for part, make_rows in makers.items():
        if part in args.parts and (places or part in ("sample", "repeats")):
            yield from make_rows()


if __name__ == "__main__":
    sys.exit(main())
