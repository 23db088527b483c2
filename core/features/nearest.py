"""Mutual nearest neighbours with Lowe's ratio test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .types import Features, Matches


@dataclass(frozen=True)
class MutualNearest:
    """Keeps a pair when each is the other's nearest neighbour and the distance is below `ratio` times the second nearest."""

    ratio: float = 0.85

    def match(self, a: Features, b: Features) -> Matches:
        """Pairs between unit descriptors; distances are Euclidean. Empty input gives no pairs."""
        if len(a) < 2 or len(b) < 2:
            return Matches(np.zeros((0, 2), np.intp), np.zeros(0, np.float32))
        similarity = a.descriptors @ b.descriptors.T
        rows = np.arange(len(a))
        best = similarity.argmax(axis=1)
        top = similarity[rows, best]
        mutual = similarity.argmax(axis=0)[best] == rows
        similarity[rows, best] = -np.inf
        second = similarity.max(axis=1)
        # |x - y|^2 = 2 - 2 x.y for unit vectors, so the ratio test on distances is one on 1 - similarity.
        good = mutual & (1 - top < self.ratio**2 * (1 - second))
        return Matches(np.stack([rows[good], best[good]], axis=1), top[good])
