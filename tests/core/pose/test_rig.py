"""The join of a panorama's faces: weighted by what each knows, blind to those that disagree, and honest about it."""

import numpy as np
import pytest

from core.geometry.camera import Pose, pose_error
from core.geometry.lie import so3_exp
from core.pose.rig import Face, join_faces

TRUTH = Pose.from_centre(so3_exp([0.1, 0.4, -0.2]), [1.0, -2.0, 3.0])
DEPTH = 4.0


def face(name, off=(0, 0, 0), turn=(0, 0, 0), verdict="trusted", std=0.002):
    pose = Pose.from_centre(so3_exp(turn) @ TRUTH.R, TRUTH.centre + off)
    return Face(name, verdict, pose, std, std / DEPTH, DEPTH)


def test_a_surer_face_counts_more():
    joined = join_faces([face("front", (0.004, 0, 0), std=0.001), face("back", (-0.004, 0, 0), (0, 0, 0.001), std=0.003)])
    np.testing.assert_allclose(joined.pose.centre - TRUTH.centre, [0.004 * (9 - 1) / 10, 0, 0], atol=1e-12)
    assert pose_error(joined.pose, TRUTH)[1] == pytest.approx(np.degrees(0.001 / 10), rel=1e-3)
    assert joined.verdict == "trusted"
    assert joined.distance_pct == pytest.approx(100 * 0.0072 / DEPTH)


def test_a_face_that_disagrees_is_left_out_and_named():
    others = [face(name) for name in ("front", "right", "back")]
    lost = Face("down", "failed", None, problem="The photo shows only 3 features.")
    joined = join_faces([*others, face("up", (0.3, 0, 0)), lost])
    np.testing.assert_allclose(joined.pose.centre, TRUTH.centre, atol=1e-12)
    assert joined.verdict == "trusted"
    (said,) = joined.reasons
    assert said.startswith("3 of 5 parts of the panorama (front, right and back) agree on the camera, within")
    assert "left out: up (It disagrees with the others), down (The photo shows only 3 features)." in said


@pytest.mark.parametrize(
    ("faces", "said"),
    [
        ([face("front")], "Only one of 1 parts"),
        ([face("front"), face("up", (1, 0, 0))], "Only one of 2 parts"),
        ([face("front", verdict="check"), face("up", verdict="check")], "2 of 2 parts"),
        ([face("a"), face("b"), face("c", (1, 0, 0)), face("d", (0, 1, 0))], "2 of 4 parts"),
    ],
)
def test_what_nothing_confirms_is_to_be_checked(faces, said):
    joined = join_faces(faces)
    assert joined.verdict == "check" and joined.reasons[0].startswith(said)


def test_three_faces_that_agree_closely_confirm_each_other():
    some = [face(name, verdict="check") for name in ("front", "back", "up")]
    assert join_faces(some).verdict == "trusted"
    apart = [face(name, (0.01 * i, 0, 0), verdict="check", std=0.01) for i, name in enumerate(("front", "back", "up"))]
    assert join_faces([*apart[:2], face("up", (0.03, 0, 0), verdict="check", std=0.02)]).verdict == "check"


def test_without_any_face_there_is_no_pose():
    joined = join_faces([Face("front", "failed", None, problem="It is too dark.")])
    assert (joined.pose, joined.verdict) == (None, "failed")
    assert joined.reasons == ("No part of the panorama could be placed; left out: front (It is too dark).",)
