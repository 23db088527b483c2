"""What Make Proxy asks for."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...core.proxy import ProxySettings
from ...core.support.options import options_of
from ..registration import preferences
from .uses import USES

CAMERAS = (
    ("ACTIVE", "This Camera", "What the scene's camera sees: quickest, and enough for a still"),
    ("PHOTOS", "Solved Photos", "All photos of the list whose camera is trusted, to be checked or placed by pins"),
    ("PLATE", "Plate", "Frames of the scene camera's plate, as it was solved"),
)
OPTIONS = options_of(ProxySettings)
TITLES = {"faces": "Triangles", "close_holes": "Close Holes", "long_side_px": "View Side (px)", "smooth_px": "Smooth (px)"}
DIALOG = ("use", "cameras", "step", "faces", "smooth_px", "close_holes", "replace")


def proxy_annotations() -> dict[str, object]:
    """The options as Blender properties; those of the engine with its own limits and texts."""
    return {
        "splat": StringProperty(name="Splat", description="Name of the splat object; empty: the one picked in the panel"),
        "camera": StringProperty(name="Camera", description="Name of the camera object; empty: the scene camera"),
        "use": EnumProperty(name="Use", items=USES, default="SHADOW_CATCHER", description="What the proxy is for"),
        "cameras": EnumProperty(
            name="From", items=CAMERAS, default="ACTIVE", description="The cameras whose views the proxy is made of"
        ),
        "step": IntProperty(
            name="Every", description="Of a plate, take every so many solved frames", default=10, min=1, soft_max=100
        ),
        **{name: _property(name) for name in TITLES},
        "replace": BoolProperty(
            name="Replace Earlier",
            description="The new mesh takes the place of the splat's proxy for the same use, which keeps its other settings. "
            "Off: it is added beside it",
            default=False,
        ),
    }


def _property(name: str) -> object:
    option, default = OPTIONS[name], getattr(ProxySettings, name)
    common: dict[str, Any] = {"name": TITLES[name], "description": option.help[:1].upper() + option.help[1:]}
    if isinstance(default, bool):
        return BoolProperty(default=default, **common)
    common |= {"min": option.low, "max": option.high}
    common |= {"soft_min": option.soft_low or option.low, "soft_max": option.soft_high or option.high}
    return (FloatProperty if isinstance(default, float) else IntProperty)(default=default, **common)


def settings_of(operator: bpy.types.Operator, context: bpy.types.Context) -> ProxySettings:
    """Raises ProxyError for values that make no sense."""
    threads = preferences.threads(context, context.scene.gssmc.threads)
    return ProxySettings(operator.faces, operator.close_holes, operator.long_side_px, operator.smooth_px, threads)
