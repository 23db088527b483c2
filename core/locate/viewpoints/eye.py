"""Small renders of the scan, the features in them, and where those lie in the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...features.extractors.sift import RootSift
from ...features.types import Extractor, Features
from ...geometry.camera import FloatArray, Intrinsics, Pose
from ...pose.search.observe import grey_of
from ...pose.shared.surface import MIN_ALPHA
from ...render.renderer import Renderer
from ...render.tables import SceneTables
from ...render.view import RenderSettings
from ...splats.scene import GaussianScene

FIELD_DEG = 65.0
NEAR_RATIO = 0.2  # of the depth: floaters beside the camera would stand before everything
MAX_DEVIATION = 0.15  # of a pixel's depth, as a share of it; beyond, its features lie at no one place
MAX_FEATURES, CONTRAST = 1200, 0.005  # corners of a render are clean, however faint; photos' own are noise below twice that


@dataclass(frozen=True, eq=False)
class RenderedFeatures:
    """A render's features and what surrounds them. `points` (N, 3) world; `depth`: median depth of the solid pixels, scene
    units; `solid`: share of them, 0..1; `near`: the near plane, scene units.
    """

    pose: Pose
    features: Features
    points: FloatArray
    depth: float
    solid: float
    near: float


class Eye:
    """Draws square views of one scene and lifts their features. Holds the scene's tables once; safe in one thread at a time."""

    def __init__(self, scene: GaussianScene | SceneTables, threads: int = 1, extractor: Extractor | None = None) -> None:
        self._renderer = Renderer(scene, RenderSettings(threads=threads))
        self._extractor = extractor or RootSift(MAX_FEATURES, CONTRAST)

    def look(self, pose: Pose, camera: Intrinsics, depth: float) -> RenderedFeatures:
        """The view of the pinhole `camera` at `pose`; `depth` (scene units) says about how far away things are there."""
        near = NEAR_RATIO * depth
        # One renderer for all near planes: it keeps the room that a view of so many Gaussians takes.
        self._renderer.settings = RenderSettings(near, self._renderer.settings.threads)
        view = self._renderer.render(camera, pose)
        solid = view.alpha >= MIN_ALPHA
        features = self._extractor.extract(grey_of(view), np.asarray(solid))
        column, row = np.clip(features.keypoints.astype(np.intp), 0, (camera.width - 1, camera.height - 1)).T
        z = view.depth[row, column].astype(np.float64)
        steady = view.depth_variance[row, column] < (MAX_DEVIATION * z) ** 2
        keep: NDArray[np.bool_] = np.asarray(steady & (z > 0))
        found = features.take(keep)
        median = float(np.median(view.depth[solid])) if solid.any() else depth
        return RenderedFeatures(pose, found, lifted(found.keypoints, z[keep], camera, pose), median, float(solid.mean()), near)


def square_camera(side_px: int) -> Intrinsics:
    """A pinhole of FIELD_DEG across each side."""
    focal = side_px / 2 / np.tan(np.radians(FIELD_DEG / 2))
    return Intrinsics(side_px, side_px, focal, focal, side_px / 2, side_px / 2)


def lifted(pixels: FloatArray, depth: FloatArray, camera: Intrinsics, pose: Pose) -> FloatArray:
    """World points (N, 3) of `pixels` (N, 2) of a view at their `depth` (N,)."""
    rays = np.column_stack([camera.normalise(pixels), np.ones(len(pixels))])
    return np.asarray((rays * depth[:, None] - pose.t) @ pose.R)


def facing(direction: FloatArray, roll: float = 0.0) -> FloatArray:
    """A world-to-camera rotation (3, 3) that looks along `direction` (3,); the roll about it is arbitrary but continuous."""
    z = direction / np.linalg.norm(direction)
    aside = np.zeros(3)
    aside[np.abs(z).argmin()] = 1.0
    x = np.cross(aside, z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    c, s = np.cos(roll), np.sin(roll)
    return np.stack([c * x + s * y, c * y - s * x, z])
