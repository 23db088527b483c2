"""The map: views of the scan, each with the landmarks that its render shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..features.types import Features
from ..geometry.camera import Pose
from .viewpoints.explore import Exploration
from .viewpoints.eye import RenderedFeatures

DESCRIPTOR_SCALE = 512.0  # RootSIFT's components are below a half but for degenerate patches; 8 bits lose no match


@dataclass(frozen=True, eq=False)
class MapView:
    """A view of the map and its landmarks.

    points (N, 3) float32, world; descriptors (N, D) uint8, a unit vector times DESCRIPTOR_SCALE; `depth`: median depth of the
    view, scene units; `known`: a camera that the user gave, not one that was guessed from the scan.
    """

    pose: Pose
    points: NDArray[np.float32]
    descriptors: NDArray[np.uint8]
    depth: float
    known: bool = False

    def __len__(self) -> int:
        return len(self.points)

    @property
    def features(self) -> Features:
        """The descriptors as a matcher takes them; keypoints are of no use here and are zero."""
        return Features(np.zeros((len(self), 2)), self.descriptors.astype(np.float32) * np.float32(1 / DESCRIPTOR_SCALE))

    @classmethod
    def of(cls, look: RenderedFeatures, known: bool = False) -> MapView:
        """The view that `look` saw."""
        scaled = np.rint(look.features.descriptors * np.float32(DESCRIPTOR_SCALE))
        return cls(look.pose, look.points.astype(np.float32), np.clip(scaled, 0, 255).astype(np.uint8), look.depth, known)


@dataclass(frozen=True, eq=False)
class LandmarkMap:
    """The views in the order in which they were made: every prefix is a map too, which finds fewer photos.

    `key` names the scan and the settings that it was made from (see `file.map_key`); `complete`: made to its end.
    `search`: where the choice of its views stands, None before it has begun.
    """

    key: str
    views: tuple[MapView, ...] = ()
    complete: bool = False
    search: Exploration | None = None

    def __len__(self) -> int:
        return len(self.views)

    @property
    def landmarks(self) -> int:
        return sum(len(view) for view in self.views)
