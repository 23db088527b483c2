"""Nuke's .chan: read back by its definition, written out by hand, points fall on the pixels where they were."""

import numpy as np
import pytest

from core.cameras.animated.chan import lacking, write_chan
from core.geometry.camera import Camera, Intrinsics, Pose
from core.geometry.lie import so3_exp

LENS = Intrinsics(1920, 1080, 1500.0, 1500.0, 960.0, 540.0)


def turned(x=0.0, y=0.0, z=0.0):
    """Nuke's ZXY: the object turns about z first, then x, then y; degrees."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians([x, y, z])), np.sin(np.radians([x, y, z]))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_y @ about_x @ about_z


def seen(line, points, lens):
    """Pixels of world points in the camera of a line: it looks along -z, with y up."""
    place, (rx, ry, rz), vfov = line[1:4], line[4:7], line[7]
    x, y, z = turned(rx, ry, rz).T @ (points - place).T
    half = np.tan(np.radians(vfov / 2))
    across, up = x / (-z * half), y / (-z * half)  # in halves of the picture's height
    return np.column_stack([lens.width / 2 + across * lens.height / 2, lens.height / 2 * (1 - up)])


def written(tmp_path, frames):
    write_chan(tmp_path / "a.chan", frames)
    return np.loadtxt(tmp_path / "a.chan", ndmin=2)


def test_points_fall_on_their_pixels(tmp_path):
    rng = np.random.default_rng(0)
    cameras = [Camera(LENS, Pose(so3_exp(rng.normal(size=3)), rng.normal(size=3))) for _ in range(5)]
    lines = written(tmp_path, list(zip(range(1001, 1006), cameras, strict=True)))
    assert lines[:, 0].tolist() == [1001, 1002, 1003, 1004, 1005]
    for line, camera in zip(lines, cameras, strict=True):
        points = camera.pose.inverse().transform(rng.normal([0, 0, 6], 1, (20, 3)))
        np.testing.assert_allclose(seen(line, points, LENS), LENS.project(camera.pose.transform(points)), atol=1e-4)


def test_a_camera_that_looks_down_the_worlds_axis_has_angles_that_anybody_can_check(tmp_path):
    """At 45 degrees to the left, level: the engine's y points down, Nuke's up."""
    left = turned(y=45) @ np.diag([1.0, -1.0, -1.0])
    (line,) = written(tmp_path, [(7, Camera(LENS, Pose.from_centre(left.T, [1, 2, 3])))])
    fov = 2 * np.degrees(np.arctan(540 / 1500))
    np.testing.assert_allclose(line, [7, 1, 2, 3, 0, 45, 0, fov], atol=1e-6)


def test_frames_are_in_order_and_angles_pass_180_degrees_without_a_jump(tmp_path):
    turns = {f: Camera(LENS, Pose.from_centre((turned(y=170 + 5 * f) @ np.diag([1.0, -1, -1])).T, [0, 0, 0])) for f in range(5)}
    lines = written(tmp_path, sorted(turns.items(), reverse=True))
    assert lines[:, 0].tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(np.diff(lines[:, 5]), 5, atol=1e-6)


@pytest.mark.parametrize(
    ("lens", "said"),
    [
        (LENS, ""),
        (Intrinsics(1920, 1080, 1500.0, 1500.0, 960.0, 540.0, (0.1, 0, 0, 0, 0)), "does not hold the distortion"),
        (Intrinsics(1920, 1080, 1500.0, 1500.0, 970.0, 540.0), "the principal point, 10.0 px off the middle"),
        (Intrinsics(960, 1080, 750.0, 1500.0, 480.0, 540.0), "2 times as wide as high"),
    ],
)
def test_what_a_chan_file_cannot_hold_is_said(lens, said):
    assert said in lacking([Camera(lens, Pose())]) if said else not lacking([Camera(lens, Pose())])
