"""How much one redraw may draw, by how long drawing takes on this machine.

While the view moves a sample of the Gaussians is drawn at once, on slow machines with fewer pixels. When it rests, all are
drawn, in as many slices as that takes, so that the window is never held up for long.
"""

from __future__ import annotations

MOVING_S = 0.04  # Target for the splats of one redraw while the view moves.
SLICE_S = 0.03  # Target for a slice of the resting picture; the nearest Gaussians may take several times as long.
FEWEST = 10_000  # In a moving picture, and at the beginning, when the speed is not known yet.
SMALLEST_SLICE = 1_000
LARGEST = 100_000_000
SHRINKS = (1, 2, 4)
SHRINK = {False: 1, True: 2}  # The first guess, by whether the processor does the drawing.
SLICE = {False: 1_000_000, True: 4_000}
MOST_MOVING = 1_000_000
GROWTH = 8.0  # The largest change from one moving picture to the next.
LEAP = 2  # If the sample may grow by this factor, it is drawn again before the view moves on.


class Budget:
    """Learns from measured passes; one for all regions. `shrink`: pixels of the viewport to one of a moving picture's."""

    def __init__(self, software: bool) -> None:
        self.moving, self.shrink = FEWEST, SHRINK[software]
        self.slice = self._first_slice = SLICE[software]

    def begin(self) -> None:
        """Another view is drawn in slices, in which Gaussians may look larger than in the last one."""
        self.slice = min(self.slice, self._first_slice)

    def moved(self, drawn: int, seconds: float) -> None:
        """A moving picture of `drawn` Gaussians took `seconds`."""
        at, factor = SHRINKS.index(self.shrink), 0.8 * MOVING_S / max(seconds, 1e-6)
        if seconds > 2 * MOVING_S:
            if at + 1 < len(SHRINKS):
                self.shrink = SHRINKS[at + 1]
            else:
                self.moving = max(FEWEST, int(self.moving * 0.7))
        elif seconds < 0.2 * MOVING_S and at > 0:
            self.shrink = SHRINKS[at - 1]
        elif factor > 1.1 and drawn >= self.moving:
            self.moving = int(min(MOST_MOVING, self.moving * min(factor, GROWTH)))

    def leaps(self, drawn: int, limit: int) -> bool:
        """Whether so many more than `drawn` may be drawn that another moving picture pays; a fast card is there at once."""
        return min(self.moving, limit) >= LEAP * max(drawn, 1)

    def sliced(self, drawn: int, seconds: float) -> None:
        """A slice of `drawn` Gaussians took `seconds`. A short last one says nothing about longer ones."""
        factor = min(2.0, max(0.25, SLICE_S / max(seconds, 1e-6)))
        if factor < 1 or drawn >= self.slice:
            self.slice = int(min(LARGEST, max(SMALLEST_SLICE, self.slice * factor)))
