"""Lenses of other models than the engine's five coefficients, said with those where they come near, else kept as they are.

The engine's model (`Intrinsics`) is OpenCV's k1 k2 p1 p2 k3. Other programs have fisheye lenses and longer series. Within the
picture most of them can be said with the five coefficients to a fraction of a pixel, which is found out by a least-squares fit;
what cannot is a `WideLens`, through which a photo is cut into pinhole pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..errors import CameraError
from .camera import FloatArray, Intrinsics
from .lens_models import BROWN, EQUIRECTANGULAR, LensModel, Values, chart_of_rays
from .lens_models import MODELS as LENS_MODELS
from .wide_lens import WideLens

__all__ = ["BROWN", "MODELS", "PANORAMAS", "Lens", "lens_of"]

Distort = Callable[[FloatArray, Values], FloatArray]

# A ray this far from the axis is the outermost that a pinhole's picture holds with a resolution worth matching.
WIDEST_DEG = 60.0
RADII, DIRECTIONS = 60, 48
# How far the five coefficients may be off, as a share of the picture's longer side: half a pixel of 1000.
TOLERANCE = 5e-4
# An error that nobody has to be told.
UNSAID_PX = 0.05
CUT = "its photo is matched through pinhole cuts of it"
EXACT = ("k1", "k2", "p1", "p2", "k3")
ALL_AROUND = (EQUIRECTANGULAR, "SPHERICAL")
UNSEEN = ("ORTHOPHOTO", "CYLINDRICAL")
PANORAMAS = (*ALL_AROUND, *UNSEEN)


@dataclass(frozen=True)
class Lens:
    """`intrinsics`: None where the five coefficients say none; `wide` is the lens then, where there is one that is known.
    `problem` says why, or what is not exact, as part of a sentence.

    `is_picture`: False for a picture that is not seen from one point.
    """

    intrinsics: Intrinsics | None
    problem: str = ""
    is_picture: bool = True
    wide: WideLens | None = None


def _in_front(model: LensModel, n: FloatArray, values: Values) -> FloatArray:
    """Image-plane points x/z, y/z (N, 2) as the lens bends them."""
    rays = np.column_stack([n, np.ones(len(n))])
    return model.bend(chart_of_rays(model.chart, rays), values)


MODELS: dict[str, Distort] = {name: partial(_in_front, model) for name, model in LENS_MODELS.items() if model.chart != "sphere"}


def lens_of(model: str, pinhole: Intrinsics, values: Values) -> Lens:
    """The lens of a `model` with the focal lengths, centre and size of `pinhole` and the model's other `values`, by name."""
    name = model.upper()
    if name in UNSEEN:
        return Lens(None, f"{name} is no picture that is seen from one point, and is left out", False)
    if name in ALL_AROUND:
        return _panorama(pinhole)
    if name not in MODELS:
        return Lens(None, f"the lens model {model} is not known, and the lens is left out")
    if not all(map(math.isfinite, values.values())):
        return Lens(None, f"the lens {model} holds a value that is not finite, and is left out")
    if name in (BROWN, "FULL_OPENCV") and not any(v for key, v in values.items() if key not in EXACT):
        k1, k2, p1, p2, k3 = (float(values.get(key, 0.0)) for key in EXACT)
        return _made(pinhole, (k1, k2, p1, p2, k3))
    return _fitted(WideLens.of(name, pinhole, values))


def _panorama(k: Intrinsics) -> Lens:
    try:
        return Lens(None, f"{EQUIRECTANGULAR} is no picture through a lens: {CUT}", wide=WideLens.panorama(k.width, k.height))
    except CameraError as error:
        return Lens(None, f"it is left out ({str(error).rstrip('.')})", False)


def _made(k: Intrinsics, dist: tuple[float, float, float, float, float]) -> Lens:
    try:
        return Lens(Intrinsics(k.width, k.height, k.fx, k.fy, k.cx, k.cy, dist))
    except CameraError as error:
        return Lens(None, f"its lens is left out ({str(error).rstrip('.')})")


def _fitted(lens: WideLens) -> Lens:
    """The five coefficients, and the focal length with them, nearest to a lens within the picture; the lens as it is where they
    do not come near it. With s the change of the focal length, the picture is linear in s and in s times the coefficients.
    """
    rays, k, name = _rays(), lens.pinhole(), lens.model
    with np.errstate(all="ignore"):
        bent = MODELS[name](rays, lens.values)
    at = bent * (k.fx, k.fy) + (k.cx, k.cy)
    inside = np.isfinite(at).all(axis=1) & (at >= 0).all(axis=1) & (at <= (k.width, k.height)).all(axis=1)
    outermost = inside.reshape(DIRECTIONS, RADII)[:, -1]
    if outermost.any():
        return Lens(None, f"the lens {name} sees more than {2 * WIDEST_DEG:g} degrees: {CUT}", wide=lens)
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
        return Lens(None, f"the lens {name} would be {off:.2g} pixels off with k1 k2 p1 p2 k3: {CUT}", wide=lens)
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
