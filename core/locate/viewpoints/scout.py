"""Cheap looks at viewpoints: what one eye sees there, and what of it a second eye at its side confirms."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...features.matchers.nearest import MutualNearest
from ...geometry.camera import FloatArray, Pose
from .candidates import Viewpoint
from .eye import Eye, RenderedFeatures, facing, square_camera
from .panorama import facing_log
from .surface import Surface, neighbour_tree

SCOUT_PX = 96
BASELINE = 0.12  # between the two eyes, of the depth
STABLE_RATIO = 0.03  # of the depth: how far two lifts of one feature may lie apart
FEWEST_POINTS = 5
SIDE_GAIN = 2.0  # how much sharper than the sieve a sight is judged by the side from which it is seen
LEAST_SOLID = 0.1


@dataclass(frozen=True, eq=False)
class Sight:
    """A viewpoint after a look. `depth`: median depth of what was seen there, scene units; `points` (N, 3) float32, world:
    the features' places or, once `proven` by a second eye, those that it confirms; `weight` (N,) float32, 0..1: how plausible
    it is that a photograph saw them from this side; `found`: the features of the first eye, until they have been put to proof.
    """

    viewpoint: Viewpoint
    depth: float
    points: NDArray[np.float32]
    weight: NDArray[np.float32]
    proven: bool = False
    found: RenderedFeatures | None = None

    @property
    def pose(self) -> Pose:
        return Pose.from_centre(facing(self.viewpoint.direction), self.viewpoint.centre)


class Scout:
    """Looks at viewpoints with small renders."""

    def __init__(self, eye: Eye, surface: Surface) -> None:
        self._eye, self._surface = eye, surface
        self._tree = neighbour_tree(surface.points)
        self._camera = square_camera(SCOUT_PX)

    def sight(self, viewpoint: Viewpoint) -> Sight | None:
        """What one eye sees there; None where that is mostly nothing."""
        pose = Pose.from_centre(facing(viewpoint.direction), viewpoint.centre)
        look = self._eye.look(pose, self._camera, viewpoint.depth)
        if look.solid < LEAST_SOLID or len(look.features) < FEWEST_POINTS:
            return None
        points = look.points.astype(np.float32)
        return Sight(viewpoint, look.depth, points, self._weight(pose, points), found=look)

    def proven(self, sight: Sight) -> Sight | None:
        """The sight with those of its points that a second eye at its side sees at the same places; None where too few are."""
        pose, depth, near = sight.pose, sight.depth, sight.viewpoint.depth
        first = sight.found or self._eye.look(pose, self._camera, near)
        aside = Pose.from_centre(pose.R, pose.centre + BASELINE * depth * pose.R[0])
        second = self._eye.look(aside, self._camera, near)
        pairs = MutualNearest().match(first.features, second.features).indices
        apart: FloatArray = np.linalg.norm(first.points[pairs[:, 0]] - second.points[pairs[:, 1]], axis=1)
        stable = first.points[pairs[apart < STABLE_RATIO * depth, 0]].astype(np.float32)
        if len(stable) < FEWEST_POINTS:
            return None
        return replace(sight, points=stable, weight=self._weight(pose, stable), proven=True, found=None)

    def _weight(self, pose: Pose, points: NDArray[np.float32]) -> NDArray[np.float32]:
        _, nearest = self._tree.query(points)
        ray = points - pose.centre.astype(np.float32)
        side = facing_log(self._surface.facing[nearest], ray, np.linalg.norm(ray, axis=1))
        return np.asarray(np.exp(SIDE_GAIN * side), np.float32)
