"""Pose and focal length from lifted matches, against exact truth."""

from dataclasses import replace

import numpy as np
import pytest
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.geometry.camera import Pose, pose_error
from core.geometry.lie import se3_exp
from core.pose.search.depth_pnp import FOCAL_SCALES, ScaledPose, _jacobian, _reproject, lifted, pnp_pose, polish

FOCAL = CAMERA.focal


def _views(seed, noise=0.0, outliers=0.0, count=3):
    rng = np.random.default_rng(seed)
    truth = random_pose(rng)
    points = world(rng)
    return truth, [make_matches(rng, truth, v, points, noise, outliers) for v in fan(rng, truth, count)]


@pytest.mark.parametrize("outliers", [0.0, 0.4])
def test_pose_is_found_among_outliers(outliers):
    truth, views = _views(1, 0.3, outliers)
    found = pnp_pose(views, FOCAL)
    distance, degrees = pose_error(found.pose, truth)
    assert found.scale == 1.0 and distance < 0.01 and degrees < 0.15


@pytest.mark.parametrize("wrong", [0.7, 0.9, 1.25, 1.5])
def test_a_wrong_focal_length_is_found_with_the_pose(wrong):
    truth, views = _views(2, 0.2, 0.3)
    guessed = [
        replace(v, query=v.query / wrong) for v in views
    ]  # ideal coordinates under a focal length `wrong` times too long
    found = pnp_pose(guessed, wrong * FOCAL, FOCAL_SCALES)
    distance, degrees = pose_error(found.pose, truth)
    assert found.scale * wrong == pytest.approx(1.0, abs=0.01)
    assert distance < 0.05 and degrees < 0.3


def test_the_jacobian_is_the_finite_difference():
    truth, views = _views(3)
    points, query = lifted(views)
    r0 = _reproject(ScaledPose(truth, 1.1), points, query, FOCAL)[1]
    J, eps = _jacobian(r0, 1.1, FOCAL), 1e-6
    for k in range(7):
        step = np.eye(7)[k] * eps
        plus, minus = (
            _reproject(ScaledPose(se3_exp(s[:6]) @ truth, 1.1 * np.exp(s[6])), points, query, FOCAL)[0] for s in (step, -step)
        )
        np.testing.assert_allclose(J[:, :, k], (plus - minus) / (2 * eps), rtol=1e-5, atol=1e-3)


def test_too_few_or_unlifted_matches_hold_no_pose():
    _, views = _views(4)
    assert pnp_pose([], FOCAL) is None
    assert pnp_pose([replace(views[0], depth=np.full(len(views[0]), np.nan))], FOCAL) is None
    same = np.arange(len(views[0])) < 5
    assert pnp_pose([views[0].take(same)], FOCAL) is None


def test_points_that_do_not_hold_a_camera_leave_it_as_it_was():
    """All in one place: the equations are singular, and no error may come of that."""
    start = ScaledPose(Pose(), 1.0)
    for z in (3.0, 1e-150):
        points, query = np.tile([0.1, 0.1, z], (40, 1)), np.full((40, 2), 0.5)
        assert np.isfinite(polish(start, points, query, 500.0, free_focal=True).pose.t).all()
