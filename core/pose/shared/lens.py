"""The lens as an unknown: which of its numbers are solved for, how a step changes them, and the prior on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ...geometry.lie import se3_exp

LensMode = Literal["fixed", "focal", "full"]
# Which of the lens numbers a fit solves for: their places in NAMES, in rising order.
Free = tuple[int, ...]

# The numbers that a step of the lens changes, in this order.
NAMES = ("log f", "cx / f", "cy / f", "k1", "k2", "p1", "p2", "k3", "log fx / fy")
ALL: Free = tuple(range(len(NAMES)))
FOCAL: Free = (0,)
MODES: dict[LensMode, Free] = {"fixed": (), "focal": FOCAL, "full": ALL}

# Standard deviations of the prior, in the order of NAMES. A lens that nobody told: the focal length, guessed by eye or habit,
# is sometimes off by a quarter; principal points of phones, crops and stabilised video lie some per cent off the centre; k1 and
# k2 of phones reach a tenth, and tangential and third radial terms some thousandths and hundredths; pixels are square but for
# scans and rescaled video.
GUESS_STD = np.array([0.3, 0.02, 0.02, 0.1, 0.1, 0.003, 0.003, 0.05, 0.01])
# A calibration is known to about what calibrations state: some tenths of a pixel in a thousand, and the distortion likewise at
# the border of the picture.
CALIBRATED_STD = np.array([2e-4, 2e-4, 2e-4, 4e-4, 4e-4, 1e-4, 1e-4, 4e-4, 1e-4])
MAX_LOG_STEP = 0.2


@dataclass(frozen=True, eq=False)
class LensPrior:
    """What is known of a lens before anything is matched: its numbers as they were given, and the standard deviations (9,) of
    NAMES. `calibrated`: somebody measured it, so that it is given rather than guessed.
    """

    lens: Intrinsics
    std: FloatArray
    calibrated: bool

    @classmethod
    def of(cls, camera: Camera) -> LensPrior:
        """The prior that the source of a camera's lens implies."""
        if not camera.focal_guessed:
            return cls(camera.intrinsics, CALIBRATED_STD, True)
        std = GUESS_STD.copy()
        if camera.focal_std is not None:
            std[0] = camera.focal_std
        return cls(camera.intrinsics, std, False)

    def resized(self, width: int, height: int) -> LensPrior:
        """The prior of the same lens for the image resampled to `width` x `height`."""
        return replace(self, lens=self.lens.resized(width, height))

    def solving(self, free: Free) -> LensPrior:
        """The prior where the numbers `free` are to be solved for whatever the source says: they are as open as a guess."""
        std = self.std.copy()
        std[list(free)] = np.maximum(std, GUESS_STD)[list(free)]
        return replace(self, std=std)

    def doubted(self) -> LensPrior:
        """The prior that a calibration leaves if it is wrong: that of a guess, around the same numbers."""
        return replace(self, std=GUESS_STD)

    def off(self, now: Intrinsics) -> FloatArray:
        """How far `now` lies from the prior's lens, (9,) in the order of NAMES."""
        return lens_difference(now, self.lens)

    @property
    def information(self) -> FloatArray:
        """Inverse variances (9,)."""
        return np.asarray(self.std**-2.0)


@dataclass(frozen=True)
class CameraUnknowns:
    """The unknowns of a fit: a pose, and the intrinsics (of the image that is matched)."""

    pose: Pose
    intrinsics: Intrinsics

    def moved(self, step: FloatArray, free: Free) -> CameraUnknowns:
        """The unknowns after a step (6 + F,): T <- exp(xi) T, then the F free lens numbers, f <- f exp(step), the others
        added.
        """
        if not free:
            return CameraUnknowns(se3_exp(step[:6]) @ self.pose, self.intrinsics)
        lens = np.zeros(len(NAMES))
        lens[list(free)] = step[6:]
        return CameraUnknowns(se3_exp(step[:6]) @ self.pose, moved_lens(self.intrinsics, lens))


def moved_lens(k: Intrinsics, step: FloatArray) -> Intrinsics:
    """`k` after a step (9,) in the order of NAMES."""
    grow = float(np.exp(np.clip(step[0], -MAX_LOG_STEP, MAX_LOG_STEP)))
    squeeze = float(np.exp(0.5 * step[8]))
    k1, k2, p1, p2, k3 = (d + float(s) for d, s in zip(k.dist, step[3:8], strict=True))
    return replace(
        k,
        fx=k.fx * grow * squeeze,
        fy=k.fy * grow / squeeze,
        cx=k.cx + float(step[1]) * k.focal,
        cy=k.cy + float(step[2]) * k.focal,
        dist=(k1, k2, p1, p2, k3),
    )


def lens_difference(now: Intrinsics, prior: Intrinsics) -> FloatArray:
    """How far `now` lies from `prior`, (9,) in the order of NAMES."""
    return np.array(
        [
            np.log(now.focal / prior.focal),
            (now.cx - prior.cx) / prior.focal,
            (now.cy - prior.cy) / prior.focal,
            *np.subtract(now.dist, prior.dist),
            np.log(now.fx / now.fy) - np.log(prior.fx / prior.fy),
        ]
    )
