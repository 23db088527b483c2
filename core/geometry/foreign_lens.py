"""Lenses of other models than the engine's five coefficients, said with those as well as they can be.

The engine's model (`Intrinsics`) is OpenCV's k1 k2 p1 p2 k3. Other programs have fisheye lenses and longer series. Within the
picture most of them can be said with the five coefficients to a fraction of a pixel, which is found out by a least-squares fit;
what cannot is refused with a reason. The models are those of COLMAP's documentation of camera models.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import CameraError
from .camera import FloatArray, Intrinsics

Values = Mapping[str, float]
Distort = Callable[[FloatArray, Values], FloatArray]

# A ray this far from the axis is the outermost that a pinhole's picture holds with a resolution worth matching.
WIDEST_DEG = 60.0
RADII, DIRECTIONS = 60, 48
# How far the five coefficients may be off, as a share of the picture's longer side: half a pixel of 1000.
TOLERANCE = 5e-4
# An error that nobody has to be told.
UNSAID_PX = 0.05
UNDISTORT = "undistort the photo"
EXACT = ("k1", "k2", "p1", "p2", "k3")
BROWN = "BROWN"
PANORAMAS = ("EQUIRECTANGULAR", "SPHERICAL", "ORTHOPHOTO", "CYLINDRICAL")


@dataclass(frozen=True)
class Lens:
    """`intrinsics`: None where there is no lens to use; `problem` says why, or what is not exact, as part of a sentence.

    `is_picture`: False for a panorama, which no lens took.
    """

    intrinsics: Intrinsics | None
    problem: str = ""
    is_picture: bool = True


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


def _on_angles(n: FloatArray) -> FloatArray:
    """The image point (N, 2) whose distance from the centre is the ray's angle from the axis."""
    r = np.maximum(np.linalg.norm(n, axis=1), 1e-12)
    return n * (np.arctan(r) / r)[:, None]


def _fisheye(n: FloatArray, v: Values) -> FloatArray:
    u = _on_angles(n)
    return u * _series((u * u).sum(axis=1), v, ("k1", "k2", "k3", "k4"))[:, None]


def _thin_prism(n: FloatArray, v: Values) -> FloatArray:
    u = _on_angles(n)
    r2 = (u * u).sum(axis=1)
    radial = u * _series(r2, v, ("k1", "k2", "k3", "k4"))[:, None]
    return radial + _tangential(u, v["p1"], v["p2"]) + np.outer(r2, (v["sx1"], v["sy1"]))


def _rad_tan_thin_prism(n: FloatArray, v: Values) -> FloatArray:
    u = _on_angles(n)
    u = u * _series((u * u).sum(axis=1), v, ("k0", "k1", "k2", "k3", "k4", "k5"))[:, None]
    r2 = (u * u).sum(axis=1)
    prism = np.outer(r2, (v["s0"], v["s2"])) + np.outer(r2 * r2, (v["s1"], v["s3"]))
    return u + _tangential(u, v["p1"], v["p0"]) + prism


def _fov(n: FloatArray, v: Values) -> FloatArray:
    r, omega = np.maximum(np.linalg.norm(n, axis=1), 1e-12), v["omega"]
    if abs(omega) < 1e-9:
        return n
    return n * (np.arctan(2 * r * math.tan(omega / 2)) / (omega * r))[:, None]


def _division(n: FloatArray, v: Values) -> FloatArray:
    """The inverse of d -> d / (1 + k |d|^2)."""
    r2 = (n * n).sum(axis=1)
    return n * (2 / (1 + np.sqrt(np.maximum(1 - 4 * v["k"] * r2, 0))))[:, None]


def _inverse_radial(n: FloatArray, v: Values) -> FloatArray:
    """The inverse of d -> d (1 + r |d|^2), by Newton's method on the length (VisualSFM)."""
    length = np.maximum(np.linalg.norm(n, axis=1), 1e-12)
    d = length.copy()
    for _ in range(30):
        d = d - (d * (1 + v["r"] * d * d) - length) / (1 + 3 * v["r"] * d * d)
    off = np.abs(d * (1 + v["r"] * d * d) - length)
    return n * np.where((off < 1e-9) & (d >= 0), d / length, np.nan)[:, None]


def _eucm(n: FloatArray, v: Values) -> FloatArray:
    depth = np.sqrt(v["beta"] * (n * n).sum(axis=1) + 1)
    return n / (v["alpha"] * depth + 1 - v["alpha"])[:, None]


MODELS: dict[str, Distort] = {
    BROWN: _long_brown,
    "FULL_OPENCV": _rational,
    "OPENCV_FISHEYE": _fisheye,
    "SIMPLE_RADIAL_FISHEYE": _fisheye,
    "RADIAL_FISHEYE": _fisheye,
    "SIMPLE_FISHEYE": _fisheye,
    "FISHEYE": _fisheye,
    "THIN_PRISM_FISHEYE": _thin_prism,
    "RAD_TAN_THIN_PRISM_FISHEYE": _rad_tan_thin_prism,
    "FOV": _fov,
    "SIMPLE_DIVISION": _division,
    "DIVISION": _division,
    "EUCM": _eucm,
    "INVERSE_RADIAL": _inverse_radial,
}


def lens_of(model: str, pinhole: Intrinsics, values: Values) -> Lens:
    """The lens of a `model` with the focal lengths, centre and size of `pinhole` and the model's other `values`, by name."""
    name = model.upper()
    if name in PANORAMAS:
        return Lens(None, f"{name} is no picture through a lens and is left out; cut it into pinhole pictures", False)
    if name not in MODELS:
        return Lens(None, f"the lens model {model} is not known, and the lens is left out")
    if not all(map(math.isfinite, values.values())):
        return Lens(None, f"the lens {model} holds a value that is not finite, and is left out")
    if MODELS[name] in (_long_brown, _rational) and not any(v for key, v in values.items() if key not in EXACT):
        k1, k2, p1, p2, k3 = (float(values.get(key, 0.0)) for key in EXACT)
        return _made(pinhole, (k1, k2, p1, p2, k3))
    return _fitted(name, pinhole, lambda n: MODELS[name](n, values))


def _made(k: Intrinsics, dist: tuple[float, float, float, float, float]) -> Lens:
    try:
        return Lens(Intrinsics(k.width, k.height, k.fx, k.fy, k.cx, k.cy, dist))
    except CameraError as error:
        return Lens(None, f"its lens is left out ({str(error).rstrip('.')})")


def _fitted(name: str, k: Intrinsics, distort: Callable[[FloatArray], FloatArray]) -> Lens:
    """The five coefficients, and the focal length with them, nearest to a lens within the picture. No lens where they do not
    come near it. With s the change of the focal length, the picture is linear in s and in s times the coefficients.
    """
    rays = _rays()
    with np.errstate(all="ignore"):
        bent = distort(rays)
    at = bent * (k.fx, k.fy) + (k.cx, k.cy)
    inside = np.isfinite(at).all(axis=1) & (at >= 0).all(axis=1) & (at <= (k.width, k.height)).all(axis=1)
    outermost = inside.reshape(DIRECTIONS, RADII)[:, -1]
    if outermost.any():
        return Lens(None, f"the lens {name} sees more than {2 * WIDEST_DEG:g} degrees and is left out; {UNDISTORT}")
    if inside.sum() < 2 * DIRECTIONS:
        return Lens(None, f"the lens {name} shows next to nothing within the picture, and is left out")
    n, wanted = rays[inside], bent[inside]
    x, y = n.T
    r2 = x * x + y * y
    columns_x = [x, x * r2, x * r2**2, 2 * x * y, r2 + 2 * x * x, x * r2**3]
    columns_y = [y, y * r2, y * r2**2, r2 + 2 * y * y, 2 * x * y, y * r2**3]
    matrix = np.concatenate([k.fx * np.stack(columns_x, axis=1), k.fy * np.stack(columns_y, axis=1)])
    target = np.concatenate([k.fx * wanted[:, 0], k.fy * wanted[:, 1]])
    found = np.linalg.lstsq(matrix, target, rcond=None)[0]
    off = float(np.abs(matrix @ found - target).max())
    if off > TOLERANCE * max(k.width, k.height):
        words = f"the lens {name} would be {off:.2g} pixels off with k1 k2 p1 p2 k3, and is left out; {UNDISTORT}"
        return Lens(None, words)
    scale = float(found[0])
    k1, k2, p1, p2, k3 = (float(value) / scale for value in found[1:])
    made = _made(replace(k, fx=scale * k.fx, fy=scale * k.fy), (k1, k2, p1, p2, k3))
    if made.intrinsics is None or off < UNSAID_PX:
        return made
    return replace(made, problem=f"the lens {name} is used as k1 k2 p1 p2 k3, up to {off:.2g} pixels off at the picture's edge")


def _rays() -> FloatArray:
    """Image-plane points x/z, y/z (DIRECTIONS * RADII, 2), evenly over the angles up to WIDEST_DEG."""
    radii = np.tan(np.radians(np.linspace(WIDEST_DEG / RADII, WIDEST_DEG, RADII)))
    angles = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.asarray((directions[:, None] * radii[None, :, None]).reshape(-1, 2), np.float64)
