"""What is decided once for each scan: whether the graphics card draws its views, or the processor."""

from __future__ import annotations

import logging
from collections.abc import Callable

import gpu

from ...core.render import RenderSettings, memory
from ...core.splats.scene import GaussianScene
from . import choice
from .executor import executor
from .renderer import ClosingRenderer, GpuRenderer, why_not

log = logging.getLogger(__name__)


class CardOffer:
    """The card, offered to one scan. Make it in the main thread; `renderer` may be called in any, once; then `close` it.

    `chosen`: the card's renderer where the card was taken.
    """

    def __init__(self, wanted: choice.Wanted, limit_bytes: int, threads: int) -> None:
        """`limit_bytes`: what a refinement may take, 0 for no limit; `threads`: views that the processor draws side by side."""
        self._plan, self._limit, self._threads = choice.plan(wanted), limit_bytes, threads
        self.chosen: GpuRenderer | None = None
        self._largest_side = gpu.capabilities.max_texture_size_get() if self._plan.card else 0
        self._owner = executor.hold() if self._plan.card else None
        if wanted == "GPU" and not self._plan.card:
            log.warning("The graphics card is not used: %s", self._plan.reason)

    @property
    def fault(self) -> str:
        """Why the card was given up in the middle of the work; "" when it was not."""
        return self.chosen.fault if self.chosen else ""

    @property
    def asks(self) -> bool:
        """Whether the main thread may be asked to draw, so that it has to serve the executor."""
        return self._owner is not None

    def renderer(
        self, scene: GaussianScene, settings: RenderSettings, processor: Callable[[], ClosingRenderer]
    ) -> ClosingRenderer:
        """The scan's renderer; `processor` makes that of the processor, at once or when the card fails."""
        if self._owner is None:
            return processor()
        reason = why_not(scene, self._spare(scene), self._largest_side)
        reason = reason or choice.refusal(choice.tested(self._owner), self._plan.forced, self._threads)
        if reason:
            (log.warning if self._plan.forced else log.info)("The graphics card is not used: %s", reason)
            self.close()
            return processor()
        log.info("The graphics card draws the views")
        self.chosen = GpuRenderer(scene, settings, processor, self._owner)
        return self.chosen

    def close(self) -> None:
        """The main thread is not asked any more. Harmless when repeated."""
        if self._owner is not None:
            executor.release(self._owner)

    def _spare(self, scene: GaussianScene) -> int | None:
        if not self._limit:
            return None
        return self._limit - memory.refine_bytes(len(scene.means), scene.sh.shape[1], 0, self._threads)
