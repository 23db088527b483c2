"""What is told of a camera that pins placed: always that it is pins, and how sure they are; never that it is trusted."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import FloatArray
from ...support.words import counted
from ..verdict.sentences import per_cent, pixels
from .report import PinReport

# From so many per cent of the distance on, the numbers say no more than that the pins do not hold the camera.
NO_HOLD_PCT = 100.0
NAMED = 3  # outliers that are named, the worst first


def placed(report: PinReport) -> str:
    """How well the pins fit, and what is known of the camera by them."""
    fits = f"Placed by pins: {counted(len(report.pins), 'pin')} to {pixels(float(np.median(report.errors_px)))}"
    if not report.translation_std_pct < NO_HOLD_PCT:
        return f"{fits}."
    sure = f"about {per_cent(report.translation_std_pct)} of the distance and {report.rotation_std_deg:.1f} degrees sure"
    if not report.solved_focal:
        return f"{fits}, {sure}."
    k = report.camera.intrinsics
    return f"{fits}, {sure}; the focal length is {k.focal:.0f} px, about {per_cent(report.focal_std_pct)} sure."


def guided(count: int) -> str:
    """That fewer than three pins place nothing."""
    return f"{counted(count, 'pin')} only {'guides' if count == 1 else 'guide'} the camera; three place it."


def three_always_fit() -> str:
    return "Three pins always fit, right or wrong; a fourth one shows whether they are right."


def two_cameras(distance_pct: float, degrees: float) -> str:
    return (
        f"Another camera, {per_cent(distance_pct)} of the distance and {degrees:.0f} degrees away, fits the pins as well; a "
        "further pin, far from the others, tells them apart."
    )


def spread_out() -> str:
    return "The pins hold the camera loosely; spread them over the photo, and over near and far."


def one_line() -> str:
    return "The pins lie on one line or at one place and hold no camera, which stays where it is; set one beside them."


def unbounded() -> str:
    return "The pins leave the camera open, for they lie on one line or at one place; set one beside them."


def contradicted(errors_px: FloatArray) -> str:
    off = pixels(float(np.median(errors_px)))
    return f"The pins contradict each other: half of them lie {off} off or more; check them, and the focal length."


def left_behind(errors_px: FloatArray) -> str:
    """That a refinement left the pins that it was to hold."""
    off = float(np.median(errors_px))
    if not isfinite(off):
        return "The pins lie behind the refined camera; compare photo and splat by eye, or keep the camera of the pins."
    return f"The pins lie {pixels(off)} off at the refined camera; compare photo and splat by eye, or weigh the pins more."


def outliers(numbers: NDArray[np.int64], errors_px: FloatArray) -> list[str]:
    """Of each pin that lies far off, the worst first, that it does."""
    worst = sorted((int(n) for n in numbers), key=lambda n: -float(errors_px[n]))[:NAMED]
    return [
        f"Pin {n + 1} lies behind the camera; delete it or set it again."
        if not isfinite(errors_px[n])
        else f"Pin {n + 1} lies {pixels(float(errors_px[n]))} off; check it."
        for n in worst
    ]
