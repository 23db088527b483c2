"""What a refinement says of the lens: of each number whether it was given, solved or held, its value, and how sure it is."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, log10

from ..geometry.camera import FloatArray, Intrinsics
from ..geometry.conventions import focal_px_from_35mm
from .final.solution import FittedCamera
from .report import LENS_NUMBERS, LensEvidence, LensNumber, LensState
from .shared.lens import MODES

# A number was solved for where the matches brought its deviation below this share of the prior's; else it is near its guess.
SOLVED_SHARE = 0.5
GROUPS = {
    "the principal point": ("cx", "cy"),
    "k1": ("k1",),
    "k2": ("k2",),
    "p1 and p2": ("p1", "p2"),
    "k3": ("k3",),
    "the squeeze": ("squeeze",),
}


def lens_numbers(solution: FittedCamera, photo: Intrinsics) -> tuple[LensNumber, ...]:
    """The numbers of a solution's lens in the units of the photo at its full size, whose intrinsics were `photo`."""
    k = solution.camera.intrinsics.resized(photo.width, photo.height) if solution.solved else photo
    held: LensState = "given" if solution.prior.calibrated else "held"
    values = (k.focal, k.cx, k.cy, *k.dist, k.fx / k.fy)
    std = _photo_units(solution.lens_std, k)
    told = solution.lens_std < SOLVED_SHARE * solution.prior.std
    states: list[LensState] = ["solved" if i in solution.solved and told[i] else held for i in range(len(values))]
    return tuple(
        LensNumber(name, state, float(value), float(s))
        for name, state, value, s in zip(LENS_NUMBERS, states, values, std, strict=True)
    )


def shared_numbers(lens: Intrinsics, std: FloatArray) -> tuple[LensNumber, ...]:
    """The numbers of a lens that photos share, whose deviations are `std` (9,) of `lens.NAMES`."""
    values = (lens.focal, lens.cx, lens.cy, *lens.dist, lens.fx / lens.fy)
    rows = zip(LENS_NUMBERS, values, _photo_units(std, lens), strict=True)
    return tuple(LensNumber(name, "shared", float(value), float(s)) for name, value, s in rows)


def lens_evidence(solution: FittedCamera, guess: Intrinsics) -> LensEvidence | None:
    """What a photo can tell others of its lens, which was guessed as `guess`; None where not all of it was solved for, or where
    it was given, for a calibration is that of its photo alone.
    """
    if solution.information is None or not set(MODES["full"]) <= set(solution.solved) or solution.prior.calibrated:
        return None
    return LensEvidence(solution.information, guess, float(solution.prior.std[0]))


def lens_sentence(numbers: Sequence[LensNumber], photo: Intrinsics) -> str:
    """What was solved for, in plain words; empty where nothing was."""
    solved = {number.name for number in numbers if number.state == "solved"}
    if not solved:
        return ""
    how = "solved for" if "focal" in solved else numbers[0].state
    others = [title for title, names in GROUPS.items() if solved.issuperset(names)]
    more = f"; {', '.join(others)} solved for" if others else ""
    return f"Focal length {focal_words(numbers[0], photo)}, {how}{more}."


def focal_words(focal: LensNumber, photo: Intrinsics) -> str:
    """A focal length with its deviation, to that one's first digit."""
    px_per_mm = focal_px_from_35mm(1.0, photo.width, photo.height)
    mm, std = focal.value / px_per_mm, focal.std / px_per_mm
    sure = isfinite(std) and std > 0
    digits = min(max(-int(log10(std) // 1), 1), 4) if sure else 1
    return f"{mm:.{digits}f} mm{f' +- {std:.1g} mm' if sure else ''} (35 mm equivalent)"


def crop_sentence(solution: FittedCamera, focal_35mm: float, photo: Intrinsics) -> str:
    """What it means that EXIF's focal length (`focal_35mm`, mm) was given up: the photo is not as it was taken."""
    found = solution.camera.intrinsics.resized(photo.width, photo.height).focal / focal_px_from_35mm(
        1.0, photo.width, photo.height
    )
    return (
        f"The photo seems to be cropped, or zoomed since it was taken: its EXIF says {focal_35mm:.3g} mm, the matches "
        f"{found:.3g} mm; use the photo as the camera wrote it, if there is one."
    )


def _photo_units(std: FloatArray, k: Intrinsics) -> FloatArray:
    """Deviations (9,) of `lens.NAMES` as those of the numbers themselves: focal length and principal point in pixels."""
    out = std.copy()
    out[:3] *= k.focal
    out[8] *= k.fx / k.fy
    return out
