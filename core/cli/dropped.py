"""Things worth saying on stderr that are no errors."""

from __future__ import annotations

from ..splats import GaussianScene
from ..splats.sog.streamed import NAME as STREAMED
from ..support.words import counted
from .console import message


def say_dropped(scene: GaussianScene, count: int | None = None) -> None:
    """Tell how many Gaussians of the file were left out, when any were. `count`: the scan's, where the scene is part of it."""
    if scene.format.startswith(STREAMED):
        message(f"Read was a {scene.format}; level 0 is the finest, and convert --level N makes a scan of another one.")
    if scene.dropped:
        total = scene.dropped + (len(scene) if count is None else count)
        message(f"Left out {scene.dropped} of {counted(total, 'Gaussian')}, for a value that is NaN or infinite.")
    if scene.normalised:
        message(f"Put right {counted(scene.normalised, 'Gaussian')} whose rotation or opacity was out of range.")
