"""A doubt is worked on before it is told: what further runs of the loop mend, and what they cost."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from boxroom import DEPTH, LENS, TRUTH, BoxRoom
from boxroom import start_off as _start

import core.pose.search.loop as loop_module
from core.geometry.camera import Camera, Pose, pose_error
from core.photos.photo import Photo
from core.pose.refine import refine
from core.pose.settings import RefineSettings

pytestmark = pytest.mark.loop


def spoil(monkeypatch, runs, way):
    """The first `runs` answers of the loop end `way` (3,) scene units away from where they should."""
    fit, calls = loop_module.fine_pose, []

    def spoilt(pose, views, K):
        good = fit(pose, views, K)
        calls.append(pose)
        moved = Pose.from_centre(good.pose.R, good.pose.centre + np.asarray(way))
        return replace(good, pose=moved) if len(calls) <= runs else good

    monkeypatch.setattr(loop_module, "fine_pose", spoilt)
    return calls


def test_an_answer_that_does_not_sit_is_tried_again_and_comes_home(room, photo, monkeypatch):
    spoil(monkeypatch, 1, (0.08 * DEPTH, 0.0, 0.0))
    seen = []
    report = refine(room, photo, Camera(LENS, _start(0.02, 1.0)), RefineSettings(iterations=1), seen.append)
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict == "trusted", (report.reasons, report.details)
    assert distance < 0.002 * DEPTH and degrees < 0.1
    assert "tried again" in report.details[-1] and "another camera" in report.details[-1]
    assert [r.index for r in report.iterations] == list(range(len(report.iterations)))
    fractions = [p.fraction for p in seen]
    assert fractions == sorted(fractions) and fractions[-1] < 1


def test_a_doubt_that_stays_ends_after_a_bounded_number_of_runs_and_changes_nothing(room, photo, monkeypatch):
    calls = spoil(monkeypatch, 99, (0.08 * DEPTH, 0.0, 0.0))
    start = Camera(LENS, _start(0.02, 1.0))
    report = refine(room, photo, start, RefineSettings(iterations=1, candidates=3))
    assert report.verdict == "failed" and report.camera is start
    assert 2 <= len(calls) <= 3 and len(report.iterations) == len(calls)


def test_a_camera_beyond_doubt_costs_no_further_view(photo):
    room = BoxRoom()
    report = refine(room, photo, Camera(LENS, _start(0.05, 4.0)))
    assert report.verdict == "trusted"
    assert not any("tried again" in sentence for sentence in report.details)
    assert room.calls <= 7 * len(report.iterations) + 3 * 7 + 1


def test_a_photo_most_of_which_is_hidden_is_placed_and_not_called_another_place(room, photo):
    """Something else stands before three quarters of the photo, a corner of the room is seen."""
    height, width = photo.pixels.shape[:2]
    noise = cv2.GaussianBlur(np.random.default_rng(1).normal(size=(height, width, 3)), (0, 0), 2.0)
    hidden = np.clip(128 + 60 * noise / noise.std(), 0, 255).astype(np.uint8)
    hidden[:, : round(0.3 * width)] = photo.pixels[:, : round(0.3 * width)]
    report = refine(room, Photo(hidden), Camera(LENS, _start(0.03, 2.0)))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict in ("trusted", "check"), report.reasons
    assert distance < 0.01 * DEPTH and degrees < 0.5
    assert report.quality.agreement < 0.36, "by the share of all corners it would be doubted"
