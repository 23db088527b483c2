"""A moving camera refined at some frames: their order, which of them are wrong, a smooth path through the rest.

Paths live on R^3 x SO(3), the camera's centre and its rotation in the world, not on se(3): a camera that turns about itself
while its centre goes straight should not be bent into a screw by what lies between.

SciPy is imported in the functions that need it: Blender loads this module at its start, where that import would be felt.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import RefineError
from ..geometry.camera import FloatArray, Pose, rotation_angle_deg
from ..geometry.lie import left_jacobian_inverse, so3_exp, so3_log

# A frame that is off the line between its neighbours by less than this share of the median depth is no fault.
STRAY_RATIO = 0.02
STRAY_DEG = 1.0
# A stray frame deviates by more than this multiple of the usual deviation, which is due to the camera's own acceleration.
STRAY_FACTOR = 6.0
ROTATION_STEPS = 20
ROTATION_DONE = 1e-12  # radians


@dataclass(frozen=True)
class FramePose:
    """The pose found for a frame; `weight` (> 0) is how much it counts against the other frames."""

    frame: int
    pose: Pose
    weight: float = 1.0


def keyframes(start: int, end: int, step: int) -> list[int]:
    """Every `step`-th frame from `start`, and `end` itself. Raises RefineError when that makes no range."""
    if step < 1:
        raise RefineError(f"The step is {step} frames; give at least 1.")
    if end < start:
        raise RefineError(f"The range ends at frame {end}, before its start {start}; exchange them.")
    frames = list(range(start, end + 1, step))
    return frames if frames[-1] == end else [*frames, end]


def outward(frames: Sequence[int], seed: int) -> list[int]:
    """The frames by their distance from `seed`, where the camera was placed by hand: each has a done neighbour then."""
    return sorted(frames, key=lambda frame: (abs(frame - seed), frame))


def nearest(frame: int, known: Iterable[int]) -> int | None:
    """The known frame closest to `frame`."""
    return min(known, key=lambda other: (abs(other - frame), other), default=None)


def stray_frames(track: Sequence[FramePose], median_depth: float) -> list[int]:
    """The frames whose pose lies off the path of the others. `track` is in order; `median_depth` in scene units.

    While the worst deviation from the line between neighbours is out of the ordinary, the frame goes whose removal leaves the
    smoothest path: a wrong pose spoils its neighbours' deviations too, at the ends more than its own.
    """
    left, strays = list(track), []
    if len(left) < 4:
        return []  # two lines must cross somewhere before one of them can be called wrong
    usual = float(np.median(_deviations(left, median_depth)))
    while len(left) > 3:
        off = _deviations(left, median_depth)
        worst = int(np.argmax(off))
        if off[worst] <= max(1.0, STRAY_FACTOR * usual):
            break
        options = range(worst, worst + 3)
        rest = [float(_deviations([*left[:i], *left[i + 1 :]], median_depth).sum()) for i in options]
        strays.append(left.pop(options[int(np.argmin(rest))]).frame)
    return sorted(strays)


def _deviations(track: Sequence[FramePose], median_depth: float) -> FloatArray:
    """How far every frame between two others lies off the line between them, 1 = as much as is surely no fault.

    Wide gaps count less, for a steady acceleration makes deviations that grow with the square of the gap.
    """
    spacing = float(np.median(np.diff([p.frame for p in track]))) or 1.0
    out = []
    for a, b, c in zip(track, track[1:], track[2:], strict=False):
        before, after = b.frame - a.frame, c.frame - b.frame
        share = before / (before + after)
        centre = (1 - share) * a.pose.centre + share * c.pose.centre
        rotation = so3_exp(share * so3_log(c.pose.R.T @ a.pose.R)) @ a.pose.R.T
        distance = float(np.linalg.norm(b.pose.centre - centre)) / (STRAY_RATIO * median_depth)
        angle = rotation_angle_deg(rotation @ b.pose.R) / STRAY_DEG
        out.append(float(np.hypot(distance, angle)) / max(1.0, before * after / spacing**2))
    return np.array(out)


def smooth(track: Sequence[FramePose], over_frames: float) -> list[Pose]:
    """The track's poses with wiggles shorter than `over_frames` taken out; 0 leaves them as they are.

    Minimises sum w |x - measured|^2 + (over_frames / 2 pi)^4 integral |x''|^2, which halves a wave of that many frames and
    leaves any steady motion alone; on the rotations by Gauss-Newton.
    """
    if over_frames <= 0 or len(track) < 3:
        return [p.pose for p in track]
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    frames = np.array([p.frame for p in track], np.float64)
    bend = _second_difference(frames) * (over_frames / (2 * np.pi)) ** 2
    weight = np.array([p.weight for p in track]) * np.gradient(frames)
    solve = splu((diags_array(weight) + bend.T @ bend).tocsc()).solve
    centres = solve(weight[:, None] * np.stack([p.pose.centre for p in track]))
    rotations = [p.pose.R.T for p in track]  # camera to world
    measured = list(rotations)
    # The last entry of a row of `bend` multiplies the difference x_{j+1} - x_j, and minus the first one that of x_j - x_{j-1};
    # of rotations, these differences are angular velocities times the time between the frames.
    outer = bend.diagonal(2) * np.diff(frames)[1:]
    for _ in range(ROTATION_STEPS):
        pull = np.stack([so3_log(z @ r.T) for z, r in zip(measured, rotations, strict=True)])
        bending = outer[:, None] * np.diff(_velocities(rotations, frames), axis=0)
        step = solve(weight[:, None] * pull - bend.T @ bending)
        rotations = [so3_exp(d) @ r for d, r in zip(step, rotations, strict=True)]
        if np.abs(step).max() < ROTATION_DONE:
            break
    return [Pose.from_centre(r.T, c) for r, c in zip(rotations, centres, strict=True)]


def _second_difference(frames: FloatArray) -> Any:
    """Second derivative at the inner frames, times the root of the time each stands for: a sparse array (N - 2, N)."""
    from scipy.sparse import diags_array

    before, after = np.diff(frames)[:-1], np.diff(frames)[1:]
    root = np.sqrt((before + after) / 2)
    entries = [1 / (before * root), -(1 / before + 1 / after) / root, 1 / (after * root)]
    return diags_array(entries, offsets=(0, 1, 2), shape=(len(frames) - 2, len(frames)))


def _velocities(rotations: Sequence[FloatArray], frames: FloatArray) -> FloatArray:
    """Angular velocity in the world between one frame and the next (N - 1, 3), radians per frame."""
    steps = np.stack([so3_log(b @ a.T) for a, b in itertools.pairwise(rotations)])
    return np.asarray(steps / np.diff(frames)[:, None])


def interpolate(track: Sequence[FramePose], frames: Sequence[int]) -> list[Pose]:
    """Poses at `frames`, which lie inside the track, on a path through its poses whose velocity has no jumps.

    Raises RefineError when a frame lies outside.
    """
    times = np.array([p.frame for p in track], np.float64)
    if not track or (len(frames) and not (times[0] <= min(frames) and max(frames) <= times[-1])):
        raise RefineError("Only frames between the first and the last refined frame can be filled in.")
    if len(track) == 1:
        return [track[0].pose for _ in frames]
    from scipy.interpolate import CubicHermiteSpline

    centres, rotations = np.stack([p.pose.centre for p in track]), [p.pose.R.T for p in track]
    speed = _at_knots(np.diff(centres, axis=0) / np.diff(times)[:, None], times)
    spin = _at_knots(_velocities(rotations, times), times)
    # Between two frames the rotation is a cubic in the tangent space of the first frame's rotation.
    vectors = [so3_log(b @ a.T) for a, b in itertools.pairwise(rotations)]
    turning = [
        CubicHermiteSpline(times[i : i + 2], [np.zeros(3), phi], [spin[i], left_jacobian_inverse(phi) @ spin[i + 1]])
        for i, phi in enumerate(vectors)
    ]
    out = []
    segments = np.clip(np.searchsorted(times, frames, side="right") - 1, 0, len(times) - 2).tolist()
    for frame, i, centre in zip(frames, segments, CubicHermiteSpline(times, centres, speed)(frames), strict=True):
        out.append(Pose.from_centre((so3_exp(turning[i](frame)) @ rotations[i]).T, centre))
    return out


def _at_knots(between: FloatArray, times: FloatArray) -> FloatArray:
    """Velocities at the knots (N, 3) from those between them (N - 1, 3): of the parabola through each three neighbours."""
    if len(between) == 1:
        return np.concatenate([between, between])
    gaps = np.diff(times)[:, None]
    inner = (gaps[1:] * between[:-1] + gaps[:-1] * between[1:]) / (gaps[1:] + gaps[:-1])
    first, last = 2 * between[0] - inner[0], 2 * between[-1] - inner[-1]
    return np.concatenate([first[None], inner, last[None]])
