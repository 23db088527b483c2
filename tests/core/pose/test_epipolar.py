"""The fine stage: residuals against OpenCV's epipolar lines, Jacobian against finite differences, recovery of exact truth."""

import cv2
import numpy as np
import pytest
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.geometry.camera import pose_error
from core.geometry.lie import hat, left_jacobian_inverse, se3_exp, so3_log
from core.pose.search.epipolar import epipolar_residuals, huber, measure_epipolar, refine_epipolar
from core.pose.search.solve import fine_pose

K = CAMERA.matrix


@pytest.fixture
def setting():
    rng = np.random.default_rng(7)
    truth = random_pose(rng)
    points = world(rng)
    return rng, truth, points, fan(rng, truth)


def _pixels(points):
    return (np.column_stack([points, np.ones(len(points))]) @ K.T)[:, :2]


def test_residual_is_the_distance_to_opencvs_epipolar_line(setting):
    rng, truth, points, views = setting
    matches = make_matches(rng, truth, views[0], points, noise_px=2.0)
    wrong = se3_exp(0.05 * rng.normal(size=6)) @ truth
    relative = views[0] @ wrong.inverse()
    F = np.linalg.inv(K).T @ hat(relative.t) @ relative.R @ np.linalg.inv(K)
    lines = cv2.computeCorrespondEpilines(_pixels(matches.query).reshape(-1, 1, 2), 1, F).reshape(-1, 3)
    want = (np.column_stack([_pixels(matches.view), np.ones(len(matches))]) * lines).sum(1)
    got, _ = epipolar_residuals(wrong, matches, K)
    np.testing.assert_allclose(np.abs(got), np.abs(want), rtol=1e-6, atol=1e-8)


def test_jacobian_is_the_finite_difference(setting):
    rng, truth, points, views = setting
    matches = make_matches(rng, truth, views[0], points, noise_px=1.0)
    pose = se3_exp(0.02 * rng.normal(size=6)) @ truth
    _, jacobian = epipolar_residuals(pose, matches, K)
    eps = 1e-6
    for k in range(6):
        step = np.eye(6)[k] * eps
        plus, _ = epipolar_residuals(se3_exp(step) @ pose, matches, K)
        minus, _ = epipolar_residuals(se3_exp(-step) @ pose, matches, K)
        np.testing.assert_allclose(jacobian[:, k], (plus - minus) / (2 * eps), rtol=1e-4, atol=1e-3)


def test_huber_is_the_papers():
    r = np.array([-3.0, -1.0, 0.5, 1.0, 2.0])
    rho, weight = huber(r)
    np.testing.assert_allclose(rho, [5.0, 1.0, 0.25, 1.0, 3.0])
    eps = 1e-6
    numeric = (huber(r * (1 + eps))[0] - huber(r * (1 - eps))[0]) / (2 * eps * r)
    np.testing.assert_allclose(2 * weight * r, numeric, atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_exact_matches_bring_the_exact_pose(seed):
    rng = np.random.default_rng(seed)
    truth = random_pose(rng)
    points = world(rng)
    views = [make_matches(rng, truth, v, points) for v in fan(rng, truth)]
    start = se3_exp(0.03 * rng.normal(size=6)) @ truth
    distance, degrees = pose_error(refine_epipolar(start, views, K).pose, truth)
    assert distance < 1e-6 and degrees < 1e-5


def _noisy_fit(seed, outliers):
    rng = np.random.default_rng(seed)
    truth = random_pose(rng)
    points = world(rng, 200)
    views = [make_matches(rng, truth, v, points, 0.3, outliers) for v in fan(rng, truth)]
    fit = fine_pose(se3_exp(0.01 * rng.normal(size=6)) @ truth, views, K)
    return fit, *pose_error(fit.pose, truth)


def test_outliers_cost_little():
    clean, spoilt = (np.median([_noisy_fit(seed, share)[1:] for seed in range(15)], axis=0) for share in (0.0, 0.05))
    assert (clean < (0.002, 0.03)).all()
    assert (spoilt < 2.5 * clean).all()


@pytest.mark.parametrize("count", [4, 7, 14])
def test_the_information_is_the_inverse_covariance_of_the_scatter(count):
    """The error of many fits to fresh noise, in units of what each fit states, squared and per unknown, averages to one: 6 x 40
    squares of unit deviation have a mean of 1 +- 0.09, whatever the number of views.
    """
    rng = np.random.default_rng(count)
    truth = random_pose(rng)
    points, views = world(rng, 150), fan(rng, truth, count)
    squared = []
    for _ in range(40):
        fit = refine_epipolar(truth, [make_matches(rng, truth, v, points, 0.4) for v in views], K, rounds=2)
        error = fit.pose @ truth.inverse()
        phi = so3_log(error.R)
        xi = np.concatenate([left_jacobian_inverse(phi) @ error.t, phi])
        squared.append(xi @ fit.information @ xi / 6)
    assert 0.75 < np.mean(squared) < 1.35


def test_measure_leaves_the_pose_alone(setting):
    rng, truth, points, views = setting
    matches = [make_matches(rng, truth, v, points, 0.5) for v in views]
    fit = measure_epipolar(truth, matches, K)
    assert fit.pose is truth
    assert fit.rms_px == pytest.approx(0.5 * np.sqrt(2), rel=0.15)  # noise of both points, across the line


def test_a_view_at_the_photos_own_pose_stays_finite(setting):
    rng, truth, points, _ = setting
    d, jacobian = epipolar_residuals(truth, make_matches(rng, truth, truth, points, 0.5), K)
    assert np.isfinite(d).all() and np.isfinite(jacobian).all()
