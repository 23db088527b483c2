"""Poses from three pins each, by the solver of Ding, Yang, Larsson, Olsson and Astrom (Revisiting the P3P Problem, 2023)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np

from ...geometry.camera import FloatArray, Intrinsics, Pose
from ..shared.lens import CameraUnknowns
from .pin import Pin, photos, worlds

# Most triples of pins that are tried; of more than these, those that span the largest triangles in the photo.
MAX_TRIPLES = 8
# Factors on a focal length that is a guess; neighbouring ones differ by a sixth, and the fit bridges half of that.
FOCAL_SCALES: tuple[float, ...] = tuple(np.geomspace(0.6, 1.7, 8))
# A solution whose points lie farther from the rays than this (image plane, x/z) is numerical dirt.
EXACT = 1e-3


@dataclass(frozen=True, eq=False)
class RoughCameras:
    """C cameras that show three of N pins exactly: rotations (C, 3, 3), shifts (C, 3), scales (C,) of the focal length, and how
    far each pin lies off, errors_px (C, N), infinite behind the camera.
    """

    lens: Intrinsics
    rotations: FloatArray
    shifts: FloatArray
    scales: FloatArray
    errors_px: FloatArray

    def __len__(self) -> int:
        return len(self.scales)

    @property
    def centres(self) -> FloatArray:
        """The cameras' centres (C, 3)."""
        return np.asarray(-np.einsum("cij,ci->cj", self.rotations, self.shifts))

    def turned_deg(self, pose: Pose) -> FloatArray:
        """The angles (C,) between the cameras and `pose`, degrees."""
        cosine = (np.einsum("cij,ij->c", self.rotations, pose.R) - 1) / 2
        return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))))

    def camera(self, index: int) -> CameraUnknowns:
        """One of them."""
        return CameraUnknowns(Pose(self.rotations[index], self.shifts[index]), scaled(self.lens, float(self.scales[index])))


def rough_cameras(lens: Intrinsics, pins: Sequence[Pin], scales: Sequence[float]) -> RoughCameras:
    """The cameras under which three of the pins lie exactly on their pixels, before the camera, for `lens` with its focal
    length times each of `scales`.
    """
    points, found = worlds(pins), []
    for scale in scales:
        k = scaled(lens, scale)
        rays = k.normalise(photos(pins))
        for triple in _triples(rays):
            for R, t in three_point_poses(points[triple], rays[triple]):
                found.append((R, t, scale, _errors(points, rays, R, t) * k.focal))
    if not found:
        return RoughCameras(lens, np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, len(points))))
    return RoughCameras(lens, *(np.array(column) for column in zip(*found, strict=True)))


def scaled(lens: Intrinsics, factor: float) -> Intrinsics:
    """The lens with its focal length times `factor`."""
    return lens if factor == 1 else replace(lens, fx=lens.fx * factor, fy=lens.fy * factor)


def _errors(points: FloatArray, rays: FloatArray, R: FloatArray, t: FloatArray) -> FloatArray:
    """Distances (N,) in the image plane; infinite behind the camera."""
    seen = points @ R.T + t
    with np.errstate(divide="ignore", invalid="ignore"):
        off = seen[:, :2] / seen[:, 2:] - rays
    return np.asarray(np.where(seen[:, 2] > 0, np.hypot(off[:, 0], off[:, 1]), np.inf))


def _triples(rays: FloatArray) -> list[list[int]]:
    every = [list(triple) for triple in combinations(range(len(rays)), 3)]
    if len(every) <= MAX_TRIPLES:
        return every
    corners = rays[np.array(every)]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return [every[i] for i in np.argsort(-area, kind="stable")[:MAX_TRIPLES]]


def three_point_poses(points: FloatArray, rays: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """R (3, 3) and t (3,) of up to four poses, world-to-camera, that show `points` (3, 3) at `rays` (3, 2), x/z and y/z of an
    ideal image plane.
    """
    try:
        _, rotations, shifts = cv2.solveP3P(
            np.ascontiguousarray(points), np.ascontiguousarray(rays), np.eye(3), None, flags=cv2.SOLVEPNP_P3P
        )
    except cv2.error:  # OpenCV raises it on points that hold no pose: on one line, or twice the same.
        return
    for rotation, shift in zip(rotations, shifts, strict=True):
        R, t = np.asarray(cv2.Rodrigues(rotation)[0], np.float64), np.asarray(shift, np.float64).ravel()
        if np.isfinite(R).all() and np.isfinite(t).all() and _errors(points, rays, R, t).max() < EXACT:
            yield R, t
