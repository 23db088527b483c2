"""The cameras of photos in a collection of their own, of which the viewport shows that of the picked photo alone."""

from __future__ import annotations

import bpy

NAME = "Photos"


def collection(scene: bpy.types.Scene) -> bpy.types.Collection:
    """The scene's collection of photo cameras, made where there is none."""
    kept = scene.gssmc.photo_collection
    if kept is None or kept not in scene.collection.children_recursive:
        kept = bpy.data.collections.new(NAME)
        scene.collection.children.link(kept)
        scene.gssmc.photo_collection = kept
    return kept


def take_in(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Moves a camera that stands in the scene's own collection into that of the photos; one that the user sorted stays."""
    if camera.name in scene.collection.objects:
        collection(scene).objects.link(camera)
        scene.collection.objects.unlink(camera)


def show_one(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> None:
    """Hides the cameras of all photos but the scene's camera in the viewport, or shows all, as the scene says."""
    for entry in scene.gssmc.photos:
        camera = entry.camera
        if camera is not None and camera.name in layer.objects:
            hidden = camera != scene.camera and not scene.gssmc.show_all_cameras
            if camera.hide_get(view_layer=layer) != hidden:
                camera.hide_set(hidden, view_layer=layer)
