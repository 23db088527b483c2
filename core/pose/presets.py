"""The settings that the paper published for its two data sets, whose unit is the metre (docs/design.md, section 4)."""

from __future__ import annotations

from .settings import RefineSettings

PRESETS: dict[str, RefineSettings] = {
    "7scenes": RefineSettings(iterations=6, candidates=6, perturb_translation_units=0.04, perturb_rotation_deg=0.01),
    "cambridge": RefineSettings(iterations=4, candidates=6, perturb_translation_units=4.0, perturb_rotation_deg=2.0),
}
