"""COLMAP's sparse models in binary form: cameras.bin and images.bin, little-endian; points are not read.

Field by field as COLMAP documents them. What a file claims is held against its size before anything is read or skipped.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..errors import DatasetError

IMAGES, CAMERAS = "images.bin", "cameras.bin"
# By COLMAP's model id: its name, and how many parameters it has.
MODEL_IDS: dict[int, tuple[str, int]] = {
    0: ("SIMPLE_PINHOLE", 3),
    1: ("PINHOLE", 4),
    2: ("SIMPLE_RADIAL", 4),
    3: ("RADIAL", 5),
    4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8),
    6: ("FULL_OPENCV", 12),
    7: ("FOV", 5),
    8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5),
    10: ("THIN_PRISM_FISHEYE", 12),
    11: ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    12: ("SIMPLE_DIVISION", 4),
    13: ("DIVISION", 5),
    14: ("SIMPLE_FISHEYE", 3),
    15: ("FISHEYE", 4),
    16: ("EUCM", 6),
    17: ("EQUIRECTANGULAR", 2),
}
POINT_BYTES = 24  # of a 2D point: x, y and the id of its 3D point
MAX_NAME_BYTES = 4096


@dataclass(frozen=True)
class BinaryImage:
    """`pose`: qw qx qy qz tx ty tz, world-to-camera; `where` begins the sentence of an error."""

    name: str
    camera_id: int
    pose: tuple[float, ...]
    where: str


@dataclass(frozen=True)
class BinaryCamera:
    """`model`: COLMAP's name; `values`: width, height and the model's parameters."""

    camera_id: int
    model: str
    values: tuple[float, ...]
    where: str


class _Reader:
    """Numbers out of a file that may end too early, which is a DatasetError."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        self.file, self.path = file, path
        self.left = path.stat().st_size

    def take(self, layout: str) -> tuple[float, ...]:
        return struct.unpack("<" + layout, self._bytes(struct.calcsize("<" + layout)))

    def count(self) -> int:
        return int(self.take("Q")[0])

    def text(self) -> str:
        """UTF-8 up to the zero byte."""
        out = bytearray()
        while (byte := self._bytes(1)) != b"\0":
            out += byte
            if len(out) > MAX_NAME_BYTES:
                raise self._damaged()
        try:
            return out.decode()
        except UnicodeDecodeError:
            raise self._damaged() from None

    def skip(self, size: int) -> None:
        if size > self.left:
            raise self._damaged()
        self.file.seek(size, 1)
        self.left -= size

    def _bytes(self, size: int) -> bytes:
        data = self.file.read(size)
        if len(data) < size:
            raise self._damaged()
        self.left -= size
        return data

    def _damaged(self) -> DatasetError:
        return DatasetError(f"'{self.path.name}' is damaged or cut off; export the COLMAP model again.")


def read_images(path: Path) -> Iterator[BinaryImage]:
    """The images of images.bin. Raises DatasetError."""
    with path.open("rb") as file:
        reader = _Reader(file, path)
        for number in range(1, reader.count() + 1):
            _, *pose, camera_id = reader.take("i7di")
            name = reader.text()
            reader.skip(POINT_BYTES * reader.count())
            yield BinaryImage(name, int(camera_id), tuple(pose), f"Image {number} of '{path.name}'")


def read_cameras(path: Path) -> Iterator[BinaryCamera]:
    """The cameras of cameras.bin. Raises DatasetError, for a model that COLMAP had not when this was written too."""
    with path.open("rb") as file:
        reader = _Reader(file, path)
        for number in range(1, reader.count() + 1):
            where = f"Camera {number} of '{path.name}'"
            camera_id, model_id, width, height = (int(value) for value in reader.take("iiQQ"))
            if model_id not in MODEL_IDS:
                raise DatasetError(f"{where} has the unknown model {model_id}; convert it to OPENCV in COLMAP.")
            model, parameters = MODEL_IDS[model_id]
            yield BinaryCamera(camera_id, model, (width, height, *reader.take(f"{parameters}d")), where)
