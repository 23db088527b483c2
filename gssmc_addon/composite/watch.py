"""What becomes of a composite when nobody presses its buttons: its scene is deleted, or its render is cropped."""

from __future__ import annotations

import bpy

from . import shared


class _Watch:
    """How many scenes there were when somebody looked last."""

    scenes = 0


_watch = _Watch()


@bpy.app.handlers.persistent
def _after_update(*_: object) -> None:
    if len(bpy.data.scenes) < _watch.scenes:
        shared.free_lenses()
        shared.free_objects()
    _watch.scenes = len(bpy.data.scenes)


@bpy.app.handlers.persistent
def _before_render(scene: bpy.types.Scene, *_: object) -> None:
    """Blender would squeeze the whole plate into a border that it crops to."""
    if scene.gssmc.composite.is_set_up:
        scene.render.use_crop_to_border = False


def register() -> None:
    bpy.app.handlers.depsgraph_update_post.append(_after_update)
    bpy.app.handlers.render_init.append(_before_render)


def unregister() -> None:
    bpy.app.handlers.render_init.remove(_before_render)
    bpy.app.handlers.depsgraph_update_post.remove(_after_update)
