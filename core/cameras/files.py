"""Camera JSON: one camera, or a list under "frames".

A camera is {"file", "width", "height", "fx", "fy", "cx", "cy", "dist": [k1, k2, p1, p2(, k3)], "R": 3x3, "t": [3]};
world-to-camera, OpenCV axes, pixel centres at +0.5. "file" and "dist" may be left out; "focal_guessed": true says that the
focal length is no calibration, and so does the "lens" of a result for which it was solved. A start may leave out its whole
lens (see `StartCamera`): the photo then gives one. "orientation": "stored" says that the camera belongs to the photo's pixels
before EXIF turns them; "upright", which is also what a file without it means, that it belongs to them afterwards.
"camera_model" with "coefficients" in place of "dist" is a lens as `geometry.wide_record` has it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args

import numpy as np

from ..errors import CameraError
from ..geometry import wide_record
from ..geometry.camera import Camera, Intrinsics, PixelOrder, Pose
from ..geometry.pinhole_cut import WideCamera
from ..geometry.turned_photo import is_quarter_turn, upright_pose
from ..geometry.wide_lens import WideLens
from ..support.atomic import atomic_write
from .types import LensOfSize, lens_of_file

T = TypeVar("T")
SHAPES = {(): "a number", (3,): "3 numbers", (3, 3): "3 rows of 3 numbers", (-1,): "a list of numbers"}
LARGEST = 1 << 53  # of the whole numbers that a float64 holds exactly
NUMBERS = ("width", "height", "fx", "fy", "cx", "cy")
ORDER = "orientation"


@dataclass(frozen=True)
class StartCamera:
    """A rough camera as its file gives it: `intrinsics` is None where the file tells a pose and no lens; `lens_of_size` is the
    lens that it tells for want of the photo's size; `wide` one that intrinsics cannot hold. `pixel_order` as in Camera.
    `verdict`: what its file says of how it was found, "" where it says nothing.
    """

    pose: Pose
    file: str = ""
    intrinsics: Intrinsics | None = None
    focal_guessed: bool = False
    pixel_order: PixelOrder = "upright"
    lens_of_size: LensOfSize | None = None
    wide: WideLens | None = None
    verdict: str = ""

    @property
    def tells_no_lens(self) -> bool:
        return self.intrinsics is None and self.lens_of_size is None and self.wide is None

    def camera(self, guess: Intrinsics, orientation: int = 1) -> Camera:
        """The camera; `guess` takes the place of a lens that the file does not tell. It belongs to the upright photo; the
        photo's EXIF `orientation` then turns a pose of the stored pixels. Raises CameraError where the lens is none.
        """
        if self.wide is not None:
            return WideCamera.of(self.wide, self.pose, self.file, self.pixel_order)
        if self.intrinsics is None and self.lens_of_size is not None:
            turned = self.pixel_order == "stored" and is_quarter_turn(orientation)
            size = (guess.height, guess.width) if turned else (guess.width, guess.height)
            lens = self.lens_of_size(*size)
            if isinstance(lens, WideLens):
                return WideCamera.of(lens, self.pose, self.file, self.pixel_order)
            return Camera(lens, self.pose, self.file, self.focal_guessed, self.pixel_order)
        if self.intrinsics is None:
            pose = upright_pose(self.pose, orientation) if self.pixel_order == "stored" else self.pose
            return Camera(guess, pose, self.file, focal_guessed=True)
        return Camera(self.intrinsics, self.pose, self.file, self.focal_guessed, self.pixel_order)

    def known_camera(self) -> Camera:
        """The camera where the file tells its lens with its size. Raises CameraError where it does not."""
        if self.intrinsics is not None:
            return self.camera(self.intrinsics)
        if self.wide is None:
            raise CameraError("The camera has no lens of a known size; give width, height, fx and fy.")
        return WideCamera.of(self.wide, self.pose, self.file, self.pixel_order)

    def to_dict(self) -> dict[str, Any]:
        """The start as JSON holds it, without the keys of a lens where it has none."""
        if self.intrinsics is not None:
            return camera_to_dict(self.camera(self.intrinsics))
        pose = {"R": self.pose.R.tolist(), "t": self.pose.t.tolist()}
        if self.wide is not None:
            return {"file": self.file, **wide_record.to_dict(self.wide), **order_to_dict(self.pixel_order), **pose}
        return {"file": self.file, **order_to_dict(self.pixel_order), **pose}


def read_cameras(path: str | Path) -> list[Camera]:
    """All cameras of a file, in its order. Raises CameraError with one sentence that names the camera and the key."""
    return parse_file(Path(path), camera_from_dict)


def read_starts(path: str | Path) -> list[StartCamera]:
    """As `read_cameras`, of cameras that may lack their lens."""
    return parse_file(Path(path), start_from_dict)


def parse_file(path: Path, parse: Callable[[Any, str], T]) -> list[T]:
    """What `parse` makes of each record of a file and the words that name it, in the file's order. Raises CameraError."""
    data = load_json(path)
    if isinstance(data, dict) and "frames" not in data:
        return [parse(data, f"The camera in '{path.name}'")]
    frames = data["frames"] if isinstance(data, dict) else data
    if not isinstance(frames, list) or not frames:
        raise CameraError(f"'{path.name}' has no list of cameras under \"frames\"; give at least one camera there.")
    return [parse(frame, f"Camera {i + 1} of '{path.name}'") for i, frame in enumerate(frames)]


def load_json(path: Path, what: str = "camera file") -> Any:
    """The content of a JSON file, which `what` names. Raises CameraError when it is missing or no JSON."""
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise CameraError(f"There is no {what} at '{path}'; check the path.") from None
    except OSError as error:
        raise CameraError(f"The {what} '{path}' cannot be read ({error.strerror}); check the path.") from error
    except (ValueError, RecursionError) as error:  # no JSON, no UTF-8, or a number of thousands of digits
        where = f" (line {error.lineno}: {error.msg})" if isinstance(error, json.JSONDecodeError) else ""
        raise CameraError(f"The {what} '{path.name}' is no valid JSON{where}; correct it or export it again.") from None


def write_cameras(path: str | Path, cameras: list[Camera]) -> None:
    """Write cameras under "frames", or a single one as it is; the file appears whole or not at all."""
    dicts = [camera_to_dict(camera) for camera in cameras]
    with atomic_write(path) as file:
        json.dump(dicts[0] if len(dicts) == 1 else {"frames": dicts}, file, indent=1)


def camera_to_dict(camera: Camera) -> dict[str, Any]:
    """The camera as JSON holds it; `dist` has k1 k2 p1 p2, and k3 where it is not zero; "focal_guessed" stands where true, and
    "orientation" where the camera is not of the upright photo.
    """
    if isinstance(camera, WideCamera):
        start = StartCamera(camera.pose, camera.file, pixel_order=camera.pixel_order, wide=camera.lens)
        return {**start.to_dict(), **_cut(camera)}
    k = camera.intrinsics
    numbers = {name: getattr(k, name) for name in NUMBERS}
    dist = list(k.dist if k.dist[4] else k.dist[:4])
    guessed = {"focal_guessed": True} if camera.focal_guessed else {}
    pose = {"R": camera.pose.R.tolist(), "t": camera.pose.t.tolist()}
    return {"file": camera.file, **numbers, "dist": dist, **guessed, **order_to_dict(camera.pixel_order), **pose}


def _cut(camera: WideCamera) -> dict[str, Any]:
    """The pinhole that shows the photo's middle, with the same pose, for programs that have no such lens."""
    if camera.lens.is_panorama:
        return {}
    return {"cut": {name: getattr(camera.intrinsics, name) for name in NUMBERS}}


def order_to_dict(order: PixelOrder) -> dict[str, str]:
    """The key that says so, where the camera belongs to the stored pixels."""
    return {} if order == "upright" else {ORDER: order}


def camera_from_dict(data: Any, name: str = "The camera") -> Camera:
    """The camera in a JSON object; `name` begins the sentence of a CameraError."""
    start = start_from_dict(data, name)
    if start.wide is None:
        _check_keys(data, (*NUMBERS, "R", "t"), name)
    return start.camera(start.intrinsics or _lens(data, name))


def start_from_dict(data: Any, name: str = "The camera") -> StartCamera:
    """The start in a JSON object: a camera, or a pose without any of the lens's keys. Raises CameraError."""
    wide = _wide(data, name)
    whole = wide is None and isinstance(data, dict) and any(key in data for key in (*NUMBERS, "dist"))
    _check_keys(data, (*(NUMBERS if whole else ()), "R", "t"), name)
    lens = _lens(data, name) if whole else None
    order = _pixel_order(data, name)
    R, t = _numbers(data["R"], (3, 3), name, "R"), _numbers(data["t"], (3,), name, "t")
    file, guessed = data.get("file", ""), data.get("focal_guessed", False)
    if not isinstance(file, str):
        raise CameraError(f'{name} has the entry "file", which is not text; give the photo\'s path.')
    if not isinstance(guessed, bool):
        raise CameraError(f'{name} has the entry "focal_guessed", which is neither true nor false; correct it.')
    try:
        guessed = wide is None and (guessed or lens is None or solved_lens(data))
        return StartCamera(Pose(R, t), file, lens, guessed, order, wide=wide, verdict=str(data.get("verdict", "")))
    except CameraError as error:
        raise CameraError(f"{name} cannot be used: {error}") from None


def solved_lens(data: dict[str, Any]) -> bool:
    """Whether the lens of a result was solved for, as its "lens" says: such a lens is no calibration. Older results name there
    what was solved for.
    """
    said = data.get("lens")
    if isinstance(said, dict):
        return any(isinstance(number, dict) and number.get("state") in ("solved", "shared") for number in said.values())
    return said in ("focal", "radial", "full")


def _check_keys(data: Any, keys: tuple[str, ...], name: str) -> None:
    if not isinstance(data, dict):
        raise CameraError(f"{name} is not a JSON object; give one with width, height, fx, fy, cx, cy, R and t.")
    missing = [key for key in keys if key not in data]
    if missing:
        raise CameraError(f"{name} lacks {', '.join(missing)}; a pose is R and t, a lens width, height, fx, fy, cx and cy.")


def _pixel_order(data: dict[str, Any], name: str) -> PixelOrder:
    order: PixelOrder = data.get(ORDER, "upright")
    if order not in get_args(PixelOrder):
        raise CameraError(f'{name} has an {ORDER} that is neither "upright" nor "stored"; correct it.')
    return order


def _lens(data: dict[str, Any], name: str) -> Intrinsics:
    numbers = {key: _number(data[key], name, key) for key in NUMBERS}
    for key in ("width", "height"):
        if not numbers[key].is_integer():
            raise CameraError(f'{name} has the entry "{key}" of {numbers[key]:g} pixels; give a whole number.')
    dist = np.atleast_1d(_numbers(data.get("dist") or [], (-1,), name, "dist"))
    fx, fy, cx, cy = (numbers[key] for key in ("fx", "fy", "cx", "cy"))
    distortion: Any = tuple(dist.tolist())  # Intrinsics pads four values to five, and refuses more
    try:
        return lens_of_file(Intrinsics(int(numbers["width"]), int(numbers["height"]), fx, fy, cx, cy, distortion))
    except CameraError as error:
        raise CameraError(f"{name} cannot be used: {error}") from None


def _wide(data: Any, name: str) -> WideLens | None:
    wide = wide_record.from_dict(data, name)
    if wide is not None:
        try:
            lens_of_file(wide.pinhole())
        except CameraError as error:
            raise CameraError(f"{name} cannot be used: {error}") from None
    return wide


def _number(value: Any, name: str, key: str) -> float:
    """`value` as a number; of a file with thousands of cameras most are plain ones. Raises CameraError."""
    plain = (type(value) is float and math.isfinite(value)) or (type(value) is int and abs(value) < LARGEST)
    return float(value if plain else _numbers(value, (), name, key))


def _numbers(value: Any, shape: tuple[int, ...], name: str, key: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """`value` as a float64 array of `shape` (-1 = any length); CameraError when it is anything else."""
    try:
        array = np.array(value)
        good = array.dtype.kind in "if" or not array.size
        fits = array.ndim == 1 if shape == (-1,) else array.shape == shape
        good = good and fits and bool(np.isfinite(array).all())
    except ValueError:  # rows of different lengths
        good = False
    if not good:
        raise CameraError(f'{name} has the entry "{key}", which is not {SHAPES[shape]}; correct it.')
    return array.astype(np.float64, copy=False)
