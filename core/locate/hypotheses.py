"""Poses of the photo from its matches with the map: each seed view solved by itself, then grown over the matches of all views.

Pooling the views before sampling drowns the few right matches of a hard photo in wrong ones of views that show other places.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.camera import FloatArray, Pose, rotation_angle_deg
from ..pose.search.depth_pnp import ScaledPose, polish, ransac_pose
from ..pose.search.observe import PhotoFeatures
from ..pose.shared.corners import filled_cells
from .matching import Pairs

GRID = 6  # cells along each side of the photo, as in the verdict's coverage
SAMPLE_PX = 10.0
GROW_PX = 15.0
COUNT_PX = 10.0
ROUNDS = 1000
COARSE_ROUNDS = 500
COARSE_FACTORS = tuple(np.geomspace(0.6, 1.7, 5))
FINE_FACTORS = tuple(np.geomspace(0.8, 1.25, 5))
MIN_PAIRS = 6
MIN_INLIERS = 8
ENOUGH_INLIERS, ENOUGH_CELLS = 80, 12  # a hypothesis that ends the search
CELL_WORTH = 12  # inliers that one cell of the photo may count for, so that a cluster does not pass for a photo
SAME_RATIO, SAME_DEG = 0.15, 10.0  # of the depth, degrees: two hypotheses that are one


@dataclass(frozen=True)
class Hypothesis:
    """A pose of the photo. `factor`: its focal length as a multiple of the given one; `inliers`: distinct features of the photo
    that land within COUNT_PX of a landmark of theirs; `cells`: how many of the photo's 6 x 6 cells hold one; `depth`: median
    depth of those landmarks, scene units.
    """

    pose: Pose
    factor: float
    inliers: int
    cells: int
    depth: float

    @property
    def score(self) -> int:
        return min(self.inliers, CELL_WORTH * self.cells)

    @property
    def clear(self) -> bool:
        """Whether no other hypothesis needs to be looked for."""
        return self.inliers >= ENOUGH_INLIERS and self.cells >= ENOUGH_CELLS

    def same_as(self, other: Hypothesis) -> bool:
        """Whether the two are the same place and direction, as far as hypotheses go."""
        near = np.linalg.norm(self.pose.centre - other.pose.centre) <= SAME_RATIO * min(self.depth, other.depth)
        return bool(near) and rotation_angle_deg(self.pose.R.T @ other.pose.R) <= SAME_DEG


def merged(found: Iterable[Hypothesis]) -> list[Hypothesis]:
    """The best first, each place once."""
    out: list[Hypothesis] = []
    for one in sorted(found, key=lambda h: -h.score):
        if not any(one.same_as(other) for other in out):
            out.append(one)
    return out


def sampled_pose(query: PhotoFeatures, pairs: Pairs, guessed: bool) -> tuple[Pose, float] | None:
    """The pose and focal factor that most of one view's pairs agree with, by RANSAC; None where fewer than MIN_INLIERS do."""
    if len(pairs) < MIN_PAIRS:
        return None
    best, factor = _best(query, pairs, COARSE_FACTORS if guessed else (1.0,), COARSE_ROUNDS if guessed else ROUNDS)
    if best is None:
        return None
    if guessed:
        finer, fine = _best(query, pairs, tuple(factor * f for f in FINE_FACTORS), ROUNDS)
        best, factor = (finer, fine) if finer is not None else (best, factor)
        assert best is not None
    return best, factor


def _best(query: PhotoFeatures, pairs: Pairs, factors: Sequence[float], rounds: int) -> tuple[Pose | None, float]:
    best, most, at = None, MIN_INLIERS - 1, 1.0
    for factor in factors:
        pose = ransac_pose(
            pairs.points, query.points[pairs.feature] / factor, SAMPLE_PX / (query.pinhole.focal * factor), rounds
        )
        if pose is None:
            continue
        near = errors_px(query, pairs, pose, factor) < SAMPLE_PX
        count = len(np.unique(pairs.feature[near]))
        if count > most:
            best, most, at = pose, count, factor
    return best, at


def grown_pose(query: PhotoFeatures, pool: Pairs, pose: Pose, factor: float, guessed: bool) -> Hypothesis | None:
    """The hypothesis that all pairs near `pose` agree on; None where too few do."""
    for _ in range(2):
        near = errors_px(query, pool, pose, factor) < GROW_PX
        if near.sum() < MIN_INLIERS:
            return None
        own = pool.take(near)
        start = ScaledPose(pose, factor)
        polished = polish(start, own.points, query.points[own.feature], query.pinhole.focal, free_focal=guessed)
        pose, factor = polished.pose, polished.scale
    return judged(query, pool, pose, factor)


def judged(query: PhotoFeatures, pool: Pairs, pose: Pose, factor: float) -> Hypothesis | None:
    """How many pairs agree with a pose; None where fewer than MIN_INLIERS features do."""
    near = errors_px(query, pool, pose, factor) < COUNT_PX
    features = np.unique(pool.feature[near])
    if len(features) < MIN_INLIERS:
        return None
    depth, lens = float(np.median(pose.transform(pool.points[near])[:, 2])), query.image.intrinsics
    cells = filled_cells(query.features.keypoints[features], (lens.width, lens.height), GRID)
    return Hypothesis(pose, factor, len(features), cells, depth)


def errors_px(query: PhotoFeatures, pairs: Pairs, pose: Pose, factor: float) -> FloatArray:
    """Distance (M,) in the photo's pixels between each landmark and its feature; infinite behind the camera."""
    p = pose.transform(pairs.points)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.linalg.norm(p[:, :2] / p[:, 2:] * factor - query.points[pairs.feature], axis=1)
    return np.where(p[:, 2] > 0, error * query.pinhole.focal, np.inf)
