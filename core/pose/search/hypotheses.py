"""The perturbed candidates around the current pose (paper: hypotheses)."""

from __future__ import annotations

import numpy as np

from ...geometry.camera import FloatArray, Pose
from ...geometry.lie import so3_exp

# Mean length of a 3D Gaussian vector of unit deviation: 2 sqrt(2 / pi).
GAUSSIAN_LENGTH = 1.5958


def candidate_poses(pose: Pose, count: int, sigma_t: float, sigma_r_deg: float, rng: np.random.Generator) -> list[Pose]:
    """`count` poses around `pose`: centres moved by the expected length of noise of deviation `sigma_t` (scene units),
    rotations by Gaussian noise of `sigma_r_deg`.

    The directions come in opposite pairs along randomly turned axes instead of being drawn one by one: six free draws now and
    then lie nearly in one plane, and then no ray fixes the centre across it.
    """
    directions: list[FloatArray] = []
    while len(directions) < count:
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
        directions += [*axes, *-axes]
    out = []
    for direction in directions[:count]:
        turn = so3_exp(np.radians(sigma_r_deg) * rng.normal(size=3))
        out.append(Pose.from_centre(turn @ pose.R, pose.centre + sigma_t * GAUSSIAN_LENGTH * direction))
    return out
