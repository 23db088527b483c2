"""The photo's features paired with the landmarks of the map's views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..features.types import Features, Matcher
from ..geometry.camera import FloatArray
from .landmarks import MapView


@dataclass(frozen=True, eq=False)
class Pairs:
    """M pairs: `feature` (M,) index of the photo's feature, `points` (M, 3) float64 the landmark's place in the world."""

    feature: NDArray[np.intp]
    points: FloatArray

    def __len__(self) -> int:
        return len(self.feature)

    def take(self, keep: NDArray[np.bool_]) -> Pairs:
        return Pairs(self.feature[keep], self.points[keep])

    @classmethod
    def joined(cls, parts: Sequence[Pairs]) -> Pairs:
        """The pairs of all parts, in their order."""
        if not parts:
            return cls(np.zeros(0, np.intp), np.zeros((0, 3)))
        return cls(np.concatenate([p.feature for p in parts]), np.concatenate([p.points for p in parts]))


def pair_view(photo: Features, view: MapView, matcher: Matcher) -> Pairs:
    """The pairs of the photo with one view of the map."""
    found = matcher.match(photo, view.features).indices
    return Pairs(found[:, 0], view.points[found[:, 1]].astype(np.float64))
