"""A lens that OpenCV's k1 k2 p1 p2 k3 cannot say, as it is: a fisheye beyond 120 degrees, a long series, a whole panorama."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..errors import CameraError
from .camera import FloatArray, Intrinsics
from .lens_models import EQUIRECTANGULAR, MODELS, LensModel, chart_of_rays, rays_of_chart
from .turned_photo import TURNS

# The steps in which a lens is followed outwards, and how far a plane's chart goes, radians from the axis.
PROFILE_STEPS, PLANE_END = 4000, math.radians(89.5)
# After a step shorter than NEWTON_END, at focal length 1, another one would change rounding errors alone.
NEWTON_STEPS, NEWTON_END, DIFFERENCE = 30, 1e-9, 1e-6
# A pixel that Newton's method brings no nearer than this, at focal length 1, is seen by no ray.
NEAR = 1e-10
PANORAMA_SLACK = 0.005
# Farther out than this times what the lens without its unsymmetric part reaches, no pixel is looked for.
BEYOND = 1.2


@dataclass(frozen=True)
class WideLens:
    """A lens of one of `lens_models.MODELS`. Lengths in pixels of a photo of `width` x `height`, pixel centres at +0.5.

    `coefficients`: (name, value) of the model's own, which others than these lack or have at 0. A panorama's focal lengths and
    centre follow from its size: longitude runs over the width, with the camera's z axis in the middle and x to the right of it,
    latitude over the height. Raises CameraError when the model is not known or a value makes no lens.
    """

    model: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    coefficients: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise CameraError(f"The lens model {self.model} is not known; use one of {', '.join(MODELS)}.")
        strange = [name for name in self.values if name not in self._model.names]
        if strange:
            raise CameraError(
                f"The lens model {self.model} has no {strange[0]}; it has {', '.join(self._model.names) or 'none'}."
            )
        if self.is_panorama and abs(self.width - 2 * self.height) > PANORAMA_SLACK * self.width:
            size = f"{self.width} x {self.height}"
            raise CameraError(f"The panorama has {size} pixels, but all around it is twice as wide as high; use it uncropped.")
        # The sizes, the focal lengths and the centre are held to what holds for every camera.
        self.pinhole()
        if not all(map(math.isfinite, self.values.values())):
            raise CameraError(f"The lens {self.model} holds a value that is not finite; give finite coefficients.")

    @classmethod
    def of(cls, model: str, pinhole: Intrinsics, values: Mapping[str, float]) -> WideLens:
        """The lens with the size, focal lengths and centre of `pinhole`, and those of `values` that its model has. Raises
        CameraError.
        """
        given = tuple((name, float(values[name])) for name in MODELS[model].names if name in values)
        k = pinhole
        return cls(model, k.width, k.height, k.fx, k.fy, k.cx, k.cy, given)

    @classmethod
    def panorama(cls, width: int, height: int) -> WideLens:
        """All around in longitude and latitude. Raises CameraError."""
        fx, fy = width / (2 * math.pi), height / math.pi
        return cls(EQUIRECTANGULAR, width, height, fx, fy, width / 2, height / 2)

    @property
    def _model(self) -> LensModel:
        return MODELS[self.model]

    @property
    def values(self) -> dict[str, float]:
        return dict(self.coefficients)

    @property
    def is_panorama(self) -> bool:
        return self.model == EQUIRECTANGULAR

    def pinhole(self) -> Intrinsics:
        """The focal lengths, centre and size alone. Raises CameraError where they make no camera."""
        return Intrinsics(self.width, self.height, self.fx, self.fy, self.cx, self.cy)

    def resized(self, width: int, height: int) -> WideLens:
        """The lens of the same photo resampled to `width` x `height`."""
        k = self.pinhole().resized(width, height)
        return replace(self, width=width, height=height, fx=k.fx, fy=k.fy, cx=k.cx, cy=k.cy)

    def turned(self, orientation: int) -> WideLens:
        """The lens of the upright photo, of one in pixels as a file with that EXIF `orientation` stores them.

        Raises CameraError where the turned photo has no lens of this model.
        """
        turn = TURNS.get(orientation, TURNS[1])
        if np.array_equal(turn, TURNS[1]):
            return self
        if self.is_panorama or any(self.values.get(name) for name in self._model.scales):
            raise CameraError(
                f"The photo is turned by its EXIF data, but its lens {self.model} is not; save the photo upright."
            )
        size = np.array([self.width, self.height], np.float64)
        width, height = np.abs(turn) @ size
        cx, cy = turn @ (np.array([self.cx, self.cy]) - size / 2) + np.array([width, height]) / 2
        fx, fy = np.abs(turn) @ (self.fx, self.fy)
        values = self.values
        for x, y in self._model.vectors:
            if x in values or y in values:
                values[x], values[y] = (float(value) for value in turn @ (values.get(x, 0.0), values.get(y, 0.0)))
        fx, fy, cx, cy = (float(value) for value in (fx, fy, cx, cy))
        return WideLens(self.model, int(width), int(height), fx, fy, cx, cy, tuple(values.items()))

    def project(self, points: ArrayLike) -> FloatArray:
        """Camera-space points (N, 3) to pixels (N, 2); NaN where the lens does not see them: behind a plane's model, or beyond
        the angle at which its series turns back inwards.
        """
        chart = chart_of_rays(self._model.chart, np.asarray(points, np.float64).reshape(-1, 3))
        if self._model.chart != "sphere":
            chart = np.where((np.hypot(*chart.T) <= self._profile[0][-1])[:, None], chart, np.nan)
        return np.asarray(self._bent(chart) * (self.fx, self.fy) + (self.cx, self.cy))

    def unproject(self, pixels: ArrayLike) -> FloatArray:
        """Pixels (N, 2) to unit directions (N, 3) in camera axes; NaN where no ray meets the pixel.

        Newton's method, from where the lens without its unsymmetric part has the pixel.
        """
        target = (np.asarray(pixels, np.float64).reshape(-1, 2) - (self.cx, self.cy)) / (self.fx, self.fy)
        if self._model.chart == "sphere":
            return rays_of_chart("sphere", target)
        radius = np.hypot(*target.T)
        chart_radii, radii = self._profile
        start = np.interp(radius, radii, chart_radii)
        chart = target * np.where(radius > 0, start / np.where(radius > 0, radius, 1), 1)[:, None]
        with np.errstate(all="ignore"):
            going = np.flatnonzero(radius <= BEYOND * radii[-1])
            for _ in range(NEWTON_STEPS):
                step = self._newton_step(chart[going], target[going])
                chart[going] -= step
                going = going[np.abs(step).max(axis=1, initial=0.0) > NEWTON_END]
                if not len(going):
                    break
            off = np.abs(self._bent(chart) - target).max(axis=1, initial=0.0)
            seen = (off <= NEAR * np.maximum(1, radius)) & (np.hypot(*chart.T) <= chart_radii[-1])
        return np.asarray(np.where(seen[:, None], rays_of_chart(self._model.chart, chart), np.nan))

    def _newton_step(self, chart: FloatArray, target: FloatArray) -> FloatArray:
        residual = self._bent(chart) - target
        columns = []
        for axis in range(2):
            ahead = np.eye(2)[axis] * DIFFERENCE
            columns.append((self._bent(chart + ahead) - self._bent(chart - ahead)) / (2 * DIFFERENCE))
        (a, c), (b, d) = (column.T for column in columns)
        det = a * d - b * c
        step = np.stack([d * residual[:, 0] - b * residual[:, 1], a * residual[:, 1] - c * residual[:, 0]], axis=1)
        return np.asarray(step / det[:, None])

    def _bent(self, chart: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            return self._model.bend(chart, self.values)

    @cached_property
    def _profile(self) -> tuple[FloatArray, FloatArray]:
        """How far from the centre the lens puts what lies so far from it in the chart: (chart radii, radii), both rising, up to
        where the lens turns back inwards.

        The even part along an axis is that of the unsymmetric coefficients, which cancels.
        """
        angles = np.linspace(0, PLANE_END if self._model.chart == "plane" else math.pi, PROFILE_STEPS)
        radii = np.tan(angles) if self._model.chart == "plane" else angles
        along = np.column_stack([radii, np.zeros_like(radii)])
        bent = (self._bent(along)[:, 0] - self._bent(-along)[:, 0]) / 2
        rises = np.diff(bent) > 0  # False for NaN
        count = 1 + int(np.argmin(rises)) if not rises.all() else len(radii)
        return radii[:count], bent[:count]
