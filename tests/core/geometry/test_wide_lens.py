"""Wide lenses: projection against OpenCV and by hand, its inverse, turned photos, and the pinholes that are cut out of them."""

import cv2
import numpy as np
import pytest

from core.errors import CameraError
from core.geometry.camera import Intrinsics, Pose
from core.geometry.lens_models import MODELS
from core.geometry.lie import so3_exp
from core.geometry.pinhole_cut import WideCamera, central_cut, cuts_of
from core.geometry.turned_photo import TURNS, upright_pose
from core.geometry.wide_lens import WideLens

K = Intrinsics(1280, 720, 420, 425, 640.5, 351)
COEFFICIENTS = {
    "BROWN": {"k1": 0.05, "k2": 0.01, "k3": 0.002, "k4": 0.001, "p1": 0.001, "p2": -0.002, "b1": 0.003, "b2": -0.001},
    "FULL_OPENCV": {"k1": 0.06, "k2": -0.08, "p1": 0.001, "p2": -0.0015, "k3": 0.02, "k4": 0.01, "k5": -0.02, "k6": 0.003},
    "OPENCV_FISHEYE": {"k1": 0.03, "k2": -0.01, "k3": 0.004, "k4": -0.0005},
    "SIMPLE_RADIAL_FISHEYE": {"k1": 0.03},
    "RADIAL_FISHEYE": {"k1": 0.03, "k2": -0.004},
    "SIMPLE_FISHEYE": {},
    "FISHEYE": {},
    "THIN_PRISM_FISHEYE": {"k1": 0.03, "k2": -0.004, "p1": 0.001, "p2": -0.002, "k3": 0.001, "sx1": 0.0005, "sy1": -0.0007},
    "RAD_TAN_THIN_PRISM_FISHEYE": {"k0": 0.03, "k1": -0.003, "p0": 0.001, "p1": -0.002, "s0": 5e-4, "s1": 3e-4, "s2": -7e-4},
    "FOV": {"omega": 0.9},
    "SIMPLE_DIVISION": {"k": -0.1},
    "DIVISION": {"k": -0.1},
    "EUCM": {"alpha": 0.6, "beta": 1.1},
    "INVERSE_RADIAL": {"r": -0.05},
}


def lens_of(model):
    return WideLens.of(model, K, COEFFICIENTS[model])


def rays_within(degrees, count=400, seed=0):
    """Unit directions (N, 3) evenly over the angles from the axis."""
    rng = np.random.default_rng(seed)
    angle, around = np.radians(degrees) * rng.uniform(0, 1, count), rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)])


def test_every_model_of_a_lens_is_here():
    assert set(COEFFICIENTS) == set(MODELS) - {"EQUIRECTANGULAR"}


def test_fisheyes_are_opencvs():
    values = COEFFICIENTS["OPENCV_FISHEYE"]
    rays = rays_within(85)
    true, _ = cv2.fisheye.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), K.matrix, np.array(list(values.values())))
    np.testing.assert_allclose(lens_of("OPENCV_FISHEYE").project(3 * rays), true[:, 0], atol=1e-9)


def test_the_rational_model_is_opencvs():
    values = COEFFICIENTS["FULL_OPENCV"]
    rays = rays_within(50)
    true, _ = cv2.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), K.matrix, np.array(list(values.values())))
    np.testing.assert_allclose(lens_of("FULL_OPENCV").project(rays), true[:, 0], atol=1e-9)


@pytest.mark.parametrize("model", ["OPENCV_FISHEYE", "RADIAL_FISHEYE"])
def test_beyond_ninety_degrees_the_series_goes_on(model):
    v = COEFFICIENTS[model]
    for degrees in (91, 100, 110):
        a = np.radians(degrees)
        radius = a * (1 + v["k1"] * a**2 + v["k2"] * a**4 + v.get("k3", 0) * a**6 + v.get("k4", 0) * a**8)
        along = np.array([0.6, -0.8])
        (got,) = lens_of(model).project([[*(np.sin(a) * along), np.cos(a)]])
        np.testing.assert_allclose(got, radius * along * (K.fx, K.fy) + (K.cx, K.cy), atol=1e-9)


@pytest.mark.parametrize("model", COEFFICIENTS)
def test_pixels_and_rays_are_each_others_inverse(model):
    lens = lens_of(model)
    rays = rays_within(100 if MODELS[model].chart == "angle" else 55)
    pixels = lens.project(rays * 2.5)
    assert np.isfinite(pixels).all()
    back = lens.unproject(pixels)
    np.testing.assert_allclose(back, rays, atol=1e-9)
    # And the other way round: a ray moved a little moves its pixel as the projection's finite difference says.
    step = 1e-6 * np.random.default_rng(1).normal(size=rays.shape)
    moved = lens.unproject(pixels + (lens.project(rays + step) - pixels))
    np.testing.assert_allclose(moved, (rays + step) / np.linalg.norm(rays + step, axis=1, keepdims=True), atol=1e-9)


def test_what_a_lens_does_not_see_has_no_pixel():
    folding = WideLens.of("OPENCV_FISHEYE", K, {"k1": -0.2})  # d/da (a - 0.2 a^3) is 0 at 1.29 radians
    turns = np.sqrt(1 / 0.6)
    inside, outside = (np.array([[np.sin(a), 0, np.cos(a)]]) for a in (turns - 0.01, turns + 0.01))
    assert np.isfinite(folding.project(inside)).all() and np.isnan(folding.project(outside)).all()
    largest = turns * (1 - 0.2 * turns**2) * K.fx
    seen, unseen = (folding.unproject([[K.cx + largest + off, K.cy]]) for off in (-0.5, 0.5))
    assert np.isfinite(seen).all() and np.isnan(unseen).all()
    assert np.isnan(lens_of("FULL_OPENCV").project([[0.1, 0.1, -1.0]])).all()


@pytest.mark.parametrize("orientation", [3, 6, 8])
@pytest.mark.parametrize("model", [m for m in COEFFICIENTS if m != "BROWN"])
def test_a_turned_photo_turns_its_lens(model, orientation):
    """Where the turned camera sees a ray is where the stored pixel of that ray is turned to."""
    stored = lens_of(model)
    rays = rays_within(50)
    turn = TURNS[orientation]
    upright = stored.turned(orientation)
    size = np.array([K.width, K.height])
    true = (stored.project(rays) - size / 2) @ turn.T + np.array([upright.width, upright.height]) / 2
    got = upright.project(upright_pose(Pose(), orientation).transform(rays))
    np.testing.assert_allclose(got, true, atol=1e-9)


def test_what_cannot_be_turned_or_made_is_said():
    with pytest.raises(CameraError, match="save the photo upright"):
        lens_of("BROWN").turned(6)
    with pytest.raises(CameraError, match="save the photo upright"):
        WideLens.panorama(200, 100).turned(3)
    with pytest.raises(CameraError, match="twice as wide as high"):
        WideLens.panorama(200, 150)
    with pytest.raises(CameraError, match="has no k9; it has k1, k2, k3, k4"):
        WideLens("OPENCV_FISHEYE", 64, 48, 20, 20, 32, 24, (("k9", 1.0),))
    with pytest.raises(CameraError, match="MEI is not known"):
        WideLens("MEI", 64, 48, 20, 20, 32, 24)
    with pytest.raises(CameraError, match="beside its axis"):
        central_cut(WideLens("FISHEYE", 64, 48, 20, 20, 0.5, 24))


def test_a_panorama_looks_where_it_should():
    lens = WideLens.panorama(400, 200)
    looks = {(200, 100): (0, 0, 1), (300, 100): (1, 0, 0), (100, 100): (-1, 0, 0), (200, 0): (0, -1, 0), (200, 200): (0, 1, 0)}
    for pixel, ray in looks.items():
        np.testing.assert_allclose(lens.unproject([pixel])[0], ray, atol=1e-12)
    rays = np.random.default_rng(0).normal(size=(200, 3))
    back = lens.unproject(lens.project(rays))
    np.testing.assert_allclose(back, rays / np.linalg.norm(rays, axis=1, keepdims=True), atol=1e-12)


def test_the_cut_has_the_photos_resolution_and_stays_within_it():
    lens = lens_of("OPENCV_FISHEYE")
    cut = central_cut(lens)
    k = cut.intrinsics
    assert (k.fx, k.fy) == pytest.approx((420, 425), rel=1e-6)
    assert 99 < cut.degrees <= 100
    edges = np.array([[0, k.cy], [k.width, k.cy], [k.cx, 0], [k.cx, k.height]])
    at = lens.project(np.column_stack([(edges - (k.cx, k.cy)) / (k.fx, k.fy), np.ones(4)]))
    assert (at > -0.01).all() and (at < np.array([K.width, K.height]) + 0.01).all()
    # Down, 100 degrees are more than the photo shows; there the cut ends where the photo does.
    assert at[2, 1] < 2 and at[3, 1] > K.height - 2


def test_the_faces_of_a_panorama_look_all_around():
    cuts = {cut.name: cut for cut in cuts_of(WideLens.panorama(2000, 1000))}
    ways = {"front": (0, 0, 1), "right": (1, 0, 0), "back": (0, 0, -1), "left": (-1, 0, 0), "up": (0, -1, 0), "down": (0, 1, 0)}
    assert set(cuts) == set(ways)
    photo = Pose(so3_exp([0.3, -0.2, 0.5]), [1.0, 2.0, 3.0])
    for name, cut in cuts.items():
        np.testing.assert_allclose(cut.turn.T @ [0, 0, 1], ways[name], atol=1e-12)
        assert cut.degrees == pytest.approx(100, abs=0.2)
        pose = cut.pose(photo)
        np.testing.assert_allclose(pose.centre, photo.centre, atol=1e-12)
        np.testing.assert_allclose(cut.photo_pose(pose).R, photo.R, atol=1e-12)
    camera = WideCamera.of(WideLens.panorama(2000, 1000), photo, "p.jpg")
    assert camera.intrinsics == cuts["front"].intrinsics
