"""Where a render sits on a photo: pictures whose truth is known pixel by pixel, most of them hidden, moved or repeating."""

import cv2
import numpy as np
import pytest

from core.features.subpixel import normalise_locally
from core.pose.verdict.regions import CELL_CORNERS, Pictures, agreeing_region, spread_corners

H, W = 360, 480


def texture(seed, size=(H, W), grain=2.0):
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=size), (0, 0), grain)
    return np.clip(128 + 40 * noise / noise.std(), 0, 255).astype(np.uint8)


def pictures(photo, render):
    inside = np.full(photo.shape, 255, np.uint8)
    return Pictures(photo, normalise_locally(photo), normalise_locally(render), inside)


def splat_of(scene):
    """What a splat shows of a scene: blurred, and of another exposure."""
    return (0.6 * cv2.GaussianBlur(scene, (0, 0), 1.5) + 20).astype(np.uint8)


@pytest.fixture(scope="module")
def scene():
    return texture(1)


def test_a_render_that_shows_the_photo_sits_on_all_of_it(scene):
    region = agreeing_region(pictures(scene, splat_of(scene)))
    assert region.area > 0.8 and region.spread > 0.95 and region.share > 0.8
    assert region.offset_px < 0.2 and region.unrivalled == 1.0
    assert region.corners > 50 * region.expected


@pytest.mark.parametrize("seen", [0.3, 0.15])
def test_what_hides_the_photo_is_no_evidence_against_the_render(scene, seen):
    """An object over the right part of the photo; the region covers the rest and no more."""
    photo, edge = scene.copy(), round(seen * W)
    photo[:, edge:] = texture(2)[:, edge:]
    region = agreeing_region(pictures(photo, splat_of(scene)))
    assert 0.75 * seen < region.area < 1.15 * seen
    assert region.corners >= 40 and region.offset_px < 0.25


def test_a_render_of_another_place_sits_nowhere(scene):
    for seed in (3, 4, 5):
        assert agreeing_region(pictures(scene, splat_of(texture(seed)))).corners == 0


@pytest.mark.parametrize("moved", [4, 9, 25])
def test_a_render_that_is_moved_sits_nowhere(scene, moved):
    assert agreeing_region(pictures(scene, splat_of(np.roll(scene, moved, axis=1)))).corners == 0


def test_the_offset_tells_a_render_that_is_nearly_right(scene):
    render = splat_of(cv2.warpAffine(scene, np.array([[1, 0, 1.0], [0, 1, 0]]), (W, H), borderMode=cv2.BORDER_REFLECT))
    region = agreeing_region(pictures(scene, render))
    assert region.corners > 100 and region.offset_px == pytest.approx(1.0, abs=0.1)


def tiles(unlike, seed=7):
    """Windows every 80 x 90 pixels, each a little unlike the next one."""
    wall = 0.15 * (texture(seed, grain=1.0).astype(float) - 128) + 150
    window, rng = texture(8, (50, 40)).astype(float), np.random.default_rng(seed)
    for y in range(10, H - 50, 90):
        for x in range(10, W - 40, 80):
            own = texture(rng.integers(1 << 30), (50, 40)).astype(float) - 128
            wall[y : y + 50, x : x + 40] = 0.5 * window + unlike * own + 40
    return np.clip(wall, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("unlike", [0.1, 0.25])
def test_a_render_one_window_off_sits_and_is_told_by_what_it_shows_elsewhere(unlike):
    facade = tiles(unlike)
    right = agreeing_region(pictures(facade, splat_of(facade)))
    wrong = agreeing_region(pictures(facade, splat_of(np.roll(facade, 80, axis=1))))
    assert right.unrivalled > 0.9
    assert wrong.corners > 100 and wrong.offset_px < 0.75, "without this figure it would be taken for right"
    assert wrong.unrivalled < 0.5


def test_corners_are_taken_from_each_part_of_the_photo_alike(scene):
    """One gaudy part must not take the corners of all the others."""
    photo = (64 + scene // 2).astype(np.uint8)
    photo[:90] = np.random.default_rng(1).integers(0, 255, (90, W))
    corners = spread_corners(pictures(photo, photo))
    counts = np.histogram2d(corners[:, 1], corners[:, 0], bins=(9, 12), range=((0, H), (0, W)))[0]
    assert counts.max() == CELL_CORNERS and np.median(counts[3:]) >= CELL_CORNERS - 2


@pytest.mark.parametrize("size", [(24, 20), (60, 400)])
def test_small_pictures_and_flat_ones_have_no_region_or_a_sound_one(size):
    flat = np.full(size, 90, np.uint8)
    assert agreeing_region(pictures(flat, flat)).corners == 0
    small = texture(1, size)
    region = agreeing_region(pictures(small, splat_of(small)))
    assert 0 <= region.area <= 1 and 0 <= region.share <= 1
