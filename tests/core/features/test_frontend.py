"""From settings to features: a wrong choice is one sentence before any work, and `auto` changes over when it should."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from boxroom import DEPTH, LENS, TRUTH, BoxRoom
from boxroom import start_off as _start
from feature_samples import rows
from onnx_files import image_net

import core.pose.refine as refine_module
from core.errors import FeatureError
from core.features import registry
from core.features.extractors.sift import RootSift
from core.features.frontend import Frontend, check_choice, make_frontend
from core.features.looks import Looks
from core.features.nets.process import RemoteExtractor, RemoteMatcher
from core.features.types import no_features
from core.geometry.camera import Camera, pose_error
from core.pose.refine import iterate_refinement, refine
from core.pose.settings import RefineSettings

pytestmark = pytest.mark.loop


@pytest.fixture
def model(tmp_path):
    scores = np.array([0.9, 0.5], np.float32)
    places = np.array([[0.1, 0.2], [-0.3, 0.4]], np.float32)
    return str(image_net(tmp_path / "net.onnx", 3, keypoints=places, descriptors=rows(2), scores=scores))


@dataclass(frozen=True)
class Choice:
    """Any other owner of the options that say which features: nobody has checked its words."""

    features: str = "sift"
    matcher: str = "nearest"
    model: str = ""
    matcher_model: str = ""
    threads: int = 0


def refused(words, settings=RefineSettings, **choice):
    settings = settings(**choice)
    with pytest.raises(FeatureError, match=words) as error:
        make_frontend(settings)
    assert str(error.value).endswith(".")
    assert "\n" not in str(error.value)


def test_choices_that_cannot_work_are_one_sentence(model, tmp_path):
    refused("no features 'surf'; choose one of sift, akaze", Choice, features="surf")
    refused("no matcher 'brute'", Choice, matcher="brute")
    refused("ALIKED needs a model file", features="aliked")
    refused("no model file at .*gone.onnx", features="disk", model=str(tmp_path / "gone.onnx"))
    refused("LightGlue needs a model file", features="superpoint", model=model, matcher="lightglue")
    refused("knows one kind of learned features, not 'orb'", features="orb", matcher="lightglue", matcher_model=model)
    refused("not 'auto'", features="auto", matcher="lightglue", matcher_model=model)
    refused("no model file at", features="auto", model=str(tmp_path / "gone.onnx"))


def test_what_this_opencv_lacks_is_said(model, monkeypatch):
    lacking = replace(registry.EXTRACTORS["aliked"], opencv="xfeatures2d.NEVER")
    monkeypatch.setitem(registry.EXTRACTORS, "aliked", lacking)
    refused("OpenCV .* has no cv2.xfeatures2d.NEVER", features="aliked", model=model)


def test_the_default_is_rootsift_with_nearest_neighbours_and_no_process():
    with make_frontend(RefineSettings()) as frontend:
        assert frontend == Frontend()
        assert frontend.stronger(0, 7) is None


def test_networks_run_elsewhere(model):
    with make_frontend(
        RefineSettings(features="superpoint", model=model, matcher="lightglue", matcher_model=model)
    ) as frontend:
        assert isinstance(frontend.extractor, RemoteExtractor)
        assert isinstance(frontend.matcher, RemoteMatcher)
        assert frontend.extractor.process is frontend.matcher.process is frontend.process
        assert frontend.stronger(0, 7) is None, "LightGlue reasons about places, which several looks at once would confuse"


def test_learned_features_have_looks_to_fall_back_on(model):
    with make_frontend(RefineSettings(features="aliked", model=model)) as frontend:
        wide = frontend.stronger(0, 7)
        assert isinstance(wide.photo_extractor, Looks)
        assert wide.extractor is frontend.extractor
        assert wide.stronger(0, 7) is None


def test_auto_is_sift_and_then_aliked_where_there_is_a_model(model, children):
    with make_frontend(RefineSettings(features="auto")) as frontend:
        assert isinstance(frontend.extractor, RootSift)
        assert frontend.stronger(0, 7) is None
    with make_frontend(RefineSettings(features="auto", model=model)) as frontend:
        assert isinstance(frontend.extractor, RootSift)
        assert isinstance(frontend.stronger(0, 7).extractor, RemoteExtractor)
        assert children == []
        frontend.stronger(0, 7).extractor.extract(np.zeros((64, 64), np.uint8))
        assert len(children) == 1


def test_features_that_still_hold_poses_in_half_the_views_go_on(model):
    with make_frontend(RefineSettings(features="auto", model=model)) as frontend:
        changes = [frontend.stronger(usable, 7) is not None for usable in range(8)]
    assert changes == [True] * 4 + [False] * 4


def test_choices_are_checked_without_reading_the_model(tmp_path):
    (tmp_path / "text.onnx").write_text("no network")
    check_choice(RefineSettings(features="aliked", model=str(tmp_path / "text.onnx")))


# ---- inside the loop


@dataclass(frozen=True)
class Blind:
    """Finds the photo's features, and nothing in the first `renders` renders."""

    seen: list
    renders: int

    def extract(self, grey, mask=None):
        self.seen.append(grey.shape)
        if 1 < len(self.seen) <= 1 + self.renders:
            return no_features(grey.shape[::-1], 128)
        return RootSift().extract(grey, mask)


@pytest.fixture(scope="module")
def room():
    return BoxRoom()


@pytest.fixture(scope="module")
def photo(room):
    return room.photo(LENS, TRUTH)


def frontends(monkeypatch, frontend):
    closed = []

    def close(self):
        closed.append(self)

    monkeypatch.setattr(Frontend, "close", close)
    monkeypatch.setattr(refine_module, "make_frontend", lambda settings: frontend)
    return closed


def test_the_stronger_features_take_over_where_the_first_found_no_answer(room, photo, monkeypatch):
    stronger = Frontend()
    seen = []
    closed = frontends(monkeypatch, Frontend(extractor=Blind(seen, 1000), fallback=stronger))
    report = refine(room, photo, Camera(LENS, _start(0.05, 4.0)))
    assert report.verdict == "trusted"
    assert report.iterations[0].matches == 0
    assert report.iterations[1].matches > 500
    assert len(seen) == 1 + 7, "the photo and one fan of views; the first features are not asked again"
    assert len(closed) == 1
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert distance < 0.002 * DEPTH and degrees < 0.12


def test_without_stronger_ones_the_first_are_asked_again(room, photo, monkeypatch):
    seen = []
    frontends(monkeypatch, Frontend(extractor=Blind(seen, 7)))
    report = refine(room, photo, Camera(LENS, _start(0.05, 4.0)))
    assert report.verdict == "trusted"
    assert len(seen) > 8


def test_a_photo_with_too_few_features_is_shown_to_the_stronger_ones(room, photo, monkeypatch):
    class Nothing:
        def extract(self, grey, mask=None):
            return no_features(grey.shape[::-1], 128)

    frontends(monkeypatch, Frontend(extractor=Nothing(), fallback=Frontend()))
    assert refine(room, photo, Camera(LENS, _start(0.05, 4.0))).verdict == "trusted"


@pytest.mark.parametrize("steps", [0, 1, 3])
def test_the_process_ends_however_the_refinement_does(room, photo, model, children, monkeypatch, steps):
    """Cancelled after `steps` views, with a network that finds two features in everything."""
    work = iterate_refinement(room, photo, Camera(LENS, _start(0.05, 4.0)), RefineSettings(features="aliked", model=model))
    if steps == 0:
        with pytest.raises(StopIteration) as end:
            next(work)
        assert "only" in end.value.value.reasons[0]
    else:
        monkeypatch.setattr(refine_module, "MIN_PHOTO_FEATURES", 1)
        for _ in range(steps):
            next(work)
        assert len(children) == 1
        work.close()


def test_a_broken_model_stops_the_refinement_with_its_sentence(room, photo, tmp_path, children):
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(FeatureError, match=r"'text.onnx' does not work"):
        refine(room, photo, Camera(LENS, TRUTH), RefineSettings(features="aliked", model=str(tmp_path / "text.onnx")))


@pytest.mark.parametrize("name", ["akaze", "orb"])
def test_binary_features_bring_a_near_start_home(room, photo, name):
    report = refine(room, photo, Camera(LENS, _start(0.05, 4.0)), RefineSettings(features=name))
    distance, degrees = pose_error(report.camera.pose, TRUTH)
    assert report.verdict == "trusted", report.reasons
    assert distance < 0.002 * DEPTH and degrees < 0.1
