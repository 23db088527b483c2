"""The normal equations of a shot.

Each piece of evidence is a quadratic cost about the cameras that the tracking found, so that the problem is one sparse linear
system, whatever the number of matches was. Tied to the splat, frame t costs by (xi_t, l, r v_t): its pose, the lens, and the
rolling shutter with the read-out share r and the motion v_t from frame to frame. A link of the frames a and b costs by
xi_b - Ad xi_a and r (v_b - Ad v_a), where Ad is the adjoint of T_b T_a^-1, because both poses move under it.

Where the lens zooms, frame t has the focal length f exp(z(t)) of a spline z (`focal.py`), and its evidence was gathered at
f exp(g_t): it is told z(t) - g_t, a link z(b) - z(a) - (g_b - g_a).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray
from ..geometry.lie import adjoint, se3_log
from ..pose.shared.lens import lens_difference
from .evidence import LENS, ROWS, SIZE, XI, Evidence
from .focal import FocalCurve
from .problem import READOUT_STD, Link, ShotProblem

IndexArray = NDArray[np.signedinteger]
LENS_NUMBERS = 9


@dataclass(frozen=True, eq=False)
class Solved:
    """Steps of the poses (N, 6), of the lens (9,), the deviations (9,) of the lens, the read-out, and the curve of the focal
    length, None where it is one.
    """

    steps: FloatArray
    lens_step: FloatArray
    lens_std: FloatArray
    readout: float
    curve: FocalCurve | None


def lens_scale(grow: float) -> FloatArray:
    """What a step (9,) of the shot's lens is multiplied by at a focal length exp(grow) times its own: the principal point is
    the same in pixels, and told in focal lengths.
    """
    scale = np.ones(LENS_NUMBERS)
    scale[1:3] = np.exp(-grow)
    return scale


class System:
    """Six unknowns a frame, then the lens (9), the read-out (1), and the coefficients of the curve of the focal length."""

    def __init__(self, problem: ShotProblem, frames: Sequence[int]) -> None:
        self._problem, self._frames = problem, frames
        self._place = {frame: np.arange(6 * i, 6 * i + 6) for i, frame in enumerate(frames)}
        lens_at = 6 * len(frames)
        self._lens = np.arange(lens_at, lens_at + LENS_NUMBERS)
        self._readout = np.array([lens_at + LENS_NUMBERS])
        self._curve = None
        if problem.change is not None:
            self._curve = FocalCurve.flat(frames[0], frames[-1], problem.change)
        count = 0 if self._curve is None else len(self._curve.coefficients)
        self._coefficients = np.arange(lens_at + LENS_NUMBERS + 1, lens_at + LENS_NUMBERS + 1 + count)
        self._size = lens_at + LENS_NUMBERS + 1 + count
        self._rows: list[IndexArray] = []
        self._columns: list[IndexArray] = []
        self._values: list[FloatArray] = []
        self._gradient = np.zeros(self._size)
        # Unknowns that are held, each at its value.
        self._held: dict[int, float] = {}

    @classmethod
    def of(cls, problem: ShotProblem, frames: Sequence[int], motion: Mapping[int, FloatArray], readout: float = 0.0) -> System:
        """The equations about the problem's poses and lens, and the read-out `readout`."""
        system = cls(problem, frames)
        for frame, tie in problem.ties.items():
            system._tie(frame, tie, motion[frame], readout)
        for link in problem.links:
            system._link(link, motion, readout)
        system._priors()
        return system

    def _tie(self, frame: int, tie: Evidence, motion: FloatArray, readout: float) -> None:
        """(xi, l, r v) by the unknowns (xi, l, r) and the curve's coefficients."""
        grow, at = self._problem.grow_of(frame), [self._place[frame], self._lens, self._readout]
        B = np.zeros((SIZE, 16))
        B[XI, :6] = np.eye(6)
        B[LENS, 6:15] = np.diag(lens_scale(grow))
        B[ROWS, 15] = motion
        offset = readout * B[:, 15]
        if self._curve is not None:
            B = np.column_stack([B, _by_focal(self._curve.basis(frame))])
            at.append(self._coefficients)
            offset[LENS.start] -= grow
        self._add(tie, B, np.concatenate(at), offset)

    def _link(self, link: Link, motion: Mapping[int, FloatArray], readout: float) -> None:
        problem, a, b = self._problem, link.a, link.b
        at = [self._place[a], self._place[b], self._readout]
        turn = adjoint(problem.poses[b] @ problem.poses[a].inverse())
        B = np.zeros((SIZE, 13))
        B[XI, :6], B[XI, 6:12] = -turn, np.eye(6)
        B[ROWS, 12] = motion[b] - turn @ motion[a]
        offset = readout * B[:, 12]
        if self._curve is not None:
            # A corner's place in the world moves along with the focal length of the frame that it is carried over from.
            B = np.column_stack([B, _by_focal(self._curve.basis(b) - self._curve.basis(a))])
            at.append(self._coefficients)
            offset[LENS.start] -= problem.grow_of(b) - problem.grow_of(a)
        self._add(link.evidence, B, np.concatenate(at), offset)

    def _add(self, evidence: Evidence, B: FloatArray, unknowns: IndexArray, offset: FloatArray) -> None:
        """A piece of evidence, whose own unknowns (21,) are `offset` plus `B` (21, n) times the n `unknowns` of the system."""
        e = evidence.equations
        used = np.abs(B).any(axis=0)
        B, unknowns = B[:, used], unknowns[used]
        self._gradient[unknowns] += B.T @ (e.gradient + e.information @ offset)
        self._put(unknowns, B.T @ e.information @ B)

    def _put(self, at: IndexArray, block: FloatArray) -> None:
        rows, columns = np.meshgrid(at, at, indexing="ij")
        self._rows.append(rows.ravel())
        self._columns.append(columns.ravel())
        self._values.append(block.ravel())

    def _priors(self) -> None:
        problem, lens = self._problem, self._problem.prior.information
        self._gradient[self._lens] += lens * lens_difference(problem.lens, problem.prior.lens)
        self._put(np.concatenate([self._lens, self._readout]), np.diag([*lens, READOUT_STD**-2]))
        if not problem.solve_lens:
            self._held |= dict.fromkeys(self._lens.tolist(), 0.0)
        if not problem.solve_readout:
            self._held[int(self._readout[0])] = 0.0
        for frame, pose in problem.pinned.items():
            step = se3_log(pose @ problem.poses[frame].inverse())
            self._held |= dict(zip(self._place[frame].tolist(), step.tolist(), strict=True))
        if self._curve is not None and problem.change is not None:
            self._held[int(self._lens[0])] = 0.0
            bends = self._curve.bends()
            self._put(self._coefficients, bends.T @ bends / problem.change.bend_std**2)
            for frame, grow in problem.anchors.items():
                w = self._curve.basis(frame)
                self._put(self._coefficients, lens[0] * np.outer(w, w))
                self._gradient[self._coefficients] -= lens[0] * grow * w

    def solved(self) -> Solved:
        """Where the cost is least."""
        from scipy.sparse import coo_array
        from scipy.sparse.linalg import splu

        parts = (np.concatenate(part) for part in (self._values, self._rows, self._columns))
        values, rows, columns = parts
        matrix = coo_array((values, (rows, columns)), shape=(self._size, self._size)).tocsc()
        free = np.setdiff1d(np.arange(self._size), list(self._held))
        x = np.zeros(self._size)
        x[list(self._held)] = list(self._held.values())
        solve = splu(matrix[free][:, free].tocsc()).solve
        x[free] = -solve((self._gradient + matrix @ x)[free])

        def deviation(unknown: int) -> float:
            unit = self._unit(unknown)[free]
            return float(np.sqrt(max(unit @ solve(unit), 0.0)))

        std = np.array([0.0 if at in self._held else deviation(at) for at in self._lens.tolist()])
        curve = None
        if self._curve is not None:
            at = np.searchsorted(free, self._coefficients)
            covariance = np.stack([solve(self._unit(place)[free])[at] for place in self._coefficients.tolist()])
            curve = replace(self._curve, coefficients=x[self._coefficients], covariance=covariance)
            if self._problem.solve_lens:
                std[0] = curve.std(next(iter(self._problem.anchors), self._frames[0]))
        steps = x[: 6 * len(self._frames)].reshape(-1, 6)
        return Solved(steps, x[self._lens], std, float(x[self._readout[0]]), curve)

    def _unit(self, at: int) -> FloatArray:
        out = np.zeros(self._size)
        out[at] = 1.0
        return out


def _by_focal(basis: FloatArray) -> FloatArray:
    """The columns (21, J) of a piece of evidence by the coefficients of the curve."""
    out = np.zeros((SIZE, len(basis)))
    out[LENS.start] = basis
    return out
