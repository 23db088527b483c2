"""The extractors and matchers there are, by the names that flags and the panel use. To add one: its file, and its line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2

from .extractors.akaze import Akaze
from .extractors.aliked import Aliked
from .extractors.disk import Disk
from .extractors.orb import Orb
from .extractors.sift import RootSift
from .extractors.superpoint import SuperPoint
from .matchers.lightglue import LightGlue
from .matchers.nearest import MutualNearest
from .types import Extractor, Matcher

# No extractor of its own, but a rule for which one to use; see `frontend`.
AUTO = "auto"


@dataclass(frozen=True)
class ExtractorKind:
    """One row of the registry.

    `opencv`: the dotted name in cv2 that it needs. `ratio`: of the nearest-neighbour matcher, as fits its descriptors; learned
    ones tell more places apart and lose good pairs under a strict one. `make` ignores the path of a kind that needs no model.
    """

    title: str
    text: str
    make: Callable[[Path], Extractor]
    opencv: str
    needs_model: bool = False
    ratio: float = 0.85
    binary: bool = False


@dataclass(frozen=True)
class MatcherKind:
    """One row of the registry; as above."""

    title: str
    text: str
    make: Callable[[Path], Matcher]
    opencv: str
    needs_model: bool = False


EXTRACTORS: Mapping[str, ExtractorKind] = {
    "sift": ExtractorKind("SIFT", "RootSIFT; nothing to download", lambda _: RootSift(), "SIFT"),
    "akaze": ExtractorKind("AKAZE", "binary, faster than SIFT", lambda _: Akaze(), "xfeatures2d.AKAZE", ratio=0.9, binary=True),
    "orb": ExtractorKind("ORB", "binary, the fastest, for near starts", lambda _: Orb(), "ORB", ratio=0.9, binary=True),
    "aliked": ExtractorKind("ALIKED", "learned, more matches, slower", Aliked, "ALIKED", needs_model=True, ratio=0.95),
    "disk": ExtractorKind("DISK", "learned", Disk, "DISK", needs_model=True, ratio=0.95),
    "superpoint": ExtractorKind(
        "SuperPoint", "learned, the paper's", SuperPoint, "dnn.readNetFromONNX", needs_model=True, ratio=0.95
    ),
}

MATCHERS: Mapping[str, MatcherKind] = {
    "nearest": MatcherKind("Nearest", "mutual nearest neighbours with a ratio test", lambda _: MutualNearest(), "SIFT"),
    "lightglue": MatcherKind(
        "LightGlue",
        "learned, for the features it was trained on",
        LightGlue,
        "dnn.readNetFromONNX",
        needs_model=True,
    ),
}


def missing(kind: ExtractorKind | MatcherKind) -> str:
    """Why the kind cannot be used with this OpenCV; "" when it can."""
    found: object = cv2
    for name in kind.opencv.split("."):
        found = getattr(found, name, None)
    return "" if found is not None else f"OpenCV {cv2.__version__} has no cv2.{kind.opencv}"
