"""Scenes that a file holds in several parts, each with its own values and place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.conventions import Orientation
from .scene import Float32Array, GaussianScene


def together(scenes: list[GaussianScene], name: str, orientation: Orientation) -> GaussianScene:
    """One scene of several, which are checked and have as many SH coefficients each."""
    joined = scenes[0]
    if len(scenes) > 1:
        names = ("means", "scales", "rotations", "opacities", "sh")
        m, s, r, o, h = (np.concatenate([getattr(one, name) for one in scenes]) for name in names)
        joined = GaussianScene(m, s, r, o, h)
    dropped, normalised = sum(one.dropped for one in scenes), sum(one.normalised for one in scenes)
    told = replace(joined, format=name, orientation=orientation, antialiased=any(one.antialiased for one in scenes))
    return replace(told, dropped=dropped, normalised=normalised)


def unit(rotations: Float32Array) -> Float32Array:
    """Quaternions (n, 4) made unit, for integers round them; one of length 0 becomes NaN."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        lengths = np.sqrt(np.einsum("ij,ij->i", rotations, rotations, dtype=np.float64))
        return np.ascontiguousarray(rotations / lengths[:, None], np.float32)
