"""Poses from pairs of features and landmarks, against exact truth."""

from dataclasses import replace

import numpy as np
import pytest

from core.features.types import Features
from core.geometry.camera import Intrinsics, Pose, pose_error
from core.geometry.lie import so3_exp
from core.locate.hypotheses import Hypothesis, grown_pose, merged, sampled_pose
from core.locate.matching import Pairs
from core.pose.search.observe import PhotoFeatures
from core.pose.shared.corners import filled_cells
from core.pose.shared.working import WorkingPhoto

LENS = Intrinsics(640, 480, 520.0, 520.0, 320.0, 240.0)


def scene(seed=0, count=120, wrong=0.4, noise_px=0.5, lens=LENS):
    """A query whose feature i shows the landmark i, but for a share of `wrong` ones, and the true pose."""
    rng = np.random.default_rng(seed)
    pose = Pose.from_centre(so3_exp(rng.normal(size=3)), rng.normal(size=3))
    depth = rng.uniform(2, 6, count)
    pixels = rng.uniform((5, 5), (635, 475), (count, 2))
    rays = np.column_stack([lens.normalise(pixels), np.ones(count)]) * depth[:, None]
    points = (rays - pose.t) @ pose.R
    lost = rng.random(count) < wrong
    points[lost] = rng.permutation(points[lost])
    seen = pixels + noise_px * rng.normal(size=pixels.shape)
    grey = np.zeros((480, 640), np.uint8)
    image = WorkingPhoto(LENS, grey, None, grey, grey, None)
    return (
        PhotoFeatures(image, Features(seen, np.zeros((count, 128), np.float32), (640, 480))),
        Pairs(np.arange(count), points),
        pose,
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_pose_comes_out_of_mostly_wrong_pairs(seed):
    query, pairs, truth = scene(seed, wrong=0.6)
    start = sampled_pose(query, pairs, guessed=False)
    assert start is not None
    found = grown_pose(query, pairs, *start, guessed=False)
    distance, degrees = pose_error(found.pose, truth)
    assert distance < 0.03
    assert degrees < 0.4
    assert found.factor == 1.0
    assert found.inliers >= 40
    assert abs(found.depth - 4) < 0.7


@pytest.mark.parametrize("factor", [0.7, 1.35])
def test_an_unknown_focal_length_is_found_with_the_pose(factor):
    lens = replace(LENS, fx=LENS.fx * factor, fy=LENS.fy * factor)
    query, pairs, truth = scene(5, lens=lens)  # the query believes in LENS
    start = sampled_pose(query, pairs, guessed=True)
    found = grown_pose(query, pairs, *start, guessed=True)
    assert abs(found.factor / factor - 1) < 0.01
    assert pose_error(found.pose, truth)[0] < 0.05


def test_wrong_pairs_alone_hold_no_clear_pose():
    query, pairs, _ = scene(1, wrong=1.0)
    start = sampled_pose(query, pairs, guessed=False)
    found = None if start is None else grown_pose(query, pairs, *start, guessed=False)
    assert found is None or found.inliers < 20


def test_few_pairs_hold_no_pose():
    query, pairs, _ = scene(1, wrong=0.0)
    assert sampled_pose(query, pairs.take(np.arange(120) < 5), guessed=False) is None
    assert sampled_pose(query, Pairs.joined([]), guessed=True) is None


def test_a_feature_counts_once_however_many_views_show_it():
    query, pairs, truth = scene(2, count=40, wrong=0.0)
    found = grown_pose(query, Pairs.joined([pairs] * 5), truth, 1.0, guessed=False)
    assert found.inliers == 40


def test_a_cluster_of_inliers_scores_less_than_a_photo_full_of_them():
    query, _, truth = scene(0)
    spread = Hypothesis(truth, 1.0, 90, 30, 4.0)
    cluster = Hypothesis(truth, 1.0, 200, 3, 4.0)
    assert cluster.score < spread.score
    assert spread.clear
    assert not cluster.clear
    assert 30 < filled_cells(query.features.keypoints[:120], (640, 480), 6) <= 36


def test_one_place_is_one_hypothesis():
    a = Hypothesis(Pose.from_centre(np.eye(3), (0, 0, 0)), 1.0, 50, 20, 4.0)
    near = Hypothesis(Pose.from_centre(so3_exp((0, np.radians(5), 0)), (0.3, 0, 0)), 1.0, 60, 20, 4.0)
    turned = Hypothesis(Pose.from_centre(so3_exp((0, np.radians(20), 0)), (0, 0, 0)), 1.0, 40, 20, 4.0)
    assert merged([a, near, turned]) == [near, turned]
