"""How many frames a second a movie shows, as the fraction that its makers mean: 23.976 is 24000/1001."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import cv2

from ..support.quiet import quiet_opencv

NTSC = Fraction(1000, 1001)  # colour television slowed whole rates down by this
SAME = 5e-4  # relative
HIGHEST = 1000  # above that, a rate stands in a file that has none


def movie_frame_rate(path: str | Path) -> Fraction | None:
    """The movie's frames a second; None where it does not tell."""
    with quiet_opencv():
        movie = cv2.VideoCapture(str(path))
    try:
        return exact_rate(float(movie.get(cv2.CAP_PROP_FPS)) if movie.isOpened() else 0.0)
    finally:
        movie.release()


def exact_rate(per_second: float) -> Fraction | None:
    """The whole rate, or the whole rate times 1000/1001, that a decimal number stands for; else the number in thousandths.

    None for what is no rate.
    """
    if not 0.01 <= per_second <= HIGHEST:
        return None
    whole = Fraction(round(per_second) or 1)
    nearest = min((whole, whole * NTSC), key=lambda rate: abs(float(rate) - per_second))
    return nearest if abs(float(nearest) - per_second) <= SAME * per_second else Fraction(round(1000 * per_second), 1000)
