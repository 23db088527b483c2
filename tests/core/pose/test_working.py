"""The photo at working size: contrast stretched where it is narrow, and left alone where it is not."""

import cv2
import numpy as np
import pytest

from core.pose.shared.working import STRETCHED, TAILS, exposed

SIZE = (160, 120)


@pytest.fixture(scope="module")
def picture():
    coarse = np.random.default_rng(3).uniform(0, 255, (12, 16, 3)).astype(np.float32)
    return np.clip(cv2.resize(coarse, (320, 240), interpolation=cv2.INTER_CUBIC), 0, 255).astype(np.uint8)


def _plain(pixels):
    return cv2.resize(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), SIZE, interpolation=cv2.INTER_AREA)


def test_a_photo_of_usual_contrast_stays_as_it_is(picture):
    np.testing.assert_array_equal(exposed(picture, SIZE, None), _plain(picture))


@pytest.mark.parametrize("change", [lambda x: x * 0.05, lambda x: 200 + x * 0.1], ids=["dark", "hazy"])
def test_a_narrow_photo_gets_the_levels_of_a_good_one(picture, change):
    out = exposed(change(picture).astype(np.uint8), SIZE, None)
    np.testing.assert_allclose(np.percentile(out, TAILS), STRETCHED, atol=3)
    assert len(np.unique(out)) > 3 * len(np.unique(_plain(change(picture).astype(np.uint8))))
    assert np.corrcoef(out.ravel(), _plain(picture).ravel())[0, 1] > 0.99


def test_a_bright_frame_that_is_masked_does_not_count(picture):
    dark = (picture * 0.05).astype(np.uint8)
    framed = dark.copy()
    framed[:40] = 255
    mask = np.ones(SIZE[::-1], bool)
    mask[:20] = False
    np.testing.assert_allclose(np.percentile(exposed(framed, SIZE, mask)[mask], TAILS), STRETCHED, atol=3)
    np.testing.assert_array_equal(exposed(framed, SIZE, ~mask), _plain(framed))


def test_nothing_is_made_of_nothing():
    flat = np.full((240, 320, 3), 7, np.uint8)
    np.testing.assert_array_equal(exposed(flat, SIZE, None), np.full(SIZE[::-1], 7, np.uint8))
