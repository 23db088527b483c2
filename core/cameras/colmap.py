"""COLMAP's sparse models: in text form cameras.txt, images.txt, points3D.txt; in binary form `colmap_binary` reads them.

World-to-camera, OpenCV axes, pixel centres at +0.5, the model's own unit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..errors import CameraError, DatasetError
from ..geometry.camera import Camera, Intrinsics
from ..support.atomic import atomic_write
from ..support.words import counted
from . import colmap_binary
from .pose_list import pose_columns
from .text import (
    POSE_COLUMNS,
    data_lines,
    head,
    numbers,
    pose_from_columns,
    pose_from_numbers,
    read_lines,
    usable_numbers,
)
from .types import PosedFrame, PoseSet, Split, lens_of_file, pose_set, short

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
CAMERA_COLUMNS = "an id, MODEL, width, height and the model's parameters"
DISTORTION = ("k1", "k2", "p1", "p2", "k3")


def detect(path: Path) -> bool:
    """A model folder, a project with a sparse model in it, or an images.txt under whatever name."""
    if path.is_dir():
        return any((path / place / name).is_file() for place in PLACES for name in (IMAGES, colmap_binary.IMAGES))
    lines = [line for line in head(path).splitlines() if line and not line.startswith("#")]
    columns = lines[0].split() if lines else []
    ids = len(columns) >= COLUMNS and columns[0].isdigit() and columns[8].isdigit()
    return path.name in (IMAGES, colmap_binary.IMAGES) or (ids and not columns[9].replace(".", "").isdigit())


def read(path: Path, split: Split = "test") -> PoseSet:
    """The images of a model, with their lenses where its cameras tell one that `Intrinsics` holds. Raises DatasetError.

    Of a folder that has both forms the text is read.
    """
    file = _images_file(path) if path.is_dir() else path
    frames = _read_binary(file) if file.name == colmap_binary.IMAGES else _read_text(file)
    return pose_set(path, frames, metric=False)


def _read_text(file: Path) -> list[PosedFrame]:
    lenses = _read_cameras(file.with_name(CAMERAS))
    return [
        PosedFrame(name, pose_from_columns(columns[1:8], where), lenses.get(columns[8]))
        for where, columns, name in _image_lines(file)
    ]


def _read_binary(file: Path) -> list[PosedFrame]:
    """Raises DatasetError."""
    cameras = file.with_name(colmap_binary.CAMERAS)
    frames, lenses = [], {}
    try:
        if cameras.is_file():
            for camera in colmap_binary.read_cameras(cameras):
                lenses[camera.camera_id] = lens_of(camera.model, list(camera.values), camera.where)
        for image in colmap_binary.read_images(file):
            values = usable_numbers(list(image.pose), image.where, POSE_COLUMNS)
            frames.append(PosedFrame(image.name, pose_from_numbers(values, image.where), lenses.get(image.camera_id)))
    except OSError as error:
        raise DatasetError(f"'{file}' cannot be read ({error.strerror}); check the path.") from error
    return frames


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
        raise DatasetError(f"{where} is no camera; it should hold {CAMERA_COLUMNS}.")
    return lens_of(columns[0], numbers(columns[1:], where, CAMERA_COLUMNS), where)


def lens_of(model: str, values: list[float], where: str) -> Intrinsics | None:
    """The lens of a COLMAP `model` with width, height and its parameters; None as for `read_lens`. Raises DatasetError."""
    names = MODELS.get(model)
    if names is None:
        return None
    width, height, *rest = usable_numbers(values, where, CAMERA_COLUMNS)
    named = dict(zip(names, rest, strict=True))
    if any(value for name, value in zip(names, rest, strict=True) if name == "0"):
        return None
    fx, fy = (named.get(name, named.get("f", 0.0)) for name in ("fx", "fy"))
    k1, k2, p1, p2, k3 = (named.get(name, 0.0) for name in DISTORTION)
    try:
        return lens_of_file(Intrinsics(int(width), int(height), fx, fy, named["cx"], named["cy"], (k1, k2, p1, p2, k3)))
    except CameraError as error:
        raise DatasetError(f"{where} cannot be used: {error}") from None


def _images_file(folder: Path) -> Path:
    found = [folder / place / name for place in PLACES for name in (IMAGES, colmap_binary.IMAGES)]
    return next(file for file in found if file.is_file())  # `detect` has seen one


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
            raise DatasetError(
                f"{where} has {counted(len(columns), 'column')}; it should hold id qw qx qy qz tx ty tz camera name."
            )
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
