"""Pinhole pictures that a wide lens's photo is cut into: which part of the view each shows, and with which camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..errors import CameraError
from .camera import Camera, FloatArray, Intrinsics, PixelOrder, Pose
from .lie import so3_exp
from .wide_lens import WideLens

# The widest that the cut of a lens is: beyond it, a pinhole stretches its corners more than twofold.
WIDEST_DEG = 100.0
# A face of a panorama: a quarter of the circle, and a margin by which neighbours overlap.
FACE_DEG = 100.0
# How finely the edge of the picture is looked for, and the smallest cut that shows anything to match.
EDGE_STEP_DEG, SMALLEST_DEG = 0.1, 5.0
OFF_AXIS = 1e-4
UP, RIGHT = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])  # the axes about which the camera is turned to look there


@dataclass(frozen=True, eq=False)
class PinholeCut:
    """`turn` (3, 3) takes directions of the photo's camera to those of the cut's, whose `intrinsics` it has; `name` is empty
    for the only cut of a lens.
    """

    name: str
    turn: FloatArray
    intrinsics: Intrinsics

    @property
    def degrees(self) -> float:
        """The angle that the longer side of the cut spans."""
        k = self.intrinsics
        sides = [math.atan(k.cx / k.fx) + math.atan((k.width - k.cx) / k.fx)]
        sides.append(math.atan(k.cy / k.fy) + math.atan((k.height - k.cy) / k.fy))
        return math.degrees(max(sides))

    def pose(self, photo: Pose) -> Pose:
        """The cut's pose, of the photo's."""
        return Pose(self.turn @ photo.R, self.turn @ photo.t)

    def photo_pose(self, cut: Pose) -> Pose:
        """The photo's pose, of the cut's. The inverse of `pose`."""
        return Pose(self.turn.T @ cut.R, self.turn.T @ cut.t)


def cuts_of(lens: WideLens) -> tuple[PinholeCut, ...]:
    """The cuts of a photo of that lens: six of a panorama, else one. Raises CameraError where the lens shows nothing."""
    return panorama_cuts(lens) if lens.is_panorama else (central_cut(lens),)


def central_cut(lens: WideLens) -> PinholeCut:
    """The middle of the view, around the optical axis, with the photo's own resolution there. Its pose is the photo's.

    It goes as far to each side as the photo, and no further than WIDEST_DEG in all allow. Raises CameraError when the lens does
    not show its own axis.
    """
    fx, fy = _focal_on_axis(lens)
    left, right, top, bottom = (math.tan(math.radians(_edge(lens, way))) for way in ((-1, 0), (1, 0), (0, -1), (0, 1)))
    width, height = math.floor(fx * (left + right)), math.floor(fy * (top + bottom))
    if min(left, right, top, bottom) < math.tan(math.radians(SMALLEST_DEG)):
        raise CameraError(
            f"The lens {lens.model} shows less than {SMALLEST_DEG:g} degrees beside its axis; correct its values."
        )
    return PinholeCut("", np.eye(3), Intrinsics(width, height, fx, fy, fx * left, fy * top))


def panorama_cuts(lens: WideLens) -> tuple[PinholeCut, ...]:
    """The six faces of a cube, and a margin, with the panorama's own resolution in their middle."""
    focal = lens.fx
    side = math.floor(2 * focal * math.tan(math.radians(FACE_DEG / 2)))
    intrinsics = Intrinsics(side, side, focal, focal, side / 2, side / 2)
    quarter = math.pi / 2
    turns = {
        "front": np.zeros(3),
        "right": -quarter * RIGHT,
        "back": 2 * quarter * RIGHT,
        "left": quarter * RIGHT,
        "up": -quarter * UP,
        "down": quarter * UP,
    }
    return tuple(PinholeCut(name, so3_exp(turn), intrinsics) for name, turn in turns.items())


def _focal_on_axis(lens: WideLens) -> tuple[float, float]:
    """Pixels of the photo per radian in its middle, to the right and down."""
    beside = np.array([[-OFF_AXIS, 0, 1], [OFF_AXIS, 0, 1], [0, -OFF_AXIS, 1], [0, OFF_AXIS, 1.0]])
    left, right, above, below = lens.project(beside)
    fx, fy = np.linalg.norm(right - left) / (2 * OFF_AXIS), np.linalg.norm(below - above) / (2 * OFF_AXIS)
    if not (np.isfinite([fx, fy]).all() and min(fx, fy) > 0):
        raise CameraError(f"The lens {lens.model} does not show its own axis; correct its values.")
    return float(fx), float(fy)


def _edge(lens: WideLens, way: tuple[int, int]) -> float:
    """How many degrees from the axis the photo shows, in a direction of the cut."""
    degrees = np.arange(0, WIDEST_DEG / 2 + EDGE_STEP_DEG / 2, EDGE_STEP_DEG)
    across = np.tan(np.radians(degrees))
    at = lens.project(np.column_stack([across * way[0], across * way[1], np.ones_like(across)]))
    with np.errstate(invalid="ignore"):
        inside = ((at >= 0) & (at <= (lens.width, lens.height))).all(axis=1)
    return float(degrees[np.argmin(inside) - 1]) if not inside.all() else float(degrees[-1])


@dataclass(frozen=True)
class WideCamera(Camera):
    """A posed camera whose photo was taken through `lens`; `intrinsics` are those of its first cut, the only one or the front.

    `pixel_order` is that of `lens`. To be made with `of`.
    """

    lens: WideLens = field(kw_only=True)

    @classmethod
    def of(cls, lens: WideLens, pose: Pose, file: str = "", pixel_order: PixelOrder = "upright") -> WideCamera:
        """Raises CameraError where the lens shows nothing."""
        return cls(cuts_of(lens)[0].intrinsics, pose, file, pixel_order=pixel_order, lens=lens)
