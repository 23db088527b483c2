"""Points seen by a photo and by rendered views, with exact truth: the ground that the pose stages are tested on."""

import numpy as np

from core.geometry.camera import Intrinsics, Pose
from core.geometry.lie import so3_exp
from core.pose.shared.matches import ViewMatches

CAMERA = Intrinsics(640, 480, 520.0, 515.0, 322.0, 238.0)


def random_pose(rng, centre_scale=0.3, turn=0.1, offset=(0.0, 0.0, 0.0)):
    return Pose.from_centre(so3_exp(turn * rng.normal(size=3)), np.asarray(offset) + centre_scale * rng.normal(size=3))


def world(rng, n=300, offset=(0.0, 0.0, 0.0)):
    z = rng.uniform(2.0, 6.0, n)
    return np.asarray(offset) + np.column_stack([rng.uniform(-0.5, 0.5, n) * z, rng.uniform(-0.4, 0.4, n) * z, z])


def see(pose, points):
    p = pose.transform(points)
    return p[:, :2] / p[:, 2:], p[:, 2]


def make_matches(rng, truth, view, points, noise_px=0.0, outliers=0.0, reference=False):
    """Matches of `points` between the photo at `truth` and the view at `view`; `outliers` is the share put anywhere."""
    q, _ = see(truth, points)
    s, depth = see(view, points)
    noise = noise_px / CAMERA.focal
    q, s = q + noise * rng.normal(size=q.shape), s + noise * rng.normal(size=s.shape)
    bad = rng.random(len(points)) < outliers
    s[bad] = rng.uniform(-0.5, 0.5, (int(bad.sum()), 2))
    return ViewMatches(view, q, s, depth, 0.01 * depth, reference)


def fan(rng, truth, count=7, spread=0.3, turn=0.05):
    """Views around a start that is itself beside `truth`."""
    return [
        Pose.from_centre(so3_exp(turn * rng.normal(size=3)) @ truth.R, truth.centre + spread * rng.normal(size=3))
        for _ in range(count)
    ]
