"""Errors and figures against numbers worked out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from core.cameras import PosedFrame, PoseSet
from core.cameras.evaluate import STYLES, average, pose_errors, rounded, score, table
from core.errors import DatasetError
from core.geometry.camera import Pose
from core.geometry.lie import so3_exp

INF = math.inf


def poses(**centres_and_degrees):
    """Frames at x along the world's x axis, turned by degrees about y from a common orientation."""
    base = so3_exp([0.3, -0.2, 0.1])
    frames = [
        PosedFrame(name, Pose.from_centre(so3_exp([0, math.radians(degrees), 0]) @ base, [x, 5, -7]))
        for name, (x, degrees) in centres_and_degrees.items()
    ]
    return PoseSet("poses.txt", tuple(frames))


def test_errors_are_the_distance_of_the_centres_and_the_angle_between():
    truth = poses(a=(0, 0), b=(1, 10), c=(2, 0), d=(0, 0))
    estimate = poses(d=(0, 180), c=(2.25, 1.5), a=(0, 0), x=(9, 9))
    expected = [[0, 0], [INF, INF], [0.25, 1.5], [0, 180]]
    np.testing.assert_allclose(pose_errors(truth, estimate), expected, atol=1e-9)


def test_another_scenes_estimate_is_refused():
    with pytest.raises(DatasetError, match=r"No name of 'poses.txt'"):
        pose_errors(poses(a=(0, 0)), poses(b=(0, 0)))


def test_an_estimate_without_a_single_answer_is_all_missing():
    nothing = replace(poses(), unsolved=1)
    assert score(pose_errors(poses(a=(0, 0)), nothing), STYLES["ours"]).missing == 1


# centimetres and degrees of five queries, the last one missing
ERRORS = np.array([[0.005, 0.5], [0.015, 1.5], [0.04, 0.2], [0.3, 4.0], [INF, INF]])


def test_figures_by_hand():
    s = score(ERRORS, STYLES["ours"])
    assert (s.n, s.missing) == (5, 1)
    assert s.median_translation == 0.04
    assert s.median_rotation_deg == 1.5  # of 0.2 0.5 1.5 4.0 inf: not the query of the median translation
    assert s.mean_translation == s.mean_rotation_deg == INF
    assert s.recall == {
        "1cm1": 20,
        "2cm2": 40,
        "3cm3": 40,
        "5cm5": 60,
        "10cm5": 60,
        "25cm2": 60,
        "50cm5": 80,
        "2m5": 80,
        "5m10": 80,
    }
    assert score(ERRORS[:4], STYLES["ours"]).mean_translation == pytest.approx(0.09)
    assert score(ERRORS[:4], STYLES["ours"]).median_translation == pytest.approx((0.015 + 0.04) / 2)


def test_both_limits_must_hold():
    s = score(np.array([[0.001, 9.0], [9.0, 0.1]]), STYLES["ours"])
    assert s.recall["5cm5"] == 0
    assert s.recall["5m10"] == 50


@pytest.mark.parametrize(
    ("style", "names", "at_the_limit"),
    [
        ("ours", "1cm1 2cm2 3cm3 5cm5 10cm5 25cm2 50cm5 2m5 5m10", 0),
        ("hloc", "1cm1 2cm2 3cm3 5cm5 25cm2 50cm5 5m10", 0),
        ("mcloc", "25cm2 50cm5 5m10 10m15", 0),
        ("gs-cpr", "1cm1 2cm2 5cm5 10cm5", 0),
        ("stdloc", "2cm2 5cm5 2m5 5m10", 100),
    ],
)
def test_each_style_has_its_thresholds_and_its_sign(style, names, at_the_limit):
    recall = score(ERRORS, STYLES[style]).recall
    assert list(recall) == names.split()
    for name in recall:
        limit, degrees = name.replace("cm", "e-2 ").replace("m", " ").split()
        assert score(np.array([[float(limit), float(degrees)]]), STYLES[style]).recall[name] == at_the_limit
        assert score(np.array([[0.999 * float(limit), 0.999 * float(degrees)]]), STYLES[style]).recall[name] == 100


def test_hloc_counts_a_missing_rotation_as_180_degrees():
    s = score(ERRORS, STYLES["hloc"])
    assert s.mean_rotation_deg == pytest.approx((0.5 + 1.5 + 0.2 + 4 + 180) / 5)
    assert s.mean_translation == INF
    assert s.recall["5m10"] == 80


def test_average_is_the_mean_over_scenes_whatever_their_size():
    a, b = score(ERRORS[:1], STYLES["ours"]), score(ERRORS[1:4], STYLES["ours"])
    both = average([a, b])
    assert (both.n, both.missing) == (4, 0)
    assert both.median_translation == pytest.approx((0.005 + 0.04) / 2)
    assert both.recall["2cm2"] == pytest.approx((100 + 100 / 3) / 2)


def test_table_prints_centimetres_of_metres_and_units_of_anything_else():
    s = score(ERRORS[:4], STYLES["gs-cpr"])
    head, _, row = table([("chess", s)], metric=True).splitlines()
    assert head == "| scene | n | missing | median cm / deg | mean cm / deg | 1cm1 | 2cm2 | 5cm5 | 10cm5 |"
    assert row == "| chess | 4 | 0 | 2.75 / 1.00 | 9.00 / 1.55 | 25.0 | 50.0 | 75.0 | 75.0 |"
    head, _, row = table([("fox", s)], metric=False).splitlines()
    assert "median units / deg" in head
    assert "| 0.01 / 1 |" in head
    assert "| 0.0275 / 1.00 | 0.09 / 1.55 |" in row


def test_halves_are_rounded_up_as_tables_are_read():
    assert rounded(99.55, 1) == "99.6"  # the double lies below the half
    assert rounded(100 * 1991 / 2000, 1) == "99.6"
    assert rounded(2.5, 0) == "3"
    assert rounded(0.0, 2) == "0.00"
    assert rounded(INF, 2) == "inf"
