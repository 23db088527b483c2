"""The camera of a photo's pixels as they are stored, and of the same photo upright, as its EXIF orientation says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .camera import Camera, FloatArray, Intrinsics, Pose

# Per EXIF orientation, where the axes right and down of the stored picture point in the upright one. The mirrored
# orientations are left out, because no camera is the mirror image of another.
TURNS: dict[int, FloatArray] = {
    1: np.eye(2),
    3: -np.eye(2),
    6: np.array([[0.0, -1.0], [1.0, 0.0]]),
    8: np.array([[0.0, 1.0], [-1.0, 0.0]]),
}
BACK = {1: 1, 3: 3, 6: 8, 8: 6}


def is_quarter_turn(orientation: int) -> bool:
    """Whether the upright picture is as wide as the stored one is high."""
    return orientation >= 5


def upright_lens(stored: Intrinsics, orientation: int) -> Intrinsics:
    """The lens, in pixels of the upright photo, that is `stored` in pixels as the file has them. Mirrored ones stay.

    The tangential part of the lens model is r^2 v + 2 (v.n) n with v = (p2, p1), a vector of the picture that turns with it.
    """
    turn = TURNS.get(orientation, TURNS[1])
    if np.array_equal(turn, TURNS[1]):
        return stored
    size = np.array([stored.width, stored.height], np.float64)
    width, height = np.abs(turn) @ size
    cx, cy = turn @ (np.array([stored.cx, stored.cy]) - size / 2) + np.array([width, height]) / 2
    fx, fy = np.abs(turn) @ (stored.fx, stored.fy)
    k1, k2, p1, p2, k3 = stored.dist
    p2, p1 = (float(value) for value in turn @ (p2, p1))
    return Intrinsics(int(width), int(height), float(fx), float(fy), float(cx), float(cy), (k1, k2, p1, p2, k3))


def upright_pose(stored: Pose, orientation: int) -> Pose:
    """The pose of the camera of the upright photo; its centre stays where it is."""
    turn = np.eye(3)
    turn[:2, :2] = TURNS.get(orientation, TURNS[1])
    return Pose(turn @ stored.R, turn @ stored.t)


def upright_camera(stored: Camera, orientation: int) -> Camera:
    """The camera of the upright photo, of one that belongs to the pixels as they are stored."""
    lens, pose = upright_lens(stored.intrinsics, orientation), upright_pose(stored.pose, orientation)
    return replace(stored, intrinsics=lens, pose=pose, pixel_order="upright")


def stored_camera(upright: Camera, orientation: int) -> Camera:
    """The inverse of `upright_camera`."""
    return replace(upright_camera(upright, BACK.get(orientation, 1)), pixel_order="stored")
