"""Copies of the photo: what is found in them lies where the photo shows it."""

import cv2
import numpy as np
import pytest

from core.features.looks import Looks, copy_map
from core.features.types import Features


class Dots:
    """An extractor of bright dots, by thresholds and centroids; the descriptor is the dot's own brightness."""

    def __init__(self):
        self.seen = []

    def extract(self, grey, mask=None):
        self.seen.append(grey.shape)
        _, labels, stats, _ = cv2.connectedComponentsWithStats((grey > 90).astype(np.uint8))
        points = []
        for label in range(1, len(stats)):
            v, u = np.nonzero(labels == label)
            weight = grey[v, u].astype(float) - 60
            points.append((np.array([u, v]) @ weight) / weight.sum() + 0.5)
        points = np.array(points).reshape(-1, 2)
        return Features(points, np.ones((len(points), 4), np.float32), grey.shape[::-1])


CENTRES = np.array([[30.3, 20.6], [150.2, 28.4], [75.0, 61.7], [22.5, 95.1], [140.8, 98.9]])


def dotted():
    v, u = np.mgrid[:120, :180] + 0.5
    image = np.full((120, 180), 60.0)
    for x, y in CENTRES:
        image += 150 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 3.0**2))
    return np.clip(image, 0, 255).astype(np.uint8)


def test_every_look_puts_the_dots_where_they_are():
    dots = Dots()
    found = Looks(dots, (0.0, -25.0, 25.0, 90.0), (1.0, 1.6, 0.7)).extract(dotted())
    assert len(dots.seen) == 12
    assert len(found) == 12 * len(CENTRES)
    assert found.size == (180, 120)
    distance = np.linalg.norm(found.keypoints[:, None] - CENTRES[None], axis=2)
    assert (np.bincount(distance.argmin(axis=1)) == 12).all()
    assert distance.min(axis=1).max() < 0.15  # a pixel centre taken for a corner would be 0.2 to 0.5


def test_the_whole_image_is_in_the_copy():
    for roll, scale in ((-25, 1.6), (25, 1), (90, 0.5)):
        (width, height), there = copy_map(180, 120, roll, scale)
        corners = np.array([[0, 0], [180, 0], [0, 120], [180, 120]]) @ there[:, :2].T + there[:, 2]
        assert corners.min() > -1
        assert (corners < (width + 1, height + 1)).all()
        assert np.ptp(corners[:, 0]) == pytest.approx(width, abs=1)


def test_a_mask_is_the_photos():
    mask = np.zeros((120, 180), bool)
    mask[:, 90:] = True
    found = Looks(Dots()).extract(dotted(), mask)
    assert len(found) == 6 * 2
    assert found.keypoints[:, 0].min() > 90


def test_nothing_in_any_look_is_an_empty_set():
    found = Looks(Dots()).extract(np.full((120, 180), 60, np.uint8))
    assert len(found) == 0
    assert found.descriptors.shape == (0, 4)
