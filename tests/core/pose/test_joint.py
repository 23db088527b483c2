"""The last fit against exact truth: every stage, the lens as an unknown, outliers, correlated matches, the choice of stage."""

from dataclasses import replace

import numpy as np
import pytest
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.geometry.camera import pose_error
from core.geometry.lie import se3_exp
from core.pose.final.joint import (
    CELL_CORRELATION,
    CELLS,
    FIT_KINDS,
    SCALE,
    SHARED_ERROR,
    JointProblem,
    _equations,
    density_weights,
    fit_joint,
)
from core.pose.final.pinned import PinnedPoints
from core.pose.final.reprojection import reproject
from core.pose.final.stage import choose
from core.pose.shared.lens import CALIBRATED_STD, FOCAL, GUESS_STD, MODES, CameraUnknowns, LensPrior, lens_difference
from core.pose.shared.matches import world_points


def _views(seed, noise=0.0, outliers=0.0, count=6):
    rng = np.random.default_rng(seed)
    truth, points = random_pose(rng), world(rng)
    views = [make_matches(rng, truth, v, points, noise, outliers) for v in fan(rng, truth, count)]
    return rng, truth, points, views


GIVEN = LensPrior(CAMERA, CALIBRATED_STD, "calibrated")


def _guess(lens=CAMERA):
    return LensPrior(lens, GUESS_STD, "guess")


def _start(rng, truth, size=0.01):
    return CameraUnknowns(se3_exp(size * rng.normal(size=6)) @ truth, CAMERA)


@pytest.mark.parametrize("stage", FIT_KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_exact_matches_bring_the_exact_pose(stage, seed):
    rng, truth, _, views = _views(seed)
    fit = fit_joint(_start(rng, truth), JointProblem.of(views, CAMERA, GIVEN), stage)
    distance, degrees = pose_error(fit.camera.pose, truth)
    assert distance < 1e-6 and degrees < 1e-5
    assert fit.camera.intrinsics is CAMERA


@pytest.mark.parametrize("wrong", [0.8, 1.25])
def test_the_focal_length_is_solved_for(wrong):
    _, truth, _, views = _views(5)
    guess = replace(CAMERA, fx=CAMERA.fx * wrong, fy=CAMERA.fy * wrong)
    views = [replace(v, query=v.query / wrong) for v in views]  # the same pixels under the guessed lens
    fit = fit_joint(CameraUnknowns(truth, guess), JointProblem.of(views, guess, _guess(guess), FOCAL), "joint")
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
    fit = fit_joint(CameraUnknowns(truth, CAMERA), JointProblem.of(views, CAMERA, _guess(), MODES["full"]), "joint")
    k = fit.camera.intrinsics
    assert k.fx == pytest.approx(lens.fx, rel=1e-3) and k.cx == pytest.approx(lens.cx, abs=0.3)
    assert k.cy == pytest.approx(lens.cy, abs=0.3) and k.dist[0] == pytest.approx(0.06, abs=2e-3)
    assert pose_error(fit.camera.pose, truth)[0] < 0.002


def test_halves_are_the_answers_of_every_other_view():
    rng, truth, points, views = _views(9)
    other = se3_exp(0.003 * rng.normal(size=6)) @ truth
    views[1::2] = [make_matches(rng, other, v.pose, points) for v in views[1::2]]
    halves = fit_joint(CameraUnknowns(truth, CAMERA), JointProblem.of(views, CAMERA, GIVEN), "joint").halves()
    for half, want in zip(halves, (truth, other), strict=True):
        distance, degrees = pose_error(half.pose, want)
        assert distance < 1e-6 and degrees < 1e-5


@pytest.mark.parametrize("stage", FIT_KINDS)
def test_outliers_cost_little(stage):
    clean, spoilt = [], []
    for seed in range(8):
        for share, out in ((0.0, clean), (0.25, spoilt)):
            rng, truth, _, views = _views(seed, 0.3, share)
            fit = fit_joint(_start(rng, truth, 0.002), JointProblem.of(views, CAMERA, GIVEN), stage)
            out.append(pose_error(fit.camera.pose, truth)[0])
    assert np.median(clean) < 0.002 and np.median(spoilt) < 2 * np.median(clean)


def test_the_joint_fit_is_better_than_lines_or_depth_alone():
    """With depth of a stated deviation, using both costs nothing and gains over either."""
    errors = {stage: [] for stage in FIT_KINDS}
    for seed in range(12):
        rng, truth, _, views = _views(seed, 0.3)
        noisy = [replace(v, depth=v.depth + v.depth_std * rng.normal(size=len(v))) for v in views]
        for stage, out in errors.items():
            fit = fit_joint(_start(rng, truth, 0.002), JointProblem.of(noisy, CAMERA, GIVEN), stage)
            out.append(pose_error(fit.camera.pose, truth)[0])
    medians = {stage: np.median(values) for stage, values in errors.items()}
    assert medians["joint"] < medians["depth"] and medians["joint"] < 1.1 * medians["epipolar"]


def test_the_information_bounds_the_error():
    """Squared errors in units of the fit's variance; density weights make it cautious, never blind."""
    squared = []
    for seed in range(20):
        rng, truth, _, views = _views(seed, 0.3)
        fit = fit_joint(_start(rng, truth, 0.002), JointProblem.of(views, CAMERA, GIVEN), "epipolar")
        distance, degrees = pose_error(fit.camera.pose, truth)
        covariance = SHARED_ERROR**-2 * np.linalg.inv(fit.information)
        squared.append((distance**2 / np.trace(covariance[:3, :3]), np.radians(degrees) ** 2 / np.trace(covariance[3:, 3:])))
    mean = np.mean(squared, axis=0)
    assert (mean < 1.5).all() and (mean > 0.01).all()


def test_density_weights_are_those_of_a_plain_count():
    rng = np.random.default_rng(0)
    seen = rng.uniform((0, 0), (640, 480), (250, 2))
    seen[50:170] = rng.uniform((100, 100), (110, 110), (120, 2))
    size = 640 / CELLS
    cells = [tuple((p // size).astype(int)) for p in seen]
    want = [1 / (1 + CELL_CORRELATION * cells.count(cell)) for cell in cells]
    np.testing.assert_allclose(density_weights(seen, CAMERA), want)


def _twin(camera, views, problem, stage):
    """Cost, gradient and Gauss-Newton matrix summed match by match, from finite differences and dense covariances."""
    size = 6 + len(problem.free)
    cost, gradient, information, weights = 0.0, np.zeros(size), np.zeros((size, size)), iter(problem.weights)

    def difference(f, step):
        return (f(step) - f(-step)) / (2 * np.linalg.norm(step))

    for view in views:

        def pixels(camera, deeper=0.0, view=view):
            points = world_points(replace(view, depth=view.depth + deeper))
            return camera.intrinsics.project(camera.pose.transform(points))

        residual = pixels(camera) - CAMERA.project(np.column_stack([view.query, np.ones(len(view))]))
        jacobian = np.stack([difference(lambda s: pixels(camera.moved(s, problem.free)), s) for s in 1e-6 * np.eye(size)], -1)
        along = difference(lambda s: pixels(camera, float(s[0])), np.array([1e-6]))
        normal = np.stack([-along[:, 1], along[:, 0]], 1) / np.linalg.norm(along, axis=1)[:, None]
        sigma = 1.4826 * np.median(np.abs((residual * normal).sum(1)))
        for r, J, a, n, std in zip(residual, jacobian, along, normal, view.depth_std, strict=True):
            spread = std**2 * np.outer(a, a) if stage == "joint" else 0.0
            inverse = np.outer(n, n) / sigma**2 if stage == "epipolar" else np.linalg.inv(sigma**2 * np.eye(2) + spread)
            squared, weight = r @ inverse @ r / SCALE**2, next(weights)
            cost += 0.5 * weight * SCALE**2 * squared / (1 + squared)
            gradient += weight / (1 + squared) ** 2 * J.T @ inverse @ r
            information += weight / (1 + squared) ** 2 * J.T @ inverse @ J
    prior, certainty = GUESS_STD[list(problem.free)], SHARED_ERROR**-2
    off = lens_difference(camera.intrinsics, problem.prior.lens)[list(problem.free)] / prior
    gradient, information = certainty * gradient, certainty * information
    gradient[6:] += off / prior
    return certainty * cost + 0.5 * off @ off, gradient, information + np.diag(np.r_[np.zeros(6), prior**-2.0])


@pytest.mark.parametrize("stage", FIT_KINDS)
@pytest.mark.parametrize("mode", ["fixed", "focal", "full"])
def test_the_stacked_equations_are_those_of_a_plain_sum_over_matches(stage, mode):
    rng, truth, _, views = _views(3, 0.5, 0.2, count=4)
    views = [views[0].take(np.arange(len(views[0])) < 90), *views[1:]]  # views of different sizes
    lens = replace(CAMERA, fx=540.0, dist=(0.05, -0.02, 0.001, 0.002, 0.0))
    camera, problem = replace(_start(rng, truth), intrinsics=lens), JointProblem.of(views, CAMERA, _guess(), MODES[mode])
    want_cost, want_gradient, want = _twin(camera, views, problem, stage)
    r = reproject(camera, problem.matches)
    got = _equations(camera, problem, stage, problem.deviations_px(r.across))
    assert got.cost == pytest.approx(want_cost, rel=1e-6)
    unit = 1 / np.sqrt(np.diag(want))
    np.testing.assert_allclose(unit * got.gradient, unit * want_gradient, atol=1e-6 * np.abs(unit * want_gradient).max())
    np.testing.assert_allclose(np.outer(unit, unit) * got.information, np.outer(unit, unit) * want, atol=1e-6)


def test_a_part_of_a_problem_is_the_problem_of_those_views():
    _, _, _, views = _views(2, 0.5)
    views = [v.take(np.arange(len(v)) >= 7 * i) for i, v in enumerate(views)]
    part = JointProblem.of(views, CAMERA, GIVEN).part(slice(1, None, 2))
    want = JointProblem.of(views[1::2], CAMERA, GIVEN)
    for got, expected in ((part.matches.points, want.matches.points), (part.matches.observed, want.matches.observed)):
        np.testing.assert_array_equal(got, expected)
    np.testing.assert_array_equal(part.counts, want.counts)


def test_matches_without_depth_take_no_part():
    _, _, _, views = _views(2)
    holes = np.arange(len(views[0])) % 3 == 0
    views[0] = replace(views[0], depth=np.where(holes, np.nan, views[0].depth))
    problem = JointProblem.of(views, CAMERA, GIVEN)
    assert problem.counts[0] == (~holes).sum() and problem.counts[1] == len(views[1])
    assert np.isfinite(problem.matches.points).all()


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
    problem = JointProblem.of(off, CAMERA, GIVEN)
    flat = replace(problem, weights=np.ones_like(problem.weights))
    start = CameraUnknowns(truth, CAMERA)
    weighed, plain = (pose_error(fit_joint(start, p, "epipolar").camera.pose, truth)[0] for p in (problem, flat))
    assert weighed < 0.7 * plain


def test_auto_leaves_a_depth_that_lies():
    rng, truth, points, views = _views(7, 0.2)
    lying = [replace(v, depth=1.05 * v.depth, depth_std=1e-4 * v.depth) for v in views]
    problem = JointProblem.of(lying, CAMERA, GIVEN)
    reference = make_matches(rng, truth, truth, points, 0.2, reference=True)
    fits = {stage: fit_joint(_start(rng, truth, 0.001), problem, stage) for stage in FIT_KINDS}
    assert choose(fits, JointProblem.of([reference], CAMERA, GIVEN)) == "epipolar"
    assert pose_error(fits["epipolar"].camera.pose, truth)[0] < 0.2 * pose_error(fits["joint"].camera.pose, truth)[0]
    nothing = reference.take(np.zeros(len(reference), bool))
    assert choose(fits, JointProblem.of([nothing], CAMERA, GIVEN)) == "joint"


def test_pins_that_weigh_more_than_the_matches_hold_the_camera_and_those_that_weigh_less_hardly_move_it():
    """Matches of one pose, and pins of another one that is 0.02 away."""
    rng, truth, points, views = _views(3, noise=0.3)
    other = se3_exp([0.02, 0, 0, 0, 0.004, 0]) @ truth
    seen = CAMERA.project(other.transform(points))
    chosen = np.flatnonzero(np.isfinite(seen).all(axis=1))[:8]
    problem = JointProblem.of(views, CAMERA, GIVEN)
    plain = fit_joint(_start(rng, truth), problem, "joint").camera.pose
    for weight, near, far in ((1.0, truth, other), (1e5, other, truth)):
        pins = PinnedPoints.of(points[chosen], seen[chosen], 2.0, np.full(8, weight), 6.0)
        held = fit_joint(CameraUnknowns(plain, CAMERA), replace(problem, pins=pins), "joint").camera.pose
        assert pose_error(held, near)[0] < 0.25 * pose_error(held, far)[0]
