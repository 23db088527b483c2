"""EWA projection of the scene into one camera: cull, project, colour, sort by depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Intrinsics, Pose
from . import constants as c
from .tables import SceneTables

Float32Array = NDArray[np.float32]
Run = Callable[..., Iterator[Any]]  # map, or that of a thread pool

MAX_PIXEL_MARGIN = 1.9  # sqrt(2 ln 255 * 0.3): how far the low-pass alone can carry a Gaussian, pixels


@dataclass(frozen=True)
class Splats:
    """M visible Gaussians, front to back, one float32 column each (M,), pixels with the image's top-left corner at 0.

    mx, my: centre. l1, l2, l3: Cholesky factor of the conic, q = (l1 dx + l2 dy)^2 + (l3 dy)^2. ex, ey: half extents of the
    ellipse where alpha = 1/255. cut: q on that ellipse. tilt: dy at its rightmost point. skew: l2 / l1. log_opacity.
    z: camera depth. color (3, M).
    """

    mx: Float32Array
    my: Float32Array
    l1: Float32Array
    l2: Float32Array
    l3: Float32Array
    ex: Float32Array
    ey: Float32Array
    cut: Float32Array
    tilt: Float32Array
    skew: Float32Array
    log_opacity: Float32Array
    z: Float32Array
    color: Float32Array

    def __len__(self) -> int:
        return len(self.z)


class View:
    """One camera in the numbers that projection needs: float32 rotation, origin-shifted translation, Jacobian limits."""

    def __init__(self, tables: SceneTables, intrinsics: Intrinsics, pose: Pose, near: float) -> None:
        k = intrinsics
        self.k, self.near = k, near
        self.R = pose.R
        self.t = pose.R @ tables.origin + pose.t
        self.centre = (pose.centre - tables.origin).astype(np.float32)
        tan_x, tan_y = 0.5 * k.width / k.fx, 0.5 * k.height / k.fy
        self.u_range = (-(k.cx / k.fx + c.JACOBIAN_MARGIN * tan_x), (k.width - k.cx) / k.fx + c.JACOBIAN_MARGIN * tan_x)
        self.v_range = (-(k.cy / k.fy + c.JACOBIAN_MARGIN * tan_y), (k.height - k.cy) / k.fy + c.JACOBIAN_MARGIN * tan_y)
        # longest possible row of the Jacobian times z
        self.gain_x = k.fx * float(np.hypot(1.0, np.abs(self.u_range).max())) * (1 + 1e-5)
        self.gain_y = k.fy * float(np.hypot(1.0, np.abs(self.v_range).max())) * (1 + 1e-5)


def project_chunk(tables: SceneTables, view: View, part: slice) -> Splats | None:
    """Project the Gaussians of `part`; None when none of them can touch the image."""
    k = view.k
    points = view.R @ tables.means[:, part].astype(np.float64) + view.t[:, None]
    index, x, y, z = _cull(points.astype(np.float32), tables.reach[part], view)
    if not len(index):
        return None
    whole = index + part.start
    axes = np.matmul(view.R.astype(np.float32), tables.axes.take(whole, axis=1).reshape(3, -1)).reshape(3, 3, -1)
    u, v = x / z, y / z
    mx, my = np.float32(k.fx) * u + np.float32(k.cx), np.float32(k.fy) * v + np.float32(k.cy)
    np.clip(u, *(np.float32(r) for r in view.u_range), out=u)
    np.clip(v, *(np.float32(r) for r in view.v_range), out=v)
    row_x = (axes[0] - u * axes[2]) * (np.float32(k.fx) / z)
    row_y = (axes[1] - v * axes[2]) * (np.float32(k.fy) / z)
    a, cc, b = _dot(row_x, row_x), _dot(row_y, row_y), _dot(row_x, row_y)
    low = np.float32(c.LOWPASS_PX2)
    det = _determinant(row_x, row_y, a, cc)
    a += low
    cc += low
    cut = tables.cut.take(whole)
    ex, ey = np.sqrt(cut * a), np.sqrt(cut * cc)
    hit = np.flatnonzero((mx + ex >= 0.5) & (mx - ex <= k.width - 0.5) & (my + ey >= 0.5) & (my - ey <= k.height - 0.5))
    if not len(hit):
        return None
    cc, det, b = cc.take(hit), det.take(hit), b.take(hit)
    whole, cut, ex = whole.take(hit), cut.take(hit), ex.take(hit)
    return Splats(
        mx=mx.take(hit),
        my=my.take(hit),
        l1=np.sqrt(cc / det).astype(np.float32),
        l2=(-b / np.sqrt(cc * det)).astype(np.float32),
        l3=np.asarray(np.float32(1) / np.sqrt(cc)),
        ex=ex,
        ey=ey.take(hit),
        cut=cut,
        tilt=b * cut / ex,
        skew=-b / cc,
        log_opacity=tables.log_opacity.take(whole),
        z=z.take(hit),
        color=_colors(tables, view, whole),
    )


def _cull(
    points: Float32Array, reach: Float32Array, view: View
) -> tuple[NDArray[np.intp], Float32Array, Float32Array, Float32Array]:
    """Indices and camera coordinates of Gaussians whose bounding sphere may reach the image, never judged by centre alone."""
    k = view.k
    x, y, z = points
    half_w, half_h = 0.5 * k.width, 0.5 * k.height
    near = z > np.float32(view.near)
    off_x = np.abs(np.float32(k.fx) * x + np.float32(k.cx - half_w) * z)
    off_x -= np.float32(half_w + MAX_PIXEL_MARGIN) * z
    off_y = np.abs(np.float32(k.fy) * y + np.float32(k.cy - half_h) * z)
    off_y -= np.float32(half_h + MAX_PIXEL_MARGIN) * z
    near &= off_x <= np.float32(view.gain_x) * reach
    near &= off_y <= np.float32(view.gain_y) * reach
    index = np.flatnonzero(near)
    return index, x.take(index), y.take(index), z.take(index)


def _determinant(row_x: Float32Array, row_y: Float32Array, a: Float32Array, c_: Float32Array) -> NDArray[np.float64]:
    """Determinant of the 2D covariance with its low-pass; a, c_: its diagonal without.

    Cauchy-Binet keeps that of a needle exact where a c - b^2 would cancel; float64 because a Gaussian larger than the
    world overflows float32 here.
    """
    det = c.LOWPASS_PX2 * (a.astype(np.float64) + c_ + c.LOWPASS_PX2)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        minor = np.multiply(row_x[i], row_y[j], dtype=np.float64)
        minor -= np.multiply(row_x[j], row_y[i], dtype=np.float64)
        det += np.square(minor, out=minor)
    return np.asarray(det)


def _dot(p: Float32Array, q: Float32Array) -> Float32Array:
    return np.asarray(p[0] * q[0] + p[1] * q[1] + p[2] * q[2])


def _colors(tables: SceneTables, view: View, index: NDArray[np.intp]) -> Float32Array:
    """RGB of the Gaussians at `index` seen from the camera centre, (3, n)."""
    sh = tables.sh
    out = sh[0].take(index, axis=1) * np.float32(c.SH_C0)
    out += np.float32(0.5)
    if len(sh) > 1:
        d = tables.means.take(index, axis=1) - view.centre[:, None]
        d /= np.maximum(np.sqrt(_dot(d, d)), np.float32(1e-30))
        for coefficient, basis in zip(sh[1:], _sh_basis(d, len(sh)), strict=True):
            out += coefficient.take(index, axis=1) * basis
    return np.asarray(np.maximum(out, np.float32(0.0)))


def _sh_basis(d: Float32Array, count: int) -> list[Float32Array]:
    """Real spherical harmonics 1 .. count - 1 at unit directions (3, n)."""
    x, y, z = d
    basis = [np.float32(-c.SH_C1) * y, np.float32(c.SH_C1) * z, np.float32(-c.SH_C1) * x]
    if count > 4:
        xx, yy, zz = x * x, y * y, z * z
        square = (x * y, y * z, 2 * zz - xx - yy, x * z, xx - yy)
        basis += [np.float32(k) * f for k, f in zip(c.SH_C2, square, strict=True)]
    if count > 9:
        cubic = (
            y * (3 * xx - yy),
            x * y * z,
            y * (4 * zz - xx - yy),
            z * (2 * zz - 3 * xx - 3 * yy),
            x * (4 * zz - xx - yy),
            z * (xx - yy),
            x * (xx - 3 * yy),
        )
        basis += [np.float32(k) * f for k, f in zip(c.SH_C3, cubic, strict=True)]
    return basis


def sort_by_depth(parts: list[Splats], run: Run) -> Splats:
    """One `Splats`, front to back; equal depths keep the file's order."""
    names = list(Splats.__dataclass_fields__)

    def whole(name: str) -> NDArray[Any]:
        column = np.concatenate([getattr(p, name or "z") for p in parts], axis=-1)
        return column if name else depth_order(column)

    order, *columns = run(whole, ["", *names])
    return Splats(*run(lambda column: column.take(order, axis=-1), columns))


def depth_order(z: Float32Array) -> NDArray[np.intp]:
    """Stable ascending order of positive float32: their bits, radix-sorted in two halves (numpy does that for 16 bits)."""
    bits = z.view(np.uint32)
    first = np.argsort(bits.astype(np.uint16), kind="stable")
    high = (bits >> np.uint32(16)).astype(np.uint16).take(first)
    return first.take(np.argsort(high, kind="stable"))
