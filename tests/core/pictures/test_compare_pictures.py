"""Pictures that set photo and render against each other."""

import numpy as np
import pytest

from core.geometry.camera import Camera, Intrinsics, Pose
from core.photos.photo import Photo
from core.pictures import compare as cp
from core.pictures.matches import matches_at
from core.pose.settings import RefineSettings
from core.render import Renderer, RenderSettings
from core.render.view import RenderedView
from core.synthetic import make_photo, make_scene, perturb_camera, sample_cameras


@pytest.fixture
def pair():
    rng = np.random.default_rng(0)
    photo, render = (rng.integers(0, 200, (60, 80, 3), np.uint8) for _ in range(2))
    return cp.Comparison(photo, render, np.ones((60, 80), bool))


def test_side_by_side_holds_both_whole(pair):
    out = cp.side_by_side(pair)
    np.testing.assert_array_equal(out[:, :80], pair.photo)
    np.testing.assert_array_equal(out[:, -80:], pair.render)


def test_diagonal_has_the_photo_top_left(pair):
    out = cp.diagonal(pair)
    np.testing.assert_array_equal(out[:20, :20], pair.photo[:20, :20])
    np.testing.assert_array_equal(out[-20:, -20:], pair.render[-20:, -20:])
    assert (out == 255).all(axis=2).sum() >= 60


@pytest.mark.parametrize(("position", "photo_columns"), [(0.0, 0), (0.5, 38), (1.0, 80), (-1.0, 0), (2.0, 80)])
def test_wipe(pair, position, photo_columns):
    out = cp.wipe(pair, position)
    np.testing.assert_array_equal(out[:, :photo_columns], pair.photo[:, :photo_columns])
    if photo_columns == 0:
        np.testing.assert_array_equal(out, pair.render)


def test_difference_forgives_exposure_and_shows_a_shift():
    y, x = np.mgrid[:90, :120]
    pattern = ((np.sin(x / 5) + np.cos(y / 7)) * 50 + 120).astype(np.uint8)
    render = np.repeat(pattern[..., None], 3, axis=2)
    darker = (render * np.array([0.6, 0.7, 0.5])).astype(np.uint8)
    solid = np.ones((90, 120), bool)
    same = cp.difference(cp.Comparison(darker, render, solid)).astype(int).max(axis=2) - cp.GREY_SHARE * darker.max(axis=2)
    moved = cp.difference(cp.Comparison(np.roll(darker, 6, axis=1), render, solid)).astype(int).max(axis=2)
    assert np.median(same) < 25
    assert np.median(moved) > 100


def test_difference_is_the_grey_photo_where_the_scan_has_nothing(pair):
    out = cp.difference(cp.Comparison(pair.photo, pair.render, np.zeros((60, 80), bool)))
    assert (out[..., 0] == out[..., 1]).all()
    assert (out[..., 1] == out[..., 2]).all()


def test_matches_are_drawn_in_two_colours(pair):
    place = np.array([[20.5, 20.5], [60.5, 40.5]])
    out = cp.matched(pair, cp.judge_matches(place, place + np.array([[0.3, 0.2], [-30, 10]]), 80))
    assert tuple(out[20, 20]) == cp.GOOD
    assert tuple(out[40, 60]) == cp.BAD
    none = np.zeros((0, 2))
    np.testing.assert_array_equal(cp.matched(pair, cp.judge_matches(none, none, 80)), cp.side_by_side(pair))


@pytest.mark.parametrize("channels", [3, 4])
def test_png_comes_back(channels):
    image = np.random.default_rng(1).integers(0, 256, (9, 7, channels), np.uint8)
    np.testing.assert_array_equal(cp.decode_png(cp.encode_png(image)), image)
    assert cp.decode_png(b"") is None
    assert cp.decode_png(b"no picture") is None


def test_at_long_side_never_enlarges_and_keeps_the_view():
    photo = Photo(np.zeros((200, 400, 3), np.uint8))
    camera = Camera(Intrinsics(400, 200, 300.0, 300.0, 210.0, 95.0, (0.1, 0, 0, 0, 0)), Pose())
    small, scaled = cp.at_long_side(photo, camera, 100)
    assert small.pixels.shape == (50, 100, 3)
    assert scaled.intrinsics == camera.intrinsics.resized(100, 50)
    same, kept = cp.at_long_side(photo, camera, 1000)
    assert same.pixels.shape == (200, 400, 3)
    assert kept.intrinsics == camera.intrinsics


class _Flat:
    """Draws red where x < cx, and nothing elsewhere."""

    def render(self, intrinsics, pose):
        shape = (intrinsics.height, intrinsics.width)
        alpha = np.zeros(shape, np.float32)
        alpha[:, : int(intrinsics.cx)] = 1
        return RenderedView(alpha[..., None] * np.float32([1, 0, 0]), alpha, alpha, alpha)


@pytest.mark.parametrize("k1", [0.0, -0.2])
def test_the_lens_bends_colour_and_solidity_alike(k1):
    camera = Camera(Intrinsics(80, 60, 70.0, 70.0, 40.0, 30.0, (k1, 0, 0, 0, 0)), Pose())
    render, solid = cp.render_photo_like(_Flat(), camera)
    assert solid[30, 5]
    assert not solid[30, 75]
    np.testing.assert_array_equal(solid, render[..., 0] >= 128)


def test_matches_at_the_true_camera_stay_and_at_a_wrong_one_do_not():
    renderer = Renderer(make_scene(0), RenderSettings())
    truth = sample_cameras()[0]
    truth = Camera(truth.intrinsics.resized(320, 240), truth.pose)
    photo = make_photo(renderer, truth)
    settings = RefineSettings(long_side_px=320)
    right = matches_at(renderer, photo, truth, settings)
    wrong = matches_at(renderer, photo, perturb_camera(truth, 0.1, 2.0), settings)
    assert len(right.good) > 40
    assert right.good.mean() > 0.9
    assert wrong.good.mean() < 0.2
