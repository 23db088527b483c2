"""The error of every frame of a tracked plate: a curve of the camera's data for the Graph Editor, and a picture of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import bpy
import cv2
import numpy as np

from ....core.track import TrackedFrame
from ....core.track.track import GOOD_RMS_PX
from ...camera import channels as camera_channels

PATH = "gssmc.frame_error_px"
SIZE = 256, 176  # of the picture, pixels
BACK, LINE, LIMIT, BAD = (30, 30, 30), (120, 200, 120), (110, 110, 110), (230, 90, 60)
TOP_PX = 1.5 * GOOD_RMS_PX  # the least that the picture shows


def write(data: bpy.types.Camera, frames: Sequence[TrackedFrame]) -> None:
    """Keys the errors of the frames that are tied to the splat; the earlier ones between the first and the last frame go."""
    first, last = frames[0].frame, frames[-1].frame
    for curve in (c for c in camera_channels.curves(data) if c.data_path == PATH):
        for point in reversed([p for p in curve.keyframe_points if first <= p.co.x <= last]):
            curve.keyframe_points.remove(point, fast=True)
        curve.update()
    for frame in frames:
        if math.isfinite(frame.rms_px):
            data.gssmc.frame_error_px = frame.rms_px
            data.keyframe_insert(PATH, frame=frame.frame)


def read(data: bpy.types.Camera) -> dict[int, float]:
    """The errors in pixels of the plate, by frame; empty where none was tracked."""
    curve = next((c for c in camera_channels.curves(data) if c.data_path == PATH), None)
    return {} if curve is None else {round(point.co.x): point.co.y for point in curve.keyframe_points}


def drawn(errors: Mapping[int, float]) -> np.ndarray:
    """The picture (height, width, 3) uint8, RGB, top row first: error over frames, red where it is not good, gaps where none is
    known, the line at which a frame is no longer good.
    """
    width, height = SIZE
    picture = np.full((height, width, 3), BACK, np.uint8)
    first, last = min(errors), max(errors)
    top = max(TOP_PX, *errors.values())

    def place(frame: float, error: float) -> tuple[int, int]:
        x = (frame - first) / max(1, last - first)
        return round(2 + x * (width - 5)), round((height - 3) * (1 - error / top) + 1)

    cv2.line(picture, place(first, GOOD_RMS_PX), place(last, GOOD_RMS_PX), LIMIT)
    above = place(first, GOOD_RMS_PX)[1] - 4
    cv2.putText(picture, f"{GOOD_RMS_PX:g} px", (4, above), cv2.FONT_HERSHEY_SIMPLEX, 0.4, LIMIT, 1, cv2.LINE_AA)
    before: int | None = None
    for frame in sorted(errors):
        colour = LINE if errors[frame] <= GOOD_RMS_PX else BAD
        start = before if before == frame - 1 else frame
        cv2.line(picture, place(start, errors[start]), place(frame, errors[frame]), colour, 2)
        before = frame
    return picture
