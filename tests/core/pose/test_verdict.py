"""The verdict and its words: every figure in one unit, few corners told from wrong ones, and no sentence that holds a nan."""

import inspect
import itertools
import math
import re
from dataclasses import fields, replace

import numpy as np
import pytest

from core.geometry.camera import Intrinsics, Pose
from core.pose.final.solution import FittedCamera
from core.pose.report import PoseQuality
from core.pose.report_json import quality_to_dict
from core.pose.search.loop import LOOKS_AWAY, TOO_FEW
from core.pose.shared.lens import CALIBRATED_STD, CameraUnknowns, LensPrior
from core.pose.shared.matches import ViewMatches
from core.pose.verdict import sentences
from core.pose.verdict.regions import Region
from core.pose.verdict.verdict import LoopMatches, assess, fits_better, is_unsettled, judge
from core.pose.verdict.verify import FinalView

GOOD = PoseQuality(
    of="refined",
    pose=Pose(),
    photo_long_side_px=4000,
    median_depth=3.0,
    corners=500,
    agreement=0.8,
    offset_px_of_photo=0.84,
    similarity=0.9,
    views_used=7,
    inliers=1500,
    coverage=0.9,
    rms_px_of_photo=1.2,
    disagreement_pct=0.03,
    disagreement_deg=0.02,
    translation_std_pct=0.05,
    rotation_std_deg=0.02,
    focal_std_pct=0.05,
    lens_log_odds=-4.0,
    region_corners=400,
    region_share=0.8,
    region_expected=3.0,
    region_area=0.6,
    region_offset_px_of_photo=0.84,
    unrivalled=1.0,
)


def said(quality):
    verdict, reasons = judge(quality)
    return verdict, " ".join(reasons)


def test_a_good_pose_is_trusted_in_plain_words():
    verdict, reasons = judge(GOOD)
    assert verdict == "trusted"
    assert reasons[0] == "The splat sits on the photo to 0.8 px."
    text = " ".join(reasons)
    assert not re.search(r"epipolar|RMS|deviation|median|covariance|corner", text), "terms belong into the details"
    details = " ".join(sentences.details(GOOD))
    for figure in ("80 % of 500 corners", "0.84 px of the photo", "1500 matches in 7 views", "1.20 px", "0.030 %", "0.050 %"):
        assert figure in details


def test_few_corners_that_sit_are_too_few_to_judge_and_no_other_place():
    verdict, text = said(replace(GOOD, corners=29, region_corners=25))
    assert verdict == "check"
    assert "too few corners of the photo to judge the camera (29)" in text and "another place" not in text


@pytest.mark.parametrize("corners", [29, 9, 1, 0])
def test_few_corners_that_support_nothing_leave_the_camera_and_say_why(corners):
    nothing = {"agreement": 0.0, "offset_px_of_photo": math.nan, "region_corners": 0, "region_offset_px_of_photo": math.nan}
    verdict, text = said(replace(GOOD, corners=corners, **nothing))
    assert verdict == "failed" and "too few corners" in text and "another place" not in text and "nan" not in text


def test_corners_that_stay_nowhere_more_often_than_by_chance_are_another_place():
    verdict, text = said(replace(GOOD, agreement=0.1, region_corners=0, region_area=0.0, region_offset_px_of_photo=math.nan))
    assert verdict == "failed" and "No part of the photo sits" in text and "another place" in text


def test_corners_that_chance_would_leave_in_place_as_well_support_nothing():
    assert judge(replace(GOOD, region_corners=60, region_expected=20.0))[0] == "trusted"
    assert judge(replace(GOOD, region_corners=30, region_expected=20.0))[0] == "failed"


def test_a_photo_most_of_which_is_hidden_is_trusted_by_the_part_that_is_not():
    hidden = replace(GOOD, agreement=0.14, region_corners=80, region_area=0.2, offset_px_of_photo=20.0)
    verdict, reasons = judge(hidden)
    assert verdict == "trusted" and reasons[0] == "The splat sits on the photo to 0.8 px."


@pytest.mark.parametrize(
    ("offset", "share", "inliers", "verdict"),
    [(3.0, 0.39, 36, "check"), (3.4, 0.39, 36, "failed"), (3.4, 0.39, 900, "check"), (3.4, 0.5, 900, "trusted")],
)
def test_a_part_in_which_few_corners_stay_loosely_needs_matches_that_hold_the_camera(offset, share, inliers, verdict):
    """The photo is 4000 px long, so that 3.125 px of it are half a pixel at a long side of 640."""
    assert judge(replace(GOOD, region_share=share, region_offset_px_of_photo=offset, inliers=inliers))[0] == verdict


def test_what_other_views_may_settle_is_told_from_what_the_photo_lacks():
    unsettled = {"disagreement_pct": 5.7, "disagreement_deg": math.nan, "views_used": 3, "inliers": 60, "region_area": 0.02}
    for name, value in unsettled.items():
        quality = replace(GOOD, **{name: value})
        assert is_unsettled(judge(quality)[0], quality), name
    for name, value in {"coverage": 0.1, "lens_shift_pct": 4.0, "focal_std_pct": 2.0}.items():
        quality = replace(GOOD, **{name: value})
        assert judge(quality)[0] == "check" and not is_unsettled("check", quality), name
    assert not is_unsettled("trusted", GOOD) and not is_unsettled("failed", None)
    assert is_unsettled("check", replace(GOOD, of="start"))


DOUBTS = {
    "region_corners": (30, "compare the two by eye"),
    "region_area": (0.05, "sits on 5 % of the photo"),
    "region_offset_px_of_photo": (5.5, "corners to 5.5 px"),
    "unrivalled": (0.4, "repeats itself"),
    "views_used": (3, "Only 3 of the rendered views"),
    "inliers": (60, "Only 60 matches"),
    "coverage": (0.1, "cover 10 % of the photo"),
    "rms_px_of_photo": (4.1, "fit only to 4.1 px"),
    "disagreement_pct": (0.6, "0.60 % of the distance"),
    "disagreement_deg": (0.5, "0.50 degrees apart"),
    "translation_std_pct": (2.5, "known only to 2.5 % of the distance"),
    "focal_std_pct": (1.5, "focal length is known only to 1.5 %"),
}


@pytest.mark.parametrize("name", DOUBTS)
def test_each_doubt_has_its_sentence(name):
    value, sentence = DOUBTS[name]
    verdict, reasons = judge(replace(GOOD, **{name: value}))
    assert verdict == "check" and len(reasons) == 1 and sentence in reasons[0]


@pytest.mark.parametrize(
    ("odds", "pct", "deg", "sentence"),
    [
        (40.0, 1.2, 0.1, "does not fit the photo: with another one, which fits better, the camera would stand 1.2 %"),
        (-2.0, 0.1, 0.5, "do not tell the lens from another one, with which the camera would stand 0.10 %"),
        (-11.0, 1.2, 0.5, ""),
        (-9.0, 1.2, 0.5, "do not tell the lens"),
        (40.0, 0.2, 0.1, ""),
        (math.nan, 1.2, 0.1, "do not tell the lens"),
    ],
)
def test_a_lens_is_doubted_where_another_may_be_right_and_would_move_the_camera(odds, pct, deg, sentence):
    verdict, reasons = judge(replace(GOOD, lens_log_odds=odds, lens_shift_pct=pct, lens_shift_deg=deg))
    assert verdict == ("check" if sentence else "trusted")
    assert sentence in reasons[0]


@pytest.mark.parametrize(("pct", "words"), [(3.14, "its focal length 3.1 % longer"), (-0.5, "its focal length 0.5 % shorter")])
def test_the_doubt_of_a_lens_says_which_focal_length_fits_and_how_to_have_it_solved_for(pct, words):
    _, reasons = judge(replace(GOOD, lens_log_odds=40.0, lens_shift_pct=1.2, lens_focal_pct=pct))
    assert words in reasons[0] and "lens mode full" in reasons[0]
    _, reasons = judge(replace(GOOD, lens_log_odds=40.0, lens_shift_pct=1.2, lens_focal_pct=0.1))
    assert "focal length" not in reasons[0]


def test_no_sentence_ever_holds_a_nan_or_an_infinity():
    floats = [f.name for f in fields(GOOD) if isinstance(getattr(GOOD, f.name), float)]
    spoilt = [{name: value} for name in floats for value in (math.nan, math.inf)]
    spoilt += [a | b for a, b in itertools.combinations(spoilt, 2)]
    for change in spoilt:
        for of, corners in itertools.product(("refined", "start", "rejected"), (0, 12, 500)):
            quality = replace(GOOD, **{"of": of, "corners": corners, **change})
            start = replace(quality, agreement=0.5)
            said_again = (
                sentences.tried_again(0.4, 0.1, True),
                sentences.tried_again(5.1, 2.1, False),
                sentences.tried_in_vain(),
            )
            said_again += (sentences.two_places(5.1, 2.1), sentences.start_kept(start, replace(GOOD)))
            for sentence in (*judge(quality)[1], *sentences.details(quality), *said_again):
                assert not re.search(r"\b(nan|inf)\b", sentence), (change, sentence)
                assert sentence.endswith(".") and (sentence[0].isupper() or sentence[0].isdigit())


@pytest.mark.parametrize("name", ["disagreement_pct", "translation_std_pct", "rms_px_of_photo", "focal_std_pct"])
def test_a_figure_that_there_is_not_is_a_doubt(name):
    assert judge(replace(GOOD, **{name: math.nan}))[0] == "check"
    assert judge(replace(GOOD, **{name: math.inf}))[0] == "check"


@pytest.mark.parametrize("name", ["region_area", "region_offset_px_of_photo", "unrivalled"])
def test_a_wrong_number_is_no_agreement(name):
    assert judge(replace(GOOD, **{name: math.nan}))[0] != "trusted"


@pytest.mark.parametrize(("photo", "rms", "verdict"), [(4000, 3.0, "trusted"), (4000, 3.2, "check"), (640, 0.99, "trusted")])
def test_the_rms_has_one_threshold_whatever_the_photo(photo, rms, verdict):
    """One pixel of the photo at a long side of 1280, or of the photo itself where that is smaller."""
    quality = replace(GOOD, photo_long_side_px=photo, rms_px_of_photo=rms, region_offset_px_of_photo=0.4)
    assert judge(quality)[0] == verdict


def solution(stage, long_side, rms_px):
    k = Intrinsics(long_side, long_side // 2, 500.0, 500.0, 300.0, 200.0)
    return FittedCamera(
        CameraUnknowns(Pose(), k),
        stage,
        rms_px,
        0.001,
        0.01,
        CALIBRATED_STD,
        0.002,
        0.01,
        LensPrior(k, CALIBRATED_STD, "calibrated"),
    )


@pytest.mark.parametrize(("stage", "long_side", "rms_px"), [("loop", 640, 0.3), ("joint", 1280, 0.6)])
def test_the_loop_and_the_last_stage_are_judged_in_the_same_pixels(stage, long_side, rms_px):
    """The same error, measured on pictures of two sizes, is one figure in the report."""
    photo = Intrinsics(5120, 2560, 4000.0, 4000.0, 2560.0, 1280.0)
    loop = Intrinsics(640, 320, 500.0, 500.0, 320.0, 160.0)
    views = [ViewMatches(Pose(), np.zeros((5, 2)), np.zeros((5, 2)), np.ones(5), np.ones(5))]
    seen = FinalView(500, 0.8, 2.4, 0.9, 1.0, Region(80, 0.7, 2.0, 0.3, 0.4, 0.3, 0.9), photo_px=8.0)
    quality = assess(solution(stage, long_side, rms_px), LoopMatches(views, loop, 2.0), seen, photo)
    assert quality.rms_px_of_photo == pytest.approx(2.4)
    assert quality.region_offset_px_of_photo == pytest.approx(2.4) and quality.region_corners == 80
    assert quality.offset_px_of_photo == 2.4 and quality.pose == Pose() and quality.of == "refined"
    assert quality.disagreement_pct == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("start", "refined", "kept"),
    [
        ((500, 0.8), (500, 0.7), True),
        ((500, 0.74), (500, 0.7), False),
        ((12, 1.0), (500, 0.5), False),
        ((80, 0.9), (3, 0.3), True),
        ((500, 0.10), (500, 0.07), True),
        ((500, 0.10), (500, 0.08), False),
    ],
)
def test_a_start_is_kept_only_on_enough_corners(start, refined, kept):
    views = [FinalView(corners, agreement, 1.0, 0.9, 1.0) for corners, agreement in (start, refined)]
    assert fits_better(*views, margin=0.05) == kept


def test_the_evidence_goes_into_json_whole():
    data = quality_to_dict(replace(GOOD, rms_px_of_photo=math.nan, translation_std_pct=math.inf))
    assert data["rms_px_of_photo"] is None and data["translation_std_pct"] is None
    assert data["pose"] == {"R": np.eye(3).tolist(), "t": [0.0, 0.0, 0.0]} and data["of"] == "refined"
    assert set(data) == {f.name for f in fields(PoseQuality)}


def test_a_photo_that_had_no_start_gets_no_advice_about_one():
    """Every sentence of a verdict, and those of the loop, said of a camera that the map gave."""
    poor = replace(GOOD, corners=12, agreement=0.1, views_used=1, inliers=1, focal_std_pct=5.0, lens_shift_pct=5.0)
    speakers = [f for f in vars(sentences).values() if inspect.isfunction(f) and not f.__name__.startswith("_")]
    made = [LOOKS_AWAY, TOO_FEW]
    for speak in speakers:
        parameters = inspect.signature(speak).parameters.values()
        if parameters and all(p.annotation == "PoseQuality" for p in parameters):
            told = speak(*[poor] * len(parameters))
            made += [told] if isinstance(told, str) else told
    about = re.compile(r"\bstart\b|closer|refine again|turn it")
    assert len([sentence for sentence in made if about.search(sentence)]) >= 6
    for sentence in made:
        changed = sentences.without_start(sentence)
        assert not about.search(changed), changed
        assert changed.endswith(".") and ";." not in changed and ", ;" not in changed
    assert sentences.without_start(sentences.another_place(poor)) == (
        "No part of the photo sits on the splat clearly beyond chance; the photo may show another place; try more views of "
        "the scan, known cameras, or another photo."
    )
