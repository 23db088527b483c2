"""The standard deviation of residuals among which there are outliers."""

from __future__ import annotations

import numpy as np

from ...geometry.camera import FloatArray

# The standard deviation of a Gaussian is this multiple of the median of its absolute values.
MAD_TO_STD = 1.4826
# Keypoints are no more accurate than this, so that smaller residuals must not be believed.
MIN_SIGMA_PX = 0.15


def robust_std(residuals: FloatArray, floor: float = MIN_SIGMA_PX) -> float:
    """Standard deviation about 0 of `residuals` (N,) in their unit, from the median of their sizes; at least `floor`."""
    return max(floor, MAD_TO_STD * float(np.median(np.abs(residuals)))) if len(residuals) else floor
