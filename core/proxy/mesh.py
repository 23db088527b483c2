"""A proxy as a mesh, and the colours that its vertices get from the views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera, FloatArray
from .space import Float32Array
from .views import DepthView

IntArray = NDArray[np.int64]

SAME = 0.02  # of the depth: a vertex so near to what a view shows is seen by it
GREY = 0.5  # of a vertex that no view shows
FAR_UV = 10.0  # pictures: farther outside a picture a place has no use


@dataclass(frozen=True, eq=False)
class ProxyMesh:
    """vertices (V, 3) in the coordinates of the splat's file; faces (F, 3), counter-clockwise as the cameras see them; colors
    (V, 3) RGB 0..1, display-encoded as the scan's.
    """

    vertices: FloatArray
    faces: IntArray
    colors: Float32Array

    def uv(self, camera: Camera) -> Float32Array:
        """Where the vertices lie in the photo of a camera (V, 2), its lens distortion included: (0, 0) is the photo's lower
        left corner, (1, 1) its upper right one. NaN for vertices behind the camera.
        """
        k = camera.intrinsics
        pixels = k.project(camera.pose.transform(self.vertices))
        uv = np.stack([pixels[:, 0] / k.width, 1 - pixels[:, 1] / k.height], axis=1)
        return np.asarray(np.clip(uv, -FAR_UV, FAR_UV), np.float32)


def coloured(vertices: FloatArray, views: Sequence[DepthView]) -> Float32Array:
    """Colours (V, 3) of vertices (V, 3): the mean of what the views that see one show there, weighted as depth is."""
    total, weights = np.zeros((len(vertices), 3)), np.zeros(len(vertices))
    for view in views:
        k, local = view.camera.intrinsics, view.camera.pose.transform(vertices)
        pixels = k.project(local)
        with np.errstate(invalid="ignore"):
            index = np.flatnonzero(((pixels >= 0) & (pixels < (k.width, k.height))).all(axis=1))
        column, row = pixels[index].astype(np.intp).T
        z = local[index, 2]
        seen = np.abs(view.depth[row, column] - z) < SAME * z
        # Where every view's own depth is another one, the nearest guess still beats grey.
        weight = view.weight[row, column] * np.where(seen, 1, 1e-6) + 1e-30
        total[index] += weight[:, None] * view.color[row, column]
        weights[index] += weight
    with np.errstate(invalid="ignore"):
        return np.where(weights[:, None] > 0, total / weights[:, None], GREY).astype(np.float32)
