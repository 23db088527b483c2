"""View-dependent colour: spherical harmonics as polynomials of the direction, evaluated in one product per chunk."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from . import constants as c

Float32Array = NDArray[np.float32]

# The monomials of a unit direction up to degree 3; z^2 is left out, because it is 1 - x^2 - y^2. Those of each degree are
# products of earlier ones.
TERMS = ("", "x", "y", "z", "xx", "xy", "xz", "yy", "yz", "xxx", "xxy", "xxz", "xyy", "xyz", "yyy", "yyz")
HARMONICS: tuple[dict[str, float], ...] = (
    {"": c.SH_C0},
    {"y": -c.SH_C1},
    {"z": c.SH_C1},
    {"x": -c.SH_C1},
    {"xy": c.SH_C2[0]},
    {"yz": c.SH_C2[1]},
    {"": 2 * c.SH_C2[2], "xx": -3 * c.SH_C2[2], "yy": -3 * c.SH_C2[2]},
    {"xz": c.SH_C2[3]},
    {"xx": c.SH_C2[4], "yy": -c.SH_C2[4]},
    {"xxy": 3 * c.SH_C3[0], "yyy": -c.SH_C3[0]},
    {"xyz": c.SH_C3[1]},
    {"y": 4 * c.SH_C3[2], "xxy": -5 * c.SH_C3[2], "yyy": -5 * c.SH_C3[2]},
    {"z": 2 * c.SH_C3[3], "xxz": -5 * c.SH_C3[3], "yyz": -5 * c.SH_C3[3]},
    {"x": 4 * c.SH_C3[4], "xxx": -5 * c.SH_C3[4], "xyy": -5 * c.SH_C3[4]},
    {"xxz": c.SH_C3[5], "yyz": -c.SH_C3[5]},
    {"xxx": c.SH_C3[6], "xyy": -3 * c.SH_C3[6]},
)


def color_polynomials(sh: Float32Array) -> Float32Array:
    """Coefficients (K, 3, n) of the first K TERMS, the offset 0.5 included, from SH coefficients (n, K, 3)."""
    count = sh.shape[1]
    harmonics = np.array([[h.get(term, 0.0) for term in TERMS[:count]] for h in HARMONICS[:count]], np.float32)
    # OpenCV transposes in half of numpy's time.
    columns = cv2.transpose(sh.reshape(len(sh), -1)) if len(sh) else sh
    out = np.matmul(harmonics.T, columns.reshape(count, -1)).reshape(count, 3, len(sh))
    out[0] += np.float32(0.5)
    return np.asarray(out)


def colors(color: Float32Array, means: Float32Array, centre: Float32Array, index: NDArray[np.intp]) -> Float32Array:
    """RGB (3, n) of the Gaussians `index` (n,) of a chunk (color (K, 3, m), means (3, m)) seen from `centre` (3,).

    Where most of a chunk is wanted, all of it is evaluated and the result gathered: 3 values each, not 3 K.
    """
    dense = 2 * len(index) >= means.shape[1]
    if not dense:
        color, means = color.take(index, axis=2), means.take(index, axis=1)
    out = np.einsum("kcn,kn->cn", color, _monomials(means, centre, len(color)))
    np.maximum(out, np.float32(0), out=out)
    return np.asarray(out.take(index, axis=1) if dense else out)


def _monomials(means: Float32Array, centre: Float32Array, count: int) -> Float32Array:
    """The first `count` TERMS of the directions from `centre` (3,) to `means` (3, n), (count, n)."""
    out = np.empty((count, means.shape[1]), np.float32)
    out[0] = 1
    if count > 1:
        d = np.subtract(means, centre[:, None], out=out[1:4])
        length = np.sqrt(np.einsum("kn,kn->n", d, d))
        np.maximum(length, np.float32(1e-30), out=length)
        d /= length
    if count > 4:
        np.multiply(out[1], out[1:4], out=out[4:7])
        np.multiply(out[2], out[2:4], out=out[7:9])
    if count > 9:
        np.multiply(out[1], out[4:9], out=out[9:14])
        np.multiply(out[2], out[7:9], out=out[14:16])
    return out
