"""What a report says of the lens: the numbers in the photo's own units, and one plain sentence."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from core.geometry.camera import Camera, Intrinsics, Pose
from core.pose.final.solution import FittedCamera
from core.pose.lens_report import crop_sentence, lens_numbers, lens_sentence
from core.pose.report import LENS_NUMBERS, LensEvidence, RefineReport
from core.pose.report_json import evidence_from_dict, report_to_dict
from core.pose.shared.lens import ALL, CALIBRATED_STD, GUESS_STD, CameraUnknowns, LensPrior

PHOTO = Intrinsics(3600, 2400, 2500.0, 2500.0, 1800.0, 1200.0)
WORKING = replace(PHOTO.resized(1200, 800), fx=900.0, fy=900.0, cx=610.0, dist=(-0.1, 0.01, 0.0, 0.0, 0.0))
TOLD = GUESS_STD * np.array([0.01, 0.1, 0.1, 0.05, 0.2, 0.9, 0.9, 0.9, 0.9])


def solution(std, prior, solved):
    fitted = CameraUnknowns(Pose(), WORKING if solved else PHOTO.resized(1200, 800))
    return FittedCamera(fitted, "joint", 0.3, 0.01, 0.01, std, 0.0, 0.0, prior, solved)


def guessed():
    return lens_numbers(solution(TOLD, LensPrior(PHOTO, GUESS_STD, "guess"), ALL), PHOTO)


def test_numbers_are_those_of_the_photo_at_its_full_size():
    numbers = {n.name: n for n in guessed()}
    assert tuple(numbers) == LENS_NUMBERS
    assert numbers["focal"].value == pytest.approx(2700) and numbers["focal"].std == pytest.approx(0.003 * 2700)
    assert numbers["cx"].value == pytest.approx(1830) and numbers["cx"].std == pytest.approx(0.002 * 2700)
    assert numbers["k1"].value == -0.1 and numbers["k1"].std == pytest.approx(0.005)


def test_a_number_that_the_matches_did_not_tell_is_held():
    states = {n.name: n.state for n in guessed()}
    assert [name for name, state in states.items() if state == "held"] == ["p1", "p2", "k3", "squeeze"]


def test_a_calibration_is_given():
    numbers = lens_numbers(solution(CALIBRATED_STD, LensPrior(PHOTO, CALIBRATED_STD, "calibrated"), ()), PHOTO)
    assert {n.state for n in numbers} == {"given"} and numbers[0].value == 2500
    assert lens_sentence(numbers, PHOTO) == ""


def test_the_sentence_names_what_was_solved_for():
    """2700 px on a 3600 x 2400 photo: 43.27 mm of diagonal / 4326.7 px x 2700 px = 27.0 mm."""
    said = lens_sentence(guessed(), PHOTO)
    assert said == ("Focal length 27.00 mm +- 0.08 mm (35 mm equivalent), solved for; the principal point, k1, k2 solved for.")


def test_a_focal_length_without_a_bound_states_none():
    std = np.where(np.arange(9) == 0, math.inf, TOLD)
    said = lens_sentence(lens_numbers(solution(std, LensPrior(PHOTO, GUESS_STD, "guess"), ALL), PHOTO), PHOTO)
    assert "inf" not in said and "held" in said


def test_what_a_photo_knows_of_its_lens_survives_json_and_nothing_else_does():
    half = np.random.default_rng(0).normal(size=(15, 15))
    known = LensEvidence(half @ half.T, PHOTO)
    report = RefineReport(Camera(PHOTO, Pose()), Camera(PHOTO, Pose()), "trusted", (), (), 1.0, lens_evidence=known)
    back = evidence_from_dict(json.loads(json.dumps(report_to_dict(report)))["lens_evidence"])
    np.testing.assert_array_equal(back.information, known.information)
    assert back.guess == PHOTO
    for spoilt in (
        None,
        {},
        {"information": [1.0], "guess": [1, 2]},
        "x",
        {"information": [math.nan] * 120, "guess": [9] * 11},
    ):
        assert evidence_from_dict(spoilt) is None


def test_a_pair_of_which_one_number_is_held_is_not_told_as_solved():
    std = np.where(np.arange(9) == 2, 0.9, TOLD / GUESS_STD) * GUESS_STD
    said = lens_sentence(lens_numbers(solution(std, LensPrior(PHOTO, GUESS_STD, "guess"), ALL), PHOTO), PHOTO)
    assert "principal point" not in said and "k1" in said


def test_a_cropped_photo_is_told_by_its_two_focal_lengths():
    said = crop_sentence(solution(TOLD, LensPrior(PHOTO, GUESS_STD, "guess"), ALL), 13.5, PHOTO)
    assert "cropped" in said and "EXIF says 13.5 mm, the matches 27 mm" in said
