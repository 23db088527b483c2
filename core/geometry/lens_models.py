"""Lens models of other programs as formulas: where a ray, given in a model's own coordinates, meets the picture.

A model bends points of a plane at distance 1 ("plane": x/z, y/z), points whose distance from the centre is the ray's angle
from the axis ("angle", for fisheyes, also beyond 90 degrees), or longitude and latitude ("sphere", for panoramas). What
comes out times the focal lengths, plus the centre, is the pixel. The formulas are those of COLMAP's, OpenCV's, Metashape's
and VisualSFM's documentation of their camera models.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .camera import FloatArray

Values = Mapping[str, float]
Chart = Literal["plane", "angle", "sphere"]
Bend = Callable[[FloatArray, Values], FloatArray]

BROWN = "BROWN"
EQUIRECTANGULAR = "EQUIRECTANGULAR"
TINY = 1e-12


@dataclass(frozen=True)
class LensModel:
    """`bend` takes points (N, 2) of the chart to the picture at focal length 1. `names`: its coefficients; `vectors`: pairs of
    them that are the x and y of a vector in the picture, which turn with it; `scales`: the names of those that scale or skew
    the picture's own axes, with which it cannot be turned.
    """

    chart: Chart
    bend: Bend
    names: tuple[str, ...] = ()
    vectors: tuple[tuple[str, str], ...] = ()
    scales: tuple[str, ...] = ()


def _series(r2: FloatArray, values: Values, names: tuple[str, ...]) -> FloatArray:
    """1 + a r^2 + b r^4 + ... with the named coefficients."""
    return 1 + sum((values.get(name, 0.0) * r2 ** (i + 1) for i, name in enumerate(names)), np.zeros_like(r2))


def _tangential(n: FloatArray, p1: float, p2: float) -> FloatArray:
    x, y = n.T
    r2 = x * x + y * y
    return np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=1)


def _long_brown(n: FloatArray, v: Values) -> FloatArray:
    """Brown's series with a fourth coefficient, and b1, b2 of a sensor whose axes are scaled or skewed (Metashape)."""
    radial = n * _series((n * n).sum(axis=1), v, ("k1", "k2", "k3", "k4"))[:, None]
    out = radial + _tangential(n, v.get("p1", 0.0), v.get("p2", 0.0))
    out[:, 0] += out[:, 0] * v.get("b1", 0.0) + out[:, 1] * v.get("b2", 0.0)
    return out


def _rational(n: FloatArray, v: Values) -> FloatArray:
    r2 = (n * n).sum(axis=1)
    scale = _series(r2, v, ("k1", "k2", "k3")) / _series(r2, v, ("k4", "k5", "k6"))
    return n * scale[:, None] + _tangential(n, v.get("p1", 0.0), v.get("p2", 0.0))


def _fisheye(u: FloatArray, v: Values) -> FloatArray:
    return u * _series((u * u).sum(axis=1), v, ("k1", "k2", "k3", "k4"))[:, None]


def _thin_prism(u: FloatArray, v: Values) -> FloatArray:
    r2 = (u * u).sum(axis=1)
    return _fisheye(u, v) + _tangential(u, v.get("p1", 0.0), v.get("p2", 0.0)) + np.outer(r2, _two(v, "sx1", "sy1"))


def _rad_tan_thin_prism(u: FloatArray, v: Values) -> FloatArray:
    u = u * _series((u * u).sum(axis=1), v, ("k0", "k1", "k2", "k3", "k4", "k5"))[:, None]
    r2 = (u * u).sum(axis=1)
    prism = np.outer(r2, _two(v, "s0", "s2")) + np.outer(r2 * r2, _two(v, "s1", "s3"))
    return u + _tangential(u, v.get("p1", 0.0), v.get("p0", 0.0)) + prism


def _two(v: Values, x: str, y: str) -> tuple[float, float]:
    return v.get(x, 0.0), v.get(y, 0.0)


def _fov(u: FloatArray, v: Values) -> FloatArray:
    """Devernay and Faugeras' model: atan(2 tan(angle) tan(omega / 2)) / omega, which goes on beyond 90 degrees."""
    angle, omega = np.maximum(np.linalg.norm(u, axis=1), TINY), v.get("omega", 0.0)
    if abs(omega) < 1e-9:
        return u * np.where(angle < math.pi / 2, np.tan(angle) / angle, np.nan)[:, None]
    radius = np.arctan2(2 * np.sin(angle) * math.tan(omega / 2), np.cos(angle)) / omega
    return u * (radius / angle)[:, None]


def _division(n: FloatArray, v: Values) -> FloatArray:
    """The inverse of d -> d / (1 + k |d|^2)."""
    r2 = (n * n).sum(axis=1)
    return n * (2 / (1 + np.sqrt(np.maximum(1 - 4 * v.get("k", 0.0) * r2, 0))))[:, None]


def _inverse_radial(n: FloatArray, v: Values) -> FloatArray:
    """The inverse of d -> d (1 + r |d|^2), by Newton's method on the length (VisualSFM)."""
    length, r = np.maximum(np.linalg.norm(n, axis=1), TINY), v.get("r", 0.0)
    d = length.copy()
    for _ in range(30):
        d = d - (d * (1 + r * d * d) - length) / (1 + 3 * r * d * d)
    off = np.abs(d * (1 + r * d * d) - length)
    return n * np.where((off < 1e-9) & (d >= 0), d / length, np.nan)[:, None]


def _eucm(n: FloatArray, v: Values) -> FloatArray:
    alpha = v.get("alpha", 0.0)
    depth = np.sqrt(v.get("beta", 1.0) * (n * n).sum(axis=1) + 1)
    return n / (alpha * depth + 1 - alpha)[:, None]


def _as_it_is(c: FloatArray, v: Values) -> FloatArray:
    return c


TANGENTIAL = (("p2", "p1"),)
FOUR = ("k1", "k2", "k3", "k4")
PRISM_NAMES = ("k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3")

MODELS: dict[str, LensModel] = {
    BROWN: LensModel("plane", _long_brown, (*FOUR, "p1", "p2", "b1", "b2"), TANGENTIAL, ("b1", "b2")),
    "FULL_OPENCV": LensModel("plane", _rational, ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), TANGENTIAL),
    "OPENCV_FISHEYE": LensModel("angle", _fisheye, FOUR),
    "SIMPLE_RADIAL_FISHEYE": LensModel("angle", _fisheye, ("k1",)),
    "RADIAL_FISHEYE": LensModel("angle", _fisheye, ("k1", "k2")),
    "SIMPLE_FISHEYE": LensModel("angle", _fisheye),
    "FISHEYE": LensModel("angle", _fisheye),
    "THIN_PRISM_FISHEYE": LensModel(
        "angle", _thin_prism, ("k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"), (*TANGENTIAL, ("sx1", "sy1"))
    ),
    "RAD_TAN_THIN_PRISM_FISHEYE": LensModel(
        "angle", _rad_tan_thin_prism, PRISM_NAMES, (("p0", "p1"), ("s0", "s2"), ("s1", "s3"))
    ),
    "FOV": LensModel("angle", _fov, ("omega",)),
    "SIMPLE_DIVISION": LensModel("plane", _division, ("k",)),
    "DIVISION": LensModel("plane", _division, ("k",)),
    "EUCM": LensModel("plane", _eucm, ("alpha", "beta")),
    "INVERSE_RADIAL": LensModel("plane", _inverse_radial, ("r",)),
    EQUIRECTANGULAR: LensModel("sphere", _as_it_is),
}


def chart_of_rays(chart: Chart, rays: FloatArray) -> FloatArray:
    """Directions (N, 3) of any length in a chart (N, 2), which holds NaN for those that it does not have."""
    x, y, z = rays.T
    if chart == "sphere":
        return np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=1)
    if chart == "plane":
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(rays[:, 2:] > 0, rays[:, :2] / rays[:, 2:], np.nan))
    across = np.hypot(x, y)
    factor = np.where(across > TINY, np.arctan2(across, z) / np.maximum(across, TINY), np.where(z > 0, 1.0, np.nan))
    return np.asarray(rays[:, :2] * factor[:, None])


def rays_of_chart(chart: Chart, c: FloatArray) -> FloatArray:
    """The unit directions (N, 3) of points (N, 2) of a chart; the inverse of `chart_of_rays`."""
    x, y = c.T
    if chart == "sphere":
        return np.stack([np.sin(x) * np.cos(y), np.sin(y), np.cos(x) * np.cos(y)], axis=1)
    if chart == "plane":
        rays = np.column_stack([c, np.ones(len(c))])
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
    angle = np.hypot(x, y)
    return np.column_stack([c * np.sinc(angle / np.pi)[:, None], np.cos(angle)])
