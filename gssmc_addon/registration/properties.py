"""What the extension keeps in the .blend: the picked splat, the photos and the settings on the scene; cameras: camera_props.

The state of a running job is not among it (see jobs): a saved file never says that something runs.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ...core.pose.presets import PRESETS
from ...core.pose.settings import RefineSettings
from ..composite import state as composite_state
from ..look import cameras as look_cameras
from ..look import looks
from ..photo import image as photo_image
from ..photo import list as photo_list
from ..photo.entry import GssmcPhoto
from ..pins.props import GssmcPin
from ..preview import state as preview_state
from ..splat import object as splat_object
from ..viewport import props as viewport_props
from . import preferences, settings
from .camera_props import GssmcCamera
from .settings import MODEL_OF, quality_annotation, settings_annotations


def _photo_clicked(self: GssmcScene, context: bpy.types.Context) -> None:
    """A line of the list was clicked: the viewport looks through its camera, and the panel shows its verdict."""
    context.window_manager.gssmc.tell("")
    photo_list.show(context, self.id_data)


def _look_changed(self: GssmcScene, context: bpy.types.Context) -> None:
    looks.apply(self.id_data)


def _cameras_changed(self: GssmcScene, context: bpy.types.Context) -> None:
    look_cameras.show_one(self.id_data, context.view_layer)


def _splat_picked(self: GssmcScene, context: bpy.types.Context) -> None:
    """A scene's first splat brings the preferences' preset, for settings that nobody has touched."""
    if self.splat:
        context.window_manager.gssmc.tell("")  # The message may have been that there was no splat.
    preset = PRESETS.get(preferences.preset(context))
    names = [option.name for option in fields(RefineSettings) if option.name not in MODEL_OF]
    if self.splat and preset and not any(self.is_property_set(name) for name in names):
        for name in names:
            if getattr(preset, name) != getattr(RefineSettings, name):
                setattr(self, name, getattr(preset, name))


def _pins_shown(self: GssmcScene, context: bpy.types.Context) -> None:
    viewport_props.redraw_views()


class GssmcScene(bpy.types.PropertyGroup):
    """On the scene: the splat to refine against, the list of photos, and the refinement's settings."""

    __annotations__ = {
        "splat": PointerProperty(
            name="Splat",
            description="The splat scan: a point cloud imported with File > Import > Gaussian Splats",
            type=bpy.types.Object,
            poll=lambda self, obj: splat_object.is_splat(obj),
            update=_splat_picked,
        ),
        "photos": CollectionProperty(type=GssmcPhoto),
        "photo_index": IntProperty(name="Photo", description="The selected photo of the list", min=0, update=_photo_clicked),
        "hold_pins": BoolProperty(
            name="Hold in Refine",
            default=False,
            description="Pins pull at the camera in the last stage of Refine Camera, as much as they weigh, and a result that "
            "leaves them is doubted",
        ),
        "show_pins": BoolProperty(
            name="Show Pins", default=True, description="Draw the pins over the photo, with their errors", update=_pins_shown
        ),
        "look": EnumProperty(
            name="Look",
            items=looks.ITEMS,
            default=looks.ALIGN,
            description="How photo, splat and CG lie over each other in the viewport; V changes it",
            update=_look_changed,
        ),
        "photo_opacity": FloatProperty(
            name="Photo Opacity",
            description="How opaque photos lie before the splat in the look Align",
            default=photo_image.BACKGROUND_ALPHA,
            min=0,
            max=1,
            subtype="FACTOR",
            update=_look_changed,
        ),
        "photo_collection": PointerProperty(
            name="Photo Collection", description="The collection of the photos' cameras", type=bpy.types.Collection
        ),
        "show_all_cameras": BoolProperty(
            name="Show All Cameras",
            description="Show the cameras of all photos in the viewport, and not only that of the picked one",
            default=False,
            update=_cameras_changed,
        ),
        "quality": quality_annotation(),
        "composite": PointerProperty(type=composite_state.GssmcComposite),
        "map_views": settings.map_views_annotation(),
        **settings_annotations(),
    }


class GssmcWindow(bpy.types.PropertyGroup):
    """On the window manager, hence never saved: the last message of an operator, and panel state."""

    if TYPE_CHECKING:  # Declared for mypy, because `tell` assigns them.
        message: str
        message_icon: str

    __annotations__ = {
        "message": StringProperty(name="Message", description="The message of the last operation"),
        "message_icon": StringProperty(name="Icon", default="INFO"),
        "details": BoolProperty(name="Details", description="Show the whole text on the camera, and not only its beginning"),
        "preview": PointerProperty(type=preview_state.GssmcPreview),
    }

    def tell(self, message: str, icon: str = "INFO") -> None:
        """Sets the message, but not to the same value, which would make Blender redraw the whole window."""
        if self.message != message or self.message_icon != icon:
            self.message = message
            self.message_icon = icon


classes = (
    *composite_state.classes,
    GssmcPhoto,
    GssmcPin,
    GssmcScene,
    GssmcCamera,
    preview_state.GssmcPreview,
    GssmcWindow,
)


@bpy.app.handlers.persistent
def _after_undo(*_: object) -> None:
    """Clears the message: undo takes back the operation that it was about, but not the message, and not what viewports show."""
    for manager in bpy.data.window_managers:
        manager.gssmc.tell("")
    looks.settle(bpy.context.scene)


def register() -> None:
    for cls in classes:
        bpy.utils.register_class(cls)
    bpy.types.Scene.gssmc = PointerProperty(type=GssmcScene)
    bpy.types.Camera.gssmc = PointerProperty(type=GssmcCamera)
    bpy.types.WindowManager.gssmc = PointerProperty(type=GssmcWindow)
    bpy.app.handlers.undo_post.append(_after_undo)
    bpy.app.handlers.redo_post.append(_after_undo)


def unregister() -> None:
    bpy.app.handlers.redo_post.remove(_after_undo)
    bpy.app.handlers.undo_post.remove(_after_undo)
    del bpy.types.WindowManager.gssmc
    del bpy.types.Camera.gssmc
    del bpy.types.Scene.gssmc
    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
