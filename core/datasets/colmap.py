"""COLMAP's sparse models in text form: cameras.txt, images.txt, points3D.txt.

World-to-camera, OpenCV axes, pixel centres at +0.5, the model's own unit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..atomic import atomic_write
from ..camera import Camera, Intrinsics
from ..errors import CameraError, DatasetError
from .pose_list import pose_columns
from .text import data_lines, head, numbers, pose_from_columns, read_lines
from .types import PosedFrame, PoseSet, Split, pose_set, short

IMAGES, CAMERAS, POINTS = "images.txt", "cameras.txt", "points3D.txt"
PLACES = (".", "sparse/0", "sparse")
COLUMNS = 10
# Where each model's parameters go; "f" sets fx and fy, and "0" stands for one that must be zero.
MODELS: dict[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "0", "0", "0"),
}
MODEL_NAME = re.compile(r"[A-Z][A-Z0-9_]+")
DISTORTION = ("k1", "k2", "p1", "p2", "k3")


def detect(path: Path) -> bool:
    """A model folder, a project with a sparse model in it, or an images.txt under whatever name."""
    if path.is_dir():
        return any((path / place / name).is_file() for place in PLACES for name in (IMAGES, "images.bin"))
    lines = [line for line in head(path).splitlines() if line and not line.startswith("#")]
    columns = lines[0].split() if lines else []
    ids = len(columns) >= COLUMNS and columns[0].isdigit() and columns[8].isdigit()
    return path.name == IMAGES or (ids and not columns[9].replace(".", "").isdigit())


def read(path: Path, split: Split = "test") -> PoseSet:
    """The images of a model, with their lenses where cameras.txt tells one that `Intrinsics` holds. Raises DatasetError."""
    file = _images_file(path) if path.is_dir() else path
    lenses = _read_cameras(file.with_name(CAMERAS))
    frames = []
    for where, columns, name in _image_lines(file):
        frames.append(PosedFrame(name, pose_from_columns(columns[1:8], where), lenses.get(columns[8])))
    return pose_set(path, frames, metric=False)


def write_model(folder: Path, cameras: Sequence[Camera]) -> None:
    """Write a model without points: one COLMAP camera for each different lens. `read` gives the same doubles back."""
    lenses = list(dict.fromkeys(camera.intrinsics for camera in cameras))
    with atomic_write(folder / CAMERAS) as file:
        file.write("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n")
        file.writelines(f"{i} {_lens_columns(lens)}\n" for i, lens in enumerate(lenses, 1))
    with atomic_write(folder / IMAGES) as file:
        file.write("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as X Y POINT3D_ID\n")
        for i, camera in enumerate(cameras, 1):
            columns = [str(i), *pose_columns(camera.pose), str(lenses.index(camera.intrinsics) + 1), _checked(camera.file, i)]
            file.write(" ".join(columns) + "\n\n")
    with atomic_write(folder / POINTS) as file:
        file.write("# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n")


def read_lens(columns: Sequence[str], where: str) -> Intrinsics | None:
    """The lens written as MODEL WIDTH HEIGHT PARAMS; None where OpenCV's five coefficients cannot say it (a fisheye)."""
    names = MODELS.get(columns[0]) if columns else None
    if names is None and columns and MODEL_NAME.fullmatch(columns[0]):
        return None
    if names is None or len(columns) != 3 + len(names):
        raise DatasetError(f"{where} is no camera; it should hold an id, MODEL, width, height and the model's parameters.")
    width, height, *values = numbers(columns[1:], where, "an id, MODEL, width, height and the model's parameters")
    named = dict(zip(names, values, strict=True))
    if any(value for name, value in zip(names, values, strict=True) if name == "0"):
        return None
    fx, fy = (named.get(name, named.get("f", 0.0)) for name in ("fx", "fy"))
    k1, k2, p1, p2, k3 = (named.get(name, 0.0) for name in DISTORTION)
    try:
        return Intrinsics(int(width), int(height), fx, fy, named["cx"], named["cy"], (k1, k2, p1, p2, k3))
    except CameraError as error:
        raise DatasetError(f"{where} cannot be used: {error}") from None


def _images_file(folder: Path) -> Path:
    for place in PLACES:
        if (folder / place / IMAGES).is_file():
            return folder / place / IMAGES
    raise DatasetError(
        f"'{folder.name}' holds a binary COLMAP model; convert it with: colmap model_converter --output_type TXT."
    )


def _image_lines(path: Path) -> Iterator[tuple[str, list[str], str]]:
    """("line N of 'file'", columns, name) of each image; the line of 2D points that follows each is checked and left."""
    where, expect_points = "", False
    for number, line in read_lines(path):
        if line.lstrip().startswith("#") or not (line.strip() or expect_points):
            continue
        where = f"Line {number} of '{path.name}'"
        if expect_points:
            if len(line.split()) % 3:
                raise DatasetError(f"{where} should hold 2D points (three values each, or none); give two lines to each image.")
            expect_points = False
            continue
        columns = line.split(maxsplit=COLUMNS - 1)
        if len(columns) < COLUMNS:
            raise DatasetError(f"{where} has {len(columns)} columns; it should hold id qw qx qy qz tx ty tz camera name.")
        expect_points = True
        yield where, columns, columns[-1].strip()


def _read_cameras(path: Path) -> dict[str, Intrinsics | None]:
    """Lenses by camera id; none without the file, for poses can be compared without lenses."""
    if not path.is_file():
        return {}
    return {columns[0]: read_lens(columns[1:], where) for where, columns in data_lines(path)}


def _lens_columns(k: Intrinsics) -> str:
    """MODEL WIDTH HEIGHT PARAMS of the simplest model that says all of the lens."""
    values = [k.fx, k.fy, k.cx, k.cy]
    model = "PINHOLE"
    if k.dist[4]:
        model, values = "FULL_OPENCV", [*values, *k.dist, 0.0, 0.0, 0.0]
    elif k.has_distortion:
        model, values = "OPENCV", [*values, *k.dist[:4]]
    return " ".join([model, str(k.width), str(k.height), *(repr(float(value)) for value in values)])


def _checked(name: str, number: int) -> str:
    if name.strip() != name or not name or "\n" in name or "\r" in name:
        raise DatasetError(f"Camera {number} has the photo '{short(name)}', which COLMAP cannot name; give its file's name.")
    return name
