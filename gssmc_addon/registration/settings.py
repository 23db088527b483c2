"""The refinement's settings as Blender properties, one per field of RefineSettings, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...core.locate import MapSettings
from ...core.pose.presets import QUALITIES
from ...core.pose.settings import RefineSettings
from ...core.support.options import Option, options_of
from . import preferences


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


OPTIONS = options_of(RefineSettings)
TITLES = {  # Short titles for fields whose own name does not fit into the sidebar.
    "final_long_side_px": "Final Side (px)",
    "perturb_translation_ratio": "Shift (ratio)",
    "perturb_translation_units": "Shift (units)",
    "perturb_rotation_deg": "Turn (deg)",
}
MAP_VIEWS = "map_views"  # It belongs to Find Camera and is not part of a quality.
LENS = "lens"  # It is shown in the Lens panel and is not part of a quality.
MODEL_OF = {"model": "features", "matcher_model": "matcher"}  # Maps a model file's field to the choice that it belongs to.
QUALITY_ITEMS = (
    ("DRAFT", "Draft", "Fewer views of smaller pictures: for a first look, and for going through many photos quickly", 0),
    ("NORMAL", "Normal", "GS-SMC's own settings", 1),
    ("BEST", "Best", "More views, and larger pictures for the last stage: for the final camera of a large photo", 2),
    ("CUSTOM", "Custom", "Values of your own, set below", 3),
)
CHOICES = {
    name: [(word, choice.title, _sentence(choice.text)) for word, choice in option.choices.items()]
    for name, option in OPTIONS.items()
    if option.choices
}


def _title(name: str) -> str:
    """ "long_side_px" -> "Long Side (px)"."""
    if name in TITLES:
        return TITLES[name]
    unit = OPTIONS[name].unit
    words = name.removesuffix(f"_{unit}").replace("_", " ").title()
    return f"{words} ({unit})" if unit else words


def _limits(option: Option) -> dict[str, Any]:
    """The limits for typing, which are those of the engine, and those of the slider."""
    if option.low is None or option.high is None:
        return {}
    soft_low = option.low if option.soft_low is None else option.soft_low
    soft_high = option.high if option.soft_high is None else option.soft_high
    return {"min": option.low, "max": option.high, "soft_min": soft_low, "soft_max": soft_high}


def quality_annotation() -> Any:
    """The choice of a quality. It stores no value: it is read from the settings and sets them."""
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


def map_views_annotation() -> object:
    """How many views the map of a scan has at most."""
    low, high = MapSettings.__dataclass_fields__["views"].metadata["range"]
    return IntProperty(
        name="Map Views",
        description="Views of the scan that the map of Find Camera has at most. More find photos of more places, and take "
        "longer; only as many are made as the photo needs",
        default=MapSettings().views,
        min=low,
        max=high,
        soft_min=10,
        soft_max=400,
    )


def reset(owner: bpy.types.bpy_struct) -> None:
    """Gives all settings, but for the lens, which has a panel of its own, the engine's defaults."""
    for name in settings_annotations():
        if name != LENS:
            owner.property_unset(name)
    owner.property_unset(MAP_VIEWS)


def settings_annotations() -> dict[str, object]:
    """One Blender property per field of RefineSettings, with its default, limits and documentation; without the model files,
    which are the user's and not the scene's.
    """
    annotations: dict[str, object] = {}
    for field in fields(RefineSettings):
        if field.name in MODEL_OF:
            continue
        option = OPTIONS[field.name]
        common: dict[str, Any] = {"name": _title(field.name), "description": _sentence(option.help), "default": field.default}
        if option.choices:
            annotations[field.name] = EnumProperty(items=CHOICES[field.name], **common)
        elif isinstance(field.default, bool):
            annotations[field.name] = BoolProperty(**common)
        elif isinstance(field.default, int):
            annotations[field.name] = IntProperty(**_limits(option), **common)
        else:
            annotations[field.name] = FloatProperty(precision=4, step=0.1, **_limits(option), **common)
    return annotations


def model_annotations() -> dict[str, object]:
    """The model files as properties, for operators: scripts may name them instead of the preferences."""
    return {
        name: StringProperty(
            name=_title(name), subtype="FILE_PATH", description=f"{_sentence(OPTIONS[name].help)}; empty: the preferences'"
        )
        for name in MODEL_OF
    }


def settings_from(
    owner: bpy.types.bpy_struct, overrides: bpy.types.OperatorProperties | None = None, **fixed: Any
) -> RefineSettings:
    """RefineSettings from `owner`'s properties; those set explicitly on `overrides` win, and `fixed` wins over both.

    Model files are the preferences'.
    """
    values: dict[str, Any] = {}
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
