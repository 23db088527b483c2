"""From a file's raw Gaussian parameters to a scene's activated ones, dropping those that are not finite."""

from __future__ import annotations

import numpy as np

from .scene import Float32Array, GaussianScene


class SceneBuilder:
    """Collects chunks of raw rows into preallocated arrays, so that a scene is held in memory once.

    A raw row is x y z, 3 log scales, 4 quaternion components (w x y z, any length), opacity logit, 3 K SH values with all of
    R first, then G, then B (each with its DC term leading).
    """

    def __init__(self, capacity: int, coefficients: int) -> None:
        self._means = np.empty((capacity, 3), np.float32)
        self._scales = np.empty((capacity, 3), np.float32)
        self._rotations = np.empty((capacity, 4), np.float32)
        self._opacities = np.empty(capacity, np.float32)
        self._sh = np.empty((capacity, coefficients, 3), np.float32)
        self.kept = 0
        self.seen = 0

    def add(self, rows: Float32Array) -> None:
        """Append raw rows (n, 11 + 3 K); rows with a NaN, an infinity or a zero quaternion are only counted."""
        self.seen += len(rows)
        with np.errstate(over="ignore", invalid="ignore"):
            scales = np.exp(rows[:, 3:6])
            opacities = 1 / (1 + np.exp(-rows[:, 10]))
            norms = np.sqrt(np.einsum("ij,ij->i", rows[:, 6:10], rows[:, 6:10], dtype=np.float64))
            good = np.isfinite(rows).all(axis=1) & np.isfinite(scales).all(axis=1) & (norms > 0)
        if not good.all():
            rows, scales, opacities, norms = rows[good], scales[good], opacities[good], norms[good]
        at = slice(self.kept, self.kept + len(rows))
        self._means[at] = rows[:, :3]
        self._scales[at] = scales
        self._rotations[at] = rows[:, 6:10] / norms[:, None]
        self._opacities[at] = opacities
        self._sh[at] = rows[:, 11:].reshape(len(rows), 3, self._sh.shape[1]).transpose(0, 2, 1)
        self.kept += len(rows)

    def scene(self, source_format: str) -> GaussianScene:
        """The scene of everything added."""
        n = self.kept
        arrays = (self._means[:n], self._scales[:n], self._rotations[:n], self._opacities[:n], self._sh[:n])
        return GaussianScene(*arrays, dropped=self.seen - n, format=source_format)
