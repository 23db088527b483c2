"""The verdict's sentences: reasons in plain words for whoever took the photo, and details for who knows the terms.

All pixels are those of the photo as it is. A figure that there is not, or that has no bound, gets words of its own.
"""

from __future__ import annotations

from math import isfinite, log

from ...support.words import counted
from ..report import PoseQuality

CLOSER = "move the camera closer to the photo's view and refine again."
# A focal length that differs by less is not what is wrong with a lens.
FOCAL_WORTH_SAYING_PCT = 0.2
SEARCH_ON = "try more views of the scan, known cameras, or another photo."
# Of each sentence that speaks of a start: these words, and those for a camera that nobody had placed.
WITHOUT_START = {
    CLOSER: SEARCH_ON,
    "turn it towards the scene and refine again.": SEARCH_ON,
    ", or the start was too far off": "",
    ", or the start is too far off": "",
    "a sharper photo or a closer start gives more.": "a sharper photo gives more.",
    "The start camera": "The camera of the first guess",
}


def without_start(reason: str) -> str:
    """A reason as it is to be said of a photo that was searched for without a start: whoever reads it has none to change."""
    for words, others in WITHOUT_START.items():
        reason = reason.replace(words, others)
    return reason


def pixels(value: float) -> str:
    """A distance in the photo as people say it."""
    if value < 0.1:
        return "less than 0.1 px"
    return f"{value:.1f} px" if value < 10 else f"{value:.0f} px"


def per_cent(value: float) -> str:
    """A figure in per cent: with two decimals below 1 %, one below 10 %, and none above."""
    return f"{value:.2f} %" if value < 1 else f"{value:.1f} %" if value < 10 else f"{value:.0f} %"


def share(value: float) -> str:
    """A share 0..1 in whole per cent; an unknown share counts as 0."""
    return f"{100 * value:.0f} %" if isfinite(value) else "0 %"


def trusted(q: PoseQuality) -> tuple[str, ...]:
    fits = f"The splat sits on the photo to {pixels(q.region_offset_px_of_photo)}."
    return fits, f"{counted(q.views_used, 'view')} of the splat from around it lead to the same camera."


def too_few_corners(q: PoseQuality) -> str:
    return f"{_few_corners(q)}; use a photo that shows more of the scan; {CLOSER}"


def few_corners(q: PoseQuality) -> str:
    return f"{_few_corners(q)}; compare photo and splat by eye."


def _few_corners(q: PoseQuality) -> str:
    return f"The splat covers too few corners of the photo to judge the camera ({q.corners})"


def another_place(q: PoseQuality) -> str:
    return (
        "No part of the photo sits on the splat clearly beyond chance; the photo may show another place, or the start was too "
        f"far off; {CLOSER}"
    )


def fits_in_part(q: PoseQuality) -> str:
    if not isfinite(q.region_offset_px_of_photo):
        return "No part of the photo sits on the splat; compare the two by eye."
    return (
        f"The splat sits on {share(q.region_area)} of the photo, with {counted(q.region_corners, 'corner')} to "
        f"{pixels(q.region_offset_px_of_photo)}; compare the two by eye."
    )


def repeats(q: PoseQuality) -> str:
    return (
        "The place repeats itself: other parts of the splat look as much like what the photo shows; check that the camera is "
        "not a window or a tile off."
    )


def start_kept(start: PoseQuality, refined: PoseQuality) -> str:
    return (
        f"The start camera fits the photo better ({share(start.agreement)} of its corners against "
        f"{share(refined.agreement)}) and was kept."
    )


def two_places(distance_pct: float, degrees: float) -> str:
    return (
        f"Another camera, {per_cent(distance_pct)} of the distance to the scene and {degrees:.1f} degrees away, sits on the "
        "photo as well; compare the two by eye."
    )


def tried_again(distance_pct: float, degrees: float, same: bool) -> str:
    came = "the same camera" if same else "another camera"
    return (
        f"Because of a doubt the photo was tried again from a wider fan of views, which led to {came}, {distance_pct:.3f} % of "
        f"the median depth and {degrees:.3f} degrees away; the better one counts."
    )


def tried_in_vain() -> str:
    return "Because of a doubt the photo was tried again from a wider fan of views, which led to no camera."


def few_views(q: PoseQuality) -> str:
    return f"Only {q.views_used} of the rendered views could be matched with the photo; {CLOSER}"


def few_matches(q: PoseQuality) -> str:
    hold = f"{counted(q.inliers, 'match', 'matches')} {'holds' if q.inliers == 1 else 'hold'}"
    return f"Only {hold} the camera; a sharper photo or a closer start gives more."


def uncovered(q: PoseQuality) -> str:
    return f"The matches cover {share(q.coverage)} of the photo; the camera may be tilted where there are none."


def views_apart(q: PoseQuality) -> str:
    if not isfinite(q.rms_px_of_photo):
        return "No match fits the camera that was found; check focal length and distortion."
    return f"The matches fit only to {pixels(q.rms_px_of_photo)}; check focal length and distortion."


def halves_apart(q: PoseQuality) -> str:
    if not (isfinite(q.disagreement_pct) and isfinite(q.disagreement_deg)):
        return "There are too few views to check one half of them against the other."
    return (
        f"Two halves of the views put the camera {per_cent(q.disagreement_pct)} of the distance to the scene and "
        f"{q.disagreement_deg:.2f} degrees apart."
    )


def place_uncertain(q: PoseQuality) -> str:
    if not isfinite(q.translation_std_pct):
        return "The matches leave open where the camera stands."
    return f"Where the camera stands is known only to {per_cent(q.translation_std_pct)} of the distance to the scene."


def focal_uncertain(q: PoseQuality) -> str:
    if not isfinite(q.focal_std_pct):
        return "The matches leave the focal length open; give it, if it is known."
    return f"The focal length is known only to {per_cent(q.focal_std_pct)}; give it, if it is known."


def other_lens(q: PoseQuality) -> str:
    what = "check the lens, or solve for all of it (lens mode full)"
    focal = ""
    if isfinite(q.lens_focal_pct) and abs(q.lens_focal_pct) >= FOCAL_WORTH_SAYING_PCT:
        focal = f", its focal length {abs(q.lens_focal_pct):.1f} % {'longer' if q.lens_focal_pct > 0 else 'shorter'}"
    where = "elsewhere"
    if isfinite(q.lens_shift_pct) and isfinite(q.lens_shift_deg):
        where = f"{per_cent(q.lens_shift_pct)} of the distance to the scene and {q.lens_shift_deg:.2f} degrees off"
    if q.lens_log_odds > 0:
        fits = f"with another one{focal}, which fits better, the camera would stand {where}"
        return f"The lens does not fit the photo: {fits}; {what}."
    return f"The matches do not tell the lens from another one{focal}, with which the camera would stand {where}; {what}."


def details(q: PoseQuality) -> tuple[str, ...]:
    """The figures behind a verdict, as far as they are known."""
    said = [_agreement(q), _region(q)]
    if q.inliers and isfinite(q.rms_px_of_photo):
        matches = f"{counted(q.inliers, 'match', 'matches')} in {counted(q.views_used, 'view')}"
        said.append(
            f"The epipolar RMS of {matches}, over {share(q.coverage)} of the photo, is {q.rms_px_of_photo:.2f} px of the photo."
        )
    if isfinite(q.disagreement_pct) and isfinite(q.disagreement_deg):
        said.append(
            f"Two halves of the views differ by {q.disagreement_pct:.3f} % of the median depth and "
            f"{q.disagreement_deg:.3f} degrees."
        )
    if isfinite(q.translation_std_pct) and isfinite(q.rotation_std_deg):
        focal = f", of the focal length {q.focal_std_pct:.2f} %" if isfinite(q.focal_std_pct) else ""
        said.append(
            f"Standard deviation of the position {q.translation_std_pct:.3f} % of the median depth, of the rotation "
            f"{q.rotation_std_deg:.3f} degrees{focal}."
        )
    if isfinite(q.lens_log_odds):
        said.append(f"Odds of another lens against the one given are 10^{q.lens_log_odds / log(10):.1f} to 1.")
    return tuple(said)


def _agreement(q: PoseQuality) -> str:
    whose = {"refined": "the refined camera", "start": "the start camera", "rejected": "the camera that was found"}[q.of]
    offset = f", with a median offset of {q.offset_px_of_photo:.2f} px of the photo" if isfinite(q.offset_px_of_photo) else ""
    return f"{share(q.agreement)} of {counted(q.corners, 'corner')} of the photo sit on the render through {whose}{offset}."


def _region(q: PoseQuality) -> str:
    if not (q.region_corners and isfinite(q.region_offset_px_of_photo) and isfinite(q.region_expected)):
        return "No part of the photo holds more corners in place than chance explains."
    unlike = f"; {share(q.unrivalled)} of patches there are shown nowhere better" if isfinite(q.unrivalled) else ""
    staying = counted(q.region_corners, "corner")
    return (
        f"In the part that sits, {share(q.region_area)} of the photo, {staying} ({share(q.region_share)} of those "
        f"there; by chance {q.region_expected:.0f}) stay to {q.region_offset_px_of_photo:.2f} px of the photo{unlike}."
    )
