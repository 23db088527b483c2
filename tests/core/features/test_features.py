"""Extractors that need no network, and the nearest-neighbour matcher: places, masks, bits, and pairs against a slow twin."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from feature_samples import picture

from core.errors import FeatureError
from core.features.matchers.nearest import MutualNearest
from core.features.registry import EXTRACTORS
from core.features.types import Features

CLASSIC = sorted(name for name, kind in EXTRACTORS.items() if not kind.needs_model)


def grey(image):
    return np.clip(128 + 20 * image, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def large():
    return picture()


def test_the_classic_ones_are_there():
    assert CLASSIC == ["akaze", "orb", "sift"]


@pytest.mark.parametrize("name", CLASSIC)
def test_places_scale_with_the_image_about_its_corner(name, large):
    """Half the image has every place at half its pixels, for the centre of the first pixel is at (0.5, 0.5)."""
    extractor = EXTRACTORS[name].make(Path())
    a = extractor.extract(grey(cv2.resize(large, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)))
    b = extractor.extract(grey(large))
    pairs = MutualNearest(EXTRACTORS[name].ratio).match(a, b).indices
    offset = a.keypoints[pairs[:, 0]] - b.keypoints[pairs[:, 1]] / 2
    right = np.abs(offset).max(axis=1) < 2
    assert len(pairs) > 150
    assert right.mean() > 0.85
    assert np.abs(np.median(offset[right], axis=0)).max() < 0.1
    assert (a.size, b.size) == ((320, 240), (640, 480))


@pytest.mark.parametrize("name", CLASSIC)
def test_descriptors_are_unit_vectors_or_bits(name, large):
    features = EXTRACTORS[name].make(Path()).extract(grey(large))
    assert features.binary == EXTRACTORS[name].binary == (name != "sift")
    if features.binary:
        assert features.descriptors.dtype == np.uint8
    else:
        np.testing.assert_allclose(np.linalg.norm(features.descriptors, axis=1), 1, atol=1e-4)


@pytest.mark.parametrize("name", CLASSIC)
def test_a_mask_leaves_out_what_is_false(name, large):
    extractor, image = EXTRACTORS[name].make(Path()), grey(large)
    mask = np.zeros(image.shape, bool)
    mask[:, 320:] = True
    everything, half = extractor.extract(image), extractor.extract(image, mask)
    assert 0 < len(half) < len(everything)
    assert half.keypoints[:, 0].min() >= 320
    assert len(half) == (everything.keypoints[:, 0] >= 320).sum()


@pytest.mark.parametrize("name", CLASSIC)
@pytest.mark.parametrize("shape", [(1, 1), (5, 300), (20, 20), (40, 40), (70, 90), (240, 320)])
def test_plain_images_of_any_size_give_an_empty_set(name, shape):
    features = EXTRACTORS[name].make(Path()).extract(np.full(shape, 77, np.uint8))
    assert len(features) == 0
    assert features.keypoints.shape == (0, 2)
    assert features.binary == EXTRACTORS[name].binary
    assert len(MutualNearest().match(features, features)) == 0


def slow_pairs(a, b, ratio):
    """Mutual nearest neighbours with the ratio test, one pair at a time, from the definition of the distances."""

    def distance(x, y):
        if a.binary:
            return sum(int(p ^ q).bit_count() for p, q in zip(x.tolist(), y.tolist(), strict=True))
        return float(np.linalg.norm(x.astype(float) - y.astype(float)))

    d = np.array([[distance(x, y) for y in b.descriptors] for x in a.descriptors], float)
    pairs = []
    for i, row in enumerate(d):
        j = int(row.argmin())
        second = np.delete(row, j).min()
        if (d[:, j] >= row[j]).all() and row[j] < ratio * second:
            pairs.append((i, j))
    return pairs


@pytest.mark.parametrize("ratio", [0.7, 0.85, 0.95])
@pytest.mark.parametrize("binary", [False, True])
def test_pairs_are_those_of_the_slow_twin(ratio, binary):
    rng = np.random.default_rng(3)
    if binary:
        base = rng.integers(0, 256, (60, 61), np.uint8)
        flips = np.packbits(rng.random((60, 488)) < rng.uniform(0.05, 0.5, (60, 1)), axis=1)
        rows = base, base ^ flips
    else:
        base = rng.normal(size=(60, 16))
        noisy = base + rng.normal(size=base.shape) * rng.uniform(0.05, 1.5, (60, 1))
        rows = tuple((r / np.linalg.norm(r, axis=1, keepdims=True)).astype(np.float32) for r in (base, noisy))
    a, b = (Features(np.zeros((60, 2)), r) for r in (rows[0], rows[1][rng.permutation(60)]))
    expected = slow_pairs(a, b, ratio)
    assert 10 < len(expected) < 60
    assert [tuple(p) for p in MutualNearest(ratio).match(a, b).indices.tolist()] == expected


def test_bits_and_vectors_do_not_mix():
    bits = Features(np.zeros((3, 2)), np.zeros((3, 32), np.uint8))
    vectors = Features(np.zeros((3, 2)), np.eye(3, 32, dtype=np.float32))
    with pytest.raises(FeatureError, match="different kinds"):
        MutualNearest().match(bits, vectors)
