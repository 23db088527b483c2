"""What a renderer takes and gives: settings and one rendered view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]


@dataclass(frozen=True)
class RenderSettings:
    """How to render. `near` is the near plane in scene units (0.2 in INRIA's code); `threads` 0 means all cores."""

    near: float = 0.2
    threads: int = 0


@dataclass(frozen=True)
class RenderedView:
    """One render of the splat, all float32, on a black background.

    color (H, W, 3) RGB as trained (display-encoded), not clamped above; depth (H, W) expected camera-space z,
    sum(w z) / max(sum w, 1e-10), scene units; alpha (H, W) = sum w = 1 - T; depth_variance (H, W) variance of z under the
    weights w / sum w, scene units squared.
    """

    color: Float32Array
    depth: Float32Array
    alpha: Float32Array
    depth_variance: Float32Array
