"""What Import Splats asks for, and what it says of the result."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ...core.splats.scene import GaussianScene
from ..support.texts import rpt_
from ..viewport import props as viewport_props
from .up_axis import AXIS_ITEMS

ORIENTATION_ITEMS = (
    ("AUTO", "By Format", "As is usual for the file's format (.ply and .splat y down, .spz y up), or as the file declares"),
    *AXIS_ITEMS,
)


def import_annotations() -> dict[str, object]:
    """The options of the dialog, and of scripts, as Blender properties."""
    return {
        "orientation": EnumProperty(
            name="Up Axis",
            items=ORIENTATION_ITEMS,
            default="AUTO",
            description="Turns the object and leaves the file's coordinates as they are. The panel can change it later",
        ),
        "scale": FloatProperty(
            name="Scale",
            default=1.0,
            min=1e-6,
            soft_min=0.01,
            soft_max=100.0,
            description="Scales the object and leaves the file's coordinates as they are",
        ),
        **_amounts(),
        "show_colours": BoolProperty(
            name="Colours of Points",
            default=True,
            description="Where the scan shows as points, switch Solid viewports to Material Preview, which has its colours",
        ),
        "wait": BoolProperty(
            name="Wait",
            default=True,
            options={"HIDDEN", "SKIP_SAVE"},
            description="For scripts: return when all is imported. Off, a window goes on meanwhile, "
            "as it does after the dialog",
        ),
    }


def _amounts() -> dict[str, object]:
    """How much of the scan is read, and shown."""
    return {
        "max_shown": IntProperty(
            name="Most Shown",
            default=viewport_props.MAX_SHOWN,
            min=1000,
            description="The largest number of Gaussians drawn in the viewport; all are imported. "
            "The panel can change it later",
        ),
        "level": IntProperty(
            name="Level",
            default=0,
            min=0,
            description="Of a streamed SOG scan (lod-meta.json) the level of detail; 0 is the finest",
        ),
    }


def summary(obj: bpy.types.Object, scene: GaussianScene) -> str:
    """Up to two sentences: what was imported as `obj`, and what was left out."""
    values = {"name": obj.name, "count": len(scene), "degree": scene.sh_degree, "format": scene.format}
    sentences = [rpt_('"{name}": {count:,} Gaussians, SH degree {degree} ({format}).', **values)]
    if any(scene.origin):
        place = dict(zip("xyz", scene.origin, strict=True))
        sentences.append(rpt_("It lies around ({x:.0f}, {y:.0f}, {z:.0f}), which is the object's own origin now.", **place))
    return " ".join([*sentences, *left_out(scene)])


def left_out(scene: GaussianScene) -> list[str]:
    """A sentence on the Gaussians that a file or an object held and `scene` does not; none where nothing was left out."""
    if scene.dropped == 1:
        return [rpt_("1 Gaussian with values that are not finite was left out.")]
    if scene.dropped:
        return [rpt_("{count} Gaussians with values that are not finite were left out.", count=scene.dropped)]
    return []
