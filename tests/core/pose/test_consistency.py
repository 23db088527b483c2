"""The coarse stage on exact and on spoilt two-view answers."""

import numpy as np
import pytest
from geometry import fan, random_pose

from core.geometry.camera import pose_error
from core.geometry.lie import so3_exp
from core.pose.search.consistency import consensus_pose
from core.pose.search.two_view import TwoViewPose


def _relative(truth, view, rng=None, turn_deg=0.0, tilt_deg=0.0):
    relative = truth @ view.inverse()
    R, t = relative.R, relative.t / np.linalg.norm(relative.t)
    if rng is not None:
        R = so3_exp(np.radians(turn_deg) * rng.normal(size=3)) @ R
        t = so3_exp(np.radians(tilt_deg) * rng.normal(size=3)) @ t
    return TwoViewPose(R, t, np.ones(50, bool))


@pytest.mark.parametrize("count", [2, 3, 7])
@pytest.mark.parametrize("origin", [0.0, 1e4])
def test_exact_answers_give_the_exact_pose_wherever_the_origin_is(count, origin):
    rng = np.random.default_rng(count)
    truth = random_pose(rng, offset=(origin, 0, -origin))
    views = fan(rng, truth, count)
    found = consensus_pose(views, [_relative(truth, v) for v in views], np.full(count, 50.0))
    distance, degrees = pose_error(found.pose, truth)
    assert distance < 1e-7 and degrees < 1e-7
    np.testing.assert_allclose(found.scales, [np.linalg.norm(truth.centre - v.centre) for v in views], atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_one_bad_view_does_not_move_the_answer(seed):
    rng = np.random.default_rng(seed)
    truth = random_pose(rng)
    views = fan(rng, truth)
    good = [_relative(truth, v, rng, 0.05, 0.3) for v in views]
    clean = consensus_pose(views, good, np.full(7, 50.0)).pose
    bad = [TwoViewPose(so3_exp([0.0, 0.5, 0.2]) @ good[0].R, -good[0].t, good[0].inliers), *good[1:]]
    spoilt = consensus_pose(views, bad, np.full(7, 50.0))
    distance, degrees = pose_error(spoilt.pose, clean)
    assert distance < 0.01 and degrees < 0.1
    assert spoilt.weights[0] < 0.05 * spoilt.weights[1:].max()


def test_one_view_fixes_no_scale():
    rng = np.random.default_rng(0)
    truth = random_pose(rng)
    view = fan(rng, truth, 1)[0]
    assert consensus_pose([view], [_relative(truth, view)], np.ones(1)) is None


def test_parallel_rays_fix_no_centre():
    rng = np.random.default_rng(0)
    truth = random_pose(rng)
    view = fan(rng, truth, 1)[0]
    assert consensus_pose([view, view], [_relative(truth, view)] * 2, np.ones(2)) is None
