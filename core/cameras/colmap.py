"""COLMAP's sparse models: in text form cameras.txt, images.txt, points3D.txt; in binary form `colmap_binary` reads them.

World-to-camera, OpenCV axes, pixel centres at +0.5, the model's own unit; of the photos' pixels as they are stored.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import CameraError, DatasetError
from ..geometry.camera import Camera, Intrinsics, Pose
from ..geometry.foreign_lens import BROWN, Lens
from ..geometry.foreign_lens import lens_of as foreign_lens
from ..geometry.pinhole_cut import WideCamera
from ..geometry.wide_lens import WideLens
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
from .types import PosedFrame, PoseSet, Split, collect, lens_of_file, pose_set, short

IMAGES, CAMERAS, POINTS = "images.txt", "cameras.txt", "points3D.txt"
PLACES = (".", "sparse/0", "sparse", "dense/sparse", "dense/0/sparse", "distorted/sparse/0")
COLUMNS = 10
FISHEYE = ("fx", "fy", "cx", "cy", "k1", "k2")
# Where each model's parameters go; "f" sets fx and fy. The engine's own coefficients have its names.
MODELS: dict[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "OPENCV_FISHEYE": (*FISHEYE, "k3", "k4"),
    "FOV": ("fx", "fy", "cx", "cy", "omega"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "THIN_PRISM_FISHEYE": (*FISHEYE, "p1", "p2", "k3", "k4", "sx1", "sy1"),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        *("fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5"),
        *("p0", "p1", "s0", "s1", "s2", "s3"),
    ),
    "SIMPLE_DIVISION": ("f", "cx", "cy", "k"),
    "DIVISION": ("fx", "fy", "cx", "cy", "k"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fx", "fy", "cx", "cy"),
    "EUCM": ("fx", "fy", "cx", "cy", "alpha", "beta"),
}
PLAIN = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")
PINHOLE = ("f", "fx", "fy", "cx", "cy")
MODEL_NAME = re.compile(r"[A-Z][A-Z0-9_]+")
CAMERA_COLUMNS = "an id, MODEL, width, height and the model's parameters"


def detect(path: Path) -> bool:
    """A model folder, a project with a sparse model in it, or an images.txt under whatever name."""
    if path.is_dir():
        return any((path / place / name).is_file() for place in PLACES for name in (IMAGES, colmap_binary.IMAGES))
    lines = [line for line in head(path).splitlines() if line and not line.startswith("#")]
    return path.name in (IMAGES, colmap_binary.IMAGES) or _is_image(lines[0].split() if lines else ())


def read(path: Path, split: Split = "test") -> PoseSet:
    """The images of a model, with their lenses where its cameras tell one that `Intrinsics` holds. Raises DatasetError.

    Of a folder that has both forms the text is read.
    """
    file = _images_file(path) if path.is_dir() else path
    frames, bad = _read_binary(file) if file.name == colmap_binary.IMAGES else _read_text(file)
    return replace(pose_set(path, frames, metric=False, bad=bad), pixel_order="stored")


Frames = tuple[list[PosedFrame], tuple[str, ...]]


def _read_text(file: Path) -> Frames:
    lenses = _read_cameras(file.with_name(CAMERAS))

    def frame_of(line: tuple[str, list[str], str]) -> PosedFrame:
        where, columns, name = line
        return _frame(name, pose_from_columns(columns[1:8], where), lenses.get(columns[8]))

    return collect(_image_lines(file), frame_of)


def _read_binary(file: Path) -> Frames:
    """Raises DatasetError."""
    cameras = file.with_name(colmap_binary.CAMERAS)
    lenses: dict[int, Lens] = {}

    def frame_of(image: colmap_binary.BinaryImage) -> PosedFrame:
        values = usable_numbers(list(image.pose), image.where, POSE_COLUMNS)
        return _frame(image.name, pose_from_numbers(values, image.where), lenses.get(image.camera_id))

    try:
        if cameras.is_file():
            for camera in colmap_binary.read_cameras(cameras):
                lenses[camera.camera_id] = lens_of(camera.model, list(camera.values), camera.where)
        return collect(colmap_binary.read_images(file), frame_of)
    except OSError as error:
        raise DatasetError(f"'{file}' cannot be read ({error.strerror}); check the path.") from error


def _frame(name: str, pose: Pose, lens: Lens | None) -> PosedFrame:
    lens = lens or Lens(None)
    return PosedFrame(name, pose, lens.intrinsics, problem=lens.problem, is_picture=lens.is_picture, wide=lens.wide)


def write_model(folder: Path, cameras: Sequence[Camera]) -> None:
    """Write a model without points: one COLMAP camera for each different lens. `read` gives the same doubles back."""
    lenses = list(dict.fromkeys(_lens(camera) for camera in cameras))
    with atomic_write(folder / CAMERAS) as file:
        file.write("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n")
        file.writelines(f"{i} {_lens_columns(lens)}\n" for i, lens in enumerate(lenses, 1))
    with atomic_write(folder / IMAGES) as file:
        file.write("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as X Y POINT3D_ID\n")
        for i, camera in enumerate(cameras, 1):
            columns = [str(i), *pose_columns(camera.pose), str(lenses.index(_lens(camera)) + 1), _checked(camera.file, i)]
            file.write(" ".join(columns) + "\n\n")
    with atomic_write(folder / POINTS) as file:
        file.write("# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n")


def read_lens(columns: Sequence[str], where: str) -> Lens:
    """The lens written as MODEL WIDTH HEIGHT PARAMS. Raises DatasetError where that is no camera."""
    model = columns[0] if columns else ""
    if not MODEL_NAME.fullmatch(model) or (model in MODELS and len(columns) != 3 + len(MODELS[model])):
        raise DatasetError(f"{where} is no camera; it should hold {CAMERA_COLUMNS}.")
    return lens_of(model, numbers(columns[1:], where, CAMERA_COLUMNS), where)


def lens_of(model: str, values: list[float], where: str) -> Lens:
    """The lens of a COLMAP `model` with width, height and its parameters. Raises DatasetError."""
    if len(values) < 2:
        raise DatasetError(f"{where} is no camera; it should hold {CAMERA_COLUMNS}.")
    width, height, *rest = usable_numbers(values, where, CAMERA_COLUMNS)
    names = MODELS.get(model, ())
    named = dict(zip(names, rest, strict=False))
    try:
        fx = named.get("fx", named.get("f", float(width)))
        fy = named.get("fy", fx)
        pinhole = lens_of_file(Intrinsics(int(width), int(height), fx, fy, named.get("cx", 0.0), named.get("cy", 0.0)))
    except CameraError as error:
        raise DatasetError(f"{where} cannot be used: {error}") from None
    others = {name: value for name, value in named.items() if name not in PINHOLE}
    return foreign_lens(BROWN if model in PLAIN else model, pinhole, others)


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
        # Some programs leave the empty lines of points out.
        if expect_points and not _is_image(line.split(maxsplit=COLUMNS - 1)):
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


def _is_image(columns: Sequence[str]) -> bool:
    """Whether the line's ids are whole numbers, and its name is no number, as no line of 2D points has it."""
    if len(columns) < COLUMNS or not (columns[0].isdigit() and columns[8].isdigit()):
        return False
    try:
        float(columns[9].split()[0])
    except ValueError:
        return True
    return False


def _read_cameras(path: Path) -> dict[str, Lens]:
    """Lenses by camera id; none without the file, for poses can be compared without lenses."""
    if not path.is_file():
        return {}
    return {columns[0]: read_lens(columns[1:], where) for where, columns in data_lines(path)}


def _lens(camera: Camera) -> Intrinsics | WideLens:
    return camera.lens if isinstance(camera, WideCamera) else camera.intrinsics


def _lens_columns(k: Intrinsics | WideLens) -> str:
    """MODEL WIDTH HEIGHT PARAMS of the simplest model that says all of the lens. Raises DatasetError where COLMAP has none."""
    if isinstance(k, WideLens):
        return _wide_columns(k)
    values = [k.fx, k.fy, k.cx, k.cy]
    model = "PINHOLE"
    if k.dist[4]:
        model, values = "FULL_OPENCV", [*values, *k.dist, 0.0, 0.0, 0.0]
    elif k.has_distortion:
        model, values = "OPENCV", [*values, *k.dist[:4]]
    return " ".join([model, str(k.width), str(k.height), *(repr(float(value)) for value in values)])


def _wide_columns(lens: WideLens) -> str:
    if lens.is_panorama:
        return f"{lens.model} {lens.width} {lens.height} {lens.width} {lens.height}"
    names = MODELS.get(lens.model)
    if names is None or ("f" in names and lens.fx != lens.fy):
        raise DatasetError(f"COLMAP has no lens model {lens.model} with these values; write --to json.")
    lengths = {"f": lens.fx, "fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy}
    values = [(lengths | lens.values).get(name, 0.0) for name in names]
    return " ".join([lens.model, str(lens.width), str(lens.height), *(repr(float(value)) for value in values)])


def _checked(name: str, number: int) -> str:
    if name.strip() != name or not name or "\n" in name or "\r" in name:
        raise DatasetError(f"Camera {number} has the photo '{short(name)}', which COLMAP cannot name; give its file's name.")
    return name
