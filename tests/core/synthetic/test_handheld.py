"""The made plates: what zooms, hides and cuts is where it is said to be."""

from dataclasses import replace

import numpy as np
import pytest

from core.render import Renderer, RenderSettings
from core.synthetic import make_scene
from core.synthetic.plate import HandHeld
from core.synthetic.sample import LENS

SHOT = HandHeld(12, lens=LENS.resized(80, 60), shutter=0.0)


@pytest.fixture(scope="module")
def renderer():
    return Renderer(make_scene(0, 3000), RenderSettings())


def test_a_zoom_starts_and_stops_smoothly_and_goes_as_far_as_it_says():
    focal = np.array([replace(SHOT, zoom=1.3).lens_at(frame).focal for frame in range(1001, 1013)]) / SHOT.lens.focal
    assert (focal[0], focal[-1]) == pytest.approx((1.0, 1.3))
    steps = np.diff(np.log(focal))
    assert (steps >= 0).all() and steps[0] == steps[-1] == 0 and (steps[3:8] > 0).all()
    assert steps[2] < 0.5 * steps.max()
    assert SHOT.lens_at(1007) == SHOT.lens


def test_a_card_hides_the_frames_that_it_covers_and_slides_over_those_beside_them(renderer):
    covered = replace(SHOT, covered=range(1005, 1008))
    shares = []
    for frame in SHOT.frames:
        same = np.abs(covered.photo(renderer, frame).pixels.astype(int) - SHOT.photo(renderer, frame).pixels).max(axis=2) < 3
        shares.append(same[:, 40:].mean() if frame in covered.covered else same.mean())
    hidden = np.array(shares)
    assert (hidden[4:7] < 0.2).all() and (hidden[[0, 10, 11]] == 1).all()
    assert 0.1 < hidden[2] < 0.9, "half over the frame two before"


def test_behind_a_cut_the_camera_stands_elsewhere_and_goes_on():
    cut = replace(SHOT, cut=1006)
    centres = np.array([cut.pose(frame).centre for frame in SHOT.frames])
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    assert steps[4] > 0.5 and np.delete(steps, 4).max() < 0.05
    assert cut.pose(1005) == SHOT.pose(1005) and cut.pose(1007) != SHOT.pose(1007)
