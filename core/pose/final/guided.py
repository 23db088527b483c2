"""Matches of the last stage: corners spread over the photo, followed into renders where the nearly right pose says they are.

Once the pose is known to a pixel or two, nothing has to be searched for: the rendered depth tells where each corner must appear
in a neighbouring render, and aligning the patch there gives its place to a tenth of a pixel. Unlike detected keypoints these
corners cover the photo evenly, and no descriptor is computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...features.subpixel import SubpixelAligner, normalise_locally
from ...geometry.camera import FloatArray, Pose
from ...render.view import RenderedView, ViewRenderer
from ..search.observe import grey_of
from ..search.solve import gate
from ..shared.corners import CornerDetector
from ..shared.matches import BoolArray, ViewMatches, bearings
from ..shared.surface import depth_at, solid_part
from ..shared.working import WorkingPhoto

MAX_CORNERS = 1500
CORNER_QUALITY = 0.005
# Least distance between corners, as a share of the long side.
SPACING = 1 / 120
# Side of the patch that is aligned, as a share of the long side.
WINDOW = 1 / 38
# How far a corner may lie from its predicted place, as a share of the long side.
MOVE = 1 / 240
MIN_WINDOW_PX, MIN_MOVE_PX = 9, 1.5
BORDER_PX = 4
GATE_PX = 4.0


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of the photo: `pixels` (N, 2) in the undistorted photo, `world` (N, 3) what the splat shows there."""

    pixels: FloatArray
    world: FloatArray


@dataclass(frozen=True, eq=False)
class PosedRender:
    """A render of the splat and the pose (world-to-camera) that it was drawn at; `reference`: that is the current pose."""

    view: RenderedView
    pose: Pose
    reference: bool = False


def pick_corners(photo: WorkingPhoto, pose: Pose, view: RenderedView) -> Corners:
    """Corners where the render at `pose` is opaque and the photo may be used."""
    solid = solid_part(view)
    if photo.usable is not None:
        solid = solid & photo.usable
    side = 2 * BORDER_PX + 1
    mask = cv2.erode(solid.astype(np.uint8), np.ones((side, side), np.uint8), borderValue=0)
    detector = CornerDetector(MAX_CORNERS, CORNER_QUALITY, max(photo.raw.shape) * SPACING)
    pixels = detector.detect(photo.aligned, np.asarray(mask, np.uint8))
    depth, _ = depth_at(view, pixels)
    rays = bearings(photo.pinhole.normalise(pixels))
    return Corners(pixels, (rays * depth[:, None] - pose.t) @ pose.R)


def follow(renderer: ViewRenderer, photo: WorkingPhoto, pose: Pose, view_pose: Pose, corners: Corners) -> ViewMatches:
    """Renders the splat at `view_pose` and follows the corners there; `pose` is the photo's pose as known so far."""
    return match_corners(PosedRender(renderer.render(photo.pinhole, view_pose), view_pose), photo, pose, corners)


def match_corners(render: PosedRender, photo: WorkingPhoto, pose: Pose, corners: Corners) -> ViewMatches:
    """Matches of the corners with a render: those that align there and back, and lie where geometry allows. `pose` is the
    photo's pose as known so far.
    """
    k, long_side = photo.pinhole, max(photo.raw.shape)
    guess, inside = _predicted(photo, render.pose, corners.world)
    start, guess = corners.pixels[inside], guess[inside]
    window = max(MIN_WINDOW_PX, round(long_side * WINDOW) | 1)
    aligner = SubpixelAligner(window_px=window, max_move_px=max(MIN_MOVE_PX, long_side * MOVE))
    pixels, good = aligner.align(photo.aligned, normalise_locally(grey_of(render.view)), start, guess)
    start, pixels = start[good], pixels[good]
    depth, std = depth_at(render.view, pixels)
    matches = ViewMatches(render.pose, k.normalise(start), k.normalise(pixels), depth, std, render.reference)
    matches = matches.take(np.isfinite(depth) & (depth > 0))
    return matches.take(gate(pose, matches, k.matrix, GATE_PX))


def _predicted(photo: WorkingPhoto, view_pose: Pose, world: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Pixels (N, 2) of world points in the view at `view_pose`, and which lie inside it (N,)."""
    k = photo.pinhole
    pixels = k.project(view_pose.transform(world))  # NaN behind the camera, which compares as outside
    with np.errstate(invalid="ignore"):
        inside = (pixels > 0).all(1) & (pixels < (k.width, k.height)).all(1)
    return pixels, np.asarray(inside)
