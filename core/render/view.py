"""What a renderer takes and gives: settings and one rendered view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Intrinsics, Pose
from ..splats.scene import GaussianScene

Float32Array = NDArray[np.float32]

INRIA_NEAR = 0.2  # scene units
# A share of the median distance of the Gaussians from their middle.
NEAR_RATIO = 0.15


@dataclass(frozen=True)
class RenderSettings:
    """How to render. `near` is the near plane in scene units (0.2 in INRIA's code); `threads` 0 means all cores."""

    near: float = INRIA_NEAR
    threads: int = 0

    @classmethod
    def for_scene(cls, scene: GaussianScene, threads: int = 0, near: float | None = None) -> RenderSettings:
        """`near` where it is given, else INRIA's near plane, or a nearer one where the scan is so small that it would cut into
        it.
        """
        if near is not None:
            return cls(near, threads)
        radius = np.linalg.norm(scene.means - np.median(scene.means, axis=0), axis=1)
        return cls(min(INRIA_NEAR, NEAR_RATIO * float(np.median(radius))) or INRIA_NEAR, threads)


@dataclass(frozen=True, eq=False)
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


class ViewRenderer(Protocol):
    """Anything that draws a pinhole view; what the refinement and the pictures need of a renderer."""

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView: ...


def sole_renderer(renderer: ViewRenderer) -> ViewRenderer:
    """The renderer for a view that is drawn by itself, not beside others. A `ProcessRenderer` draws each view on one thread and
    has another renderer (`sole`), whose threads share one view; any other renderer is returned as it is.
    """
    sole: ViewRenderer = getattr(renderer, "sole", renderer)
    return sole
