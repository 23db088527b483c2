"""LightGlue: a learned matcher (Lindenberger, Sarlin and Pollefeys, ICCV 2023) from an ONNX file, through OpenCV's dnn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import FeatureError
from ...geometry.conventions import to_opencv_pixels
from ..types import Features, Matches, no_matches

MIN_FEATURES = 2


@dataclass(frozen=True)
class LightGlue:
    """LightGlue with the network in `model` (.onnx): `kpts0`, `kpts1`, `desc0`, `desc1` -> `matches0`, `mscores0`.

    Both common exports work: pairs (S, 2) with their scores, or for each first feature its partner, -1 for none.
    """

    model: Path
    min_score: float = 0.1

    def match(self, a: Features, b: Features) -> Matches:
        """Pairs of two feature sets whose `size` is known. Raises cv2.error or FeatureError when the model does not work."""
        if len(a) < MIN_FEATURES or len(b) < MIN_FEATURES:
            return no_matches()
        if a.binary or b.binary:
            raise FeatureError("LightGlue takes learned features, not binary ones.")
        # The network is read for every pair, because a network that is used again gives wrong scores.
        net = cv2.dnn.readNetFromONNX(str(self.model))
        if net.empty():
            raise FeatureError("It holds operators that OpenCV does not know.")
        for index, features in enumerate((a, b)):
            net.setInput(_normalised(features)[None], f"kpts{index}")
            net.setInput(np.ascontiguousarray(features.descriptors, np.float32)[None], f"desc{index}")
        names = list(net.getUnconnectedOutLayersNames())
        outputs: dict[str, Any] = dict(zip(names, net.forward(names), strict=True))
        if not {"matches0", "mscores0"} <= set(outputs):
            raise FeatureError(f"It has the outputs {', '.join(names)}, not those of LightGlue.")
        # OpenCV returns None for an output that has no rows.
        if outputs["matches0"] is None:
            return no_matches()
        pairs, scores = _pairs(outputs["matches0"], outputs["mscores0"])
        valid = (pairs >= 0).all(axis=1) & (pairs < (len(a), len(b))).all(axis=1) & (scores >= self.min_score)
        return Matches(pairs[valid], scores[valid])


def _normalised(features: Features) -> NDArray[np.float32]:
    """Keypoints (N, 2) float32 about the image's middle, in halves of its long side: what the published networks take."""
    size = np.array(features.size, np.float64)
    return np.ascontiguousarray((to_opencv_pixels(features.keypoints) - size / 2) / (size.max() / 2), np.float32)


def _pairs(matches: NDArray[Any], scores: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Index pairs (S, 2) and scores (S,) of either export."""
    if matches.ndim == 2 and matches.shape[1] == 2 and scores.size == len(matches):
        return matches.astype(np.intp), scores.ravel().astype(np.float32)
    if matches.size != scores.size:
        raise FeatureError(f"Its outputs {matches.shape}, {scores.shape} are not those of LightGlue.")
    partner = matches.ravel().astype(np.intp)
    return np.stack([np.arange(len(partner)), partner], axis=1), scores.ravel().astype(np.float32)
