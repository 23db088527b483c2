"""The focal length over a shot: one, or a smooth curve over the frames, for a lens that zooms or breathes with its focus.

Frame t has the shot's lens with the focal length f exp(z(t)), where z is a cubic spline. Its knots lie so many frames apart as
the kind of curve says: what moves faster than that is the noise of single frames. The principal point in pixels and the
distortion stay those of the shot's lens.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..geometry.camera import FloatArray, Intrinsics

FocalKind = Literal["fixed", "breathing", "zoom"]
DEGREE = 3


@dataclass(frozen=True)
class FocalChange:
    """How a focal length may change. knot_frames: frames from knot to knot; step_std: deviation of its logarithm at a frame
    from where the frames before lead to expect it; bend_std: of the second difference of the spline's coefficients.
    """

    knot_frames: float
    step_std: float
    bend_std: float


# A zoom starts and stops within some frames, and what knots too far apart miss of that would stand in the cameras; a lens that
# is focused changes its picture by some per cent in all, over a second or so.
CHANGES: dict[FocalKind, FocalChange | None] = {
    "fixed": None,
    "breathing": FocalChange(8.0, 0.005, 0.005),
    "zoom": FocalChange(3.0, 0.02, 0.02),
}


def grown(lens: Intrinsics, grow: float) -> Intrinsics:
    """The lens with its focal length times exp(grow)."""
    return lens if grow == 0 else replace(lens, fx=lens.fx * float(np.exp(grow)), fy=lens.fy * float(np.exp(grow)))


@dataclass(frozen=True, eq=False)
class FocalCurve:
    """The spline over the frames `first` to `last`: `coefficients` (J,) of its basis with `knots`, and their `covariance`
    (J, J).
    """

    knots: FloatArray
    coefficients: FloatArray
    covariance: FloatArray

    @classmethod
    def flat(cls, first: int, last: int, change: FocalChange) -> FocalCurve:
        """The curve that is 0 everywhere, with its knots as far apart as `change` says."""
        spans = max(1, round((last - first) / change.knot_frames))
        inner = np.linspace(first, max(last, first + 1), spans + 1)
        knots = np.concatenate([np.repeat(inner[0], DEGREE), inner, np.repeat(inner[-1], DEGREE)])
        count = spans + DEGREE
        return cls(knots, np.zeros(count), np.zeros((count, count)))

    def basis(self, frame: float) -> FloatArray:
        """What each coefficient counts at a frame (J,); outside of the shot that at its end."""
        from scipy.interpolate import BSpline

        inside = float(np.clip(frame, self.knots[0], self.knots[-1]))
        return np.asarray(BSpline.design_matrix([inside], self.knots, DEGREE).toarray()[0])

    def at(self, frame: float) -> float:
        """The logarithm of the focal length over that of the shot's lens."""
        return float(self.basis(frame) @ self.coefficients)

    def std(self, frame: float) -> float:
        """The deviation of that."""
        w = self.basis(frame)
        return math.sqrt(max(float(w @ self.covariance @ w), 0.0))

    def bends(self) -> FloatArray:
        """The second differences of the coefficients, as a matrix (J - 2, J) that is applied to them."""
        return np.asarray(np.diff(np.eye(len(self.coefficients)), 2, axis=0))


def focal_words(focals_mm: Sequence[float]) -> str:
    """A sentence on the range of focal lengths in 35 mm terms."""
    return f"Focal length from {min(focals_mm):.1f} to {max(focals_mm):.1f} mm (35 mm equivalent) over the shot."
