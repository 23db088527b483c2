"""The whole shot solved: every frame's camera tied to the splat, neighbours to each other, one lens, one read-out time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.camera import FloatArray, Pose
from ..geometry.lie import se3_exp, se3_log
from .focal import FocalCurve
from .problem import READOUT_STD, ShotProblem
from .system import System, lens_scale

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
class ShotSolution:
    """poses by frame; `lens_step` (9,) of `lens.NAMES` and its deviations, that of the focal length, where it changes, at the
    first anchor; `curve`: how it changes; `readout` as a share of the time from frame to frame; `rms_px` of each frame at its
    solution, pixels of the matched pictures.
    """

    poses: dict[int, Pose]
    lens_step: FloatArray
    lens_std: FloatArray
    readout: float
    rms_px: dict[int, float]
    curve: FocalCurve | None = None

    def grow(self, frame: int) -> float:
        """The logarithm of the frame's focal length over that of the shot's lens."""
        return 0.0 if self.curve is None else self.curve.at(frame)


def solve_shot(problem: ShotProblem) -> ShotSolution:
    """The cameras, the lens and the read-out time that cost least.

    The read-out is found by the frames well inside of the shot, for the motion at its ends is extrapolated; then all frames are
    solved with it.
    """
    frames, readout = sorted(problem.poses), problem.readout
    motion = motions(problem.poses, readout or READOUT_STD)
    if problem.solve_readout:
        inner = {f: v if AT_ENDS <= i < len(frames) - AT_ENDS else np.zeros(6) for i, (f, v) in enumerate(motion.items())}
        for _ in range(ROUNDS):
            found = System.of(problem, frames, inner).solved()
            readout = min(max(found.readout, 0.0), 1.0)
            motion = motions(_moved(problem, frames, found.steps), readout)
            inner = {f: v if inner[f].any() else v * 0 for f, v in motion.items()}
    found = System.of(replace(problem, solve_readout=False), frames, motion, readout).solved()
    solution = ShotSolution(_moved(problem, frames, found.steps), found.lens_step, found.lens_std, readout, {}, found.curve)
    for frame, step in zip(frames, found.steps, strict=True):
        if frame in problem.ties:
            lens = found.lens_step @ np.diag(lens_scale(problem.grow_of(frame)))
            lens[0] += solution.grow(frame) - problem.grow_of(frame)
            solution.rms_px[frame] = problem.ties[frame].rms_px(np.concatenate([step, lens, readout * motion[frame]]))
    return solution


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
