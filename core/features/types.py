"""What extractors and matchers exchange."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..camera import FloatArray


@dataclass(frozen=True)
class Features:
    """Local features of one image.

    keypoints (N, 2) float64, pixels, centre of the top-left pixel at (0.5, 0.5); descriptors (N, D) float32 of unit length.
    """

    keypoints: FloatArray
    descriptors: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.keypoints)


@dataclass(frozen=True)
class Matches:
    """Index pairs (M, 2) intp into two feature sets, and their similarity (M,) float32, larger is better."""

    indices: NDArray[np.intp]
    similarity: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.indices)


class Extractor(Protocol):
    """Finds features in a grey image (H, W) uint8; `mask` (H, W) bool leaves out what is False."""

    def extract(self, grey: NDArray[np.uint8], mask: NDArray[np.bool_] | None = None) -> Features: ...


class Matcher(Protocol):
    """Pairs the features of two images."""

    def match(self, a: Features, b: Features) -> Matches: ...
