"""Reprojection of lifted matches: against OpenCV's projection, finite differences, and the dense covariance written out."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from geometry import CAMERA, make_matches, random_pose, world

from core.geometry.lie import hat, se3_exp
from core.pose.final.reprojection import Lifted, apply, reproject, whitening
from core.pose.shared.lens import ALL, CameraUnknowns, lens_difference, moved_lens
from core.pose.shared.matches import world_points
from core.pose.shared.robust import MIN_SIGMA_PX, robust_std

LENS = replace(CAMERA, dist=(-0.12, 0.05, 0.001, -0.002, 0.01))


def lift(matches, seen):
    return Lifted.of([matches], [seen])


def plain(count):
    """The whitening that leaves pixels as they are."""
    return np.repeat(np.eye(2)[:, :, None], count, 2)


@pytest.fixture
def setting():
    rng = np.random.default_rng(3)
    truth = random_pose(rng)
    matches = make_matches(rng, truth, random_pose(rng), world(rng, 80), noise_px=1.0)
    pose = se3_exp(0.01 * rng.normal(size=6)) @ truth
    seen = LENS.project(np.column_stack([matches.query, np.ones(len(matches))]))
    return rng, CameraUnknowns(pose, LENS), matches, seen


def test_residuals_are_opencvs_projection_minus_what_was_seen(setting):
    _, camera, matches, seen = setting
    K = LENS.matrix
    rotation = cv2.Rodrigues(camera.pose.R)[0]
    want, _ = cv2.projectPoints(world_points(matches), rotation, camera.pose.t, K, np.array(LENS.dist))
    got = reproject(camera, lift(matches, seen))
    np.testing.assert_allclose(got.residual.T, want.reshape(-1, 2) - seen, atol=1e-6)
    np.testing.assert_allclose(got.points.T, camera.pose.transform(world_points(matches)))


@pytest.mark.parametrize("lens", [LENS, LENS.pinhole()])
def test_the_jacobian_by_pose_and_lens_is_the_finite_difference(setting, lens):
    _, camera, matches, seen = setting
    camera, lifted = replace(camera, intrinsics=lens), lift(matches, seen)
    got = reproject(camera, lifted).jacobian(plain(len(matches)), ALL)
    for k in range(15):
        step = np.eye(15)[k] * 1e-6
        plus, minus = (reproject(camera.moved(s, ALL), lifted).residual for s in (step, -step))
        np.testing.assert_allclose(got[k], (plus - minus) / 2e-6, rtol=1e-5, atol=2e-3)


def test_along_is_the_finite_difference_by_depth(setting):
    _, camera, matches, seen = setting
    deeper, nearer = (lift(replace(matches, depth=matches.depth + d), seen) for d in (1e-6, -1e-6))
    want = (reproject(camera, deeper).residual - reproject(camera, nearer).residual) / 2e-6
    np.testing.assert_allclose(reproject(camera, lift(matches, seen)).along, want, rtol=1e-5, atol=1e-4)


def test_whitening_is_the_dense_covariance(setting):
    rng, camera, matches, seen = setting
    r = reproject(camera, lift(matches, seen))
    sigma_depth, sigma_px = rng.uniform(0.0, 0.1, len(matches)), rng.uniform(0.2, 0.6, len(matches))
    W = whitening(r, sigma_px, sigma_depth)
    white, jacobian, along = apply(W, r.residual), r.jacobian(W), r.along.T
    covariance = sigma_px[:, None, None] ** 2 * np.eye(2)
    covariance += sigma_depth[:, None, None] ** 2 * along[:, :, None] * along[:, None, :]
    inverse = np.linalg.inv(covariance)
    np.testing.assert_allclose((white**2).sum(0), np.einsum("in,nij,jn->n", r.residual, inverse, r.residual))
    pixels = r.jacobian(plain(len(matches)))
    want = np.einsum("ikn,nkl,jln->nij", pixels, inverse, pixels)
    np.testing.assert_allclose(np.einsum("ikn,jkn->nij", jacobian, jacobian), want, rtol=1e-9, atol=1e-6)


def test_an_unknown_depth_leaves_the_distance_to_opencvs_epipolar_line(setting):
    _, camera, matches, _ = setting
    camera = CameraUnknowns(camera.pose, CAMERA)
    K = CAMERA.matrix
    seen = matches.query @ K[:2, :2].T + K[:2, 2]
    relative = camera.pose @ matches.pose.inverse()
    F = np.linalg.inv(K).T @ hat(relative.t) @ relative.R @ np.linalg.inv(K)
    view = matches.view @ K[:2, :2].T + K[:2, 2]
    lines = cv2.computeCorrespondEpilines(view.reshape(-1, 1, 2), 1, F).reshape(-1, 3)
    want = np.abs((np.column_stack([seen, np.ones(len(seen))]) * lines).sum(1))
    r = reproject(camera, lift(matches, seen))
    white = apply(whitening(r, 1.0, np.inf), r.residual)
    np.testing.assert_allclose(np.linalg.norm(white, axis=0), want, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(np.abs(r.across), want, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("offset", [0.0, 1000.0])
def test_without_a_baseline_both_directions_count_alike(offset):
    """Also far from the world's origin, where rounding leaves something of a line."""
    rng, offset = np.random.default_rng(3), (offset, 0.0, 0.0)
    pose, points = random_pose(rng, offset=offset), world(rng, 80, offset)
    matches = make_matches(rng, pose, pose, points, noise_px=1.0)
    seen = LENS.project(np.column_stack([matches.query, np.ones(len(matches))]))
    r = reproject(CameraUnknowns(pose, LENS), lift(matches, seen))
    white = apply(whitening(r, 0.5, np.inf), r.residual)
    assert np.isfinite(white).all()
    np.testing.assert_allclose((white**2).sum(0), (r.residual**2).sum(0) / 0.25)


def test_the_deviation_across_the_lines_ignores_outliers(setting):
    rng, camera, matches, seen = setting
    r = reproject(camera, lift(matches, seen))
    across = 0.4 * rng.normal(size=len(matches))
    across[:10] = 500.0
    x, y = r.along / np.linalg.norm(r.along, axis=0)
    spoilt = replace(r, residual=across * np.stack([-y, x]))
    assert robust_std(spoilt.across) == pytest.approx(0.4, rel=0.35)
    assert robust_std(0 * spoilt.across) == MIN_SIGMA_PX


def test_a_step_of_the_lens_and_its_difference_are_inverse():
    step = np.array([0.1, 0.03, -0.01, 0.01, -0.02, 0.002, -0.001, 0.004, 0.006])
    moved = moved_lens(LENS, step)
    got = lens_difference(moved, LENS)
    np.testing.assert_allclose(got, step, rtol=1e-9)
    assert moved.focal / LENS.focal == pytest.approx(np.exp(0.1))
    assert (moved.fx / moved.fy) / (LENS.fx / LENS.fy) == pytest.approx(np.exp(0.006))
