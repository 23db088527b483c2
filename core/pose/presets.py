"""Settings under a name: what the paper published for its two data sets, whose unit is the metre, and qualities."""

from __future__ import annotations

from collections.abc import Mapping

from .settings import RefineSettings

PRESETS: dict[str, RefineSettings] = {
    "7scenes": RefineSettings(iterations=6, candidates=6, perturb_translation_units=0.04, perturb_rotation_deg=0.01),
    "cambridge": RefineSettings(iterations=4, candidates=6, perturb_translation_units=4.0, perturb_rotation_deg=2.0),
}

# The settings of each quality. Those that do not change the cost (features, lens, size of the steps, seed) are not among them.
QUALITIES: dict[str, Mapping[str, int]] = {
    "draft": {"iterations": 3, "candidates": 4, "long_side_px": 480, "final_long_side_px": 960},
    "normal": {"iterations": 5, "candidates": 6, "long_side_px": 640, "final_long_side_px": 1280},
    "best": {"iterations": 8, "candidates": 12, "long_side_px": 960, "final_long_side_px": 2560},
}
