"""One iteration's answer: from the observed views to a pose, by the coarse and then the fine stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...features.frontend import Frontend
from ...geometry.camera import FloatArray, Pose
from ..shared.matches import BoolArray, ViewMatches, bearings, world_points
from .consistency import consensus_pose
from .depth_pnp import pnp_pose
from .epipolar import EpipolarFit, epipolar_distances, measure_epipolar, refine_epipolar
from .observe import Observation, PhotoFeatures, align_matches
from .two_view import TwoViewPose, two_view_pose

# An essential matrix with fewer inliers is as likely to be chance as geometry.
MIN_VIEW_INLIERS = 15
RANSAC_PX = 1.0
# A match within this distance of its line at the coarse pose goes into the fine stage, also if RANSAC rejected it.
GATE_PX = 3.0
MIN_FINE_MATCHES = 12
MIN_PARALLAX_PX = 3.0
# A match may lie along its line as far off as an error of this share of the depth would move it.
DEPTH_TOLERANCE = 0.25


@dataclass(frozen=True)
class UsableView:
    """A view whose matches hold a two-view pose."""

    observation: Observation
    relative: TwoViewPose

    @property
    def support(self) -> int:
        return int(self.relative.inliers.sum())

    @property
    def inliers(self) -> ViewMatches:
        return self.observation.matches.take(self.relative.inliers)


def usable_views(observations: Sequence[Observation], focal: float) -> list[UsableView]:
    """The views that see the same place as the photo."""
    out = []
    for observation in observations:
        relative = two_view_pose(observation.matches, RANSAC_PX / focal)
        if relative is not None and relative.inliers.sum() >= MIN_VIEW_INLIERS:
            out.append(UsableView(observation, relative))
    return out


def coarse_pose(
    observations: Sequence[Observation], views: Sequence[UsableView], K: FloatArray, multiview: bool
) -> Pose | None:
    """The best of the consensus of all views, each view's own answer with the scale of its rendered depth, and the pose of all
    matches lifted by their depth: the one that most matches agree with. None when no view holds an answer.
    """
    options = [pose for view in views if (pose := single_view_pose(view)) is not None]
    if multiview and len(views) >= 2:
        support = np.array([float(view.support) for view in views])
        consensus = consensus_pose([v.observation.pose for v in views], [v.relative for v in views], support)
        if consensus is not None:
            options.insert(0, consensus.pose)
    matches = [o.matches for o in observations]
    pooled = pnp_pose(matches, focal_of(K)) if multiview else None
    if pooled is not None:
        options.append(pooled.pose)
    if not options:
        return None
    scores = [agreement(pose, matches, K) for pose in options]
    best = int(np.argmax(scores))
    return options[best] if scores[best] >= MIN_FINE_MATCHES / 2 else None


def agreement(pose: Pose, views: Sequence[ViewMatches], K: FloatArray) -> float:
    """How many matches `pose` explains, each counted 1 on its epipolar line falling to 0 at the gate."""
    total = 0.0
    for view in views:
        d = epipolar_distances(pose, view, K)
        total += float(np.sum(np.where(gate(pose, view, K), 1 - (d / GATE_PX) ** 2, 0.0)))
    return total


def single_view_pose(view: UsableView) -> Pose | None:
    """The photo's pose from one view: its two-view pose, made metric by the depth that the splat renders there."""
    inliers, relative = view.inliers, view.relative
    s, q = bearings(inliers.view), bearings(inliers.query)
    r = s @ relative.R.T
    # The depths a and b satisfy a q = b r + t for a baseline of 1; the cross product with q gives b, the depth in the view.
    qr, qt = np.cross(q, r), np.cross(q, relative.t)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit_depth = -(qr * qt).sum(1) / (qr * qr).sum(1)
        scale = inliers.depth / unit_depth
    scale = scale[np.isfinite(scale) & (unit_depth > 0) & (inliers.depth > 0)]
    if len(scale) < MIN_VIEW_INLIERS // 2:
        return None
    pose = view.observation.pose
    return Pose(relative.R @ pose.R, relative.R @ pose.t + float(np.median(scale)) * relative.t)


def gate(pose: Pose, matches: ViewMatches, K: FloatArray, gate_px: float = GATE_PX) -> BoolArray:
    """Which matches (M,) lie on their epipolar line at `pose`, and, where the splat has depth, near the right place on it."""
    on_line = np.abs(epipolar_distances(pose, matches, K)) < gate_px
    points = pose.transform(world_points(matches))
    with np.errstate(invalid="ignore"):
        offset = np.linalg.norm((points[:, :2] / points[:, 2:] - matches.query) * (K[0, 0], K[1, 1]), axis=1)
        # The parallax that a depth error of DEPTH_TOLERANCE makes is that share of the pair's own parallax.
        baseline = np.linalg.norm(pose.centre - matches.pose.centre)
        allowed = gate_px + DEPTH_TOLERANCE * focal_of(K) * baseline / np.abs(points[:, 2])
        misplaced = (points[:, 2] <= 0) | (offset > allowed)
    return np.asarray(on_line & ~misplaced)


def fine_matches(
    pose: Pose, observations: Sequence[Observation], photo: PhotoFeatures, frontend: Frontend
) -> list[ViewMatches]:
    """All views' matches that fit `pose`, aligned to sub-pixel. Left out: views with too few of them, and views so close to
    `pose` that there is no parallax, whose epipolar lines turn with the noise (unless there are no others).
    """
    K = photo.pinhole.matrix
    apart = [o for o in observations if _parallax_px(pose, o, K) >= MIN_PARALLAX_PX] or observations
    aligned = [align_matches(o, photo, gate(pose, o.matches, K), frontend.aligner) for o in apart]
    return [m for m in aligned if len(m) >= MIN_FINE_MATCHES]


def _parallax_px(pose: Pose, observation: Observation, K: FloatArray) -> float:
    """How far a point at the view's median depth moves between `pose` and the view, pixels, turning left aside."""
    depth = observation.median_depth
    return focal_of(K) * float(np.linalg.norm(pose.centre - observation.pose.centre)) / depth if depth > 0 else 0.0


def focal_of(K: FloatArray) -> float:
    """Geometric mean of the focal lengths in K, pixels."""
    return float(np.sqrt(K[0, 0] * K[1, 1]))


def fine_pose(pose: Pose, views: Sequence[ViewMatches], K: FloatArray) -> EpipolarFit:
    """The epipolar stage, twice: once to settle, once on the matches within the gate of where it settled."""
    fit = refine_epipolar(pose, views, K)
    kept = [v.take(np.abs(epipolar_distances(fit.pose, v, K)) < 4 * s) for v, s in zip(views, fit.sigmas, strict=True)]
    kept = [v for v in kept if len(v) >= MIN_FINE_MATCHES]
    return refine_epipolar(fit.pose, kept, K) if kept else fit


def keep_distance(fit: EpipolarFit, coarse: Pose, view: ViewMatches, K: FloatArray) -> EpipolarFit:
    """One view alone says nothing of the distance to it: `fit` with the distance that the coarse pose had from its depth."""
    distance = np.linalg.norm(coarse.centre - view.pose.centre)
    way = fit.pose.centre - view.pose.centre
    centre = view.pose.centre + way * distance / max(float(np.linalg.norm(way)), 1e-12)
    return measure_epipolar(Pose.from_centre(fit.pose.R, centre), [view], K)
