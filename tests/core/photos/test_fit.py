"""Lenses that no photo has are refused before they can be taken for a wrong pose."""

from dataclasses import replace

import numpy as np
import pytest

from core.errors import PhotoError
from core.geometry.camera import Camera, Intrinsics, Pose
from core.photos.fit import fit_camera, fit_lens
from core.photos.photo import Photo

LENS = Intrinsics(64, 48, 50.0, 52.0, 30.0, 25.5, (0.05, -0.02, 0.003, -0.004, 0.01))
PHOTO = Photo(np.zeros((48, 64, 3), np.uint8), "a.jpg")


ABSURD = {
    "focal length": (replace(LENS, fx=0.9, fy=0.9), "0.9 pixels, a view of 177 degrees"),
    "a focal length in metres": (replace(LENS, fx=1e6, fy=1e6), "which cannot be matched"),
    "principal point": (replace(LENS, cx=5000.0), r"at \(5000, "),
    "distortion": (replace(LENS, dist=(-9.0, 0.0, 0.0, 0.0, 0.0)), "folds its picture"),
}


@pytest.mark.parametrize("name", ABSURD)
def test_a_lens_that_no_photo_has_is_refused_by_what_is_wrong_with_it(name):
    lens, sentence = ABSURD[name]
    with pytest.raises(PhotoError, match=sentence):
        fit_lens(PHOTO, lens)
    with pytest.raises(PhotoError, match=sentence):
        fit_camera(PHOTO, Camera(lens, Pose()))


def test_lenses_of_real_photos_pass():
    for dist in ((), (-0.3, 0.1), (0.05, -0.06, 0.001, 0.001, 0.01)):
        assert fit_lens(PHOTO, replace(LENS, dist=dist, cx=-20.0)).dist[: len(dist)] == dist
