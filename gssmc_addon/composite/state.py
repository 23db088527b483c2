"""What Set Up Composite keeps on the scene, so that Remove Composite can put back all that it touched."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import CollectionProperty, IntVectorProperty, PointerProperty, StringProperty


class GssmcTouchedObject(bpy.types.PropertyGroup):
    """An object, and its properties as JSON {name: value} before it was touched and after."""

    if TYPE_CHECKING:
        object: bpy.types.Object | None
        before: str
        after: str

    __annotations__ = {
        "object": PointerProperty(name="Object", type=bpy.types.Object),
        "before": StringProperty(name="Before"),
        "after": StringProperty(name="After"),
    }


class GssmcTouchedCamera(bpy.types.PropertyGroup):
    """A camera, and its lens as JSON before it was touched and after: what the user changed since is not put back."""

    if TYPE_CHECKING:
        data: bpy.types.Camera | None
        before: str
        after: str

    __annotations__ = {
        "data": PointerProperty(name="Camera", type=bpy.types.Camera),
        "before": StringProperty(name="Before"),
        "after": StringProperty(name="After"),
    }


class GssmcMadeImage(bpy.types.PropertyGroup):
    """An image that was made for the composite and goes with it."""

    if TYPE_CHECKING:
        image: bpy.types.Image | None

    __annotations__ = {"image": PointerProperty(name="Image", type=bpy.types.Image)}


class GssmcComposite(bpy.types.PropertyGroup):
    """On the scene: the composite that is set up in it, if any."""

    if TYPE_CHECKING:
        before: str
        engine: str
        camera: bpy.types.Object | None
        tree: bpy.types.NodeTree | None
        own_tree: bpy.types.NodeTree | None
        host: str
        frames_folder: str
        frames_range: tuple[int, int]
        frames_size: tuple[int, int]

    __annotations__ = {
        "before": StringProperty(
            name="Before", description="The scene's settings as they were, as JSON; empty: none is set up"
        ),
        "engine": StringProperty(name="Engine", description="The render engine that it was set up for"),
        "camera": PointerProperty(name="Camera", description="The camera that it was set up for", type=bpy.types.Object),
        "tree": PointerProperty(name="Tree", description="The compositor's nodes that were made", type=bpy.types.NodeTree),
        "own_tree": PointerProperty(name="Own Tree", description="The scene's own compositor nodes", type=bpy.types.NodeTree),
        "host": StringProperty(name="Host", description="How the compositor itself was before, as JSON"),
        "objects": CollectionProperty(type=GssmcTouchedObject),
        "cameras": CollectionProperty(type=GssmcTouchedCamera),
        "frames_folder": StringProperty(
            name="Frames", description="Folder of the rendered frames of the splat", subtype="DIR_PATH"
        ),
        "frames_range": IntVectorProperty(name="Frame Range", description="The first and the last of those frames", size=2),
        "frames_size": IntVectorProperty(name="Frame Size", description="Their width and height; 0: there are none", size=2),
        "images": CollectionProperty(type=GssmcMadeImage),
    }

    @property
    def is_set_up(self) -> bool:
        return bool(self.before)


classes = (GssmcTouchedObject, GssmcTouchedCamera, GssmcMadeImage, GssmcComposite)
