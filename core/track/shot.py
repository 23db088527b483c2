"""The whole shot as one problem: every frame's camera tied to the splat, neighbours to each other, one lens, one read-out time.

Each piece of evidence is a quadratic cost about the cameras that the tracking found, so that the problem is one sparse linear
system, whatever the number of matches was. Tied to the splat, frame t costs by (xi_t, l, r v_t): its pose, the lens, and the
rolling shutter with the read-out share r and the motion v_t from frame to frame. A link of the frames a and b costs by
xi_b - Ad xi_a and r (v_b - Ad v_a), where Ad is the adjoint of T_b T_a^-1, because both poses move under it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray, Intrinsics, Pose
from ..geometry.lie import adjoint, se3_exp, se3_log
from ..pose.shared.lens import LensPrior, lens_difference
from .evidence import LENS, ROWS, SIZE, XI, Evidence

IndexArray = NDArray[np.signedinteger]
# The read-out takes this share of the time from frame to frame, give or take, before anything is matched.
READOUT_STD = 0.5
# The motion at a frame is that of a spline through so many frames on either side; its degree by how many there are in all.
AROUND = 5
DEGREES = (0, 1, 1, 3, 3, 5)
# The first and last frames of a shot, at which the spline is extrapolated, say nothing of the read-out.
AT_ENDS = 4
# Where in the read-out the path is looked at, and the shortest one for which that can be told from a point.
NODES = np.linspace(-0.5, 0.5, 5)
LEAST_READOUT = 0.05
# The motion in a rolling shutter is that of the poses which the last round found.
ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Link:
    """What the corners followed from frame `a` to frame `b` know of the two cameras."""

    a: int
    b: int
    evidence: Evidence


@dataclass(frozen=True, eq=False)
class ShotProblem:
    """Poses found, evidence of each frame, and links, all with the lens `lens` of the matched pictures. `prior`: what is known
    of it; solve_lens, solve_readout: whether these are unknowns.
    """

    poses: Mapping[int, Pose]
    ties: Mapping[int, Evidence]
    links: Sequence[Link]
    lens: Intrinsics
    prior: LensPrior
    solve_lens: bool
    solve_readout: bool


@dataclass(frozen=True, eq=False)
class ShotSolution:
    """poses by frame; `lens_step` (9,) of `lens.NAMES` and its deviations; `readout` as a share of the time from frame to
    frame; `rms_px` of each frame at its solution, pixels of the matched pictures.
    """

    poses: dict[int, Pose]
    lens_step: FloatArray
    lens_std: FloatArray
    readout: float
    rms_px: dict[int, float]


def solve_shot(problem: ShotProblem) -> ShotSolution:
    """The cameras, the lens and the read-out time that cost least.

    The read-out is found by the frames well inside of the shot, for the motion at its ends is extrapolated; then all frames are
    solved with it.
    """
    frames, readout = sorted(problem.poses), 0.0
    motion = motions(problem.poses, READOUT_STD)
    if problem.solve_readout:
        inner = {f: v if AT_ENDS <= i < len(frames) - AT_ENDS else np.zeros(6) for i, (f, v) in enumerate(motion.items())}
        for _ in range(ROUNDS):
            steps, _, readout, _ = _System.of(problem, frames, inner).solved()
            readout = min(max(readout, 0.0), 1.0)
            motion = motions(_moved(problem, frames, steps), readout)
            inner = {f: v if inner[f].any() else v * 0 for f, v in motion.items()}
    found = replace(problem, solve_readout=False)
    steps, lens_step, _, lens_std = _System.of(found, frames, motion, readout).solved()
    rms = {}
    for frame, step in zip(frames, steps, strict=True):
        if frame in problem.ties:
            rms[frame] = problem.ties[frame].rms_px(np.concatenate([step, lens_step, readout * motion[frame]]))
    return ShotSolution(_moved(problem, frames, steps), lens_step, lens_std, readout, rms)


def _moved(problem: ShotProblem, frames: Sequence[int], steps: FloatArray) -> dict[int, Pose]:
    return {f: se3_exp(step) @ problem.poses[f] for f, step in zip(frames, steps, strict=True)}


def motions(poses: Mapping[int, Pose], readout: float) -> dict[int, FloatArray]:
    """The motion (6,) per frame during each frame's read-out, T <- exp(motion) T, of a smooth path through the poses: a spline
    of the fifth degree over the frames around. The difference of the neighbours would be half of a shake's quick part.
    """
    from scipy.interpolate import make_interp_spline

    frames = np.array(sorted(poses))
    times = NODES * max(readout, LEAST_READOUT)
    out = {}
    for i, frame in enumerate(frames.tolist()):
        low = max(0, min(i - AROUND, len(frames) - 2 * AROUND - 1))
        near = frames[low : low + 2 * AROUND + 1]
        if len(near) < 2:
            out[frame] = np.zeros(6)
            continue
        inverse = poses[frame].inverse()
        steps = np.stack([se3_log(poses[f] @ inverse) for f in near.tolist()])
        degree = DEGREES[min(len(near), len(DEGREES)) - 1]
        # The straight line through the path, as the rows see it between the first one and the last.
        out[frame] = times @ make_interp_spline(near - frame, steps, k=degree)(times) / (times @ times)
    return out


class _System:
    """The normal equations of a shot: six unknowns a frame, then the lens (9) and the read-out (1)."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._size = 6 * count + 10
        self._rows: list[IndexArray] = []
        self._columns: list[IndexArray] = []
        self._values: list[FloatArray] = []
        self._gradient = np.zeros(self._size)
        self._held: list[int] = []

    @classmethod
    def of(cls, problem: ShotProblem, frames: Sequence[int], motion: Mapping[int, FloatArray], readout: float = 0.0) -> _System:
        """The equations about the problem's poses and lens, and the read-out `readout`."""
        system, place = cls(len(frames)), {frame: i for i, frame in enumerate(frames)}
        globals_at = 6 * len(frames)
        tail = np.arange(globals_at, globals_at + 10)
        for frame, tie in problem.ties.items():
            # (xi, l, r v) by the unknowns (xi, l, r)
            B = np.zeros((SIZE, 16))
            B[XI, :6] = np.eye(6)
            B[LENS, 6:15] = np.eye(9)
            B[ROWS, 15] = motion[frame]
            system._add(tie, B, np.concatenate([_of(place[frame]), tail]), readout)
        for link in problem.links:
            turn = adjoint(problem.poses[link.b] @ problem.poses[link.a].inverse())
            B = np.zeros((SIZE, 13))
            B[XI, :6], B[XI, 6:12] = -turn, np.eye(6)
            B[ROWS, 12] = motion[link.b] - turn @ motion[link.a]
            system._add(link.evidence, B, np.concatenate([_of(place[link.a]), _of(place[link.b]), tail[9:]]), readout)
        system._priors(problem, tail)
        return system

    def _add(self, evidence: Evidence, B: FloatArray, unknowns: IndexArray, readout: float) -> None:
        """A piece of evidence, whose own unknowns are `B` (21, n) times the n `unknowns` of the system, the last of which is
        the read-out.
        """
        e, at = evidence.equations, unknowns
        self._gradient[at] += B.T @ (e.gradient + readout * e.information @ B[:, -1])
        self._put(at, B.T @ e.information @ B)

    def _put(self, at: IndexArray, block: FloatArray) -> None:
        rows, columns = np.meshgrid(at, at, indexing="ij")
        self._rows.append(rows.ravel())
        self._columns.append(columns.ravel())
        self._values.append(block.ravel())

    def _priors(self, problem: ShotProblem, tail: IndexArray) -> None:
        lens = problem.prior.information
        self._gradient[tail[:9]] += lens * lens_difference(problem.lens, problem.prior.lens)
        self._put(tail, np.diag([*lens, READOUT_STD**-2]))
        if not problem.solve_lens:
            self._held += tail[:9].tolist()
        if not problem.solve_readout:
            self._held.append(int(tail[9]))

    def solved(self) -> tuple[FloatArray, FloatArray, float, FloatArray]:
        """Steps of the poses (N, 6), of the lens (9,), the read-out, and the deviations (9,) of the lens."""
        from scipy.sparse import coo_array
        from scipy.sparse.linalg import splu

        parts = (np.concatenate(part) for part in (self._values, self._rows, self._columns))
        values, rows, columns = parts
        matrix = coo_array((values, (rows, columns)), shape=(self._size, self._size)).tocsc()
        free = np.setdiff1d(np.arange(self._size), self._held)
        solve = splu(matrix[free][:, free].tocsc()).solve
        x = np.zeros(self._size)
        x[free] = -solve(self._gradient[free])
        at = 6 * self._count
        std = np.zeros(9)
        for i, number in enumerate(range(at, at + 9)):
            if number in free:
                unit = np.zeros(len(free))
                unit[np.searchsorted(free, number)] = 1.0
                std[i] = np.sqrt(max(solve(unit)[np.searchsorted(free, number)], 0.0))
        return x[:at].reshape(-1, 6), x[at : at + 9], float(x[at + 9]), std


def _of(place: int) -> IndexArray:
    return np.arange(6 * place, 6 * place + 6)
