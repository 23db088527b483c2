"""How many Gaussians a redraw may have, by how long redraws take on this machine.

While the view moves a sample is drawn; once it rests, the picture is completed in steps.
"""

from __future__ import annotations

MOVING_S = 0.05  # aimed at for a redraw while the view moves
STILL_S = 0.6  # a redraw of the resting view may take as long as this
FEWEST = 10_000
START = {False: 250_000, True: 20_000}  # by whether the processor draws
MOST_MOVING = 1_000_000
GROWTH = 4
MEMORY = 0.5  # weight of the newest measurement


class Budget:
    """Learns from `measured` redraws; one for the whole window system."""

    def __init__(self, software: bool) -> None:
        self.moving = START[software]
        self._seconds_each: float | None = None

    def measured(self, drawn: int, seconds: float, moving: bool) -> None:
        """A redraw of `drawn` Gaussians took `seconds`, all else included."""
        each = seconds / max(drawn, FEWEST)
        old = self._seconds_each
        self._seconds_each = each if old is None else old + MEMORY * (each - old)
        if not moving:
            return
        if seconds > 2 * MOVING_S:
            self.moving = max(FEWEST, int(self.moving * 0.7))
        elif seconds < 0.5 * MOVING_S and drawn >= self.moving:
            self.moving = min(MOST_MOVING, int(self.moving * 1.3))

    def next_still(self, drawn: int, total: int) -> int:
        """How many to draw of a resting view of which `drawn` are shown; `drawn` itself when that has to do."""
        if self._seconds_each is None:
            return min(total, max(drawn, self.moving))
        affordable = int(STILL_S / max(self._seconds_each, 1e-9))
        wanted = min(total, drawn * GROWTH, affordable)
        return wanted if wanted >= min(total, 1.3 * drawn) else drawn  # not for a few more
