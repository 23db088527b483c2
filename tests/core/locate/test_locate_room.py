"""Find Camera on the procedural room, whose cameras are known exactly: no start is given anywhere."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from core.errors import Cancelled
from core.geometry.camera import pose_error
from core.locate import (
    LandmarkMap,
    MapSettings,
    PhotoLens,
    build_map,
    find_camera,
    iterate_finding,
    locate,
    read_map,
    write_map,
)
from core.photos.lens_guess import guess_lens
from core.photos.photo import Photo
from core.pose.settings import RefineSettings
from core.render import Renderer, RenderSettings
from core.splats.scene import GaussianScene
from core.synthetic.room import make_scene
from core.synthetic.sample import make_photo, sample_cameras

pytestmark = pytest.mark.loop

VIEWS = 16
SETTINGS = MapSettings(views=VIEWS, side_px=320)
QUICK = RefineSettings(threads=1, final="none", iterations=2, candidates=4)
DEPTH = 3.2


@pytest.fixture(scope="module")
def scene():
    return make_scene(gaussians=20_000)


@pytest.fixture(scope="module")
def renderer(scene):
    return Renderer(scene, RenderSettings(threads=1))


@pytest.fixture(scope="module")
def steps(scene):
    return list(build_map(scene, SETTINGS))


@pytest.fixture(scope="module")
def landmarks(steps):
    return steps[-1].map


def photo_of(renderer, index):
    camera = sample_cameras()[index]
    return camera, make_photo(renderer, camera, index)


def near(pose, truth, ratio=0.05):
    distance, degrees = pose_error(pose, truth)
    return distance < ratio * DEPTH and degrees < 3


def test_every_step_of_the_making_is_a_map(steps, landmarks):
    sizes = [len(step.map) for step in steps]
    assert sizes == sorted(sizes)
    assert (sizes[0], sizes[-1]) == (0, VIEWS)
    assert [step.fraction for step in steps] == sorted(step.fraction for step in steps)
    assert [step.map.complete for step in steps] == [False] * (len(steps) - 1) + [True]
    for step in steps:
        assert all(a is b for a, b in zip(step.map.views, landmarks.views, strict=False))
    assert all(np.isfinite(view.points).all() for view in landmarks.views)


def test_the_progress_moves_while_viewpoints_are_looked_for(steps):
    """Before the first view there is a search, which takes as long as several views do."""
    before = [step.fraction for step in steps if len(step.map) == 0]
    assert len(before) > 20
    assert len(set(before)) > 20
    assert 0.1 < max(before) < 0.9
    assert max(np.diff([step.fraction for step in steps])) < 0.1


def test_a_map_that_was_interrupted_is_continued_to_the_same_map(scene, steps, landmarks, tmp_path):
    """What the search for viewpoints knew is in the file, so that nothing of it is done again."""
    part = next(step.map for step in steps if len(step.map) == VIEWS - 2)
    write_map(tmp_path / "part.map", part)
    begun = read_map(tmp_path / "part.map", part.key)
    rest = list(build_map(scene, SETTINGS, begun=begun))
    assert [len(step.map) for step in rest if step.step == "drawing views"] == [VIEWS - 1, VIEWS]
    assert len(rest) < len(steps) / 3
    for a, b in zip(rest[-1].map.views, landmarks.views, strict=True):
        assert np.allclose(a.pose.R, b.pose.R, atol=1e-12)
        assert np.allclose(a.pose.t, b.pose.t, atol=1e-12)
        assert np.allclose(a.points, b.points, atol=1e-5)


def test_landmarks_lie_on_the_room(scene, landmarks):
    points = np.concatenate([view.points for view in landmarks.views])
    low, high = scene.means.min(axis=0), scene.means.max(axis=0)
    assert np.mean(((points > low - 0.05) & (points < high + 0.05)).all(axis=1)) > 0.99


def test_the_same_seed_makes_the_same_map(scene, landmarks):
    again = next(step.map for step in build_map(scene, SETTINGS) if len(step.map) == 2)
    for a, b in zip(again.views, landmarks.views[:2], strict=True):
        assert (a.pose.R == b.pose.R).all()
        assert (a.points == b.points).all()


@pytest.mark.parametrize("index", [0, 2, 4])
def test_a_photo_is_found_with_its_lens_known(renderer, landmarks, index):
    camera, photo = photo_of(renderer, index)
    located = locate(renderer, PhotoLens(photo, camera.intrinsics), landmarks)
    best = located.hypotheses[0]
    assert near(best.pose, camera.pose)
    assert best.factor == 1.0
    assert located.camera(best).focal_guessed is False


def test_a_photo_is_found_with_its_lens_guessed(renderer, landmarks):
    camera, photo = photo_of(renderer, 1)
    located = locate(renderer, PhotoLens(photo), landmarks)
    best = located.hypotheses[0]
    start = located.camera(best)
    assert near(best.pose, camera.pose, 0.1)  # a guess knows nothing of the distortion, which moves the camera along its axis
    assert start.focal_guessed
    assert abs(start.intrinsics.focal / camera.intrinsics.focal - 1) < 0.06
    assert abs(guess_lens(photo).intrinsics.focal / camera.intrinsics.focal - 1) > 0.15  # the guess itself is no good


def test_a_photo_turned_on_its_side_is_found(renderer, landmarks):
    camera, photo = photo_of(renderer, 3)
    side = Photo(np.ascontiguousarray(np.rot90(photo.pixels, -1)))
    k = camera.intrinsics.pinhole()
    lens = replace(k, width=480, height=640, fx=k.fy, fy=k.fx, cx=480 - k.cy, cy=k.cx)
    located = locate(renderer, PhotoLens(side, lens), landmarks)
    assert np.linalg.norm(located.hypotheses[0].pose.centre - camera.pose.centre) < 0.05 * DEPTH


def other_place(seed=0):
    """A photo with plenty of corners of a place that is not the room."""
    rng = np.random.default_rng(seed)
    pixels = np.full((480, 640, 3), 120, np.uint8)
    for _ in range(300):
        y, x, h, w = rng.integers(0, (440, 600, 60, 60))
        pixels[y : y + h, x : x + w] = rng.integers(0, 256, 3)
    return Photo(pixels)


@pytest.mark.parametrize("guessed", [False, True])
def test_a_photo_of_another_place_is_not_found_and_the_reason_is_a_sentence(renderer, landmarks, guessed):
    lens = None if guessed else sample_cameras()[0].intrinsics
    report = find_camera(renderer, PhotoLens(other_place(), lens), landmarks, QUICK)
    assert report.verdict == "failed"
    assert report.camera is None
    assert report.refined is None  # nothing was worth a refinement
    assert "No place in the scan matches the photo" in report.reasons[0]
    assert report.views == VIEWS


def test_a_blank_photo_is_refused_before_the_search(renderer, landmarks):
    report = find_camera(renderer, PhotoLens(Photo(np.full((480, 640, 3), 90, np.uint8))), landmarks, QUICK)
    assert report.verdict == "failed"
    assert "0 features" in report.reasons[0]
    assert report.views == 0


def test_find_camera_comes_home_with_a_verdict(renderer, landmarks):
    camera, photo = photo_of(renderer, 5)
    seen = []
    report = find_camera(renderer, PhotoLens(photo, camera.intrinsics), landmarks, RefineSettings(threads=1), seen.append)
    distance, degrees = pose_error(report.camera.pose, camera.pose)
    assert report.verdict == "trusted"
    assert distance < 0.003 * DEPTH
    assert degrees < 0.2
    assert report.camera.intrinsics == camera.intrinsics
    assert any(step.refining is not None for step in seen)


def test_the_search_asks_for_no_more_map_than_it_needs(renderer, steps):
    camera, photo = photo_of(renderer, 0)
    asked = iter(steps)
    report = find_camera(renderer, PhotoLens(photo, camera.intrinsics), asked, QUICK)
    assert report.verdict == "trusted"
    assert report.views == 10
    assert len(next(asked).map) <= 11


def test_a_camera_to_be_checked_ends_the_search_where_its_hypothesis_was_clear(renderer, steps):
    """More views of the map would lead to the same place again, at the price of the whole map."""
    camera, photo = photo_of(renderer, 0)
    asked = iter(steps)
    few_views = RefineSettings(threads=1, iterations=1, candidates=2)  # which the verdict never trusts
    report = find_camera(renderer, PhotoLens(photo, camera.intrinsics), asked, few_views)
    assert report.verdict == "check"
    assert report.hypothesis.clear
    assert report.views == 10


def test_cancelling_at_any_step_leaves_nothing_behind(renderer, landmarks):
    camera, photo = photo_of(renderer, 0)
    target = PhotoLens(photo, camera.intrinsics)
    for stop in (1, 5, 12):
        work = iterate_finding(renderer, target, landmarks, QUICK)
        assert len(list(islice(work, stop))) == stop
        work.close()

    def refuse(_):
        raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        find_camera(renderer, target, landmarks, QUICK, refuse)


def test_known_cameras_are_the_first_views(scene, renderer):
    known = sample_cameras(4)
    made = list(build_map(scene, replace(SETTINGS, views=4), known))[-1].map
    assert [view.known for view in made.views] == [True] * 4
    assert {tuple(view.pose.centre.round(9)) for view in made.views} == {tuple(c.pose.centre.round(9)) for c in known}
    camera, photo = photo_of(renderer, 1)
    assert near(locate(renderer, PhotoLens(photo, camera.intrinsics), made).hypotheses[0].pose, camera.pose)


def test_more_views_lose_no_photo(renderer, landmarks):
    """Views that lift well and wrong are added to a map that finds the photo: it is found nevertheless."""
    camera, photo = photo_of(renderer, 2)
    bent = tuple(replace(v, points=(1.5 * v.points + (3, 1, -2)).astype(np.float32)) for v in landmarks.views)
    larger = LandmarkMap("", landmarks.views[:10] + bent * 2)
    for size in (10, 42):
        located = locate(renderer, PhotoLens(photo, camera.intrinsics), LandmarkMap("", larger.views[:size]))
        assert near(located.hypotheses[0].pose, camera.pose)


def test_views_that_lift_wrong_alone_find_nothing(renderer, landmarks):
    camera, photo = photo_of(renderer, 2)
    bent = tuple(replace(v, points=(1.5 * v.points + (3, 1, -2)).astype(np.float32)) for v in landmarks.views)
    located = locate(renderer, PhotoLens(photo, camera.intrinsics), LandmarkMap("", bent))
    assert located.hypotheses == ()
    assert "No place in the scan matches" in located.reason


def test_a_scan_of_one_blank_wall_ends_with_an_empty_map(renderer):
    rng = np.random.default_rng(0)
    n = 3000
    means = np.column_stack([rng.uniform(-1, 1, (n, 2)), np.zeros(n)]).astype(np.float32)
    rotations = np.tile(np.float32([1, 0, 0, 0]), (n, 1))
    sh = np.full((n, 1, 3), 0.3, np.float32)
    wall = GaussianScene(means, np.full((n, 3), 0.05, np.float32), rotations, np.full(n, 0.95, np.float32), sh)
    last = list(build_map(wall, MapSettings(views=5, side_px=200)))[-1].map
    assert last.complete
    assert last.landmarks < 50
    camera, photo = photo_of(renderer, 0)
    report = find_camera(renderer, PhotoLens(photo, camera.intrinsics), last, QUICK)
    assert report.verdict == "failed"
    assert report.reasons[0].endswith(".")
