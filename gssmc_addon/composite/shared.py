"""What the composites of several scenes share: a scan, its proxies, cameras. None takes from another what that one needs."""

from __future__ import annotations

import json
from collections.abc import Iterator

import bpy

from . import record
from .state import GssmcComposite, GssmcTouchedCamera, GssmcTouchedObject


def holder(data: bpy.types.Camera | None, but: bpy.types.Scene | None = None) -> bpy.types.Scene | None:
    """The scene, other than `but`, whose composite renders through the camera; None where there is none."""
    for scene in bpy.data.scenes:
        kept = scene.gssmc.composite
        if scene != but and kept.is_set_up and kept.camera is not None and kept.camera.data == data:
            return scene
    return None


def leave_camera(scene: bpy.types.Scene, item: GssmcTouchedCamera) -> bool:
    """Whether another scene's composite renders through the camera; then that one puts it back, to what it was before both."""
    other = holder(item.data, scene)
    if other is not None:
        _hand_over(item, (one for one in other.gssmc.composite.cameras if one.data == item.data))
    return other is not None


def leave_object(scene: bpy.types.Scene, item: GssmcTouchedObject) -> bool:
    """Whether a composite that another scene set up since has use for the object; that one then puts it back, to what it was
    before both.
    """
    later = (one for kept in _others(scene) for one in kept.objects if one.object == item.object)
    return _hand_over(item, later)


def free_lenses() -> None:
    """Gives cameras that show more than their photo, but are in no composite, the photo's frame back: copies of a composite's
    camera, and those that were solved or moved since it was set up.
    """
    for data in bpy.data.cameras:
        if data.gssmc.overscan != 1 and data.is_editable and holder(data) is None:
            record.zoom_out(data, 1 / data.gssmc.overscan)


def note(obj: bpy.types.Object, before: str, after: str) -> None:
    """Notes on an object what it was before the first composite touched it: the scene that keeps that may be deleted."""
    obj.gssmc.composite_before = obj.gssmc.composite_before or before
    obj.gssmc.composite_after = after


def free_objects() -> None:
    """Puts objects back that a composite touched and none has any more, such as those of a scene that was deleted."""
    touched = [obj for obj in bpy.data.objects if obj.gssmc.composite_before and obj.is_editable]
    if not touched:
        return
    kept = {item.object for scene in bpy.data.scenes for item in scene.gssmc.composite.objects}
    for obj in (one for one in touched if one not in kept):
        if json.dumps(record.values(obj, record.OBJECT_PATHS)) == obj.gssmc.composite_after:
            record.put(obj, json.loads(obj.gssmc.composite_before))
        obj.gssmc.composite_before = obj.gssmc.composite_after = ""


def _others(scene: bpy.types.Scene) -> Iterator[GssmcComposite]:
    return (one.gssmc.composite for one in bpy.data.scenes if one != scene and one.gssmc.composite.is_set_up)


def _hand_over(
    item: GssmcTouchedCamera | GssmcTouchedObject, others: Iterator[GssmcTouchedCamera] | Iterator[GssmcTouchedObject]
) -> bool:
    """Gives what `item` keeps to each of `others` that began with the same, as in a copy of the scene, or where it ended."""
    found = [one for one in others if one.before in (item.before, item.after)]
    for one in found:
        one.before = item.before
    return bool(found)
