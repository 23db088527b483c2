"""Records of photos that nobody has placed: a photo's name, and its lens where that is known.

In camera JSON such a record has neither "R" nor "t", or null for both; it may also be the photo's name alone, as a string.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import CameraError
from ..geometry.camera import Camera, Intrinsics, PixelOrder, Pose
from ..geometry.pinhole_cut import WideCamera
from ..geometry.wide_lens import WideLens
from .files import NUMBERS, StartCamera, camera_to_dict, parse_file, start_from_dict

POSE = ("R", "t")


@dataclass(frozen=True)
class Unplaced:
    """A photo without a pose: `intrinsics` at its full size, None where nothing tells its lens, or it is `wide`; `pixel_order`
    as in Camera.
    """

    file: str = ""
    intrinsics: Intrinsics | None = None
    focal_guessed: bool = False
    pixel_order: PixelOrder = "upright"
    wide: WideLens | None = None

    @property
    def tells_no_lens(self) -> bool:
        return self.intrinsics is None and self.wide is None

    def with_guess(self, guess: Intrinsics) -> Unplaced:
        """The same; `guess` takes the place of a lens that is not known."""
        if not self.tells_no_lens:
            return self
        return replace(self, intrinsics=guess, focal_guessed=True, pixel_order="upright")

    @classmethod
    def of(cls, camera: Camera | StartCamera) -> Unplaced:
        """What is left of a camera whose pose is not known, or not to be used."""
        wide = camera.lens if isinstance(camera, WideCamera) else getattr(camera, "wide", None)
        lens = None if wide else camera.intrinsics
        return cls(camera.file, lens, camera.focal_guessed, camera.pixel_order, wide)


def read_wanted(path: str | Path) -> tuple[list[StartCamera | Unplaced], tuple[str, ...]]:
    """The records of a camera JSON, in its order, each with or without a pose, and a sentence for each that cannot be used.

    Raises CameraError where that is none of them.
    """
    found = parse_file(Path(path), _wanted_or_why_not)
    records, bad = (
        [one for one in found if not isinstance(one, CameraError)],
        [str(e) for e in found if isinstance(e, CameraError)],
    )
    if not records:
        raise CameraError(bad[0])
    return records, tuple(bad)


def _wanted_or_why_not(data: Any, name: str) -> StartCamera | Unplaced | CameraError:
    try:
        return wanted_from_dict(data, name)
    except CameraError as error:
        return error


def wanted_from_dict(data: Any, name: str = "The camera") -> StartCamera | Unplaced:
    """The record in a JSON value. `name` begins the sentence of a CameraError, which whatever is half a pose raises."""
    if isinstance(data, str):
        return Unplaced(data)
    if not is_unplaced(data):
        return start_from_dict(data, name)
    lens = {key: value for key, value in data.items() if value is not None and key not in POSE}
    start = start_from_dict({**lens, "R": Pose().R.tolist(), "t": [0.0, 0.0, 0.0]}, name)
    guessed = start.focal_guessed and start.intrinsics is not None
    return Unplaced(start.file, start.intrinsics, guessed, start.pixel_order, start.wide)


def is_unplaced(data: Any) -> bool:
    """Whether a JSON value is the record of a photo without a pose: a name, or an object that names a photo or a lens."""
    if isinstance(data, str):
        return True
    said = isinstance(data, dict) and any(data.get(key) is not None for key in ("file", *NUMBERS))
    return said and all(data.get(key) is None for key in POSE)


def wanted_to_dict(wanted: Camera | StartCamera | Unplaced) -> dict[str, Any]:
    """The record as JSON holds it; without a pose, "R" and "t" are null, and the lens's keys are left out where it has none."""
    if isinstance(wanted, Camera):
        return camera_to_dict(wanted)
    if isinstance(wanted, StartCamera):
        return wanted.to_dict()
    if wanted.wide is not None:
        start = StartCamera(Pose(), wanted.file, pixel_order=wanted.pixel_order, wide=wanted.wide)
        return {**start.to_dict(), "R": None, "t": None}
    if wanted.intrinsics is None:
        return {"file": wanted.file, "R": None, "t": None}
    camera = Camera(wanted.intrinsics, Pose(), wanted.file, wanted.focal_guessed, wanted.pixel_order)
    return {**camera_to_dict(camera), "R": None, "t": None}
