"""The one module that flips axes, against formulas and matrices written down independently."""

import numpy as np
import pytest

from core.errors import CameraError
from core.geometry import conventions
from core.geometry.camera import Intrinsics, Pose, pose_error
from core.geometry.conventions import BlenderLens, Similarity


def random_rotation(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def affine(linear, translation=(0.0, 0.0, 0.0)):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = linear, translation
    return m


def project_as_blender_does(lens, width, height, point):
    """Where Blender draws a point given in the camera's own space: the frame of view3d, not our formula for K."""
    aspect_x, aspect_y = lens.pixel_aspect_x, lens.pixel_aspect_y
    across, down = width * aspect_x, height * aspect_y
    horizontal = lens.sensor_fit == "HORIZONTAL" or (lens.sensor_fit == "AUTO" and across >= down)
    sensor = lens.sensor_height_mm if lens.sensor_fit == "VERTICAL" else lens.sensor_width_mm
    view_width = sensor if horizontal else sensor * across / down  # size of the frame at the distance `lens_mm`, in mm
    view_height = view_width * down / across
    along = sensor
    x = -point[0] / point[2] * lens.lens_mm - lens.shift_x * along
    y = -point[1] / point[2] * lens.lens_mm - lens.shift_y * along
    return (x / view_width + 0.5) * width, (0.5 - y / view_height) * height


LENSES = [
    BlenderLens(50.0),
    BlenderLens(28.0, 36.0, 24.0, "AUTO", 0.1, -0.2),
    BlenderLens(35.0, 32.0, 18.0, "HORIZONTAL", -0.05, 0.3, 1.0, 1.5),
    BlenderLens(85.0, 32.0, 18.0, "VERTICAL", 0.25, 0.0, 2.0, 1.0),
]


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("size", [(1920, 1080), (720, 1280), (500, 500), (900, 800)])
def test_intrinsics_agree_with_blenders_own_frame(lens, size):
    intrinsics = conventions.intrinsics_from_blender(lens, *size)
    rng = np.random.default_rng(1)
    for _ in range(5):
        blender_point = np.array([*rng.uniform(-1, 1, 2), -rng.uniform(2, 5)])
        expected = project_as_blender_does(lens, *size, blender_point)
        got = intrinsics.project(conventions.FLIP_YZ @ blender_point)[0]
        np.testing.assert_allclose(got, expected, atol=1e-9)


@pytest.mark.parametrize("lens", LENSES)
def test_lens_comes_back(lens):
    back = conventions.blender_from_intrinsics(conventions.intrinsics_from_blender(lens, 720, 1280), lens)
    assert back.lens_mm == pytest.approx(lens.lens_mm)
    assert (back.shift_x, back.shift_y) == pytest.approx((lens.shift_x, lens.shift_y))
    assert (back.pixel_aspect_x, back.pixel_aspect_y) == (lens.pixel_aspect_x, lens.pixel_aspect_y)


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("focal", [(900.0, 1000.0), (1000.0, 900.0), (950.0, 950.0)])
def test_intrinsics_come_back_with_any_pixel_shape(fit, focal):
    wanted = Intrinsics(1280, 720, *focal, 600.0, 380.0)
    lens = conventions.blender_from_intrinsics(wanted, BlenderLens(50.0, 30.0, 20.0, fit))
    assert min(lens.pixel_aspect_x, lens.pixel_aspect_y) == 1.0
    got = conventions.intrinsics_from_blender(lens, 1280, 720)
    np.testing.assert_allclose(got.matrix, wanted.matrix, rtol=1e-12)


def test_distortion_is_carried():
    dist = (0.1, -0.02, 0.001, 0.002, 0.03)
    assert conventions.intrinsics_from_blender(BlenderLens(50.0), 640, 480, dist).dist == dist


def test_golden_blender_camera():
    """An unrotated Blender camera looks down -z with y up; the engine's looks down +z with y down."""
    camera = affine(np.eye(3), (1.0, 2.0, 3.0))
    pose = conventions.pose_from_blender(camera, Similarity.from_matrix(np.eye(4)))
    np.testing.assert_allclose(pose.transform([[1.5, 2.25, -2.0]]), [[0.5, -0.25, 5.0]], atol=1e-12)
    np.testing.assert_allclose(pose.centre, (1.0, 2.0, 3.0), atol=1e-12)


def test_poses_come_back_through_any_similarity():
    rng = np.random.default_rng(2)
    for _ in range(20):
        pose = Pose.from_centre(random_rotation(rng), rng.normal(size=3))
        splat = Similarity(rng.uniform(0.01, 50), random_rotation(rng), rng.normal(size=3) * 10)
        matrix = conventions.pose_to_blender(pose, splat)
        np.testing.assert_allclose(np.linalg.norm(matrix[:3, :3], axis=0), 1.0)
        distance, angle = pose_error(conventions.pose_from_blender(matrix, splat), pose)
        assert distance < 1e-9
        assert angle < 1e-6


def test_a_moved_splat_looks_the_same_from_the_moved_camera():
    """Pixels of a file point do not depend on where its object stands: the point of the whole bridge."""
    rng = np.random.default_rng(3)
    pose = Pose.from_centre(random_rotation(rng), rng.normal(size=3))
    points = pose.inverse().transform(rng.uniform(-1, 1, (8, 3)) + np.array([0, 0, 4]))
    scale, rotation, translation = 2.5, random_rotation(rng), np.array([4.0, -3.0, 1.0])
    matrix = conventions.pose_to_blender(pose, Similarity.from_matrix(affine(scale * rotation, translation)))
    in_scene = points @ (scale * rotation).T + translation
    in_camera = (in_scene - matrix[:3, 3]) @ matrix[:3, :3] * (1, -1, -1)
    np.testing.assert_allclose(in_camera / scale, pose.transform(points), atol=1e-9)


def test_scale_of_the_camera_itself_is_ignored():
    splat = Similarity.from_matrix(np.eye(4))
    plain = conventions.pose_from_blender(affine(np.eye(3), (1, 2, 3)), splat)
    scaled = conventions.pose_from_blender(affine(np.diag([2.0, 3.0, 0.5]), (1, 2, 3)), splat)
    assert pose_error(plain, scaled) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (affine(np.diag([1.0, 1.0, 1.1])), "unevenly"),
        (affine([[1, 0.2, 0], [0, 1, 0], [0, 0, 1]]), "unevenly"),
        (affine(np.diag([-1.0, 1.0, 1.0])), "mirrored"),
        (affine(np.zeros((3, 3))), "has a scale of zero"),
        (affine(np.diag([1.0, 0.0, 1.0])), "has a scale of zero"),
        (affine(np.eye(3), (np.nan, 0, 0)), "finite"),
    ],
)
def test_what_is_no_similarity_is_refused(matrix, words):
    with pytest.raises(CameraError, match=words):
        Similarity.from_matrix(matrix)


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (affine([[1, 0.3, 0], [0, 1, 0], [0, 0, 1]]), "sheared or mirrored"),
        (affine(np.diag([1.0, -1.0, 1.0])), "sheared or mirrored"),
        (affine(np.zeros((3, 3))), "has a scale of zero; give both a scale above zero"),
        (affine(np.eye(3), (np.nan, 0, 0)), "is no finite number; clear its transform"),  # its scale has no fault
    ],
)
def test_a_camera_bent_by_its_parent_is_refused(matrix, words):
    with pytest.raises(CameraError, match=words):
        conventions.pose_from_blender(matrix, Similarity.from_matrix(np.eye(4)))


@pytest.mark.parametrize(
    ("name", "up"), [("Y_DOWN", (0, -1, 0)), ("Y_UP", (0, 1, 0)), ("Z_UP", (0, 0, 1)), ("Z_DOWN", (0, 0, -1))]
)
def test_orientations_put_the_named_axis_up(name, up):
    matrix = conventions.orientation_matrix(name)
    np.testing.assert_allclose(matrix[:3, :3] @ up, (0, 0, 1), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)


def test_exif_focal_length_counts_the_diagonal():
    """A full-frame camera's 50 mm on its own 3:2 picture: 50 / 36 of the width."""
    assert conventions.focal_px_from_35mm(50.0, 6000, 4000) == pytest.approx(6000 * 50 / 36)


# What Blender 5.2's RegionView3D.window_matrix held for a region of 1311 x 878 pixels: [0][0] and [1][1] for two lenses.
@pytest.mark.parametrize(("lens", "m00", "m11"), [(50.0, 1.3888889, 2.0738421), (35.0, 0.9722222, 1.4516894)])
@pytest.mark.parametrize("picture", [(1311, 878), (640, 480), (480, 640), (1920, 400)])
def test_a_picture_shows_what_the_viewport_shows(lens, m00, m11, picture):
    """The picture's half sides over the focal length are the tangents of the view's frustum, cut where the shapes differ."""
    focal = conventions.focal_px_from_view(lens, (1311, 878), picture)
    x, y = picture[0] / 2 / focal * m00, picture[1] / 2 / focal * m11  # 1 is the view's own edge
    assert max(x, y) == pytest.approx(1.0, rel=1e-5)
    assert x / y == pytest.approx(picture[0] / picture[1] * 878 / 1311, rel=1e-5)


@pytest.mark.parametrize("frame", [(1920, 1080), (1080, 1920), (600, 900), (61, 90)])
def test_a_photo_lies_whole_in_the_middle_of_the_frame(frame):
    """Its corners by hand, and back again."""
    photo = Intrinsics(60, 90, 80.0, 84.0, 31.0, 44.0, (0.1, 0, 0, 0, 0))
    whole = conventions.frame_around_photo(photo, *frame)
    scale = min(frame[0] / 60, frame[1] / 90)
    corner = np.divide(frame, 2) - scale * np.array([30, 45])
    points = np.array([[0.1, -0.2, 1.0], [-0.3, 0.4, 2.0]])
    np.testing.assert_allclose(whole.project(points), photo.project(points) * scale + corner)
    back = conventions.photo_in_frame(whole, 60, 90)
    np.testing.assert_allclose(back.matrix, photo.matrix, rtol=1e-12)
    assert back.dist == photo.dist
