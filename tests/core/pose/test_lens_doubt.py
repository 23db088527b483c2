"""A lens that was given and is wrong is found out, a right one is left in peace; and deviations know of what was held."""

from dataclasses import replace

import numpy as np
import pytest
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.geometry.camera import Camera, Pose, pose_error
from core.pose.final.joint import SCALE, SHARED_ERROR, JointProblem, fit_joint
from core.pose.final.lens_doubt import SUSPECTS, doubt
from core.pose.final.reprojection import apply, reproject, whitening
from core.pose.final.solution import from_joint
from core.pose.final.stage import FinalStage
from core.pose.settings import RefineSettings
from core.pose.shared.lens import ALL, CALIBRATED_STD, FOCAL, GUESS_STD, PRIOR_STD, CameraUnknowns, LensPrior, moved_lens

GIVEN = LensPrior(CAMERA, CALIBRATED_STD, "calibrated")
DEPTH = 3.0


def _seen(seed, lens, noise=0.3):
    """A true pose and matches with six views, whose photo a camera of the lens `lens` took, read as if it were CAMERA's."""
    rng = np.random.default_rng(seed)
    truth, points = random_pose(rng), world(rng)
    views = [make_matches(rng, truth, v, points, noise) for v in fan(rng, truth, 6)]
    pixels = [lens.project(np.column_stack([v.query, np.ones(len(v))])) for v in views]
    return truth, [replace(v, query=CAMERA.normalise(p)) for v, p in zip(views, pixels, strict=True)]


def _fit(seed, lens, prior=GIVEN, free=()):
    truth, views = _seen(seed, lens)
    return truth, fit_joint(CameraUnknowns(truth, prior.lens), JointProblem.of(views, CAMERA, prior, free), "joint")


@pytest.mark.parametrize("seed", range(6))
def test_a_lens_that_is_right_raises_no_doubt(seed):
    _, fit = _fit(seed, CAMERA)
    assert doubt(fit).log_odds < -8


WRONG = {
    "focal length": replace(CAMERA, fx=1.03 * CAMERA.fx, fy=1.03 * CAMERA.fy),
    "principal point": replace(CAMERA, cx=CAMERA.cx + 12, cy=CAMERA.cy - 9),
    "distortion": replace(CAMERA, dist=(-0.1, 0.02, 0, 0, 0)),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_lens_is_found_out_and_how_far_it_moved_the_camera(name):
    truth, fit = _fit(1, WRONG[name])
    found = doubt(fit)
    assert found.log_odds > 15
    distance, degrees = pose_error(fit.camera.pose, truth)
    assert found.shift_units == pytest.approx(distance, rel=0.25, abs=0.003)
    assert found.shift_deg == pytest.approx(degrees, rel=0.25, abs=0.05)
    assert found.focal_change == pytest.approx(WRONG[name].focal / CAMERA.focal - 1, abs=0.004)


def _cost(camera, problem, sigma_px):
    """The cost of a camera summed plainly from whitened residuals, and that of its prior."""
    r = reproject(camera, problem.matches)
    squared = (apply(whitening(r, sigma_px, problem.matches.depth_std), r.residual) ** 2).sum(0) / SCALE**2
    off = problem.prior.off(camera.intrinsics) / problem.prior.std
    return (problem.weights * squared / (1 + squared)).sum() * SCALE**2 / 2 / SHARED_ERROR**2 + 0.5 * off @ off


def test_the_odds_are_those_of_the_two_models_written_out():
    _, fit = _fit(2, replace(CAMERA, fx=1.004 * CAMERA.fx, fy=1.004 * CAMERA.fy))
    wide = replace(fit.problem, prior=LensPrior(CAMERA, GUESS_STD, "guess"), free=SUSPECTS)
    freer, std = fit_joint(fit.camera, wide, fit.kind), GUESS_STD[:5]
    sigma_px = wide.deviations_px(reproject(freer.camera, wide.matches).across)
    fall = _cost(fit.camera, wide, sigma_px) - _cost(freer.camera, wide, sigma_px)
    posterior = np.linalg.inv(freer.evidence.information[:11, :11] + np.diag([*[0.0] * 6, *std**-2]))[6:, 6:]
    want = fall + 0.5 * np.linalg.slogdet(posterior)[1] - np.log(std).sum()
    assert fall > 1 and doubt(fit).log_odds == pytest.approx(want, rel=1e-6)


def test_nothing_more_can_be_doubted_where_all_was_solved_for():
    _, fit = _fit(3, CAMERA, LensPrior(CAMERA, GUESS_STD, "guess"), ALL)
    assert doubt(fit).log_odds == -np.inf


def test_deviations_of_the_pose_know_what_a_lens_that_is_held_may_be_off():
    """Lenses drawn from the prior that a calibration has, each taken for the nominal one: the errors are as large as stated."""
    ratios, blind = [], []
    prior = replace(GIVEN, std=10 * CALIBRATED_STD)
    for seed in range(24):
        lens = moved_lens(CAMERA, prior.std * np.random.default_rng(seed).normal(size=9))
        truth, fit = _fit(seed, lens, prior, ALL)
        stated = from_joint(fit, DEPTH)
        distance, _ = pose_error(fit.camera.pose, truth)
        ratios.append(distance / stated.translation_std_units)
        pose_only = np.linalg.inv(fit.evidence.information[:6, :6])
        blind.append(distance / np.sqrt(np.trace(pose_only[:3, :3])))
    rms, without = np.sqrt(np.mean(np.square(ratios))), np.sqrt(np.mean(np.square(blind)))
    assert 1 / (2 * SHARED_ERROR) < rms < 1.25 and without > 1.5 * rms


def test_a_guess_states_what_the_matches_leave_of_its_width():
    _, fit = _fit(4, CAMERA, LensPrior(CAMERA, GUESS_STD, "guess"), ALL)
    std = from_joint(fit, DEPTH).lens_std
    assert (std < GUESS_STD).all() and std[0] < 0.05 * GUESS_STD[0]


def test_a_number_that_is_asked_for_is_as_open_as_a_guess():
    solving = GIVEN.solving(FOCAL)
    assert solving.std[0] == GUESS_STD[0] and (solving.std[1:] == CALIBRATED_STD[1:]).all()


def _photo_with_exif(true_factor, noise=1.0):
    """Matches of a photo whose EXIF says CAMERA's focal length, taken with `true_factor` times that."""
    lens = replace(CAMERA, fx=true_factor * CAMERA.fx, fy=true_factor * CAMERA.fy)
    return lens, *_seen(7, lens, noise)


def test_exif_is_a_guess_of_three_per_cent_where_the_focal_length_is_its_own():
    mm = CAMERA.focal * np.hypot(36, 24) / np.hypot(CAMERA.width, CAMERA.height)
    guessed = Camera(CAMERA, Pose(), focal_guessed=True)
    assert LensPrior.of(guessed, mm).source == "exif" and LensPrior.of(guessed, mm).std[0] == 0.03
    assert LensPrior.of(guessed, 1.1 * mm).source == LensPrior.of(guessed).source == "guess"
    assert LensPrior.of(replace(guessed, focal_guessed=False), mm).source == "calibrated"


@pytest.mark.parametrize(("true_factor", "refuted"), [(1.01, False), (1.5, True)])
def test_exif_of_a_cropped_photo_does_not_hold_its_focal_length(true_factor, refuted):
    lens, truth, views = _photo_with_exif(true_factor)
    prior = LensPrior(CAMERA, PRIOR_STD["exif"], "exif")
    stage = FinalStage(None, RefineSettings(final="joint"), prior, ALL)
    fit = stage._solve(CameraUnknowns(truth, CAMERA), views, views[0].take(np.zeros(len(views[0]), bool)), CAMERA)
    assert fit.camera.intrinsics.focal == pytest.approx(lens.focal, rel=5e-3)
    assert (fit.problem.prior.source == "guess") == refuted
