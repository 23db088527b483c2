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
from core.pose.shared.lens import CameraUnknowns
from core.pose.shared.matches import ViewMatches
from core.pose.verdict import sentences
from core.pose.verdict.verdict import LoopMatches, assess, fits_better, judge
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


@pytest.mark.parametrize("agreeing", [1.0, 0.5])
def test_few_corners_that_agree_are_too_few_to_judge_and_no_other_place(agreeing):
    verdict, text = said(replace(GOOD, corners=29, agreement=agreeing))
    assert verdict == "check"
    assert "too few corners of the photo to judge the camera (29)" in text and "another place" not in text


@pytest.mark.parametrize(("corners", "agreement"), [(29, 0.1), (9, 1.0), (1, 1.0), (0, 0.0)])
def test_few_corners_that_support_nothing_leave_the_camera_and_say_why(corners, agreement):
    verdict, text = said(replace(GOOD, corners=corners, agreement=agreement, offset_px_of_photo=math.nan))
    assert verdict == "failed" and "too few corners" in text and "another place" not in text and "nan" not in text


def test_many_corners_that_wander_off_are_another_place():
    verdict, text = said(replace(GOOD, agreement=0.1))
    assert verdict == "failed" and "Only 10 % of the photo's corners" in text and "another place" in text


DOUBTS = {
    "agreement": (0.3, "compare the two by eye"),
    "views_used": (3, "Only 3 of the rendered views"),
    "inliers": (60, "Only 60 matches"),
    "coverage": (0.1, "cover 10 % of the photo"),
    "rms_px_of_photo": (4.1, "fit only to 4.1 px"),
    "disagreement_pct": (0.6, "0.60 % of the distance"),
    "disagreement_deg": (0.5, "0.50 degrees apart"),
    "translation_std_pct": (2.5, "known only to 2.5 % of the distance"),
    "focal_std_pct": (1.5, "focal length is known only to 1.5 %"),
    "lens_gain_pct": (40.0, "fit 40 % better"),
}


@pytest.mark.parametrize("name", DOUBTS)
def test_each_doubt_has_its_sentence(name):
    value, sentence = DOUBTS[name]
    verdict, reasons = judge(replace(GOOD, **{name: value}))
    assert verdict == "check" and len(reasons) == 1 and sentence in reasons[0]


def test_no_sentence_ever_holds_a_nan_or_an_infinity():
    floats = [f.name for f in fields(GOOD) if isinstance(getattr(GOOD, f.name), float)]
    spoilt = [{name: value} for name in floats for value in (math.nan, math.inf)]
    spoilt += [a | b for a, b in itertools.combinations(spoilt, 2)]
    for change in spoilt:
        for of, corners in itertools.product(("refined", "start", "rejected"), (0, 12, 500)):
            quality = replace(GOOD, **{"of": of, "corners": corners, **change})
            start = replace(quality, agreement=0.5)
            for sentence in (*judge(quality)[1], *sentences.details(quality), sentences.start_kept(start, replace(GOOD))):
                assert not re.search(r"\b(nan|inf)\b", sentence), (change, sentence)
                assert sentence.endswith(".") and (sentence[0].isupper() or sentence[0].isdigit())


@pytest.mark.parametrize("name", ["disagreement_pct", "translation_std_pct", "rms_px_of_photo"])
def test_a_figure_that_there_is_not_is_a_doubt(name):
    assert judge(replace(GOOD, **{name: math.nan}))[0] == "check"
    assert judge(replace(GOOD, **{name: math.inf}))[0] == "check"


def test_a_wrong_number_is_no_agreement():
    assert judge(replace(GOOD, agreement=math.nan))[0] != "trusted"


@pytest.mark.parametrize(("photo", "rms", "verdict"), [(4000, 3.0, "trusted"), (4000, 3.2, "check"), (640, 0.99, "trusted")])
def test_the_rms_has_one_threshold_whatever_the_photo(photo, rms, verdict):
    """One pixel of the photo at a long side of 1280, or of the photo itself where that is smaller."""
    assert judge(replace(GOOD, photo_long_side_px=photo, rms_px_of_photo=rms))[0] == verdict


def solution(stage, long_side, rms_px):
    k = Intrinsics(long_side, long_side // 2, 500.0, 500.0, 300.0, 200.0)
    return FittedCamera(CameraUnknowns(Pose(), k), stage, rms_px, 0.001, 0.01, math.nan, 0.002, 0.01, "fixed")


@pytest.mark.parametrize(("stage", "long_side", "rms_px"), [("loop", 640, 0.3), ("joint", 1280, 0.6)])
def test_the_loop_and_the_last_stage_are_judged_in_the_same_pixels(stage, long_side, rms_px):
    """The same error, measured on pictures of two sizes, is one figure in the report."""
    photo = Intrinsics(5120, 2560, 4000.0, 4000.0, 2560.0, 1280.0)
    loop = Intrinsics(640, 320, 500.0, 500.0, 320.0, 160.0)
    views = [ViewMatches(Pose(), np.zeros((5, 2)), np.zeros((5, 2)), np.ones(5), np.ones(5))]
    seen = FinalView(500, 0.8, 2.4, 0.9, 1.0)
    quality = assess(solution(stage, long_side, rms_px), LoopMatches(views, loop, 2.0), seen, photo)
    assert quality.rms_px_of_photo == pytest.approx(2.4)
    assert quality.offset_px_of_photo == 2.4 and quality.pose == Pose() and quality.of == "refined"
    assert quality.disagreement_pct == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("start", "refined", "kept"),
    [
        ((500, 0.8), (500, 0.7), True),
        ((500, 0.74), (500, 0.7), False),
        ((12, 1.0), (500, 0.5), False),
        ((80, 0.9), (3, 0.3), True),
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
    poor = replace(GOOD, corners=12, agreement=0.1, views_used=1, inliers=1, focal_std_pct=5.0, lens_gain_pct=50.0)
    helpers = {sentences.pixels, sentences.per_cent, sentences.share, sentences.without_start}
    speakers = [f for f in vars(sentences).values() if inspect.isfunction(f) and f not in helpers]
    made = [LOOKS_AWAY, TOO_FEW]
    for speak in speakers:
        if speak.__module__ == sentences.__name__ and not speak.__name__.startswith("_"):
            told = speak(*[poor] * len(inspect.signature(speak).parameters))
            made += [told] if isinstance(told, str) else told
    about = re.compile(r"\bstart\b|closer|refine again|turn it")
    assert len([sentence for sentence in made if about.search(sentence)]) >= 6
    for sentence in made:
        changed = sentences.without_start(sentence)
        assert not about.search(changed), changed
        assert changed.endswith(".") and ";." not in changed and ", ;" not in changed
    assert sentences.without_start(sentences.another_place(poor)) == (
        "Only 10 % of the photo's corners sit where the splat shows them; the photo may show another place; try more views of "
        "the scan, known cameras, or another photo."
    )
