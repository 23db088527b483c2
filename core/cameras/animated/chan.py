"""Nuke's .chan: a line for each frame, of its number, the camera's place, three angles, and the vertical field of view.

tx ty tz rx ry rz vfov: the place in the scan's coordinates; the angles in degrees for Nuke's rotation order ZXY, the default of
its cameras: camera-to-world, of a camera that looks along -z with y up, is Ry Rx Rz; the field of view in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...geometry.camera import Camera
from ...geometry.conventions import pose_to_opengl
from ...support.atomic import atomic_write

# How far the principal point may lie off the middle, pixels, before that is told.
CENTRE_PX = 0.5


def write_chan(path: Path, frames: Sequence[tuple[int, Camera]]) -> None:
    """Writes the cameras of frames, in their order. Angles go on smoothly where they pass 180 degrees. Raises OSError."""
    from scipy.spatial.transform import Rotation

    ordered = sorted(frames, key=lambda one: one[0])
    worlds = np.stack([pose_to_opengl(camera.pose) for _, camera in ordered])
    # Rotations about the camera's own axes y, x, z are Ry Rx Rz.
    angles = Rotation.from_matrix(worlds[:, :3, :3]).as_euler("YXZ", degrees=True)[:, [1, 0, 2]]
    angles = np.unwrap(angles, axis=0, period=360.0)
    with atomic_write(path) as file:
        for (frame, camera), world, turn in zip(ordered, worlds, angles, strict=True):
            numbers = [*world[:3, 3], *turn, vertical_fov_deg(camera)]
            file.write("\t".join([str(frame), *(f"{value:.9g}" for value in numbers)]) + "\n")


def vertical_fov_deg(camera: Camera) -> float:
    k = camera.intrinsics
    return math.degrees(2 * math.atan(k.height / (2 * k.fy)))


def lacking(cameras: Sequence[Camera]) -> str:
    """What of the cameras' lenses a .chan file cannot hold, in a sentence; empty where nothing is lost."""
    lost = []
    if any(camera.intrinsics.has_distortion for camera in cameras):
        lost.append("the distortion (undistort the plate by the maps of stmap)")
    k = [camera.intrinsics for camera in cameras]
    if any(abs(one.cx - one.width / 2) > CENTRE_PX or abs(one.cy - one.height / 2) > CENTRE_PX for one in k):
        far = max(math.hypot(one.cx - one.width / 2, one.cy - one.height / 2) for one in k)
        lost.append(f"the principal point, {far:.1f} px off the middle (Nuke's window translate)")
    if any(abs(one.fx / one.fy - 1) > 1e-4 for one in k):
        lost.append(f"the shape of the pixels ({k[0].fy / k[0].fx:.4g} times as wide as high)")
    return f"A .chan file does not hold {', nor '.join(lost)}." if lost else ""
