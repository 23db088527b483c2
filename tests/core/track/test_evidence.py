"""What a frame's matches know, against residuals worked out anew; and the shot's problem against cameras that are known."""

from dataclasses import replace

import numpy as np
import pytest
from geometry import CAMERA, make_matches, random_pose, world

from core.geometry.camera import Intrinsics, Pose, pose_error
from core.geometry.lie import adjoint, se3_exp, se3_log
from core.pose.final.joint import JointProblem, fit_joint
from core.pose.final.reprojection import reproject
from core.pose.shared.lens import CALIBRATED_STD, GUESS_STD, CameraUnknowns, LensPrior, lens_difference, moved_lens
from core.track.evidence import LENS, ROWS, XI, evidence_of
from core.track.focal import CHANGES, grown
from core.track.problem import Link, ShotProblem
from core.track.shot import motions, solve_shot

GIVEN = LensPrior(CAMERA, CALIBRATED_STD, "calibrated")
DEPTH = 3.5


def tied(rng, truth: Pose, lens: Intrinsics = CAMERA, noise=0.1, prior=GIVEN, row_motion=None):
    """The fit, with CAMERA, of a frame that a camera of the lens `lens` took from `truth`, to its own render; the row at height
    s is seen from exp(s row_motion) truth.
    """
    points = world(rng, offset=truth.centre)
    matches = make_matches(rng, truth, truth, points, 0.0, reference=True)
    pixels = lens.project(np.column_stack([matches.query, np.ones(len(matches))]))
    if row_motion is not None:
        for _ in range(3):  # the row depends on the pixel, which depends on the row
            rows = pixels[:, 1] / CAMERA.height - 0.5
            seen = [
                lens.project((se3_exp(s * row_motion) @ truth).transform(p[None]))[0] for s, p in zip(rows, points, strict=True)
            ]
            pixels = np.stack(seen)
    query = CAMERA.normalise(pixels + noise * rng.normal(size=pixels.shape))
    problem = JointProblem.of([replace(matches, query=query)], CAMERA, prior)
    return fit_joint(CameraUnknowns(truth, CAMERA), problem, "joint")


def test_se3_log_and_adjoint_are_those_of_se3_exp():
    rng = np.random.default_rng(0)
    for _ in range(10):
        xi, pose = rng.normal(size=6) * (0.5, 0.5, 0.5, 0.8, 0.8, 0.8), random_pose(rng)
        np.testing.assert_allclose(se3_log(se3_exp(xi)), xi, atol=1e-9)
        around = pose @ se3_exp(xi) @ pose.inverse()
        np.testing.assert_allclose(se3_log(around), adjoint(pose) @ xi, atol=1e-9)


@pytest.mark.parametrize("block", [XI, LENS, ROWS], ids=["pose", "lens", "rows"])
def test_the_error_after_a_step_is_the_error_of_the_moved_camera(block):
    rng = np.random.default_rng(1)
    fit = tied(rng, random_pose(rng), noise=0.5)
    evidence = evidence_of(fit, CAMERA.height)
    step = np.zeros(21)
    step[block] = 3e-4 * rng.normal(size=block.stop - block.start)
    before, matches = fit.camera, fit.problem.matches
    rows = matches.observed[1] / CAMERA.height - 0.5
    residuals = []
    for i, s in enumerate(rows):
        pose = se3_exp(step[XI] + s * step[ROWS]) @ before.pose
        one = CameraUnknowns(pose, moved_lens(before.intrinsics, step[LENS]))
        residuals.append(reproject(one, matches.take(np.arange(len(rows)) == i)).residual[:, 0])
    now = reproject(before, matches).residual
    inside = np.linalg.norm(now, axis=0) < 3 * np.median(np.linalg.norm(now, axis=0))
    if int(inside.sum()) != evidence.matches:  # the deviation across the lines bounds the inliers as well
        inside = np.linalg.norm(now, axis=0) < np.sort(np.linalg.norm(now, axis=0))[evidence.matches - 1] + 1e-12
    rms = np.sqrt((np.array(residuals)[inside] ** 2).sum(1).mean())
    assert evidence.rms_px(step) == pytest.approx(rms, rel=2e-3)
    assert evidence.rms_px(step) != pytest.approx(evidence.rms_px(np.zeros(21)), rel=2e-3)


def path(frame):
    """A camera that moves and turns, with a shake."""
    turn = 0.004 * np.array([np.sin(frame), np.cos(1.3 * frame), np.sin(0.7 * frame)])
    return se3_exp(np.array([0.02 * frame, 0.01 * np.sin(frame), 0.0, *turn]))


def shot(lens=CAMERA, readout=0.0, prior=GIVEN, frames=16, noise=0.1):
    """The problem of a shot whose ties are made of exact cameras and noise, begun off their poses; and its true poses."""
    rng = np.random.default_rng(3)
    truth = {f: path(f) for f in range(frames)}
    motion = motions(truth, readout)
    ties, poses = {}, {}
    for frame, pose in truth.items():
        fit = tied(rng, pose, lens, noise, prior, readout * motion[frame] if readout else None)
        ties[frame], poses[frame] = evidence_of(fit, CAMERA.height, readout > 0), fit.camera.pose
    return ShotProblem(poses, ties, [], CAMERA, prior, not prior.calibrated, readout > 0), truth


def test_the_readout_of_a_rolling_shutter_is_found():
    problem, truth = shot(readout=0.6)
    solution = solve_shot(problem)
    assert solution.readout == pytest.approx(0.6, rel=0.05)
    error = [pose_error(solution.poses[f], truth[f]) for f in truth]
    without = [pose_error(problem.poses[f], truth[f]) for f in truth]
    assert np.median([e[1] for e in error]) < 0.5 * np.median([e[1] for e in without])


def test_one_lens_is_solved_for_the_shot():
    lens = replace(CAMERA, fx=1.003 * CAMERA.fx, fy=1.003 * CAMERA.fy, cx=CAMERA.cx + 1.5, dist=(-0.005, 0, 0, 0, 0))
    problem, _ = shot(lens, prior=LensPrior(CAMERA, GUESS_STD, "guess"))
    solution = solve_shot(problem)
    found = moved_lens(CAMERA, solution.lens_step)
    assert found.focal == pytest.approx(lens.focal, rel=1e-3)
    assert found.cx == pytest.approx(lens.cx, abs=0.5)
    assert (np.abs(solution.lens_step - lens_difference(lens, CAMERA)) < 3 * solution.lens_std).all()
    before = np.mean([tie.rms_px(np.zeros(21)) for tie in problem.ties.values()])
    assert np.mean(list(solution.rms_px.values())) < before


def test_a_calibrated_lens_stays():
    problem, _ = shot()
    assert not solve_shot(problem).lens_step.any() and not solve_shot(problem).lens_std.any()


def zooming(frame):
    """The logarithm of the focal length over CAMERA's: a zoom to 1.3 times that starts and stops smoothly."""
    share = np.clip((frame - 4) / 24, 0, 1)
    return np.log(1.3) * share * share * (3 - 2 * share)


def test_a_zoom_is_solved_as_a_smooth_curve_through_what_single_frames_know():
    """Each frame is fitted with its own focal length, as a walk does it, and from one that is some per mille off."""
    rng, count = np.random.default_rng(4), 32
    truth = {f: path(f) for f in range(count)}
    ties, poses, grow = {}, {}, {}
    for frame, pose in truth.items():
        fit = tied_zoom(rng, pose, grown(CAMERA, zooming(frame)), grown(CAMERA, zooming(frame) + 0.005 * rng.normal()))
        ties[frame], poses[frame] = evidence_of(fit, CAMERA.height), fit.camera.pose
        grow[frame] = float(np.log(fit.camera.intrinsics.focal / CAMERA.focal))
    problem = ShotProblem(poses, ties, [], CAMERA, GIVEN, False, False, CHANGES["zoom"], grow, {0: 0.0})
    solution = solve_shot(problem)
    off = np.array([solution.grow(f) - zooming(f) for f in truth])
    single = np.array([grow[f] - zooming(f) for f in truth])
    assert np.sqrt((off**2).mean()) < 0.7 * np.sqrt((single**2).mean())
    std = np.array([solution.curve.std(f) for f in truth])
    assert (np.abs(off) < 4 * std).all() and std[0] < 3e-4 and std.max() < 0.002
    errors = np.array([pose_error(solution.poses[f], truth[f])[0] for f in truth])
    before = np.array([pose_error(poses[f], truth[f])[0] for f in truth])
    assert np.sqrt((errors**2).mean()) < 0.8 * np.sqrt((before**2).mean())


def tied_zoom(rng, truth, lens, expected):
    """As `tied`, of a frame that `lens` took, fitted from the lens `expected` with the focal length free."""
    points = world(rng, offset=truth.centre)
    matches = make_matches(rng, truth, truth, points, 0.0, reference=True)
    pixels = lens.project(np.column_stack([matches.query, np.ones(len(matches))]))
    query = expected.normalise(pixels + 0.5 * rng.normal(size=pixels.shape))
    prior = replace(GIVEN, lens=expected, std=GUESS_STD)
    problem = JointProblem.of([replace(matches, query=query)], expected, prior, (0,))
    return fit_joint(CameraUnknowns(truth, expected), problem, "joint")


def test_a_pinned_frame_stays_to_the_last_digit_and_draws_its_neighbours_along_its_links():
    problem, truth = shot(noise=0.5)
    rng, links = np.random.default_rng(5), []
    for a in range(len(truth) - 1):
        before, after = problem.poses[a], truth[a + 1] @ truth[a].inverse() @ problem.poses[a]
        carried = make_matches(rng, after, before, world(rng, offset=before.centre), 0.03, reference=True)
        fit = fit_joint(CameraUnknowns(after, CAMERA), JointProblem.of([carried], CAMERA, GIVEN), "joint")
        links.append(Link(a, a + 1, relinked(fit, problem.poses[a + 1])))
    free = replace(problem, links=links)
    wanted = se3_exp(np.array([0.01, 0, 0, 0, 0.001, 0])) @ truth[8]
    pinned = solve_shot(replace(free, pinned={8: wanted}))
    assert pose_error(pinned.poses[8], wanted) < (1e-12, 1e-9)
    moved = [pose_error(pinned.poses[f], solve_shot(free).poses[f])[0] for f in (7, 0)]
    assert moved[0] > 0.001 > moved[1], "the links hand it on, and less and less of it"


def test_links_take_out_the_noise_of_single_frames():
    """The links are far sharper than the ties; a shot that ignores them keeps the noise from frame to frame."""
    problem, truth = shot(noise=1.0)
    rng, links = np.random.default_rng(5), []
    for a in range(len(truth) - 1):
        before, after = problem.poses[a], truth[a + 1] @ truth[a].inverse() @ problem.poses[a]
        points = world(rng, offset=before.centre)
        carried = make_matches(rng, after, before, points, 0.03, reference=True)
        fit = fit_joint(CameraUnknowns(after, CAMERA), JointProblem.of([carried], CAMERA, GIVEN), "joint")
        links.append(Link(a, a + 1, relinked(fit, problem.poses[a + 1])))
    linked = solve_shot(replace(problem, links=links))
    assert _shake(linked.poses, truth) < 0.5 * _shake(solve_shot(problem).poses, truth)


def relinked(fit, pose):
    """The evidence of a link at the pose that the shot begins with."""
    return evidence_of(replace(fit, camera=CameraUnknowns(pose, fit.camera.intrinsics)), CAMERA.height)


def _shake(poses, truth):
    """RMS of the second differences of the error, radians."""
    off = np.stack([se3_log(poses[f] @ truth[f].inverse())[3:] for f in sorted(truth)])
    return float(np.sqrt((np.diff(off, 2, axis=0) ** 2).mean()))
