"""Pixels that are not square are found out, and square ones stay square to the last digit."""

from dataclasses import replace

import numpy as np
import pytest
from geometry import CAMERA, fan, make_matches, random_pose, world

from core.geometry.camera import pose_error
from core.pose.final.joint import JointProblem, fit_joint
from core.pose.final.squeeze import squeeze_log_odds, with_squeeze
from core.pose.shared.lens import GUESS_STD, MODES, CameraUnknowns, LensPrior

SQUARE = replace(CAMERA, fx=520.0, fy=520.0)


def _fit(seed, ratio):
    rng = np.random.default_rng(seed)
    truth, points = random_pose(rng), world(rng)
    lens = replace(SQUARE, fx=SQUARE.fx * np.sqrt(ratio), fy=SQUARE.fy / np.sqrt(ratio))
    views = [make_matches(rng, truth, v, points, 0.3) for v in fan(rng, truth, 6)]
    pixels = [lens.project(np.column_stack([v.query, np.ones(len(v))])) for v in views]
    views = [replace(v, query=SQUARE.normalise(p)) for v, p in zip(views, pixels, strict=True)]
    problem = JointProblem.of(views, SQUARE, LensPrior(SQUARE, GUESS_STD, "guess"), MODES["full"])
    return truth, fit_joint(CameraUnknowns(truth, SQUARE), problem, "joint")


@pytest.mark.parametrize("seed", range(5))
def test_square_pixels_stay_square(seed):
    _, fit = _fit(seed, 1.0)
    assert squeeze_log_odds(fit) < 0 and with_squeeze(fit) is fit
    assert fit.camera.intrinsics.fx == pytest.approx(fit.camera.intrinsics.fy, rel=1e-12)


@pytest.mark.parametrize("ratio", [0.94, 1.06])
def test_a_squeezed_picture_is_found_out(ratio):
    truth, fit = _fit(0, ratio)
    free = with_squeeze(fit)
    k = free.camera.intrinsics
    assert k.fx / k.fy == pytest.approx(ratio, rel=2e-3)
    assert pose_error(free.camera.pose, truth)[0] < 0.2 * pose_error(fit.camera.pose, truth)[0]


def test_a_lens_that_was_given_keeps_its_pixels():
    _, fit = _fit(0, 1.06)
    given = fit_joint(fit.camera, replace(fit.problem, free=()), fit.kind)
    assert with_squeeze(given) is given
