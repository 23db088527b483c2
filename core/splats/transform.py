"""A splat scene moved as a whole: turned, scaled alike in all directions, and shifted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.camera import FloatArray
from ..geometry.conventions import Orientation, Similarity
from ..geometry.quaternion import quaternion_from_rotation
from .scene import GaussianScene

# More than enough to tell the 7 functions of degree 3 apart.
DIRECTIONS = 64


def transformed(scene: GaussianScene, move: Similarity, orientation: Orientation) -> GaussianScene:
    """`scene` with every Gaussian moved by `move`; seen from a camera moved alike it looks as before.

    Means, scales, rotations and the SH coefficients of every degree change; opacities stay. `orientation` says which way the
    axes point afterwards.
    """
    sh = scene.sh.copy()
    for degree in range(1, scene.sh_degree + 1):
        band = slice(degree**2, (degree + 1) ** 2)
        sh[:, band] = np.matmul(sh_rotation(move.rotation, degree).astype(np.float32), scene.sh[:, band])
    # The place of a scan far out goes into its origin as a whole.
    near, (x, y, z) = not any(scene.origin), move.to_scene(np.array([scene.origin]))[0]
    turn = _left_product(quaternion_from_rotation(move.rotation))
    return replace(
        scene,
        means=(move.to_scene(scene.means) - (0 if near else move.translation)).astype(np.float32),
        origin=(0.0, 0.0, 0.0) if near else (float(x), float(y), float(z)),
        scales=scene.scales * np.float32(move.scale),
        rotations=np.ascontiguousarray(scene.rotations @ turn.T.astype(np.float32)),
        sh=sh,
        orientation=orientation,
    )


def sh_rotation(rotation: FloatArray, degree: int) -> FloatArray:
    """The matrix (2 degree + 1, same) that takes a function's SH coefficients of one degree to those of the turned function.

    The turned function has at direction d the value that the function had at R^T d. Turned functions of one degree are again
    sums of that degree's harmonics, so solving Y(d) D = Y(R^T d) over some directions finds D without a remainder.
    """
    directions = _spread_directions(DIRECTIONS)
    before, after = _harmonics(directions @ rotation, degree), _harmonics(directions, degree)
    return np.asarray(np.linalg.lstsq(after, before, rcond=None)[0])


def _harmonics(directions: FloatArray, degree: int) -> FloatArray:
    """Real spherical harmonics (n, 2 degree + 1) in INRIA's order and signs: the imaginary and real parts of the complex ones,
    whose sign (-1)^m (Condon and Shortley's) it kept.
    """
    # Imported here, because it takes as long as all else that a process for drawing imports, which turns no harmonics.
    from scipy.special import sph_harm_y

    x, y, z = directions.T
    polar, azimuth = np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x)
    of_order = [np.asarray(sph_harm_y(degree, order, polar, azimuth)) for order in range(degree + 1)]
    sines = [np.sqrt(2) * of_order[order].imag for order in range(degree, 0, -1)]
    cosines = [np.sqrt(2) * of_order[order].real for order in range(1, degree + 1)]
    return np.stack([*sines, of_order[0].real, *cosines], axis=1)


def _spread_directions(count: int) -> FloatArray:
    """Unit vectors (count, 3), spread evenly over the sphere along a spiral of golden angles."""
    z = 1 - (2 * np.arange(count) + 1) / count
    azimuth = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)


def _left_product(q: FloatArray) -> FloatArray:
    """The matrix (4, 4) of the product q p of quaternions w x y z, for any p."""
    w, x, y, z = q
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
