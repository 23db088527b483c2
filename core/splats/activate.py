"""From a file's values to a scene's arrays, dropping Gaussians that are not finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import SplatFormatError
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
        self.kept = 0
        self.seen = 0

    def add(self, rows: Float32Array) -> None:
        """Append raw rows (n, 11 + 3 K); rows with a NaN, an infinity or a zero quaternion are only counted.

        A raw row is x y z, 3 log scales, 4 quaternion components (w x y z, any length), opacity logit, 3 K SH values with
        all of R first, then G, then B (each with its DC term leading).
        """
        with np.errstate(over="ignore", invalid="ignore"):
            scales = np.exp(rows[:, 3:6])
            opacities = np.asarray(1 / (1 + np.exp(-rows[:, 10])), np.float32)
            good = np.isfinite(rows).all(axis=1) & np.isfinite(scales).all(axis=1)
        sh = rows[:, 11:].reshape(len(rows), 3, self._sh.shape[1]).transpose(0, 2, 1)
        self._append(rows[:, :3], scales, rows[:, 6:10], opacities, sh, good)

    def add_activated(
        self, means: Float32Array, scales: Float32Array, rotations: Float32Array, opacities: Float32Array, sh: Float32Array
    ) -> None:
        """Append n Gaussians shaped as in GaussianScene, their quaternions of any length; those with a NaN, an infinity, a
        negative scale or a zero quaternion are only counted.
        """
        with np.errstate(invalid="ignore"):
            good = np.isfinite(means).all(axis=1) & np.isfinite(scales).all(axis=1) & (scales >= 0).all(axis=1)
            good &= np.isfinite(rotations).all(axis=1) & np.isfinite(opacities) & np.isfinite(sh).all(axis=(1, 2))
        self._append(means, scales, rotations, opacities, sh, good)

    def _append(
        self,
        means: Float32Array,
        scales: Float32Array,
        rotations: Float32Array,
        opacities: Float32Array,
        sh: Float32Array,
        good: NDArray[np.bool_],
    ) -> None:
        self.seen += len(means)
        with np.errstate(over="ignore", invalid="ignore"):
            norms = np.sqrt(np.einsum("ij,ij->i", rotations, rotations, dtype=np.float64))
        good &= norms > 0
        if not good.all():
            means, scales, rotations, opacities = means[good], scales[good], rotations[good], opacities[good]
            sh, norms = sh[good], norms[good]
        at = slice(self.kept, self.kept + len(means))
        self._means[at] = means
        self._scales[at] = scales
        self._rotations[at] = rotations / norms[:, None]
        self._opacities[at] = opacities
        self._sh[at] = sh
        self.kept += len(means)

    def scene(self, source_format: str, orientation: Orientation = "Y_DOWN") -> GaussianScene:
        """The scene of everything added. Raises SplatFormatError when nothing of it could be kept."""
        n = self.kept
        if n == 0:
            raise SplatFormatError(f"All {self.seen} Gaussians of the file hold NaN or infinite values; export the scan again.")
        arrays = (self._means[:n], self._scales[:n], self._rotations[:n], self._opacities[:n], self._sh[:n])
        return GaussianScene(*arrays, dropped=self.seen - n, format=source_format, orientation=orientation)
