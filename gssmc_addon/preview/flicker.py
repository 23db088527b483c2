"""Flicker: a timer that shows photo and render in turn, wherever one of them shows, while the window's `flicker` is on."""

from __future__ import annotations

import bpy

from . import images as preview_images

INTERVAL_S = 0.5


def changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The switch was turned: starts the timer; it ends by itself when it finds the switch off."""
    if self.flicker and not bpy.app.background and not bpy.app.timers.is_registered(_toggle):
        bpy.app.timers.register(_toggle, first_interval=INTERVAL_S, persistent=True)


def _toggle() -> float | None:
    own = bpy.context.window_manager.gssmc.preview
    pair = preview_images.find("photo"), preview_images.find("render")
    if not own.flicker or None in pair:
        own.flicker = False
        return None
    for area in preview_images.editors():
        space = area.spaces.active
        if space.image in pair:
            space.image = pair[0] if space.image == pair[1] else pair[1]
            area.tag_redraw()
    data = preview_images.in_viewport()
    slots = data.background_images if data else ()
    for slot in slots:
        if slot.image in pair:
            slot.image = pair[0] if slot.image == pair[1] else pair[1]
            slot.id_data.update_tag()
    return INTERVAL_S


def unregister() -> None:
    if bpy.app.timers.is_registered(_toggle):
        bpy.app.timers.unregister(_toggle)
