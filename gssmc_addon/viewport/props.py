"""What an artist sets of a splat's look: splats, points or box, how many, how opaque. Kept on the object."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..proxy import uses as proxy_uses
from ..splat import object as splat_object
from ..splat import up_axis
from ..support.texts import iface_

MAX_SHOWN = 1_000_000
SHOW_ITEMS = (
    ("SPLATS", "Splats", "Draw the Gaussians as they are"),
    ("POINTS", "Points", "Draw a point for each Gaussian; in colour in Material Preview"),
    ("BOX", "Box", "Draw only the box around the scan"),
)
_state = {"drawable": False}  # Whether this Blender has a window and a graphics card that can draw splats.


def set_drawable(drawable: bool) -> None:
    """Notes whether this Blender has a window and a graphics card that can draw splats."""
    _state["drawable"] = drawable


def is_drawable() -> bool:
    """Whether this Blender has a window and a graphics card that can draw splats."""
    return _state["drawable"]


def shows_splats(obj: bpy.types.Object) -> bool:
    """True when the extension itself draws this object's Gaussians; Blender then draws its box, to click at."""
    return obj.gssmc.show_as == "SPLATS" and obj.display_type == "BOUNDS" and splat_object.is_splat(obj)


def apply(obj: bpy.types.Object) -> None:
    """Sets Blender's own display of a splat object so that nothing is drawn twice, or not at all."""
    ours = is_drawable() and not splat_object.is_native(obj.data)
    box = obj.gssmc.show_as == "BOX" or (obj.gssmc.show_as == "SPLATS" and ours)
    wanted = "BOUNDS" if box else "TEXTURED"
    if obj.display_type != wanted:  # This also works for a linked object: it only changes the display and is not saved.
        obj.display_type = wanted


def apply_all() -> None:
    """Called after a file was opened, which may come from another machine."""
    for obj in bpy.data.objects:
        if splat_object.is_splat(obj):
            apply(obj)


def draw_settings(layout: bpy.types.UILayout, obj: bpy.types.Object | None) -> None:
    """The rows of the panel for a splat object; none of those about drawing where Blender itself draws it.

    One setting a row: two numbers beside each other lose their last digits in a narrow sidebar.
    """
    if not splat_object.is_splat(obj):
        return
    axis = iface_(up_axis.AXIS_WORDS[up_axis.of(obj)])
    layout.operator_menu_enum("gssmc.up_axis", "axis", text=iface_("Up Axis: {axis}", axis=axis))
    if splat_object.is_native(obj.data):
        return
    layout.row(align=True).prop(obj.gssmc, "show_as", expand=True)
    if obj.gssmc.show_as != "SPLATS":
        return
    if not is_drawable():
        layout.label(text="Shown as points:", icon="INFO")
        layout.label(text="no fit graphics here", icon="BLANK1")
        return
    layout.prop(obj.gssmc, "max_shown")  # Side by side the number would be cut off in a narrow sidebar.
    layout.prop(obj.gssmc, "opacity", slider=True)


def _changed(self: GssmcObject, context: bpy.types.Context) -> None:
    if splat_object.is_splat(self.id_data):
        apply(self.id_data)
    redraw_views()


def redraw_views() -> None:
    """Requests a redraw of every 3D viewport. A change from a script, unlike a click in the panel, does not do that."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


class GssmcObject(bpy.types.PropertyGroup):
    """On objects: how a splat shows in the viewport; of a proxy, whose it is and what it is for."""

    __annotations__ = {
        "show_as": EnumProperty(
            name="Show As",
            items=SHOW_ITEMS,
            default="SPLATS",
            description="How the scan shows in the viewport",
            update=_changed,
        ),
        "max_shown": IntProperty(
            name="Most Shown",
            description="The largest number of Gaussians drawn in the viewport, chosen at random from all; "
            "only the display uses it",
            default=MAX_SHOWN,
            min=1000,
            soft_max=10_000_000,
            step=10_000,
            update=_changed,
        ),
        "file": StringProperty(
            name="File",
            description="The scan's file that the object was imported from",
            subtype="FILE_PATH",
            options={"HIDDEN"},
        ),
        "up_axis": EnumProperty(
            name="Up Axis",
            description="Which axis of the file points up, as the object was imported or turned; Up Axis changes it",
            items=(("UNKNOWN", "Unknown", "Another importer made the object"), *up_axis.AXIS_ITEMS),
            default="UNKNOWN",
            options={"HIDDEN"},
        ),
        "opacity": FloatProperty(
            name="Opacity",
            description="Opacity of the splats in the viewport; lower it to see what is behind them, for example the photo",
            default=1.0,
            min=0.0,
            max=1.0,
            update=_changed,
        ),
        "composite_before": StringProperty(
            name="Before Composite",
            description="What a composite changed of the object, as it was before, as JSON",
            options={"HIDDEN"},
        ),
        "composite_after": StringProperty(
            name="In Composite", description="The same as the composite has it, as JSON", options={"HIDDEN"}
        ),
        "proxy_of": PointerProperty(
            name="Proxy Of",
            description="The splat that this mesh stands for",
            type=bpy.types.Object,
            options={"HIDDEN"},
        ),
        "proxy_use": EnumProperty(
            name="Proxy Use",
            description="What the proxy is for",
            items=proxy_uses.ITEMS,
            default=proxy_uses.NONE,
            options={"HIDDEN"},
        ),
    }


classes = (GssmcObject,)


def register() -> None:
    for cls in classes:
        bpy.utils.register_class(cls)
    bpy.types.Object.gssmc = PointerProperty(type=GssmcObject)


def unregister() -> None:
    del bpy.types.Object.gssmc
    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
