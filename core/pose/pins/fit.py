"""The camera of least cost near another one: by pins, by what is known of the lens, and where wanted by nearness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...geometry.camera import FloatArray, Pose, pose_error
from ...geometry.lie import left_jacobian_inverse, so3_log
from ..final.pinned import PinnedPoints
from ..shared.least_squares import MAX_STEPS, NormalEquations, levenberg_marquardt
from ..shared.lens import CameraUnknowns, Free, LensPrior

# Whoever drags a pin has the camera about right: it stands within this of its distance to the pins, and is turned by no more.
# It decides between cameras that the pins cannot tell apart.
CHOICE_RATIO, CHOICE_DEG = 1.0, 60.0
# In directions that the pins do not hold, a camera moves no farther than it must, and rather turns. Three pins clicked to three
# pixels came out half as far off in their worst tenth as without it (benchmarks/pins.py).
HELD_RATIO, HELD_DEG = 0.12, 15.0
REFITS = 2
# A fit ends where the cost falls by less than this share of it: far below what a click tells.
MIN_GAIN = 1e-5


@dataclass(frozen=True, eq=False)
class Near:
    """The wish to stay near `pose`; `depth`: the distance of what it looks at, scene units; `strength`: 1, or less of it."""

    pose: Pose
    depth: float
    strength: float = 1.0

    def choice(self, distance: FloatArray, degrees: FloatArray) -> FloatArray:
        """Minus the logarithm of how likely cameras (C,) are at such distances and angles from `pose`, which is about right."""
        return np.asarray(0.5 * self.strength * ((distance / (CHOICE_RATIO * self.depth)) ** 2 + (degrees / CHOICE_DEG) ** 2))

    def is_left(self, pose: Pose) -> bool:
        """Whether `pose` is so far away that nearness was no good guess."""
        distance, degrees = pose_error(pose, self.pose)
        return distance > HELD_RATIO * self.depth or degrees > HELD_DEG

    def equations(self, pose: Pose) -> NormalEquations:
        """The normal equations (6, 6) of the wish by xi, T <- exp(xi) T; for small steps."""
        turn = pose.R @ self.pose.R.T
        angles = so3_log(turn)
        off = np.concatenate([left_jacobian_inverse(angles) @ (pose.t - turn @ self.pose.t), angles])
        information = self.strength * np.array([*[(HELD_RATIO * self.depth) ** -2] * 3, *[np.radians(HELD_DEG) ** -2] * 3])
        return NormalEquations(0.5 * float(information @ off**2), information * off, np.diag(information))


@dataclass(frozen=True, eq=False)
class PinProblem:
    """What is given, and which lens numbers are solved for, under `prior`."""

    points: PinnedPoints
    prior: LensPrior
    free: Free

    def lens_cost(self, camera: CameraUnknowns) -> float:
        """What the lens of `camera` costs by what was known of it."""
        off = self.prior.off(camera.intrinsics)[list(self.free)]
        return 0.5 * float(self.prior.information[list(self.free)] @ off**2)

    def equations(self, camera: CameraUnknowns, near: Near) -> NormalEquations:
        """The normal equations of pins, lens and nearness by xi and the free lens numbers."""
        e, wish, free = self.points.equations(camera, self.free), near.equations(camera.pose), list(self.free)
        known, off = self.prior.information[free], self.prior.off(camera.intrinsics)[free]
        gradient, information = e.gradient.copy(), e.information.copy()
        gradient[:6] += wish.gradient
        information[:6, :6] += wish.information
        gradient[6:] += known * off
        information[6:, 6:] += np.diag(known)
        return NormalEquations(e.cost + self.lens_cost(camera) + wish.cost, gradient, information)


def fit_pins(start: CameraUnknowns, problem: PinProblem, near: Near, max_steps: int = MAX_STEPS) -> CameraUnknowns:
    """The camera of least cost near `start`, as far as `max_steps` lead."""

    def move(camera: CameraUnknowns, step: FloatArray) -> CameraUnknowns:
        return camera.moved(step, problem.free)

    return levenberg_marquardt(start, partial(problem.equations, near=near), move, MIN_GAIN, max_steps)


def settled(camera: CameraUnknowns, problem: PinProblem, near: Near) -> CameraUnknowns:
    """The camera that was fitted with nearness to where it started. Where it had to go far from there, it is fitted again with
    nearness to the answer, for then the pins know better.
    """
    for _ in range(REFITS):
        if not near.is_left(camera.pose):
            break
        near = replace(near, pose=camera.pose)
        camera = fit_pins(camera, problem, near)
    return camera
