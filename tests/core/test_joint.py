"""The last fit against exact truth: every stage, the lens as an unknown, outliers, correlated matches, the choice of stage."""

from dataclasses import replace

import numpy as np
import pytest
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.camera import pose_error
from core.lie import se3_exp
from core.pose.final import choose
from core.pose.joint import CELL_CORRELATION, CELLS, STAGES, JointProblem, density_weights, fit_joint
from core.pose.lens import LensCamera


def _views(seed, noise=0.0, outliers=0.0, count=6):
    rng = np.random.default_rng(seed)
    truth, points = random_pose(rng), world(rng)
    views = [make_matches(rng, truth, v, points, noise, outliers) for v in fan(rng, truth, count)]
    return rng, truth, points, views


def _start(rng, truth, size=0.01):
    return LensCamera(se3_exp(size * rng.normal(size=6)) @ truth, CAMERA)


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("seed", range(3))
def test_exact_matches_bring_the_exact_pose(stage, seed):
    rng, truth, _, views = _views(seed)
    fit = fit_joint(_start(rng, truth), JointProblem.of(views, CAMERA, CAMERA), stage)
    distance, degrees = pose_error(fit.camera.pose, truth)
    assert distance < 1e-6 and degrees < 1e-5
    assert fit.camera.intrinsics is CAMERA


@pytest.mark.parametrize("wrong", [0.8, 1.25])
def test_the_focal_length_is_solved_for(wrong):
    _, truth, _, views = _views(5)
    guess = replace(CAMERA, fx=CAMERA.fx * wrong, fy=CAMERA.fy * wrong)
    views = [replace(v, query=v.query / wrong) for v in views]  # the same pixels under the guessed lens
    fit = fit_joint(LensCamera(truth, guess), JointProblem.of(views, guess, guess, "focal"), "joint")
    assert fit.camera.intrinsics.fx == pytest.approx(CAMERA.fx, rel=1e-3)
    assert fit.camera.intrinsics.fx / fit.camera.intrinsics.fy == pytest.approx(CAMERA.fx / CAMERA.fy)
    assert pose_error(fit.camera.pose, truth)[0] < 0.005


def test_the_whole_lens_is_solved_for():
    _, truth, _, views = _views(6)
    lens = replace(
        CAMERA, fx=CAMERA.fx * 1.03, fy=CAMERA.fy * 1.03, cx=CAMERA.cx + 6, cy=CAMERA.cy - 4, dist=(0.06, 0.02, 0, 0, 0)
    )
    pixels = [lens.project(np.column_stack([v.query, np.ones(len(v))])) for v in views]
    views = [replace(v, query=CAMERA.normalise(p)) for v, p in zip(views, pixels, strict=True)]
    fit = fit_joint(LensCamera(truth, CAMERA), JointProblem.of(views, CAMERA, CAMERA, "full"), "joint")
    k = fit.camera.intrinsics
    assert k.fx == pytest.approx(lens.fx, rel=1e-3) and k.cx == pytest.approx(lens.cx, abs=0.3)
    assert k.cy == pytest.approx(lens.cy, abs=0.3) and k.dist[0] == pytest.approx(0.06, abs=2e-3)
    assert pose_error(fit.camera.pose, truth)[0] < 0.002


@pytest.mark.parametrize("stage", STAGES)
def test_outliers_cost_little(stage):
    clean, spoilt = [], []
    for seed in range(8):
        for share, out in ((0.0, clean), (0.25, spoilt)):
            rng, truth, _, views = _views(seed, 0.3, share)
            fit = fit_joint(_start(rng, truth, 0.002), JointProblem.of(views, CAMERA, CAMERA), stage)
            out.append(pose_error(fit.camera.pose, truth)[0])
    assert np.median(clean) < 0.002 and np.median(spoilt) < 2 * np.median(clean)


def test_the_joint_fit_is_better_than_lines_or_depth_alone():
    """With depth of a stated deviation, using both costs nothing and gains over either."""
    errors = {stage: [] for stage in STAGES}
    for seed in range(12):
        rng, truth, _, views = _views(seed, 0.3)
        noisy = [replace(v, depth=v.depth + v.depth_std * rng.normal(size=len(v))) for v in views]
        for stage, out in errors.items():
            fit = fit_joint(_start(rng, truth, 0.002), JointProblem.of(noisy, CAMERA, CAMERA), stage)
            out.append(pose_error(fit.camera.pose, truth)[0])
    medians = {stage: np.median(values) for stage, values in errors.items()}
    assert medians["joint"] < medians["depth"] and medians["joint"] < 1.1 * medians["epipolar"]


def test_the_information_bounds_the_error():
    """Squared errors in units of the fit's variance; density weights make it cautious, never blind."""
    squared = []
    for seed in range(20):
        rng, truth, _, views = _views(seed, 0.3)
        fit = fit_joint(_start(rng, truth, 0.002), JointProblem.of(views, CAMERA, CAMERA), "epipolar")
        distance, degrees = pose_error(fit.camera.pose, truth)
        covariance = np.linalg.inv(fit.information)
        squared.append((distance**2 / np.trace(covariance[:3, :3]), np.radians(degrees) ** 2 / np.trace(covariance[3:, 3:])))
    mean = np.mean(squared, axis=0)
    assert (mean < 1.5).all() and (mean > 0.01).all()


def test_density_weights_are_those_of_a_plain_count():
    rng = np.random.default_rng(0)
    seen = [rng.uniform((0, 0), (640, 480), (n, 2)) for n in (50, 200)]
    seen[1][:120] = rng.uniform((100, 100), (110, 110), (120, 2))
    got = density_weights(seen, CAMERA)
    size = 640 / CELLS
    everything = [tuple((p // size).astype(int)) for s in seen for p in s]
    want = [1 / (1 + CELL_CORRELATION * everything.count(cell)) for cell in everything]
    np.testing.assert_allclose(np.concatenate(got), want)
    assert [len(w) for w in got] == [50, 200]


def test_a_spoilt_corner_with_most_of_the_matches_does_not_outvote_the_rest():
    """A cluster that is consistently off by a pixel moves the pose less than it would if its matches counted as independent."""
    rng, truth, points, views = _views(4)
    corner = world(rng, 600)
    corner[:, :2] = corner[:, 2:] * (np.array([0.35, 0.25]) + 0.02 * rng.normal(size=(600, 2)))
    off = []
    for view in (v.pose for v in views):
        m = make_matches(rng, truth, view, np.concatenate([points, corner]))
        shift = np.where(np.arange(len(m)) < len(points), 0.0, 1.0 / CAMERA.focal)
        off.append(replace(m, view=m.view + shift[:, None]))
    problem = JointProblem.of(off, CAMERA, CAMERA)
    flat = replace(problem, weights=tuple(np.ones_like(w) for w in problem.weights))
    start = LensCamera(truth, CAMERA)
    weighed, plain = (pose_error(fit_joint(start, p, "epipolar").camera.pose, truth)[0] for p in (problem, flat))
    assert weighed < 0.7 * plain


def test_auto_leaves_a_depth_that_lies():
    rng, truth, points, views = _views(7, 0.2)
    lying = [replace(v, depth=1.05 * v.depth, depth_std=1e-4 * v.depth) for v in views]
    problem = JointProblem.of(lying, CAMERA, CAMERA)
    reference = make_matches(rng, truth, truth, points, 0.2, reference=True)
    fits = {stage: fit_joint(_start(rng, truth, 0.001), problem, stage) for stage in STAGES}
    assert choose(fits, JointProblem.of([reference], CAMERA, CAMERA)) == "epipolar"
    assert pose_error(fits["epipolar"].camera.pose, truth)[0] < 0.2 * pose_error(fits["joint"].camera.pose, truth)[0]
    assert choose(fits, JointProblem.of([], CAMERA, CAMERA)) == "joint"
