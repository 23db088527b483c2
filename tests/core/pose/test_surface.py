"""Depth between pixels: read one way everywhere, and not pulled to nothing beside the scan's edge."""

from dataclasses import replace

import numpy as np
import pytest

from core.features.types import Features, Matches
from core.geometry.camera import Intrinsics, Pose
from core.photos.photo import Photo
from core.pose.search.observe import extract_photo_features, observe
from core.pose.search.solve import gate
from core.pose.shared.matches import ViewMatches
from core.pose.shared.surface import depth_at
from core.render.view import RenderedView


def plane(alpha=None):
    """A slanted plane, z = 2 + x / 20 at the pixel x, 40 x 30 pixels."""
    z = np.tile(2 + (np.arange(40) + 0.5) / 20, (30, 1)).astype(np.float32)
    alpha = np.ones((30, 40), np.float32) if alpha is None else alpha
    z = np.where(alpha > 0, z, 0).astype(np.float32)
    return RenderedView(np.repeat(z[..., None] / 5, 3, axis=2), z, alpha, np.full_like(z, 0.04))


def test_depth_between_pixels_is_interpolated():
    pixels = np.array([[5.5, 4.5], [5.9, 4.7], [20.0, 11.0]])
    depth, std = depth_at(plane(), pixels)
    np.testing.assert_allclose(depth, 2 + pixels[:, 0] / 20, atol=2e-3)  # OpenCV interpolates in steps of 1/32 pixel
    np.testing.assert_allclose(std, 0.2, rtol=1e-5)


def test_beside_the_edge_the_empty_side_counts_for_nothing():
    alpha = np.ones((30, 40), np.float32)
    alpha[:, 20:] = 0
    depth, _ = depth_at(plane(alpha), np.array([[19.8, 10.0], [20.4, 10.0]]))
    assert depth[0] == pytest.approx(2 + 19.5 / 20, abs=1e-3)
    assert np.isnan(depth[1])


def test_the_loop_reads_depth_as_the_last_stage_does():
    """A keypoint between two pixels has the depth between theirs."""
    places = np.array([[5.9, 4.7], [20.25, 11.0], [30.0, 20.0]])

    class Frontend:
        matcher = extractor = None

        def __init__(self):
            self.matcher = self.extractor = self

        def extract(self, grey, mask=None):
            return Features(places, np.zeros((3, 4), np.float32))

        photo_features = extract

        def match(self, a, b):
            return Matches(np.array([[0, 0], [1, 1], [2, 2]]), np.ones(3, np.float32))

    class Plane:
        def render(self, intrinsics, pose):
            return plane()

    lens, frontend = Intrinsics(40, 30, 40.0, 40.0, 20.0, 15.0), Frontend()
    query = extract_photo_features(Photo(np.zeros((30, 40, 3), np.uint8)), lens, 640, frontend)
    matches = observe(Plane(), query, Pose(), True, frontend).matches
    np.testing.assert_allclose(matches.depth, depth_at(plane(), places)[0])
    np.testing.assert_allclose(matches.depth, 2 + places[:, 0] / 20, atol=2e-3)


@pytest.mark.parametrize("turned", [False, True])
def test_the_gate_is_as_wide_whichever_focal_length_is_the_longer(turned):
    """The same picture lying and standing: fx and fy change places, and what passes must not."""
    lens = Intrinsics(400, 400, 300.0, 900.0, 200.0, 200.0)
    swap = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) if turned else np.eye(3)
    lens = replace(lens, fx=lens.fy, fy=lens.fx) if turned else lens
    offsets = np.column_stack([np.linspace(-0.0195, 0.0195, 40), np.zeros(40)])  # along the epipolar lines, in the image plane
    view, query = np.zeros((40, 2)), offsets
    rotate = swap[:2, :2]
    pose = Pose.from_centre(np.eye(3), swap @ [1e-6, 0, 0])
    matches = ViewMatches(Pose(), query @ rotate.T, view @ rotate.T, np.full(40, 2.0), np.full(40, 0.01))
    passed = gate(pose, matches, lens.matrix)
    assert passed.sum() == 20, "3 px of 300 px focal length are 0.01 of the image plane"
