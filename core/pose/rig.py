"""One pose out of several pictures that were taken from one point in known directions, each refined by itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.camera import FloatArray, Pose, rotation_angle_deg
from ..geometry.lie import so3_exp, so3_log
from .report import RefineReport, Verdict
from .verdict.sentences import per_cent

# Two faces agree within so many of their deviations together, and in any case within these, per cent of the depth and degrees.
DEVIATIONS, ALWAYS_PCT, ALWAYS_DEG = 3.0, 0.3, 0.2
ENOUGH = 3
ROTATION_STEPS = 10


@dataclass(frozen=True, eq=False)
class Face:
    """A refined picture: the pose that it gives the whole, None where it gives none, and its deviations (scene units, radians).

    `problem`: why it gives none, a whole sentence.
    """

    name: str
    verdict: Verdict
    pose: Pose | None
    place_std: float = math.inf
    turn_std: float = math.inf
    depth: float = math.nan
    problem: str = ""


@dataclass(frozen=True, eq=False)
class JoinedFaces:
    """`pose`: None where no face has one. `distance_pct`, `degrees`: how far the one farthest from it is among those used."""

    pose: Pose | None
    verdict: Verdict
    reasons: tuple[str, ...]
    distance_pct: float = math.nan
    degrees: float = math.nan


def face_of(name: str, report: RefineReport, pose: Pose) -> Face:
    """A face by its report; `pose` is what its camera means for the whole."""
    quality = report.quality
    if report.verdict == "failed" or quality is None or quality.of != "refined":
        return Face(name, "failed", None, problem=report.reasons[0] if report.reasons else "")
    place = quality.translation_std_pct / 100 * quality.median_depth
    turn = math.radians(quality.rotation_std_deg)
    if not (0 < place < math.inf and 0 < turn < math.inf):
        return Face(name, "failed", None, problem="What it tells of the pose has no bound.")
    return Face(name, report.verdict, pose, place, turn, quality.median_depth)


def join_faces(faces: Sequence[Face]) -> JoinedFaces:
    """The mean of the largest set of faces that agree with one of them, weighted by their information, and its verdict.

    It is trusted where at least two faces agree, more than disagree, one of which is trusted by itself; or where so many agree
    closely that chance is out of the question, for each sees another part of the scene.
    """
    placed = [face for face in faces if face.pose is not None]
    if not placed:
        return JoinedFaces(None, "failed", (_left_out(faces, "No part of the panorama could be placed"),))
    sets = [[other for other in placed if _agree(face, other)] for face in placed]
    used = max(sets, key=lambda some: (len(some), sum(face.place_std**-2 for face in some)))
    pose = _mean(used)
    apart = [_apart(face, pose) for face in used]
    pct, degrees = (max(values) for values in zip(*apart, strict=True))
    against = len(placed) - len(used)
    closely = len(used) >= ENOUGH and pct <= ALWAYS_PCT and degrees <= ALWAYS_DEG
    sure = len(used) > max(1, against) and (closely or any(face.verdict == "trusted" for face in used))
    names = " and ".join(", ".join(face.name for face in used).rsplit(", ", 1))
    if len(used) == 1:
        said = f"Only one of {len(faces)} parts of the panorama places the camera ({names}), so that none confirms it"
    else:
        said = (
            f"{len(used)} of {len(faces)} parts of the panorama ({names}) agree on the camera, "
            f"within {per_cent(pct)} of the depth and {degrees:.2g} degrees"
        )
    others = [face for face in faces if face not in used]
    return JoinedFaces(pose, "trusted" if sure else "check", (_left_out(others, said),), pct, degrees)


def _left_out(faces: Sequence[Face], said: str) -> str:
    """The sentence, with the faces that are left out, each with what is wrong with it."""
    words = [f"{face.name} ({(face.problem or 'It disagrees with the others.').rstrip('.')})" for face in faces]
    return f"{said}; left out: {', '.join(words)}." if words else f"{said}."


def _agree(one: Face, other: Face) -> bool:
    assert one.pose is not None and other.pose is not None
    place = max(DEVIATIONS * math.hypot(one.place_std, other.place_std), ALWAYS_PCT / 100 * one.depth)
    turn = max(DEVIATIONS * math.hypot(one.turn_std, other.turn_std), math.radians(ALWAYS_DEG))
    distance = float(np.linalg.norm(one.pose.centre - other.pose.centre))
    return distance <= place and math.radians(rotation_angle_deg(one.pose.R @ other.pose.R.T)) <= turn


def _apart(face: Face, pose: Pose) -> tuple[float, float]:
    """Per cent of the depth and degrees from a face's own pose to `pose`."""
    assert face.pose is not None
    distance = float(np.linalg.norm(face.pose.centre - pose.centre))
    return 100 * distance / face.depth, rotation_angle_deg(face.pose.R @ pose.R.T)


def _mean(faces: Sequence[Face]) -> Pose:
    """The mean pose, each face's centre and rotation weighted by the inverse of its variance."""
    poses = [face.pose for face in faces if face.pose is not None]
    by_place, by_turn = (_shares([getattr(face, name) for face in faces]) for name in ("place_std", "turn_std"))
    centre = by_place @ np.array([pose.centre for pose in poses])
    R = poses[int(np.argmax(by_turn))].R
    for _ in range(ROTATION_STEPS):
        R = so3_exp(by_turn @ np.array([so3_log(pose.R @ R.T) for pose in poses])) @ R
    return Pose.from_centre(R, centre)


def _shares(deviations: Sequence[float]) -> FloatArray:
    weights = np.array(deviations) ** -2.0
    return np.asarray(weights / weights.sum())
