"""The refinement's settings as Blender properties, one per field of RefineSettings, and back."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...core.features.registry import AUTO, EXTRACTORS, MATCHERS
from ...core.pose.presets import QUALITIES
from ...core.pose.settings import RefineSettings, choices
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
LENS = "lens"  # stands in the Lens panel, and belongs to no quality
MODEL_OF = {"model": "features", "matcher_model": "matcher"}  # model file -> the choice that it belongs to
AUTO_ITEM = (AUTO, "Auto", "SIFT; ALIKED takes over where it finds no answer, if there is a model of it")
QUALITY_ITEMS = (
    ("DRAFT", "Draft", "Fewer views of smaller pictures: for a first look, and for going through many photos quickly", 0),
    ("NORMAL", "Normal", "GS-SMC's own settings", 1),
    ("BEST", "Best", "More views, and larger pictures for the last stage: for the final camera of a large photo", 2),
    ("CUSTOM", "Custom", "Values of your own, set below", 3),
)
CHOICES = {
    "features": [*((name, kind.title, kind.text[:1].upper() + kind.text[1:]) for name, kind in EXTRACTORS.items()), AUTO_ITEM],
    "matcher": [(name, kind.title, kind.text[:1].upper() + kind.text[1:]) for name, kind in MATCHERS.items()],
    **{name: [(word, word.title(), "") for word in words] for name, words in choices().items()},
}


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


def quality_annotation() -> EnumProperty:
    """What is chosen instead of single settings. It keeps nothing of its own: it is read from the settings, and sets them."""
    return EnumProperty(
        name="Quality",
        items=QUALITY_ITEMS,
        default="NORMAL",
        get=_quality,
        set=_set_quality,
        description="How much work goes into a camera; it sets some of the values below",
        options={"SKIP_SAVE"},
    )


def _quality(owner: bpy.types.bpy_struct) -> int:
    """The number of the quality whose values are set, that of CUSTOM when it is none's."""
    return next((number for number, values in enumerate(QUALITIES.values()) if _has(owner, values)), len(QUALITIES))


def _has(owner: bpy.types.bpy_struct, values: Mapping[str, object]) -> bool:
    return all(getattr(owner, name) == value for name, value in values.items())


def _set_quality(owner: bpy.types.bpy_struct, number: int) -> None:
    if number < len(QUALITIES):
        for name, value in list(QUALITIES.values())[number].items():
            setattr(owner, name, value)


def reset(owner: bpy.types.bpy_struct) -> None:
    """Gives all settings, but for the lens, which has a panel of its own, the engine's defaults."""
    for name in settings_annotations():
        if name != LENS:
            owner.property_unset(name)


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
