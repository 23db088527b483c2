"""The spread of residuals that hold outliers."""

from __future__ import annotations

import numpy as np

from ...geometry.camera import FloatArray

MAD_TO_STD = 1.4826  # of a Gaussian: its standard deviation as a multiple of the median of its absolute values
MIN_SIGMA_PX = 0.15  # residuals of matches cannot be trusted to be quieter than keypoints are


def robust_std(residuals: FloatArray, floor: float = MIN_SIGMA_PX) -> float:
    """Standard deviation about 0 of `residuals` (N,) in their unit, from the median of their sizes; at least `floor`."""
    return max(floor, MAD_TO_STD * float(np.median(np.abs(residuals)))) if len(residuals) else floor
