"""Mutual nearest neighbours with Lowe's ratio test, for unit vectors and for bits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import FeatureError
from ..types import Features, Matches, no_matches


@dataclass(frozen=True)
class MutualNearest:
    """Keeps a pair when each is the other's nearest neighbour and the distance is below `ratio` times the second nearest.

    The distance is Euclidean between unit vectors and Hamming between binary descriptors.
    """

    ratio: float = 0.85

    def match(self, a: Features, b: Features) -> Matches:
        """Pairs of two sets with the same kind of descriptors. Empty input gives no pairs.

        Raises FeatureError when the descriptors are of different kinds.
        """
        if len(a) < 2 or len(b) < 2:
            return no_matches()
        if a.binary != b.binary or a.descriptors.shape[1] != b.descriptors.shape[1]:
            raise FeatureError("The photo and the render have features of different kinds; use one kind for both.")
        # For unit vectors 1 - x.y is half the squared distance; for bits written as signs it is the Hamming distance itself,
        # as a share of half the bits. So the same ratio is squared for the one and plain for the other.
        power = 1 if a.binary else 2
        return _mutual(_directions(a) @ _directions(b).T, self.ratio**power)


def _directions(features: Features) -> NDArray[np.float32]:
    """Descriptors as unit vectors (N, D) float32: a bit becomes a component of either sign."""
    if not features.binary:
        return np.asarray(features.descriptors, np.float32)
    bits = np.unpackbits(features.descriptors.astype(np.uint8), axis=1)
    return np.asarray((2 * bits.astype(np.float32) - 1) / np.float32(np.sqrt(bits.shape[1])))


def _mutual(similarity: NDArray[np.float32], factor: float) -> Matches:
    """Mutual best pairs of `similarity` (N, M) whose 1 - s is below `factor` times that of the second best in the row."""
    rows = np.arange(len(similarity))
    best = similarity.argmax(axis=1)
    top = similarity[rows, best]
    mutual = similarity.argmax(axis=0)[best] == rows
    similarity[rows, best] = -np.inf
    second = similarity.max(axis=1)
    good = mutual & (1 - top < factor * (1 - second))
    return Matches(np.stack([rows[good], best[good]], axis=1), top[good])
