"""Where on the scan a click lands: on the surface that the scan shows there, not on the Gaussian whose centre is nearest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import RefineError
from ...geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ...geometry.conventions import pixel_centres
from ...render.view import RenderedView, ViewRenderer, sole_renderer
from ..shared.surface import MIN_ALPHA, depth_at
from .pin import Pin, ViewPin

# A window of this many pixels is rendered around each click.
WINDOW = 15
# Where the depth under the click is this uncertain (share of the depth), it lies on an edge, or in fog: the clearest surface
# within SNAP_PX counts, of two that are equally clear the nearer one.
CLEAR_RATIO = 0.02
SNAP_PX = 3.0


def surface_point(renderer: ViewRenderer, lens: Intrinsics, pose: Pose, pixel: tuple[float, float]) -> FloatArray | None:
    """The point (3,) of the scan, in its coordinates, that is seen at `pixel` of the pinhole view `lens` from `pose`; None
    where nothing of the scan is seen there. Only a small window of the view is rendered.
    """
    left, top = (int(np.floor(value)) - WINDOW // 2 for value in pixel)
    window = replace(lens.pinhole(), width=WINDOW, height=WINDOW, cx=lens.cx - left, cy=lens.cy - top)
    view = sole_renderer(renderer).render(window, pose)
    depth = depth_of_surface(view, (pixel[0] - left, pixel[1] - top))
    if depth is None:
        return None
    x, y = lens.pinhole().normalise(np.array([pixel]))[0]
    return np.asarray((np.array([x, y, 1.0]) * depth - pose.t) @ pose.R)


def depth_of_surface(view: RenderedView, pixel: tuple[float, float]) -> float | None:
    """The depth, camera-space z, of the surface at `pixel` of a render; None where it shows nothing within SNAP_PX."""
    height, width = view.alpha.shape
    x, y = np.meshgrid(pixel_centres(width) - pixel[0], pixel_centres(height) - pixel[1])
    away = np.hypot(x, y)
    solid = (view.alpha >= MIN_ALPHA) & (away <= SNAP_PX)
    if not solid.any():
        return None
    # Left out pixels are infinitely far, so that argmin never takes one.
    here = np.unravel_index(np.argmin(np.where(solid, away, np.inf)), away.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        unclear = np.sqrt(np.maximum(view.depth_variance, 0)) / view.depth
    if unclear[here] <= CLEAR_RATIO:
        between = float(depth_at(view, np.array([pixel]))[0][0])
        return between if np.isfinite(between) else float(view.depth[here])
    clear = solid & (unclear <= max(CLEAR_RATIO, float(unclear[solid].min())))
    return float(view.depth[np.unravel_index(np.argmin(np.where(clear, view.depth, np.inf)), away.shape)])


def lifted_pins(renderer: ViewRenderer, camera: Camera | None, pins: Sequence[Pin | ViewPin]) -> list[Pin]:
    """The pins, those that are told by a pixel of a view with the point that the scan shows there through `camera`.

    Raises RefineError where there is no camera to look through, or where the scan shows nothing.
    """
    out = []
    for number, pin in enumerate(pins, 1):
        if isinstance(pin, Pin):
            out.append(pin)
            continue
        if camera is None:
            raise RefineError(
                f'Pin {number} is told by a pixel of a view, but there is no camera of that view; give "world" instead.'
            )
        point = surface_point(renderer, camera.intrinsics, camera.pose, pin.view)
        if point is None:
            raise RefineError(f"The scan shows nothing where pin {number} lies in the view; set it on the scan.")
        x, y, z = (float(value) for value in point)
        out.append(Pin(pin.photo, (x, y, z), pin.weight))
    return out
