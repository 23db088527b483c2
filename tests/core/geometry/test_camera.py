"""Intrinsics against OpenCV's own projection, poses against plain matrices, and what is refused."""

import cv2
import numpy as np
import pytest

from core.errors import CameraError
from core.geometry.camera import Intrinsics, Pose, pose_error, rotation_angle_deg
from core.geometry.lie import so3_exp
from core.geometry.viewport import intrinsics_from_projection

LENS = Intrinsics(720, 1280, 917.0, 916.3, 369.7, 643.5, (0.0578, -0.0805, -0.00098, 0.00016, 0.01))


def _points(n=200, seed=0):
    rng = np.random.default_rng(seed)
    z = rng.uniform(1, 5, n)
    return np.column_stack([rng.uniform(-0.4, 0.4, n) * z, rng.uniform(-0.7, 0.7, n) * z, z])


def test_project_is_opencvs_up_to_the_half_pixel_that_ours_does_not_need():
    p = _points()
    theirs, _ = cv2.projectPoints(p, np.zeros(3), np.zeros(3), LENS.matrix, np.asarray(LENS.dist))
    np.testing.assert_allclose(LENS.project(p), theirs.reshape(-1, 2), atol=1e-9)


def test_normalise_undoes_the_lens():
    p = _points()
    np.testing.assert_allclose(LENS.normalise(LENS.project(p)), p[:, :2] / p[:, 2:], atol=1e-11)
    np.testing.assert_allclose(LENS.undistort(LENS.project(p)), LENS.pinhole().project(p), atol=1e-8)


def test_points_behind_the_camera_have_no_pixel():
    assert np.isnan(LENS.project([[0.1, 0.2, -1.0], [0.0, 0.0, 0.0]])).all()


def test_resized_camera_sees_the_same_rays():
    small = LENS.with_long_side(640)
    assert (small.width, small.height) == (360, 640)
    p = _points()
    np.testing.assert_allclose(small.project(p) * 2, LENS.project(p), atol=1e-9)
    assert LENS.with_long_side(5000) is LENS


@pytest.mark.parametrize(
    "bad",
    [
        {"width": 0},
        {"fx": 0.0},
        {"fy": -1.0},
        {"cx": float("nan")},
        {"dist": (0.0,) * 6},
    ],
)
def test_numbers_that_make_no_camera_are_refused(bad):
    good = {"width": 10, "height": 10, "fx": 5.0, "fy": 5.0, "cx": 5.0, "cy": 5.0, "dist": ()}
    with pytest.raises(CameraError):
        Intrinsics(**{**good, **bad})


@pytest.mark.parametrize("R", [np.diag([1.0, 1.0, -1.0]), 1.1 * np.eye(3), np.full((3, 3), np.nan), np.eye(4)])
def test_a_matrix_that_is_no_rotation_is_refused(R):
    with pytest.raises(CameraError):
        Pose(R, np.zeros(3))


def test_pose_algebra_matches_homogeneous_matrices():
    rng = np.random.default_rng(5)
    a, b = (Pose(so3_exp(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2))

    def m(p):
        return np.vstack([np.column_stack([p.R, p.t]), [0, 0, 0, 1]])

    np.testing.assert_allclose(m(a @ b), m(a) @ m(b), atol=1e-12)
    np.testing.assert_allclose(m(a.inverse()), np.linalg.inv(m(a)), atol=1e-12)
    np.testing.assert_allclose(a.transform([a.centre]), [[0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(Pose.from_centre(a.R, a.centre).t, a.t, atol=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 0.03, 90.0, 179.999])
def test_rotation_angle_is_exact_over_its_whole_range(degrees):
    axis = np.array([0.6, 0.0, 0.8])
    assert rotation_angle_deg(so3_exp(np.radians(degrees) * axis)) == pytest.approx(degrees, abs=1e-9)


def test_pose_error_is_centre_distance_and_angle():
    truth = Pose.from_centre(so3_exp([0.1, 0.2, 0.3]), [1.0, 2.0, 3.0])
    moved = Pose.from_centre(so3_exp([0.0, np.radians(2.0), 0.0]) @ truth.R, [1.0, 2.0, 3.5])
    assert pose_error(moved, truth) == pytest.approx((0.5, 2.0))


def test_a_viewports_projection_puts_points_where_opengl_does():
    """An off-centre frustum as Blender makes it for a camera with a shift; OpenGL divides by -z and counts rows from below."""
    P = np.array([[2.1, 0, 0.3, 0], [0, 3.3, -0.2, 0], [0, 0, -1.002, -0.2], [0, 0, -1, 0]])
    k = intrinsics_from_projection(P, 800, 500)
    points = _points(20)
    clip = np.column_stack([points * (1, -1, -1), np.ones(20)]) @ P.T
    ndc = clip[:, :2] / clip[:, 3:]
    np.testing.assert_allclose(k.project(points), (ndc * (1, -1) + 1) / 2 * (800, 500), atol=1e-9)
    with pytest.raises(CameraError, match="orthographic"):
        intrinsics_from_projection(np.diag([1.0, 1, -0.01, 1]), 800, 500)
