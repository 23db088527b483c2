"""What extractors and matchers exchange."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray

Grey = NDArray[np.uint8]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Features:
    """Local features of one image.

    keypoints (N, 2) float64, pixels, centre of the top-left pixel at (0.5, 0.5); descriptors (N, D) float32 of unit length, or
    (N, B) uint8, eight bits of a binary descriptor to a byte; size (width, height) of the image in pixels, for matchers that
    look at places too.
    """

    keypoints: FloatArray
    descriptors: NDArray[np.float32] | NDArray[np.uint8]
    size: tuple[int, int] = (0, 0)

    def __len__(self) -> int:
        return len(self.keypoints)

    @property
    def binary(self) -> bool:
        """Whether descriptors are bits, to be compared by how many differ."""
        return self.descriptors.dtype == np.uint8

    def take(self, keep: Mask | NDArray[np.intp]) -> Features:
        """The features where `keep` (N,) is True, or those at the indices in it."""
        return replace(self, keypoints=self.keypoints[keep], descriptors=self.descriptors[keep])

    def where(self, mask: Mask | None) -> Features:
        """The features on pixels where `mask` (H, W) is True; all without a mask."""
        if mask is None or len(self) == 0:
            return self
        cell = np.clip(self.keypoints.astype(np.intp), 0, (mask.shape[1] - 1, mask.shape[0] - 1))
        return self.take(np.asarray(mask[cell[:, 1], cell[:, 0]]))


def no_features(size: tuple[int, int], columns: int, binary: bool = False) -> Features:
    """An empty set of features with descriptors of `columns` numbers."""
    return Features(np.zeros((0, 2)), np.zeros((0, columns), np.uint8 if binary else np.float32), size)


@dataclass(frozen=True, eq=False)
class Matches:
    """Index pairs (M, 2) intp into two feature sets, and their similarity (M,) float32, larger is better."""

    indices: NDArray[np.intp]
    similarity: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.indices)


def no_matches() -> Matches:
    return Matches(np.zeros((0, 2), np.intp), np.zeros(0, np.float32))


class Extractor(Protocol):
    """Finds features in a grey image (H, W) uint8; `mask` (H, W) bool leaves out what is False."""

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features: ...


class Matcher(Protocol):
    """Pairs the features of two images."""

    def match(self, a: Features, b: Features) -> Matches: ...
