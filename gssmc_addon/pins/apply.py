"""The camera goes where its pins place it, at once."""

from __future__ import annotations

import bpy

from ...core.pose.pins.place import PinLens, PinOptions
from ..clicks import surface
from ..photo import camera as photo_camera
from ..photo import image as photo_image
from . import state


def solve_and_keep(context: bpy.types.Context, lens: str = "AUTO") -> str:
    """Places the scene's camera by its pins and keeps that as its solution; `lens`: AUTO, FIXED or FOCAL. What is to be said.

    Raises GssmcError, with nothing changed.
    """
    splat, camera = splat_and_camera(context)
    scene = context.scene
    solved: PinLens = "fixed" if lens == "FIXED" else "focal" if lens == "FOCAL" else "auto"
    options = PinOptions(solved, state.focal_35mm(camera.data))
    report = state.solve(scene, state.camera_of(scene, camera, splat), camera.data, options)
    photo_image.straighten(camera.data)
    state.show(scene, camera, splat, report)
    keyed = state.keep(scene, camera, splat, report)
    photo_camera.stop_moving_with_view()
    return " ".join([*report.reasons, *([keyed] if keyed else [])])


def splat_and_camera(context: bpy.types.Context) -> tuple[bpy.types.Object, bpy.types.Object]:
    """The scene's splat, and its camera that may be pinned, as a script left them. Raises GssmcError."""
    splat = surface.fresh(context)
    return splat, state.check(context.scene)
