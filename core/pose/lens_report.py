"""What a refinement says of the lens: of each number whether it was given, solved or held, its value, and how sure it is."""

from __future__ import annotations

from ..geometry.camera import FloatArray, Intrinsics
from .final.solution import FittedCamera
from .report import LENS_NUMBERS, LensNumber, LensState


def lens_numbers(solution: FittedCamera, photo: Intrinsics) -> tuple[LensNumber, ...]:
    """The numbers of a solution's lens in the units of the photo at its full size, whose intrinsics were `photo`."""
    k = solution.camera.intrinsics.resized(photo.width, photo.height) if solution.solved else photo
    held: LensState = "given" if solution.prior.calibrated else "held"
    values = (k.focal, k.cx, k.cy, *k.dist, k.fx / k.fy)
    std = _photo_units(solution.lens_std, k)
    states: list[LensState] = ["solved" if i in solution.solved else held for i in range(len(values))]
    return tuple(
        LensNumber(name, state, float(value), float(s))
        for name, state, value, s in zip(LENS_NUMBERS, states, values, std, strict=True)
    )


def _photo_units(std: FloatArray, k: Intrinsics) -> FloatArray:
    """Deviations (9,) of `lens.NAMES` as those of the numbers themselves: focal length and principal point in pixels."""
    out = std.copy()
    out[:3] *= k.focal
    out[8] *= k.fx / k.fy
    return out
