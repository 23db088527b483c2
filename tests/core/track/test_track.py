"""Whole tracks in the ray-cast room: accuracy, gaps, cuts, what is lost and said, and going on after an interruption."""

import itertools
import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pytest
from boxroom import DEPTH, LENS, TRUTH, BoxRoom

from core.errors import PhotoError, RefineError
from core.geometry.camera import Camera, pose_error
from core.geometry.lie import se3_exp
from core.photos.photo import Photo
from core.track import Earlier, PartialTrack, Shot, TrackSettings, iterate_again, iterate_track
from core.track.file import read_track, track_to_dict
from core.track.focal import grown
from core.track.journal import read_found, write_found

COUNT = 9
AWAY = se3_exp(np.array([0.9, 0.0, -0.4, 0.0, 0.35, 0.0])) @ TRUTH  # another place in the room
SETTINGS = TrackSettings(long_side_px=320)
FRAMES = range(1001, 1001 + COUNT)


def true_pose(frame):
    """A hand-held move: along, and shaking."""
    n = frame - FRAMES[0]
    shake = 0.004 * np.array([np.sin(1.7 * n), np.cos(2.3 * n), np.sin(0.9 * n)])
    return se3_exp(np.array([0.03 * n, 0.01 * np.sin(n), 0.02 * n, *shake])) @ TRUTH


@pytest.fixture(scope="module")
def room():
    return BoxRoom()


@pytest.fixture(scope="module")
def photos(room):
    return {frame: room.photo(LENS, true_pose(frame), seed=frame) for frame in FRAMES}


@pytest.fixture(scope="module")
def track(room, photos):
    return run(room, photos)


def run(
    room, photos, lens=LENS, guessed=False, start=FRAMES[4], settings=SETTINGS, found=None, recover=None, off=0.0, pinned=None
):
    begin = se3_exp(off * np.array([0.02, -0.01, 0.01, 0.002, -0.003, 0.001])) @ true_pose(start)
    camera = Camera(lens, begin, focal_guessed=guessed)
    shot = Shot(lambda frame: read(photos, frame), list(FRAMES), recover, "plate.{:04d}.png".format, pinned=pinned or {})
    return finished(iterate_track(room, shot, {start: camera}, settings, found))


def finished(steps):
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def read(photos, frame):
    if photos[frame] is None:
        raise PhotoError("The file is damaged.")
    return photos[frame]


def errors(track):
    """Per cent of the depth and degrees, of every frame."""
    found = [pose_error(frame.camera.pose, true_pose(frame.frame)) for frame in track.frames]
    return np.array([(100 * distance / DEPTH, degrees) for distance, degrees in found])


def test_every_frame_is_found_from_one_start(track):
    assert [frame.frame for frame in track.frames] == list(FRAMES)
    assert {frame.state for frame in track.frames} == {"good"}
    assert track.verdict == "trusted"
    assert (np.sqrt((errors(track) ** 2).mean(0)) < (0.10, 0.03)).all()
    assert track.frames[3].camera.file == "plate.1004.png"
    assert track.lens == LENS and not track.numbers


def test_the_stated_error_is_that_of_the_pictures(track):
    """A camera that is turned by a pixel must not be called as good as the right one."""
    assert max(frame.rms_px for frame in track.frames) < 0.5


def test_a_start_some_pixels_off_is_drawn_in(room, photos, track):
    off = run(room, photos, off=1.0)
    assert np.abs(errors(off) - errors(track)).max() < 0.05


def test_a_guessed_lens_is_solved_for_the_shot(room, photos):
    guess = replace(LENS, fx=1.004 * LENS.fx, fy=1.004 * LENS.fy, dist=(-0.07, 0.02, 0.0, 0.0, 0.0))
    solved = run(room, photos, guess, guessed=True)
    assert solved.lens.focal == pytest.approx(LENS.focal, rel=2e-3)
    assert abs(solved.lens.focal - LENS.focal) < 3 * solved.numbers[0].std
    held = run(room, photos, guess, guessed=True, settings=replace(SETTINGS, solve_lens=False))
    assert held.lens == guess
    assert np.median(errors(solved)[:, 0]) < np.median(errors(held)[:, 0])


def covered(photo, share=1.0):
    """The photo behind somebody who stands in front of the lens."""
    pixels = photo.pixels.copy()
    noise = np.random.default_rng(0).integers(0, 60, (12, 16, 3)).astype(np.uint8)
    width = int(share * photo.width)
    pixels[:, :width] = cv2.resize(noise, (photo.width, photo.height), interpolation=cv2.INTER_NEAREST)[:, :width]
    return Photo(pixels)


def test_covered_frames_are_lost_and_those_behind_them_followed_over_the_gap(room, photos):
    hidden = {frame: covered(photo) if frame in FRAMES[5:7] else photo for frame, photo in photos.items()}
    track = run(room, hidden)
    states = {frame.frame: frame.state for frame in track.frames}
    assert [f for f, state in states.items() if state == "lost"] == list(FRAMES[5:7])
    assert states[FRAMES[7]] == states[FRAMES[8]] == "good"
    assert track.verdict == "check" and "not tied to the splat, on the path of the others: 2" in track.reasons[0]
    assert errors(track)[5:7].max() < 3.0, "on the path between the frames beside them"


def test_behind_a_cut_frames_are_found_anew_and_followed_back_to_it(room, photos):
    away = room.photo(LENS, AWAY, seed=1)
    cut = {frame: away if frame in FRAMES[5:] else photo for frame, photo in photos.items()}
    asked = []

    def recover(photo, last):
        asked.append(last)
        return Camera(LENS, AWAY) if len(asked) == 3 else None

    track = run(room, cut, recover=recover)
    assert len(asked) == 3, "after one lost frame, two and four"
    assert {frame.state for frame in track.frames} == {"good"}
    assert all(pose_error(frame.camera.pose, AWAY)[0] < 0.002 * DEPTH for frame in track.frames[5:])


def test_half_a_picture_that_is_hidden_costs_no_frame(room, photos):
    hidden = {frame: covered(photo, 0.4) if frame in FRAMES[2:7] else photo for frame, photo in photos.items()}
    track = run(room, hidden)
    assert {frame.state for frame in track.frames} <= {"good", "weak"}
    assert errors(track)[:, 0].max() < 0.4


def test_a_second_start_takes_back_what_was_lost_before_it_and_is_linked_to_what_was_not(room, photos):
    away = room.photo(LENS, AWAY, seed=1)
    cut = {frame: away if frame in FRAMES[5:] else photo for frame, photo in photos.items()}
    starts = {FRAMES[0]: Camera(LENS, true_pose(FRAMES[0])), FRAMES[3]: Camera(LENS, true_pose(FRAMES[3]))}
    starts[FRAMES[7]] = Camera(LENS, AWAY)
    found = PartialTrack()
    track = finished(iterate_track(room, Shot(cut.__getitem__, list(FRAMES)), starts, SETTINGS, found))
    assert {frame.state for frame in track.frames} == {"good"}
    assert all(pose_error(frame.camera.pose, AWAY)[0] < 0.002 * DEPTH for frame in track.frames[5:])
    pairs = {frozenset((link.a, link.b)) for link in found.links}
    assert pairs == {frozenset(pair) for pair in itertools.pairwise(FRAMES)} - {frozenset(FRAMES[4:6])}
    assert len(found.links) == len(pairs)


def test_a_frame_that_cannot_be_read_is_said_and_ends_nothing(room, photos):
    track = run(room, {**photos, FRAMES[1]: None}, recover=lambda photo, last: Camera(LENS, true_pose(FRAMES[0])))
    states = {frame.frame: (frame.state, frame.reason) for frame in track.frames}
    assert states[FRAMES[1]] == ("lost", "The file is damaged.")
    assert {states[f][0] for f in FRAMES[2:]} == {"good"}


def test_fewer_than_half_of_the_frames_fail(room, photos):
    track = run(room, {frame: photo if frame in FRAMES[3:6] else covered(photo) for frame, photo in photos.items()})
    assert track.verdict == "failed"


def test_a_start_that_sits_nowhere_is_one_sentence(room, photos):
    with pytest.raises(RefineError, match="No frame sits on the splat at its start"):
        run(room, {frame: covered(photo) for frame, photo in photos.items()})
    shot = Shot(photos.get, list(FRAMES))
    with pytest.raises(RefineError, match="No frame of the range has a camera"):
        next(iterate_track(room, shot, {7: Camera(LENS, TRUTH)}, SETTINGS))


def test_a_zoom_is_followed_and_solved(room):
    """By 1.2 times in eight frames, from a start in the middle whose lens is given; one frame is hidden meanwhile."""
    lenses = {frame: grown(LENS, np.log(1.2) * (frame - FRAMES[4]) / 8) for frame in FRAMES}
    photos = {frame: room.photo(lenses[frame], true_pose(frame), seed=frame) for frame in FRAMES}
    photos[FRAMES[6]] = covered(photos[FRAMES[6]])
    track = run(room, photos, settings=replace(SETTINGS, focal="zoom"))
    assert [frame.state for frame in track.frames] == ["lost" if frame == FRAMES[6] else "good" for frame in FRAMES]
    focal = [frame.camera.intrinsics.focal / lenses[frame.frame].focal for frame in track.frames]
    assert np.abs(np.array(focal) - 1).max() < 0.002
    assert (np.sqrt((np.delete(errors(track), 6, axis=0) ** 2).mean(0)) < (0.15, 0.04)).all()
    assert "Focal length from " in track.reasons[-1]
    shot = Shot(photos.__getitem__, [FRAMES[2]], name="plate.{:04d}.png".format)
    again = finished(iterate_again(room, shot, Earlier(track), SETTINGS)).frames[2].camera
    assert again.intrinsics.focal == pytest.approx(lenses[FRAMES[2]].focal, rel=0.002), "also of a frame made anew"
    assert pose_error(again.pose, true_pose(FRAMES[2]))[0] < 0.002 * DEPTH


def test_a_pinned_frame_has_its_pose_whatever_the_picture_says(room, photos):
    wanted = se3_exp(np.array([0.02, 0, 0, 0, 0, 0])) @ true_pose(FRAMES[2])
    hidden = {**photos, FRAMES[6]: covered(photos[FRAMES[6]])}
    pinned = {FRAMES[2]: wanted, FRAMES[6]: true_pose(FRAMES[6])}
    track = run(room, hidden, pinned=pinned, settings=replace(SETTINGS, smooth_frames=6))
    assert all(frame.camera.pose == pinned.get(frame.frame, frame.camera.pose) for frame in track.frames)
    assert pose_error(track.frames[2].camera.pose, wanted) < (1e-9, 1e-9)
    hidden_frame = track.frames[6]
    assert (hidden_frame.state, hidden_frame.reason) == ("weak", "Its camera is pinned, and nothing else holds it.")


def test_a_range_is_tracked_anew_and_the_others_stay(room, photos, track):
    """A track with two bad frames in it, and one that is lost."""
    away = se3_exp(np.array([0.1, 0.0, 0.0, 0.0, 0.02, 0.0]))
    frames = list(track.frames)
    for i in (3, 4):
        frames[i] = replace(frames[i], camera=replace(frames[i].camera, pose=away @ frames[i].camera.pose), state="weak")
    before = replace(track, frames=tuple(frames), verdict="check", seconds=100.0)
    seen = []
    shot = Shot(_Noted(photos, seen).__getitem__, list(FRAMES[3:5]), name="plate.{:04d}.png".format)
    again = finished(iterate_again(room, shot, Earlier(before), SETTINGS))
    assert set(seen) == set(FRAMES[2:6]), "the range and the frames beside it"
    assert [a is b for a, b in zip(again.frames, before.frames, strict=True)] == [i not in (3, 4) for i in range(COUNT)]
    assert errors(again)[3:5, 0].max() < 0.15 and again.verdict == "trusted" and again.seconds > 100
    file = tmp_track(again)
    for read, written in zip(file.frames, again.frames, strict=True):
        assert pose_error(read.camera.pose, written.camera.pose) < (1e-12, 1e-9)
        assert read.camera.intrinsics == written.camera.intrinsics
    assert (file.verdict, file.reasons, [f.state for f in file.frames]) == (
        again.verdict,
        again.reasons,
        [f.state for f in again.frames],
    )
    wrong = Camera(grown(LENS, 0.1), true_pose(FRAMES[4]))
    started = finished(iterate_again(room, shot, Earlier(before, {FRAMES[4]: wrong}), SETTINGS))
    assert {frame.camera.intrinsics for frame in started.frames} == {LENS}, "the shot's lens holds, whatever a start says"
    lost = replace(before, frames=tuple(replace(frame, state="lost") for frame in before.frames))
    with pytest.raises(RefineError, match="No frame beside the range is tied to the splat"):
        finished(iterate_again(room, shot, Earlier(lost), SETTINGS))


def tmp_track(track):
    """The track after it was written and read."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "t.json").write_text(json.dumps(track_to_dict(track)))
        return read_track(Path(folder) / "t.json")


def test_an_interrupted_track_goes_on_to_the_same_end(room, photos, track, tmp_path):
    found = PartialTrack()
    shot = Shot(photos.get, list(FRAMES))
    steps = iterate_track(room, shot, {FRAMES[4]: Camera(LENS, true_pose(FRAMES[4]))}, SETTINGS, found)
    for _ in range(5):
        next(steps)
    steps.close()
    assert len(found.ties) == 6
    write_found(tmp_path / "j", found, "key")
    assert not read_found(tmp_path / "j", "another").ties
    again = read_found(tmp_path / "j", "key")
    assert list(again.ties) == list(found.ties) and len(again.links) == len(found.links)
    seen = []
    photos = {**photos}
    end = run(room, _Noted(photos, seen), found=again)
    assert set(seen) <= {FRAMES[4], FRAMES[8], *FRAMES[:4]}, "frames that were found are not read again, but where it goes on"
    assert np.abs(errors(end) - errors(track)).max() < 0.02


class _Noted(dict):
    """Notes which frames are asked for."""

    def __init__(self, photos, seen):
        super().__init__(photos)
        self.seen = seen

    def __getitem__(self, frame):
        self.seen.append(frame)
        return super().__getitem__(frame)


@pytest.mark.parametrize("data", [b"", b"no zip", b"PK\x03\x04 cut"])
def test_a_damaged_journal_is_as_none(tmp_path, data):
    (tmp_path / "j").write_bytes(data)
    assert not read_found(tmp_path / "j", "key").ties
