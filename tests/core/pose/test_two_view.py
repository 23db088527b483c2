"""Two-view poses against exact relative poses, with outliers, narrow baselines and degenerate input."""

import numpy as np
import pytest
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.geometry.camera import Pose, rotation_angle_deg
from core.pose.search.two_view import in_front, two_view_pose
from core.pose.shared.matches import ViewMatches

THRESHOLD = 1.0 / CAMERA.focal


def _direction_error_deg(a, b):
    return float(np.degrees(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("outliers", [0.0, 0.4])
def test_relative_pose_is_found_among_outliers(seed, outliers):
    rng = np.random.default_rng(seed)
    truth = random_pose(rng)
    view = fan(rng, truth, 1)[0]
    found = two_view_pose(make_matches(rng, truth, view, world(rng), 0.3, outliers), THRESHOLD)
    relative = truth @ view.inverse()
    assert rotation_angle_deg(found.R.T @ relative.R) < 1.0
    assert _direction_error_deg(found.t, relative.t) < 4.0
    assert found.inliers.mean() == pytest.approx(1 - outliers, abs=0.12)


def test_a_narrow_baseline_keeps_its_direction():
    """Points lie 70 to 200 baselines away; OpenCV's recoverPose would take them all to be behind the camera."""
    rng = np.random.default_rng(1)
    truth = Pose()
    points = 10 * world(rng, 600)
    view = Pose.from_centre(np.eye(3), [0.25, 0.1, 0.1])
    found = two_view_pose(make_matches(rng, truth, view, points, 0.05), THRESHOLD)
    assert _direction_error_deg(found.t, (truth @ view.inverse()).t) < 15.0


def test_few_or_degenerate_matches_give_none():
    rng = np.random.default_rng(2)
    truth = random_pose(rng)
    view = fan(rng, truth, 1)[0]
    assert two_view_pose(make_matches(rng, truth, view, world(rng, 7)), THRESHOLD) is None
    same = np.tile([[0.1, 0.2]], (50, 1))
    assert two_view_pose(ViewMatches(view, same, same, np.ones(50), np.ones(50)), THRESHOLD) is None


def test_in_front_tells_the_sign_of_the_baseline():
    rng = np.random.default_rng(3)
    truth = random_pose(rng)
    view = fan(rng, truth, 1)[0]
    m = make_matches(rng, truth, view, world(rng))
    relative = truth @ view.inverse()
    q, s = (np.column_stack([p, np.ones(len(p))]) for p in (m.query, m.view))
    assert in_front(relative.R, relative.t, q, s).all()
    assert not in_front(relative.R, -relative.t, q, s).any()
