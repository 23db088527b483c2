"""A hypothesis looked at once more: the scan drawn there, with the photo's own lens, must match the photo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..features.frontend import Frontend
from ..pose.search.depth_pnp import ransac_pose
from ..pose.search.observe import PhotoFeatures, observe
from ..pose.shared.corners import filled_cells
from ..pose.shared.matches import world_points
from ..render.view import ViewRenderer, sole_renderer
from .hypotheses import GRID, Hypothesis

CHECK_PX = 6.0
CHECK_ROUNDS = 2000
CHECK_INLIERS = 25
CHECK_CELLS = 6
STAY_RATIO = 0.5  # of the depth; a pose that the render at the hypothesis sends farther away than that has not been confirmed


def checked(renderer: ViewRenderer, query: PhotoFeatures, hypothesis: Hypothesis, frontend: Frontend) -> Hypothesis | None:
    """The hypothesis with the pose that its own render gives, and the inliers there; None where the render does not match."""
    lens = query.image.intrinsics
    lens = replace(lens, fx=lens.fx * hypothesis.factor, fy=lens.fy * hypothesis.factor)
    photo = query.with_intrinsics(lens)
    matches = observe(sole_renderer(renderer), photo, hypothesis.pose, True, frontend).matches
    points = world_points(matches)
    known = np.isfinite(points).all(axis=1) & (matches.depth > 0)
    points, seen = points[known], matches.query[known]
    if len(points) < CHECK_INLIERS:
        return None
    pose = ransac_pose(points, seen, CHECK_PX / photo.pinhole.focal, CHECK_ROUNDS)
    if pose is None:
        return None
    p = pose.transform(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.linalg.norm(p[:, :2] / p[:, 2:] - seen, axis=1) * photo.pinhole.focal
    good = (p[:, 2] > 0) & (error < CHECK_PX)
    cells = filled_cells(lens.to_pixels(seen[good]), (lens.width, lens.height), GRID)
    moved = float(np.linalg.norm(pose.centre - hypothesis.pose.centre))
    if good.sum() < CHECK_INLIERS or cells < CHECK_CELLS or moved > STAY_RATIO * hypothesis.depth:
        return None
    return Hypothesis(pose, hypothesis.factor, int(good.sum()), cells, float(np.median(p[good, 2])))
