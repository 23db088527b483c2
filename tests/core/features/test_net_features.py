"""Adapters of networks: places against tiny graphs whose answer is known, then the real ALIKED where its weights are."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from feature_samples import GREY, glue, pair, picture, rows, unit
from onnx_files import image_net

from core.errors import FeatureError
from core.features.extractors.aliked import Aliked
from core.features.extractors.disk import Disk
from core.features.extractors.superpoint import SuperPoint
from core.features.matchers.lightglue import LightGlue
from core.features.matchers.nearest import MutualNearest
from core.features.types import Features

MODELS = Path(__file__).resolve().parents[4] / "shared" / "models"


def shared_model(name):
    path = MODELS / name
    if not path.is_file():
        pytest.skip(f"no {name} in ../shared/models")
    return path


def test_aliked_places_scores_and_padding(tmp_path):
    """The network sees 96 x 64; x = 2 i / (side - 1) - 1 for pixel index i, whose centre is at i + 0.5."""
    index = np.array([[0, 0], [89, 49], [31.25, 20.5], [40, 10], [93, 20], [20, 60]])
    scores = np.array([0.9, 0.5, 0.3, 0.019, 0.8, 0.8], np.float32)  # the fourth is noise, the last two lie in the padding
    descriptors = rows(6)
    places = (2 * index / [95, 63] - 1).astype(np.float32)
    model = image_net(tmp_path / "aliked.onnx", 3, keypoints=places, descriptors=descriptors, scores=scores)
    features = Aliked(model).extract(GREY)
    np.testing.assert_allclose(features.keypoints, index[:3] + 0.5, atol=1e-4)
    np.testing.assert_allclose(features.descriptors, unit(descriptors[:3]), atol=1e-5)
    assert features.size == (90, 50)
    mask = np.zeros(GREY.shape, bool)
    mask[49, 89] = True
    np.testing.assert_allclose(Aliked(model).extract(GREY, mask).keypoints, [[89.5, 49.5]], atol=1e-4)


@pytest.mark.parametrize(("kind", "channels", "columns"), [(Disk, 3, 128), (SuperPoint, 1, 256)])
def test_pixel_indices_become_pixel_centres(tmp_path, kind, channels, columns):
    index = np.array([[[3, 5], [89, 49], [92, 7]]])  # the last lies in the padding
    descriptors = rows(3, columns)[None]
    scores = np.array([[0.5, 0.9, 0.8]], np.float32)
    model = image_net(tmp_path / "net.onnx", channels, keypoints=index, scores=scores, descriptors=descriptors)
    features = kind(model).extract(GREY)
    order = np.argsort(features.keypoints[:, 0])
    np.testing.assert_allclose(features.keypoints[order], [[3.5, 5.5], [89.5, 49.5]])
    np.testing.assert_allclose(features.descriptors[order], unit(descriptors[0, :2]), atol=1e-5)


def test_superpoint_keeps_the_strongest(tmp_path):
    index, scores = np.array([[[3, 5], [10, 20], [30, 7]]]), np.array([[0.5, 0.9, 0.8]], np.float32)
    model = image_net(tmp_path / "net.onnx", 1, keypoints=index, scores=scores, descriptors=rows(3)[None])
    np.testing.assert_allclose(SuperPoint(model, max_features=2).extract(GREY).keypoints, [[10.5, 20.5], [30.5, 7.5]])


def test_superpoint_with_other_outputs_is_refused(tmp_path):
    scores = np.array([[0.5, 0.9]], np.float32)
    model = image_net(
        tmp_path / "net.onnx", 1, keypoints=np.zeros((1, 3, 2), np.int64), scores=scores, descriptors=rows(2)[None]
    )
    with pytest.raises(FeatureError, match="not those of SuperPoint"):
        SuperPoint(model).extract(GREY)


def test_lightglue_reads_both_exports(tmp_path):
    a, b = pair()
    pairs = np.array([[0, 3], [1, 5], [4, 0], [2, 9]])  # the last is outside, the second too weak
    fused = glue(tmp_path / "fused.onnx", pairs, np.array([0.9, 0.05, 0.7, 0.8], np.float32))
    partners = glue(tmp_path / "each.onnx", np.array([[3, 5, -1, -1, 0]]), np.array([[0.9, 0.05, 0, 0, 0.7]], np.float32))
    for model in (fused, partners):
        matches = LightGlue(model).match(a, b)
        assert matches.indices.tolist() == [[0, 3], [4, 0]]
        np.testing.assert_allclose(matches.similarity, [0.9, 0.7], atol=1e-6)


def test_lightglue_is_fed_places_about_the_middle_in_halves_of_the_long_side(tmp_path, monkeypatch):
    fed = {}

    class Net:
        def empty(self):
            return False

        def setInput(self, blob, name):  # noqa: N802 - OpenCV's name
            fed[name] = blob

        def getUnconnectedOutLayersNames(self):  # noqa: N802
            return ["matches0", "mscores0"]

        def forward(self, names):
            return np.zeros((0, 2), np.int64), np.zeros(0, np.float32)

    monkeypatch.setattr(cv2.dnn, "readNetFromONNX", lambda path: Net())
    corners = Features(np.array([[0.5, 0.5], [45.5, 25.5], [89.5, 49.5]]), unit(rows(3)), (90, 50))
    assert len(LightGlue(tmp_path / "any.onnx").match(corners, corners)) == 0
    np.testing.assert_allclose(fed["kpts0"][0], [[-1, -25 / 45], [0, 0], [44 / 45, 24 / 45]], atol=1e-6)
    assert fed["kpts1"].dtype == fed["desc0"].dtype == np.float32
    assert fed["desc1"].shape == (1, 3, 16)


# ---- real networks, where they are


@pytest.mark.loop
@pytest.mark.scan
@pytest.mark.parametrize("name", ["aliked-t16-top2048.onnx", "aliked-n16rot-top2048.onnx"])
def test_real_aliked_finds_the_same_places_in_a_moved_picture(name):
    """The picture is moved by a whole number of pixels, so every place moves by exactly that."""
    model = shared_model(name)
    rng = np.random.default_rng(4)
    big = cv2.resize(rng.integers(0, 255, (40, 50), np.uint8), (400, 320), interpolation=cv2.INTER_CUBIC)
    a, b = Aliked(model).extract(big[:288, :352]), Aliked(model).extract(big[13:301, 21:373])
    pairs = MutualNearest(0.95).match(a, b).indices
    offset = a.keypoints[pairs[:, 0]] - b.keypoints[pairs[:, 1]]
    right = np.abs(offset - [21, 13]).max(axis=1) < 1
    assert len(a) > 200
    assert right.sum() > 150
    np.testing.assert_allclose(np.median(offset[right], axis=0), [21, 13], atol=0.1)


@pytest.mark.loop
@pytest.mark.scan
def test_real_aliked_sees_a_picture_turned_upside_down_at_the_mirrored_places():
    """A shift of the places shows twice here. cv2.ALIKED's own grows from left to right, to 2 where the network's is 0.3."""
    model = shared_model("aliked-t16-top2048.onnx")
    noise = 6 * np.random.default_rng(0).normal(size=(480, 640))
    image = np.clip(128 + 45 * picture() + noise, 0, 255).astype(np.uint8)
    a, b = Aliked(model).extract(image).keypoints, Aliked(model).extract(np.ascontiguousarray(image[::-1, ::-1])).keypoints
    offset = a[:, None] - ((640, 480) - b)[None]
    near = np.abs(offset).max(axis=2) < 1.5
    shifts = []
    for side in (a[:, 0] < 200, a[:, 0] > 440, a[:, 1] < 150, a[:, 1] > 330):
        same = offset[side][near[side]]
        assert len(same) > 100
        shifts.append(same.mean(axis=0))
    assert np.abs(shifts).max() < 0.5
    assert np.ptp(shifts, axis=0).max() < 0.25


@pytest.mark.loop
@pytest.mark.scan
def test_the_papers_pair_with_random_weights_runs():
    superpoint, lightglue = (shared_model(f"randomweights_{n}_test.onnx") for n in ("superpoint", "lightglue_unfused"))
    rng = np.random.default_rng(6)
    image = cv2.resize(rng.integers(0, 255, (30, 40), np.uint8), (320, 240), interpolation=cv2.INTER_CUBIC)
    a, b = SuperPoint(superpoint).extract(image), SuperPoint(superpoint).extract(image[:200])
    assert len(a) > 50 and len(a) != len(b)
    assert (SuperPoint(superpoint).extract(image).keypoints == a.keypoints).all(), "a second run must not change anything"
    matches = LightGlue(lightglue, min_score=0.0).match(a, b)
    assert (matches.indices < (len(a), len(b))).all()
    with pytest.raises(FeatureError, match="as ALIKED's do"):
        SuperPoint(shared_model("aliked-t16-top2048.onnx")).extract(image[:192, :256])
