"""Matches between the photo and one rendered view, in the form that every pose stage takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import FloatArray, Pose

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ViewMatches:
    """M matches of the photo with the view rendered at `pose` (world-to-camera).

    query, view: (M, 2) float64, ideal image-plane coordinates x/z, y/z in the photo and in the view, lens distortion undone.
    depth: (M,) float64, rendered camera-space z at the view's keypoint, scene units; NaN where the splat is not opaque.
    depth_std: (M,) float64, standard deviation of z along that pixel's ray, scene units.
    reference: True for the view at the current pose, False for a perturbed candidate.
    """

    pose: Pose
    query: FloatArray
    view: FloatArray
    depth: FloatArray
    depth_std: FloatArray
    reference: bool = False

    def __len__(self) -> int:
        return len(self.query)

    def take(self, keep: BoolArray) -> ViewMatches:
        """The matches where `keep` (M,) is True."""
        return replace(
            self, query=self.query[keep], view=self.view[keep], depth=self.depth[keep], depth_std=self.depth_std[keep]
        )


def bearings(points: FloatArray) -> FloatArray:
    """Image-plane points (N, 2) as rays (N, 3) with z = 1."""
    return np.column_stack([points, np.ones(len(points))])


def world_points(matches: ViewMatches) -> FloatArray:
    """The matches' points in the world (M, 3), lifted by the rendered depth; NaN where there is none."""
    p = bearings(matches.view) * matches.depth[:, None]
    return np.asarray((p - matches.pose.t) @ matches.pose.R)
