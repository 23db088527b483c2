"""What the extension keeps in the .blend: the picked splat and settings on the scene, photo, lens and verdict on the camera.

The state of a running job is not among it (see jobs): a saved file never says that something runs.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import fields

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

from ...core.features.registry import AUTO, EXTRACTORS, MATCHERS
from ...core.pose.presets import PRESETS
from ...core.pose.settings import RefineSettings, choices
from ..photo import entry as photo_entry
from ..photo import image as photo_image
from ..photo import mask as mask_source
from ..preview import state as preview_state
from ..splat import object as splat_object
from ..support.texts import iface_
from . import preferences

LIMITS = {
    "iterations": (1, 100),
    "candidates": (1, 64),
    "long_side_px": (64, 8192),
    "final_long_side_px": (64, 8192),
    "threads": (0, 256),
}
TITLES = {  # where the field's own name does not fit into the sidebar
    "final_long_side_px": "Final Side (px)",
    "perturb_translation_ratio": "Shift (ratio)",
    "perturb_translation_units": "Shift (units)",
    "perturb_rotation_deg": "Turn (deg)",
}
MODEL_OF = {"model": "features", "matcher_model": "matcher"}  # model file -> the choice that it belongs to
AUTO_ITEM = (AUTO, "Auto", "SIFT; ALIKED takes over where it finds no answer, if there is a model of it")
CHOICES = {
    "features": [*((name, kind.title, kind.text[:1].upper() + kind.text[1:]) for name, kind in EXTRACTORS.items()), AUTO_ITEM],
    "matcher": [(name, kind.title, kind.text[:1].upper() + kind.text[1:]) for name, kind in MATCHERS.items()],
    **{name: [(word, word.title(), "") for word in words] for name, words in choices().items()},
}
VERDICTS = (
    ("NONE", "None", "Not refined yet"),
    ("TRUSTED", "Trusted", "The camera fits the photo"),
    ("CHECK", "Check", "Look at the result before you rely on it"),
    ("FAILED", "Failed", "No camera was found; nothing was changed"),
)
VERDICT_NAMES = {item[0]: item[1] for item in VERDICTS}
VERDICT_ICONS = {"NONE": "NONE", "TRUSTED": "CHECKMARK", "CHECK": "QUESTION", "FAILED": "ERROR"}


def _field_docs() -> dict[str, str]:
    """Tooltips from the dataclass's docstring, where each option stands as `name: text.`"""
    found = re.findall(r"^\s*(\w+): (.+?)(?=\n\s*\w+: |\n\s*$|\Z)", RefineSettings.__doc__ or "", re.MULTILINE | re.DOTALL)
    return {name: " ".join(text.split()).rstrip(".") for name, text in found}


def _title(name: str) -> str:
    """ "long_side_px" -> "Long Side (px)"; ratios need no unit."""
    if name in TITLES:
        return TITLES[name]
    words = name.removesuffix("_ratio").split("_")
    unit = f" ({words.pop()})" if words[-1] in {"px", "deg"} else ""
    return " ".join(words).title() + unit


def settings_annotations() -> dict[str, object]:
    """One Blender property per field of RefineSettings, with its default, limits and documentation; without the model files,
    which are the user's and not the scene's.
    """
    docs, annotations = _field_docs(), {}
    for option in fields(RefineSettings):
        if option.name in MODEL_OF:
            continue
        common = {"name": _title(option.name), "description": docs.get(option.name, "")}
        if option.name in CHOICES:
            annotations[option.name] = EnumProperty(items=CHOICES[option.name], default=option.default, **common)
        elif isinstance(option.default, bool):
            annotations[option.name] = BoolProperty(default=option.default, **common)
        elif isinstance(option.default, int):
            low, high = LIMITS.get(option.name, (0, 2**31 - 1))
            annotations[option.name] = IntProperty(default=option.default, min=low, max=high, **common)
        else:
            annotations[option.name] = FloatProperty(default=option.default, min=0.0, precision=4, step=0.1, **common)
    return annotations


def model_annotations() -> dict[str, object]:
    """The model files as properties, for operators: scripts may name them instead of the preferences."""
    docs = _field_docs()
    return {
        name: StringProperty(name=_title(name), subtype="FILE_PATH", description=f"{docs[name]}; empty: the preferences'")
        for name in MODEL_OF
    }


def settings_from(
    owner: bpy.types.bpy_struct, overrides: bpy.types.OperatorProperties | None = None, **fixed: object
) -> RefineSettings:
    """RefineSettings from `owner`'s properties; those set explicitly on `overrides` win, and `fixed` wins over both.

    Model files are the preferences'.
    """
    values = {}
    for option in fields(RefineSettings):
        if option.name in MODEL_OF:
            given = bpy.path.abspath(getattr(overrides, option.name)) if overrides else ""
            values[option.name] = given or preferences.model_for(bpy.context, values[MODEL_OF[option.name]])
            continue
        source = overrides if overrides and overrides.is_property_set(option.name) else owner
        value = getattr(source, option.name)
        values[option.name] = float(f"{value:.6g}") if isinstance(value, float) else value  # Blender keeps float32
    values["threads"] = preferences.threads(bpy.context, values["threads"])
    return RefineSettings(**{**values, **fixed})


def verdict_title(note: GssmcCamera) -> str:
    """One line for the panel: the verdict, with iterations and time of the refinement that gave it."""
    values = {"verdict": iface_(VERDICT_NAMES[note.verdict]), "count": note.iterations_done, "seconds": note.seconds}
    if note.iterations_done == 1:
        return iface_("{verdict}: 1 iteration, {seconds:.1f} s", **values)
    return iface_("{verdict}: {count} iterations, {seconds:.1f} s", **values)


def note_verdict(data: bpy.types.Camera, verdict: str, reasons: Sequence[str], iterations: int, seconds: float) -> None:
    """Keeps on the camera what was said of it; `verdict` as the engine spells it, or "none"."""
    note = data.gssmc
    note.verdict, note.reasons = verdict.upper(), "\n".join(reasons)
    note.iterations_done, note.seconds = iterations, seconds


def _photo_picked(self: GssmcCamera, context: bpy.types.Context) -> None:
    if self.photo:
        context.window_manager.gssmc.tell("")  # that there was none
        photo_image.show_behind(self.id_data, self.photo)


def _splat_picked(self: GssmcScene, context: bpy.types.Context) -> None:
    """A scene's first splat brings the preferences' preset, for settings that nobody has touched."""
    if self.splat:
        context.window_manager.gssmc.tell("")  # that there was none, or one no longer in the scene
    preset = PRESETS.get(preferences.preset(context))
    names = [option.name for option in fields(RefineSettings) if option.name not in MODEL_OF]
    if self.splat and preset and not any(self.is_property_set(name) for name in names):
        for name in names:
            if getattr(preset, name) != getattr(RefineSettings, name):
                setattr(self, name, getattr(preset, name))


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
        "photos": CollectionProperty(type=photo_entry.GssmcPhoto),
        "photo_index": IntProperty(name="Photo", description="The photo that is looked at", min=0, update=photo_entry.picked),
        **settings_annotations(),
    }


class GssmcCamera(bpy.types.PropertyGroup):
    """On the camera data: its photo, lens distortion (OpenCV's k1 k2 p1 p2 k3), and what the last refinement said of it."""

    __annotations__ = {
        "photo": PointerProperty(
            name="Photo",
            description="The photograph taken by this camera",
            type=bpy.types.Image,
            poll=lambda self, image: image.source != "VIEWER",  # Render Result and Viewer Node
            update=_photo_picked,
        ),
        "mask": PointerProperty(
            name="Mask",
            description="Leaves people, sky and cars out of matching: white is used, black is not. A picture of the photo's "
            "size, upright, from a file or painted in Blender",
            type=bpy.types.Image,
            poll=lambda self, image: image.source in mask_source.SINGLE and image != self.photo,
        ),
        **{
            name: FloatProperty(name=name, precision=6, step=0.1, description=f"Lens distortion {name} in OpenCV's model")
            for name in ("k1", "k2", "p1", "p2", "k3")
        },
        "undistorted": PointerProperty(
            name="Undistorted", description="The photo's copy without lens distortion, for the background", type=bpy.types.Image
        ),
        "lens_calibrated": BoolProperty(
            name="Calibrated",
            description="The focal length is known well, from a calibration. Otherwise it is a guess (from EXIF, or by eye), "
            "for which Refine solves when Solve For is Auto",
        ),
        "frame_x": IntProperty(name="Frame X", description="Render resolution that the lens belongs to; 0: the scene's", min=0),
        "frame_y": IntProperty(name="Frame Y", description="Render resolution that the lens belongs to; 0: the scene's", min=0),
        "verdict": EnumProperty(name="Verdict", items=VERDICTS, default="NONE"),
        "reasons": StringProperty(name="Reasons", description="Why, one sentence per line"),
        "iterations_done": IntProperty(name="Iterations", description="Iterations of the last refinement"),
        "seconds": FloatProperty(name="Seconds", description="Wall time of the last refinement"),
        "bad_frames": StringProperty(
            name="Bad Frames", description="Frames of a plate that could not be refined and have no key"
        ),
    }


class GssmcWindow(bpy.types.PropertyGroup):
    """On the window manager, hence never saved: the last message of an operator, and panel state."""

    __annotations__ = {
        "message": StringProperty(name="Message", description="What the last operation said"),
        "message_icon": StringProperty(name="Icon", default="INFO"),
        "preview": PointerProperty(type=preview_state.GssmcPreview),
    }

    def tell(self, message: str, icon: str = "INFO") -> None:
        """Sets the message. The same again is not written, for Blender draws the whole window anew then."""
        if (self.message, self.message_icon) != (message, icon):
            self.message, self.message_icon = message, icon


classes = (photo_entry.GssmcPhoto, GssmcScene, GssmcCamera, preview_state.GssmcPreview, GssmcWindow)


def register() -> None:
    for cls in classes:
        bpy.utils.register_class(cls)
    bpy.types.Scene.gssmc = PointerProperty(type=GssmcScene)
    bpy.types.Camera.gssmc = PointerProperty(type=GssmcCamera)
    bpy.types.WindowManager.gssmc = PointerProperty(type=GssmcWindow)


def unregister() -> None:
    del bpy.types.WindowManager.gssmc
    del bpy.types.Camera.gssmc
    del bpy.types.Scene.gssmc
    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
