"""The whole loop on a ray-cast room: exact truth, and a renderer that shares no code with ours."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from boxroom import DEPTH, LENS, TRUTH, BoxRoom
from boxroom import start_off as _start

import core.pose.search.loop as loop_module
from core.errors import RefineError
from core.geometry.camera import Camera, Pose, pose_error
from core.photos.photo import Photo
from core.pose.refine import iterate_refinement, refine
from core.pose.report_json import report_to_dict
from core.pose.search.observe import grey_of
from core.pose.settings import RefineSettings
from core.pose.shared.working import WorkingPhoto
from core.pose.verdict.verify import compare

pytestmark = pytest.mark.loop


@pytest.mark.parametrize("seed", range(3))
def test_a_near_start_comes_home(room, photo, seed):
    report = refine(room, photo, Camera(LENS, _start(0.05, 4.0, seed), "p.png"))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict == "trusted", report.reasons
    assert distance < 0.001 * DEPTH and degrees < 0.06
    assert report.camera.intrinsics == LENS and report.camera.file == "p.png"
    assert report.iterations[-1].inliers > 200 and report.iterations[-1].rms_px_of_photo < 0.5


def test_a_far_start_comes_home_in_more_iterations(room, photo):
    report = refine(room, photo, Camera(LENS, _start(0.18, 15.0, 1)))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict == "trusted", report.reasons
    assert distance < 0.002 * DEPTH and degrees < 0.12
    assert len(report.iterations) > 1


def test_the_same_seed_gives_the_same_answer_whatever_the_threads(room, photo):
    start = Camera(LENS, _start(0.05, 4.0))
    a, b = (refine(room, photo, start, RefineSettings(seed=3, threads=threads)) for threads in (1, 3))
    np.testing.assert_array_equal(a.camera.pose.R, b.camera.pose.R)
    np.testing.assert_array_equal(a.camera.pose.t, b.camera.pose.t)


@pytest.mark.parametrize("units", [0.04, 0.5])
def test_a_deviation_in_scene_units_is_that_of_the_rendered_candidates(room, photo, units):
    """2 sqrt(2 / pi) is the mean length of a 3D Gaussian of deviation 1, at which the candidates stand around the start, and
    those of the last stage around what it starts from."""
    centres = []

    class Recorder:
        def render(self, intrinsics, pose):
            centres.append(pose.centre)
            return room.render(intrinsics, pose)

    start = _start(0.05, 4.0)
    settings = RefineSettings(perturb_translation_units=units, candidates=6, threads=1)
    work, fine = iterate_refinement(Recorder(), photo, Camera(LENS, start), settings), 0
    for progress in work:
        fine = fine or (len(centres) if progress.step == "rendering the photo's view" else 0)
        if fine and len(centres) >= fine + 7:
            break
    work.close()
    for group in (centres[:7], centres[fine : fine + 7]):
        distances = np.linalg.norm(np.array(group) - group[0], axis=1)
        np.testing.assert_allclose(sorted(distances), [0.0] + [2 * np.sqrt(2 / np.pi) * units] * 6, rtol=1e-4, atol=1e-12)
    np.testing.assert_array_equal(centres[0], start.centre)


def test_a_photo_at_a_twentieth_of_its_exposure_comes_home(room, photo):
    dark = Photo((photo.pixels * 0.05).astype(np.uint8))
    assert dark.pixels.max() < 13
    report = refine(room, dark, Camera(LENS, _start(0.05, 4.0)))
    assert report.verdict == "trusted", report.reasons
    assert pose_error(report.camera.pose, TRUTH)[0] < 0.003 * DEPTH


def test_lens_distortion_is_honoured(room, photo):
    """Told that there is no distortion, the same photo ends measurably farther off."""
    start = _start(0.05, 4.0)
    right = refine(room, photo, Camera(LENS, start))
    wrong = refine(room, photo, Camera(LENS.pinhole(), start))
    assert pose_error(right.camera.pose, TRUTH)[0] < 0.25 * pose_error(wrong.camera.pose, TRUTH)[0]


def test_without_the_epipolar_stage_the_coarse_answer_stands(room, photo):
    report = refine(room, photo, Camera(LENS, _start(0.05, 4.0)), RefineSettings(epipolar=False))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert distance < 0.01 * DEPTH and degrees < 0.5


def test_one_view_alone_is_less_exact(room, photo):
    start = Camera(LENS, _start(0.05, 4.0))
    full, less = (refine(room, photo, start, RefineSettings(multiview=on)) for on in (True, False))
    error = pose_error(less.camera.pose, TRUTH)[0]
    assert pose_error(full.camera.pose, TRUTH)[0] < error < 0.05 * DEPTH
    assert less.iterations[0].views_used == 1


def _failed_untouched(report, start, word):
    assert report.verdict == "failed"
    assert report.camera is start
    assert len(report.reasons) >= 1 and all(word in r or r.endswith(".") for r in report.reasons)
    assert word in " ".join(report.reasons)


def test_a_photo_of_another_place_fails_and_leaves_the_camera(photo):
    start = Camera(LENS, _start(0.05, 4.0))
    report = refine(BoxRoom(seed=9), photo, start, RefineSettings(iterations=2))
    _failed_untouched(report, start, "another place")


@pytest.fixture(scope="module")
def mirrored(room, photo):
    """What comes of a photo that is mirrored, and its start."""
    start = Camera(LENS, _start(0.05, 4.0))
    return refine(room, Photo(np.ascontiguousarray(photo.pixels[:, ::-1])), start), start


def test_a_mirrored_photo_fails(mirrored):
    report, start = mirrored
    _failed_untouched(report, start, "another place")


def test_a_start_that_sees_nothing_says_so(room, photo):
    start = Camera(LENS, Pose.from_centre(TRUTH.R, [50.0, 0.0, 60.0]))
    _failed_untouched(refine(room, photo, start), start, "sees almost nothing")


def test_a_photo_without_features_says_so(room):
    start = Camera(LENS, TRUTH)
    _failed_untouched(refine(room, Photo(np.full((240, 320, 3), 90, np.uint8)), start), start, "features")


def test_progress_is_told_and_closing_the_generator_stops_the_work(photo):
    room = BoxRoom()
    work = iterate_refinement(room, photo, Camera(LENS, _start(0.05, 4.0)), RefineSettings(threads=1))
    first = next(work)
    assert first.iteration == 1 and 0 <= first.fraction < 1
    next(work)
    work.close()
    calls = room.calls
    assert calls < 7
    with pytest.raises(StopIteration):
        next(work)


def test_fractions_rise_and_each_iteration_leaves_a_record(room, photo):
    seen = []
    report = refine(room, photo, Camera(LENS, _start(0.18, 15.0, 1)), on_progress=seen.append)
    fractions = [p.fraction for p in seen]
    assert fractions == sorted(fractions) and fractions[-1] < 1
    assert [p.record for p in seen if p.record] == list(report.iterations)


def test_an_exception_from_the_progress_callback_comes_through(room, photo):
    class StopError(Exception):
        pass

    def stop(_):
        raise StopError

    with pytest.raises(StopError):
        refine(room, photo, Camera(LENS, _start(0.05, 4.0)), on_progress=stop)


@pytest.mark.parametrize("bad", [{"iterations": 0}, {"candidates": 0}, {"long_side_px": 10}, {"threads": -1}])
def test_options_out_of_range_are_refused(bad):
    with pytest.raises(RefineError, match=next(iter(bad))):
        RefineSettings(**bad)


def test_a_start_that_is_right_stays_right(room, photo):
    report = refine(room, photo, Camera(LENS, TRUTH))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict == "trusted" and distance < 0.001 * DEPTH and degrees < 0.06


def test_a_worse_answer_than_the_start_is_not_handed_back(room, photo, monkeypatch):
    """Whatever the stages come to, the start that fits the photo better is kept, and the report says so."""
    fit = loop_module.fine_pose

    def spoilt(pose, views, K):
        good = fit(pose, views, K)
        return replace(good, pose=Pose.from_centre(good.pose.R, good.pose.centre + 0.003 * DEPTH))

    monkeypatch.setattr(loop_module, "fine_pose", spoilt)
    start = Camera(LENS, TRUTH)
    report = refine(room, photo, start, RefineSettings(iterations=1, final="none"))
    assert report.camera is start and report.verdict in ("check", "failed")
    assert report.verdict == "check" and "kept" in report.reasons[0]
    assert report.quality.of == "start" and report.quality.pose == start.pose
    render = room.render(LENS.pinhole(), start.pose)
    look = WorkingPhoto.of(photo, LENS, 640)
    seen = compare(look, grey_of(render), render.alpha > 0.5)
    assert (report.quality.corners, report.quality.agreement) == (seen.corners, seen.agreement), "the start's own evidence"
    assert report.quality.inliers == 0 and np.isnan(report.quality.rms_px_of_photo), "no fit had a part in the start"
    assert 0.8 * DEPTH < report.quality.median_depth < 1.2 * DEPTH


def test_evidence_says_which_pose_it_is_of(room, photo, mirrored):
    good = refine(room, photo, Camera(LENS, _start(0.05, 4.0)))
    assert good.quality.of == "refined" and good.quality.pose == good.camera.pose
    failed, start = mirrored
    assert failed.verdict == "failed"
    if failed.quality is not None:
        assert failed.quality.of == "rejected" and failed.quality.pose != start.pose
        assert report_to_dict(failed)["quality"]["pose"]["t"] == failed.quality.pose.t.tolist()


@pytest.mark.parametrize("final", ["joint", "none"])
def test_pixels_are_those_of_the_photo_whatever_size_it_was_matched_at(room, final):
    """Twice the pixels of the same picture: the errors are twice as many pixels of it."""
    lens = LENS.resized(640, 480)
    large = room.photo(lens, TRUTH)
    small = Photo(np.asarray(cv2.resize(large.pixels, (320, 240), interpolation=cv2.INTER_AREA)))
    settings = RefineSettings(final=final, long_side_px=320, final_long_side_px=320)
    got = [refine(room, p, Camera(k, _start(0.05, 4.0)), settings) for p, k in ((small, LENS), (large, lens))]
    (a, b), (s, t) = [r.quality for r in got], [r.iterations[-1] for r in got]
    assert b.offset_px_of_photo == pytest.approx(2 * a.offset_px_of_photo, rel=0.1)
    assert b.rms_px_of_photo == pytest.approx(2 * a.rms_px_of_photo, rel=0.1)
    assert t.rms_px_of_photo == pytest.approx(2 * s.rms_px_of_photo, rel=0.1)
    assert (a.photo_long_side_px, b.photo_long_side_px) == (320, 640)


@pytest.mark.parametrize("final", ["joint", "epipolar", "depth", "none"])
def test_every_last_stage_comes_home(room, photo, final):
    report = refine(room, photo, Camera(LENS, _start(0.05, 4.0)), RefineSettings(final=final))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict == "trusted", report.reasons
    assert distance < 0.001 * DEPTH and degrees < 0.06
    assert report.stage == ("loop" if final == "none" else final)


@pytest.mark.parametrize("wrong", [0.75, 1.25])
def test_a_guessed_focal_length_is_solved_for(room, photo, wrong):
    """A quarter off, as a guess may be; the ratio of fx to fy is the camera's and stays."""
    guess = replace(LENS, fx=LENS.fx * wrong, fy=LENS.fy * wrong)
    report = refine(room, photo, Camera(guess, _start(0.05, 4.0), "p.png", focal_guessed=True))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict == "trusted" and report.solved_lens, report.reasons
    assert distance < 0.01 * DEPTH and degrees < 0.1
    k = report.camera.intrinsics
    assert k.fx == pytest.approx(LENS.fx, rel=5e-3) and k.fx / k.fy == pytest.approx(LENS.fx / LENS.fy, rel=2e-3)
    assert not report.camera.focal_guessed
    assert 0 < report.quality.focal_std_pct < 1


def test_the_whole_lens_is_solved_for(room, photo):
    """Told of no distortion and a shifted centre, it finds both."""
    guess = replace(LENS.pinhole(), cx=LENS.cx + 4, cy=LENS.cy - 3)
    settings = RefineSettings(lens="full", iterations=6)
    report = refine(room, photo, Camera(guess, _start(0.03, 2.0)), settings)
    plain = refine(room, photo, Camera(guess, _start(0.03, 2.0)), replace(settings, lens="fixed"))
    k = report.camera.intrinsics
    assert k.dist[0] == pytest.approx(LENS.dist[0], abs=0.02)
    assert abs(k.cx - LENS.cx) < 2 and abs(k.cy - LENS.cy) < 2
    assert pose_error(report.camera.pose, TRUTH)[0] < 0.5 * pose_error(plain.camera.pose, TRUTH)[0]


def test_a_distortion_that_nobody_told_of_is_found_where_the_lens_is_a_guess(room, photo):
    guess = replace(LENS.pinhole(), fx=LENS.fx * 1.1, fy=LENS.fy * 1.1)
    report = refine(room, photo, Camera(guess, _start(0.05, 4.0), focal_guessed=True))
    k = report.camera.intrinsics
    assert report.verdict == "trusted" and report.solved_lens, report.reasons
    assert k.dist[0] == pytest.approx(LENS.dist[0], abs=0.015) and k.fx == pytest.approx(LENS.fx, rel=5e-3)
    assert (k.cx, k.cy) == pytest.approx((guess.cx, guess.cy), abs=1.0)
    assert pose_error(report.camera.pose, TRUTH)[0] < 0.004 * DEPTH


@pytest.mark.parametrize("lens", ["fixed", "focal"])
def test_and_is_told_where_it_may_not_be_solved_for(room, photo, lens):
    report = refine(room, photo, Camera(LENS.pinhole(), _start(0.05, 4.0)), RefineSettings(lens=lens))
    assert report.verdict == "check" and report.solved_lens == (lens == "focal")
    assert any("The lens does not fit the photo" in reason for reason in report.reasons)
    assert report.quality.lens_log_odds > 10


def test_a_wrong_focal_length_held_fixed_is_not_trusted(room, photo):
    guess = replace(LENS, fx=LENS.fx * 1.25, fy=LENS.fy * 1.25)
    report = refine(room, photo, Camera(guess, _start(0.05, 4.0)))
    assert report.verdict != "trusted"
    assert report.camera.intrinsics == guess


@pytest.mark.parametrize("bad", [{"final": "best"}, {"lens": "zoom"}])
def test_words_that_are_no_option_are_refused(bad):
    with pytest.raises(RefineError, match="give one of auto"):
        RefineSettings(**bad)
