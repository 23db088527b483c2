"""The lens as an unknown: which of its numbers are solved for, how a step changes them, and the prior on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...geometry.camera import FloatArray, Intrinsics, Pose
from ...geometry.lie import se3_exp

LensMode = Literal["fixed", "focal", "radial", "full"]

# The numbers that a step of the lens changes, in this order; each mode solves for the first FREE[mode] of them. PRIOR_STD holds
# the standard deviations of the prior: a focal length guessed from EXIF or by eye is sometimes off by a quarter, k1 and k2 of
# phones by a tenth, and principal points by some per cent.
NAMES = ("log f", "k1", "k2", "cx / f", "cy / f")
PRIOR_STD = np.array([0.3, 0.1, 0.1, 0.02, 0.02])
FREE: dict[LensMode, int] = {"fixed": 0, "focal": 1, "radial": 3, "full": 5}
MAX_LOG_STEP = 0.2


@dataclass(frozen=True)
class CameraUnknowns:
    """The unknowns of a fit: a pose, and the intrinsics (of the image that is matched)."""

    pose: Pose
    intrinsics: Intrinsics

    def moved(self, step: FloatArray) -> CameraUnknowns:
        """The unknowns after a step (6 + free lens numbers,): T <- exp(xi) T, f <- f exp(step); the other numbers are added."""
        lens = np.zeros(len(NAMES))
        lens[: len(step) - 6] = step[6:]
        k = moved_lens(self.intrinsics, lens) if len(step) > 6 else self.intrinsics
        return CameraUnknowns(se3_exp(step[:6]) @ self.pose, k)


def moved_lens(k: Intrinsics, step: FloatArray) -> Intrinsics:
    """`k` after a step (5,) in the order of NAMES."""
    grow = float(np.exp(np.clip(step[0], -MAX_LOG_STEP, MAX_LOG_STEP)))
    k1, k2, p1, p2, k3 = k.dist
    return replace(
        k,
        fx=k.fx * grow,
        fy=k.fy * grow,
        dist=(k1 + float(step[1]), k2 + float(step[2]), p1, p2, k3),
        cx=k.cx + float(step[3]) * k.focal,
        cy=k.cy + float(step[4]) * k.focal,
    )


def lens_difference(now: Intrinsics, prior: Intrinsics) -> FloatArray:
    """How far `now` lies from `prior`, (5,) in the order of NAMES."""
    return np.array(
        [
            np.log(now.focal / prior.focal),
            now.dist[0] - prior.dist[0],
            now.dist[1] - prior.dist[1],
            (now.cx - prior.cx) / prior.focal,
            (now.cy - prior.cy) / prior.focal,
        ]
    )
