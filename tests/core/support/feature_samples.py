"""Pictures, descriptors and networks with known answers, for the tests of features."""

import cv2
import numpy as np
from onnx_files import FLOAT, INT64, node, write_onnx

from core.features.types import Features

GREY = np.random.default_rng(0).integers(0, 255, (50, 90), np.uint8)  # no side is a multiple of 8


def picture(width=640, height=480, seed=0):
    """Smooth noise on several scales, float, around 0."""
    rng = np.random.default_rng(seed)
    image = np.zeros((height, width), np.float32)
    for cell in (8, 16, 32, 64):
        coarse = rng.normal(size=(height // cell + 1, width // cell + 1)).astype(np.float32)
        image += cell**0.3 * cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return image


def rows(count, columns=16, seed=1):
    return np.random.default_rng(seed).normal(size=(count, columns)).astype(np.float32)


def unit(array):
    return array / np.linalg.norm(array, axis=-1, keepdims=True)


def glue(path, matches, scores):
    names = {"kpts0": 2, "kpts1": 2, "desc0": 16, "desc1": 16}
    return write_onnx(
        path,
        [node("Identity", ["m"], ["matches0"]), node("Identity", ["s"], ["mscores0"])],
        {"m": matches, "s": scores},
        {name: (FLOAT, (1, f"n_{name}", columns)) for name, columns in names.items()},
        {"matches0": (INT64, matches.shape), "mscores0": (FLOAT, scores.shape)},
    )


def pair(count_a=5, count_b=6):
    rng = np.random.default_rng(2)
    return tuple(Features(rng.uniform(0, 90, (n, 2)), unit(rows(n, seed=n)), (90, 50)) for n in (count_a, count_b))
