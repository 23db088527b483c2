"""The lens as an unknown: which of its numbers are solved for, how a step changes them, and the prior on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ...geometry.conventions import focal_px_from_35mm
from ...geometry.lie import se3_exp

LensMode = Literal["fixed", "focal", "full"]
# Which of the lens numbers a fit solves for: their places in NAMES, in rising order.
Free = tuple[int, ...]

# The numbers that a step of the lens changes, in this order.
NAMES = ("log f", "cx / f", "cy / f", "k1", "k2", "p1", "p2", "k3", "log fx / fy")
ALL: Free = tuple(range(len(NAMES)))
FOCAL: Free = (0,)
SQUEEZE = NAMES.index("log fx / fy")
# Pixels are taken for square, or as oblong as they were given, unless the matches say otherwise (`final/squeeze.py`).
MODES: dict[LensMode, Free] = {"fixed": (), "focal": FOCAL, "full": ALL[:SQUEEZE]}

LensSource = Literal["calibrated", "exif", "guess"]
# Standard deviations of what is known of a lens, in the order of NAMES, by the source that told it.
# A guess, by eye or habit: the focal length is sometimes off by a quarter; principal points of phones, crops and stabilised
# video lie some per cent off the centre; k1 and k2 of phones reach a tenth, tangential and third radial terms some thousandths
# and hundredths; pixels are square to a thousandth.
# EXIF: its focal length in 35 mm terms is rounded to whole millimetres, and the lens breathes with its focus.
# A calibration is known to what calibrations state: some tenths of a pixel in a thousand, and the distortion likewise at the
# border of the picture.
PRIOR_STD: dict[LensSource, FloatArray] = {
    "guess": np.array([0.3, 0.02, 0.02, 0.1, 0.1, 0.003, 0.003, 0.05, 0.001]),
    "exif": np.array([0.03, 0.02, 0.02, 0.1, 0.1, 0.003, 0.003, 0.05, 0.001]),
    "calibrated": np.array([2e-4, 2e-4, 2e-4, 4e-4, 4e-4, 1e-4, 1e-4, 4e-4, 1e-4]),
}
GUESS_STD, CALIBRATED_STD = PRIOR_STD["guess"], PRIOR_STD["calibrated"]
# A guessed focal length that lies this near to EXIF's is EXIF's.
SAME_FOCAL = 1e-3
# A lens this many deviations from what EXIF says was photographed with another one: a crop, or a picture that was resized.
REFUTED = 3.0
MAX_LOG_STEP = 0.2


@dataclass(frozen=True, eq=False)
class LensPrior:
    """What is known of a lens before anything is matched: its numbers as they were given, the standard deviations (9,) of
    NAMES, and who told them.
    """

    lens: Intrinsics
    std: FloatArray
    source: LensSource

    @classmethod
    def of(cls, camera: Camera, focal_35mm: float | None = None) -> LensPrior:
        """The prior that the source of a camera's lens implies; `focal_35mm`: what the photo's EXIF says (mm)."""
        k = camera.intrinsics
        source: LensSource = "guess" if camera.focal_guessed else "calibrated"
        if camera.focal_guessed and focal_35mm:
            by_exif = focal_px_from_35mm(focal_35mm, k.width, k.height)
            source = "exif" if abs(np.log(k.focal / by_exif)) < SAME_FOCAL else "guess"
        return cls(k, PRIOR_STD[source], source)

    @property
    def calibrated(self) -> bool:
        """Whether somebody measured the lens, so that it is given rather than guessed."""
        return self.source == "calibrated"

    def refuted(self, now: Intrinsics) -> bool:
        """Whether the lens `now` that was solved for shows that EXIF's focal length is not the photo's."""
        return self.source == "exif" and bool(abs(self.off(now)[0]) > REFUTED * self.std[0])

    def resized(self, width: int, height: int) -> LensPrior:
        """The prior of the same lens for the image resampled to `width` x `height`."""
        return replace(self, lens=self.lens.resized(width, height))

    def solving(self, free: Free) -> LensPrior:
        """The prior where the numbers `free` are to be solved for whatever the source says: they are as open as a guess."""
        std = self.std.copy()
        std[list(free)] = np.maximum(std, GUESS_STD)[list(free)]
        return replace(self, std=std)

    def doubted(self) -> LensPrior:
        """The prior that is left if the source is wrong: that of a guess, around the same numbers."""
        return replace(self, std=GUESS_STD, source="guess")

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
