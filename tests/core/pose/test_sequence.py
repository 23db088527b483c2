"""Moving plates: order, strays, smoothing and filling on paths with exact truth."""

import itertools

import numpy as np
import pytest

from core.errors import RefineError
from core.geometry.camera import Pose, pose_error
from core.geometry.lie import so3_exp
from core.pose.sequence import FramePose, interpolate, keyframes, nearest, outward, smooth, stray_frames

DEPTH = 3.0


def truth(frame):
    """A camera that walks along a bow and looks about."""
    s = frame / 100
    centre = np.array([np.sin(s), 0.2 * np.cos(1.3 * s), 0.8 * s])
    return Pose.from_centre(so3_exp([0.15 * np.sin(s), 0.5 * s, 0.1 * np.cos(s)]), centre)


def track(frames, noise=0.0, noise_deg=0.0, seed=0):
    rng = np.random.default_rng(seed)
    out = []
    for frame in frames:
        pose = truth(frame)
        turn = so3_exp(np.radians(noise_deg) * rng.normal(size=3)) @ pose.R
        out.append(FramePose(frame, Pose.from_centre(turn, pose.centre + noise * rng.normal(size=3))))
    return out


def errors(poses, frames):
    return np.array([pose_error(pose, truth(frame)) for pose, frame in zip(poses, frames, strict=True)])


def test_keyframes_hold_both_ends():
    assert keyframes(1, 21, 10) == [1, 11, 21]
    assert keyframes(-3, 20, 10) == [-3, 7, 17, 20]
    assert keyframes(5, 5, 10) == [5]
    with pytest.raises(RefineError, match="before its start"):
        keyframes(2, 1, 1)
    with pytest.raises(RefineError, match="at least 1"):
        keyframes(1, 2, 0)


@pytest.mark.parametrize("seed", [-50, 1, 30, 33, 61, 500])
def test_every_frame_has_a_done_neighbour(seed):
    frames = keyframes(1, 61, 10)
    order = outward(frames, seed)
    assert sorted(order) == frames
    for k, frame in enumerate(order[1:], 1):
        assert abs(nearest(frame, order[:k]) - frame) == 10
    assert nearest(3, []) is None


@pytest.mark.parametrize("bad", [[], [0], [1], [9], [19], [18], [0, 7], [5, 6], [3, 11, 19]])
@pytest.mark.parametrize("seed", range(3))
def test_strays_are_found_and_nothing_else(bad, seed):
    clean = track(range(0, 200, 10), 0.003, 0.05, seed)
    rng = np.random.default_rng(seed + 10)
    for i in bad:
        pose = clean[i].pose
        way = rng.normal(size=3)
        moved = pose.centre + 0.6 * way / np.linalg.norm(way)
        clean[i] = FramePose(clean[i].frame, Pose.from_centre(so3_exp(0.1 * rng.normal(size=3)) @ pose.R, moved))
    assert stray_frames(clean, DEPTH) == [10 * i for i in bad]


def test_a_camera_that_only_turns_wrongly_is_found():
    frames = track(range(0, 100, 10))
    frames[4] = FramePose(40, Pose.from_centre(so3_exp([0, 0.2, 0]) @ frames[4].pose.R, frames[4].pose.centre))
    assert stray_frames(frames, DEPTH) == [40]


def test_too_few_frames_are_not_judged():
    frames = track([0, 10, 20])
    frames[1] = FramePose(10, Pose())
    assert stray_frames(frames, DEPTH) == []
    assert stray_frames([], DEPTH) == []


def test_smoothing_brings_noise_down_and_the_path_nearer_the_truth():
    frames = [f for f in range(0, 300, 5) if f not in (100, 105, 110)]
    noisy = track(frames, 0.01, 0.2, seed=1)
    before, after = errors([p.pose for p in noisy], frames), errors(smooth(noisy, 60), frames)
    assert np.sqrt((after**2).mean(axis=0) / (before**2).mean(axis=0)).max() < 0.6


def test_smoothing_leaves_steady_motion_alone():
    spin, speed = np.array([0.002, 0.004, -0.001]), np.array([0.01, 0.0, 0.02])
    frames = [0, 7, 20, 30, 55, 60]
    steady = [FramePose(f, Pose.from_centre((so3_exp(f * spin)).T, f * speed)) for f in frames]
    for before, after in zip(steady, smooth(steady, 100), strict=True):
        distance, degrees = pose_error(after, before.pose)
        assert distance < 1e-10
        assert degrees < 1e-8


def test_smoothing_halves_a_wave_of_that_many_frames():
    frames = np.arange(0, 800, 2)
    wave = [
        FramePose(
            int(f), Pose.from_centre(so3_exp([0, 0, 0.01 * np.sin(2 * np.pi * f / 40)]).T, [np.sin(2 * np.pi * f / 40), 0, 0])
        )
        for f in frames
    ]
    middle = slice(100, 300)
    out = smooth(wave, 40)
    centre = np.array([p.centre[0] for p in out])[middle]
    angle = np.array([np.arcsin(p.R.T[1, 0]) for p in out])[middle]
    assert np.abs(centre).max() == pytest.approx(0.5, abs=0.03)
    assert np.abs(angle).max() == pytest.approx(0.005, abs=0.0003)


def test_a_doubted_frame_bends_the_path_less():
    frames = track(range(0, 100, 10))
    off = Pose.from_centre(frames[5].pose.R, frames[5].pose.centre + np.array([0.1, 0, 0]))
    believed, doubted = ([*frames[:5], FramePose(50, off, w), *frames[6:]] for w in (1.0, 0.05))
    far, near = (errors(smooth(t, 30), range(0, 100, 10))[5, 0] for t in (believed, doubted))
    assert near < 0.5 * far


def test_no_smoothing_changes_nothing():
    frames = track(range(0, 50, 10), 0.01)
    assert smooth(frames, 0) == [p.pose for p in frames]
    assert smooth(frames[:2], 50) == [p.pose for p in frames[:2]]


def test_gaps_are_filled_close_to_the_truth():
    keys = track([0, 10, 20, 40, 50, 60, 70])
    frames = list(range(71))
    off = errors(interpolate(keys, frames), frames)
    assert off[:, 0].max() < 1.5e-3
    assert off[:, 1].max() < 0.06
    assert errors(interpolate(keys, [20, 70]), [20, 70]).max() < 1e-6


def test_the_filled_path_has_no_jumps_in_velocity():
    keys = track([0, 10, 30, 40])
    step = 1e-4
    for knot in (10, 30):
        poses = interpolate(keys, [knot - step, knot, knot + step])
        before, after = (b.centre - a.centre for a, b in itertools.pairwise(poses))
        np.testing.assert_allclose(before, after, atol=1e-8)
        turns = [p.R.T for p in poses]
        np.testing.assert_allclose(turns[1] @ turns[0].T, turns[2] @ turns[1].T, atol=1e-8)


def test_nothing_is_made_up_outside():
    keys = track([10, 20])
    with pytest.raises(RefineError, match="between"):
        interpolate(keys, [9])
    assert interpolate(keys[:1], [10]) == [keys[0].pose]
    with pytest.raises(RefineError):
        interpolate([], [])
