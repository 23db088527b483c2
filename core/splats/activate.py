"""From a file's values to a scene's arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..geometry.conventions import Orientation
from .scene import Float32Array, GaussianScene

SH_C0 = 0.28209479177387814  # the constant basis function, 1 / (2 sqrt(pi)): colour = 0.5 + SH_C0 f_dc


class SceneBuilder:
    """Collects chunks of Gaussians into preallocated arrays, so that a scene is held in memory once."""

    def __init__(self, capacity: int, coefficients: int) -> None:
        self._means = np.empty((capacity, 3), np.float32)
        self._scales = np.empty((capacity, 3), np.float32)
        self._rotations = np.empty((capacity, 4), np.float32)
        self._opacities = np.empty(capacity, np.float32)
        self._sh = np.empty((capacity, coefficients, 3), np.float32)
        self.filled, self.coefficients = 0, coefficients

    def add(self, rows: Float32Array) -> None:
        """Append raw rows (n, 11 + 3 K). Infinite opacities and scales of minus infinity are values like others: programs that
        write opaque, invisible or flat Gaussians take the logarithms of 0 and 1.

        A raw row is x y z, 3 log scales, 4 quaternion components (w x y z, any length), opacity logit, 3 K SH values with
        all of R first, then G, then B (each with its DC term leading).
        """
        with np.errstate(over="ignore", invalid="ignore"):
            scales = np.exp(rows[:, 3:6])
            opacities = np.asarray(1 / (1 + np.exp(-rows[:, 10])), np.float32)
        sh = rows[:, 11:].reshape(len(rows), 3, self._sh.shape[1]).transpose(0, 2, 1)
        self.add_activated(rows[:, :3], scales, rows[:, 6:10], opacities, sh)

    def add_activated(
        self, means: Float32Array, scales: Float32Array, rotations: Float32Array, opacities: Float32Array, sh: Float32Array
    ) -> None:
        """Append n Gaussians shaped as in GaussianScene, their quaternions of any length."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            norms = np.sqrt(np.einsum("ij,ij->i", rotations, rotations, dtype=np.float64))
            rows = slice(self.filled, self.filled + len(means))
            # A quaternion of length 0 becomes NaN.
            self._rotations[rows] = rotations / norms[:, None]
        self._means[rows] = means
        self._scales[rows] = scales
        self._opacities[rows] = opacities
        self._sh[rows] = sh
        self.filled += len(means)

    def scene(self, source_format: str, orientation: Orientation = "Y_DOWN", **more: Any) -> GaussianScene:
        """The scene of everything added, with `more` of its values, as `GaussianScene.checked` makes it. Raises its errors."""
        n = self.filled
        arrays = (self._means[:n], self._scales[:n], self._rotations[:n], self._opacities[:n], self._sh[:n])
        return GaussianScene(*arrays, format=source_format, orientation=orientation, **more).checked()
