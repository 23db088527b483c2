"""EWA projection of the scene into one camera: cull, project, sort by depth.

Columns are stacked and worked on together: a call into numpy passes the interpreter lock, and threads that make many short
calls wait for each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Intrinsics, Pose
from ..geometry.conventions import HALF_PIXEL
from . import constants as c
from .columns import BLEND_COLUMNS, ELLIPSE_COLUMNS, BlendColumn, EllipseColumn
from .scan.blocks import ROUNDING, Part
from .scan.order import stable_order
from .tables import CUT_MARGIN, SceneTables

Float32Array = NDArray[np.float32]
Int16Array = NDArray[np.int16]
IndexArray = NDArray[np.intp]

TILE = 8  # pixels along each side of a tile
# sqrt(2 ln 255 * 0.3) pixels: how far the low-pass filter alone can carry a Gaussian.
MAX_PIXEL_MARGIN = 1.9
EMPTY_LOG_OPACITY = -120.0


class SplatBuffers:
    """Room for what a view shows of at most N Gaussians: those of a part of the scene lie packed from its first slot on.

    Pixels have the image's top-left corner at 0. The quadratic form of a splat is q = (l1 dx + l2 dy)^2 + (l3 dy)^2.

    table (N + 1, BLEND_COLUMNS): the columns are `BlendColumn`; the last row is transparent padding. ellipses
    (N, ELLIPSE_COLUMNS): the columns are `EllipseColumn`. first, last (N,): tile rows of the ellipse, last < first where there
    is no splat. z (N,): camera depth. place (N,): where in the tables the Gaussian stands.
    """

    def __init__(self, count: int) -> None:
        self.table = np.empty((count + 1, BLEND_COLUMNS), np.float32)
        self.ellipses = np.empty((count, ELLIPSE_COLUMNS), np.float32)
        self.first, self.last = np.empty((2, count), np.int16)
        self.z, self.place = np.empty(count, np.float32), np.empty(count, np.int32)
        self.table[-1] = 0
        self.table[-1, BlendColumn.LOG_OPACITY] = EMPTY_LOG_OPACITY

    def __len__(self) -> int:
        return len(self.z)


class ViewProjection:
    """The numbers of one camera that projection needs; those of x and y are stacked, (2, 1)."""

    def __init__(self, tables: SceneTables, intrinsics: Intrinsics, pose: Pose, near: float) -> None:
        k = intrinsics
        self.near = np.float32(near)
        self.tile_rows = -(-k.height // TILE)
        self.R, self.R32 = pose.R, pose.R.astype(np.float32)
        self.t = (pose.R @ tables.origin + pose.t)[:, None]
        with np.errstate(over="ignore"):
            self.centre = (pose.centre - tables.origin).astype(np.float32)
        f, middle, half = (np.array(a)[:, None] for a in ((k.fx, k.fy), (k.cx, k.cy), (0.5 * k.width, 0.5 * k.height)))
        low, high = -middle / f, (2 * half - middle) / f
        margin = c.JACOBIAN_MARGIN * half / f
        # The range of x/z and y/z within which the Jacobian is taken.
        limits = np.stack([low - margin, high + margin])
        # The greatest length of a row of the Jacobian, times z.
        gain = f * np.hypot(1.0, np.abs(limits).max(axis=0)) * (1 + 1e-5)
        self.f, self.middle, self.gain = (a.astype(np.float32) for a in (f, middle, gain))
        self.limits, self.off_middle = limits.astype(np.float32), (middle - half).astype(np.float32)
        self.border = (half + MAX_PIXEL_MARGIN).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Conic:
    """The ellipses of n splats, low-pass included: variances (2, n) and covariance (n,) in pixels^2, 1 / l1 and l3 (n,).

    `share` (n,): the determinant without the low-pass, divided by that with it.
    """

    variance: Float32Array
    covariance: Float32Array
    inverse_l1: Float32Array
    l3: Float32Array
    share: Float32Array


@dataclass(frozen=True, eq=False)
class ProjectedSplats:
    """n Gaussians in the image: centre (2, n) in pixels, camera depth (n,), ellipses, log opacity and cut (n,) as in
    `SceneTables`.
    """

    centre: Float32Array
    z: Float32Array
    conic: Conic
    log_opacity: Float32Array
    cut: Float32Array


def seen_blocks(tables: SceneTables, view: ViewProjection) -> IndexArray:
    """The blocks of which a Gaussian's bounding sphere may reach the image, ascending; the test of `_cull`, for boxes."""
    blocks, R = tables.blocks, view.R
    with np.errstate(over="ignore", invalid="ignore"):
        # Written so that what is no number (a Gaussian larger than the world) counts as seen.
        kept = ~(-blocks.least(-R[2], -view.t[2, 0]) <= view.near)
        for axis in range(2):
            outwards = view.f[axis, 0] * R[axis] + view.off_middle[axis, 0] * R[2]
            offset = view.f[axis, 0] * view.t[axis, 0] + view.off_middle[axis, 0] * view.t[2, 0]
            for sign in (-1, 1):
                border = view.border[axis, 0]
                over = blocks.least(sign * outwards - border * R[2], sign * offset - border * view.t[2, 0])
                kept &= ~(over > view.gain[axis, 0] * (1 + ROUNDING) * blocks.reach)
    return np.flatnonzero(kept)


def project_part(tables: SceneTables, view: ViewProjection, part: Part, splats: SplatBuffers) -> IndexArray:
    """Project the Gaussians of `part` into its slots, all but the colour; which of its columns (n,) fill the first n slots."""
    exact = view.R @ part.columns(tables.means).astype(np.float64)
    exact += view.t
    with np.errstate(over="ignore"):  # a camera so far away sees nothing
        points: Float32Array = exact.astype(np.float32)
    index = _cull(points, part.columns(tables.reach), view)
    splats.first[part.slots], splats.last[part.slots] = 0, -1
    if len(index):
        own = slice(part.slots.start, part.slots.start + len(index))
        places = part.places(index)
        splats.place[own] = places
        points, body = points.take(index, axis=1), tables.body.take(places, axis=1)
        z = points[2]
        splats.z[own] = z
        plane = points[:2] / z
        centre = plane * view.f
        centre += view.middle
        np.clip(plane, *view.limits, out=plane)
        axes = np.matmul(view.R32, body[:9].reshape(3, -1)).reshape(3, 3, -1)
        rows = np.empty((2, 5, len(index)), np.float32)
        np.multiply(plane[:, None], axes[2], out=rows[:, :3])
        np.subtract(axes[:2], rows[:, :3], out=rows[:, :3])
        rows[:, :3] *= np.divide(view.f, z)[:, None]
        conic, log_opacity, cut = _conic(rows), body[9], body[10]
        if tables.antialiased:
            log_opacity, cut = _compensated(conic, log_opacity, cut)
        _write(splats, own, view.tile_rows, ProjectedSplats(centre, z, conic, log_opacity, cut))
    return index


def _cull(points: Float32Array, reach: Float32Array, view: ViewProjection) -> IndexArray:
    """Which Gaussians' bounding spheres may reach the image, never judged by the centre alone. points (3, m): camera space."""
    z = points[2]
    off = points[:2] * view.f
    off += view.off_middle * z
    np.abs(off, out=off)
    off -= view.border * z
    off -= view.gain * reach
    near = z > view.near
    near &= np.maximum(off[0], off[1]) <= 0
    return np.flatnonzero(near)


def _conic(rows: Float32Array) -> Conic:
    """The ellipses of n splats.

    rows (2, 5, n): the Jacobian times the Gaussian's axes, the last two of five are room; overwritten. 1 / l1^2 is the variance
    of x where y is known, the determinant divided by that of y. Cauchy-Binet keeps that of a needle, where a c - b^2 would
    cancel; dividing first keeps a Gaussian larger than the world within float32.
    """
    low = np.float32(c.LOWPASS_PX2)
    variance = np.einsum("ikn,ikn->in", rows[:, :3], rows[:, :3])
    covariance = np.einsum("kn,kn->n", rows[0, :3], rows[1, :3])
    free = low * variance[0]
    variance += low
    l3 = np.sqrt(variance[1])
    np.divide(np.float32(1), l3, out=l3)
    rows[1, :3] *= l3
    rows[:, 3:] = rows[:, :2]
    minors = rows[0, 1:4] * rows[1, 2:5]
    minors -= rows[0, 2:5] * rows[1, 1:4]
    free *= l3
    free *= l3
    free += low
    bare = np.einsum("kn,kn->n", minors, minors)
    free += bare
    bare /= free
    return Conic(variance, covariance, np.sqrt(free, out=free), l3, bare)


def _compensated(conic: Conic, log_opacity: Float32Array, cut: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Log opacity and cut of n splats whose opacity is multiplied by sqrt(det S / det(S + low-pass)), so that a splat smaller
    than a pixel gives no more light than it has (Yu et al., Mip-Splatting, 2024, equation 9 with the low-pass of 3DGS).
    """
    with np.errstate(divide="ignore"):
        log_share = np.log(conic.share)
    np.maximum(log_share, np.float32(2 * EMPTY_LOG_OPACITY), out=log_share)
    log_opacity = np.asarray(log_opacity + np.float32(0.5) * log_share, np.float32)
    return log_opacity, np.asarray(np.maximum(cut + log_share, np.float32(CUT_MARGIN)), np.float32)


def _write(splats: SplatBuffers, own: slice, tile_rows: int, projected: ProjectedSplats) -> None:
    """The rows of n splats into the slots `own`; the arrays of their ellipses are overwritten."""
    variance = projected.conic.variance
    variance *= projected.cut
    extent = np.sqrt(variance, out=variance)
    ellipse, skew = _ellipse_rows(projected, extent[0])
    cv2.transpose(_blend_rows(projected, skew), splats.table[own])
    cv2.transpose(ellipse, splats.ellipses[own])
    edges = ellipse[EllipseColumn.Y] + extent[1] * np.array([[-1], [1]], np.float32)
    edges *= np.float32(1 / TILE)
    np.floor(edges, out=edges)
    np.clip(edges, np.array([[0], [-1]], np.float32), np.array([[tile_rows], [tile_rows - 1]], np.float32), out=edges)
    splats.first[own], splats.last[own] = edges


def _ellipse_rows(projected: ProjectedSplats, extent_x: Float32Array) -> tuple[Float32Array, Float32Array]:
    """What the tile test reads of n splats, (ELLIPSE_COLUMNS, n), in tiles; and the ellipses' skew (n,) in pixels."""
    centre, conic, cut = projected.centre, projected.conic, projected.cut
    ellipse = np.empty((ELLIPSE_COLUMNS, len(projected.z)), np.float32)
    ellipse[EllipseColumn.Y], ellipse[EllipseColumn.L3], ellipse[EllipseColumn.CUT] = centre[1], conic.l3, cut
    ellipse[EllipseColumn.Y] -= np.float32(HALF_PIXEL)
    tilt = np.multiply(conic.covariance, cut, out=ellipse[EllipseColumn.TILT])
    tilt /= extent_x
    covariance = conic.covariance
    covariance *= conic.l3
    covariance *= conic.l3
    skew = np.negative(covariance, out=covariance)
    np.subtract(centre[0], np.float32(HALF_PIXEL), out=ellipse[EllipseColumn.X])
    ellipse[EllipseColumn.SKEW], ellipse[EllipseColumn.INVERSE_L1] = skew, conic.inverse_l1
    ellipse[EllipseColumn.X : EllipseColumn.INVERSE_L1 + 1] *= np.float32(1 / TILE)
    ellipse[-1] = 0
    return ellipse, skew


def _blend_rows(projected: ProjectedSplats, skew: Float32Array) -> Float32Array:
    """What blending reads of n splats, (BLEND_COLUMNS, n): place, depth, opacity, and the exponent's coefficients."""
    block = np.empty((BLEND_COLUMNS, len(projected.z)), np.float32)
    block[BlendColumn.X : BlendColumn.Y + 1] = projected.centre
    block[BlendColumn.Z], block[BlendColumn.LOG_OPACITY] = projected.z, projected.log_opacity
    half = np.float32(np.sqrt(0.5))
    np.divide(half, projected.conic.inverse_l1, out=block[BlendColumn.L1])
    np.multiply(skew, block[BlendColumn.L1], out=block[BlendColumn.L2])
    np.multiply(half, projected.conic.l3, out=block[BlendColumn.L3])
    np.multiply(block[BlendColumn.L1 : BlendColumn.L3], block[BlendColumn.L1], out=block[BlendColumn.XX : BlendColumn.XY + 1])
    block[BlendColumn.XY] += block[BlendColumn.XY]
    lower = block[BlendColumn.L2 : BlendColumn.L3 + 1]
    np.einsum("kn,kn->n", lower, lower, out=block[BlendColumn.YY])
    exponent = block[BlendColumn.XX : BlendColumn.YY + 1]
    np.negative(exponent, out=exponent)
    block[BlendColumn.FEATURES :] = 1
    return block


def depth_order(splats: SplatBuffers, count: int, rank: NDArray[np.int32]) -> IndexArray:
    """Of the first `count` slots those that hold a splat, front to back; splats of equal depth stand in the order of their
    `rank` (N,), a row of the tables.
    """
    filled = np.flatnonzero(splats.last[:count] >= splats.first[:count])
    z = splats.z.take(filled)
    order = ascending_order(z)
    z, order = z.take(order), filled.take(order)
    same = np.concatenate([[False], z[1:] == z[:-1], [False]])
    tied = np.flatnonzero(same[1:] | same[:-1])
    if len(tied):
        slots = order.take(tied)
        # One number for each: which group of equal depth it is of, and its rank.
        key = np.cumsum(~same.take(tied), dtype=np.int64) << 32
        key |= rank.take(splats.place.take(slots))
        order[tied] = slots.take(np.argsort(key, kind="stable"))
    return order


def ascending_order(z: Float32Array) -> IndexArray:
    """Stable ascending order of positive float32 (n,), by their bits."""
    return stable_order(z.view(np.uint32))
