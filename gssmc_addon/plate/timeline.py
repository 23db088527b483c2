"""The scene's frames made those of a plate."""

from __future__ import annotations

import bpy

from ...core.photos.frame_rate import movie_frame_rate
from ...core.photos.plate import Plate
from ..support.texts import rpt_

OWN_NUMBER = -1  # A plate's first frame is shown at its own number.


def fit(scene: bpy.types.Scene, plate: Plate, start: int, end: int) -> list[str]:
    """Makes `start` to `end` the scene's frames, and a movie's frame rate the scene's, and shows the first. Sentences on what
    was changed.
    """
    notes = []
    if (scene.frame_start, scene.frame_end) != (start, end):
        values = {"old_start": scene.frame_start, "old_end": scene.frame_end}
        notes.append(rpt_("The scene went from frame {old_start} to {old_end} and now goes with the plate.", **values))
        scene.frame_start, scene.frame_end = min(start, scene.frame_end), end  # Blender moves the end behind the start.
        scene.frame_start = start
    rate = movie_frame_rate(plate.path) if plate.is_movie else None
    if rate is not None:
        whole = -(-rate.numerator // rate.denominator)  # The next whole number: 24 for 23.976.
        base = whole / float(rate)
        before = scene.render.fps / scene.render.fps_base
        scene.render.fps, scene.render.fps_base = whole, base
        if abs(before - float(rate)) > 1e-3:
            notes.append(
                rpt_("The frame rate was {old:.3f} a second and is now the plate's, {new:.3f}.", new=float(rate), old=before)
            )
    scene.frame_set(start)
    return notes
