"""Options of a refinement. Command-line flags, Blender properties and tests all derive from this dataclass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args, get_type_hints

from ..errors import RefineError

Final = Literal["auto", "joint", "epipolar", "depth", "none"]
Lens = Literal["auto", "fixed", "focal", "full"]


@dataclass(frozen=True)
class RefineSettings:
    """Every option of a refinement, with units in the names.

    iterations: most iterations of the loop; it stops earlier once the answer lies inside the fan of rendered views.
    candidates: L, rendered views around the current pose besides the pose itself.
    seed: of every random draw; the same seed gives the same answer.
    multiview: the coarse multi-view consistency stage; off = the reference view alone (paper's ablation), no last stage either.
    epipolar: the fine epipolar stage; off = the coarse answer as it is (paper's ablation), no last stage either.
    final: the last stage, on finer renders: joint = epipolar lines and rendered depth in one problem, epipolar or depth = one
        of them alone, auto = the one that best explains matches held out from the fit, none = the loop's own answer.
    lens: what of the lens is solved for: fixed = nothing, focal = the focal length, full = focal length, principal point, k1
        and k2; auto = focal where the camera's focal length is a guess, else fixed.
    long_side_px: photo and renders are matched at this size of the long side.
    final_long_side_px: the same for the last stage, which looks for sub-pixel places instead of matches.
    perturb_translation_ratio: deviation of the candidates' centres, as a share of the median rendered depth.
    perturb_translation_units: the same deviation in scene units, where the scan's unit is known (paper: metres); 0 = the ratio.
    perturb_rotation_deg: deviation of the candidates' rotation about each axis.
    threads: views rendered and matched side by side, 0 = one per core.
    features: the local features, a name of the registry, or auto: SIFT, and ALIKED takes over where that finds no answer.
    matcher: how features are paired, a name of the registry.
    model: network file (.onnx) of learned features.
    matcher_model: network file (.onnx) of a learned matcher.
    Raises RefineError when a number is outside its range.
    """

    iterations: int = 5
    candidates: int = 6
    seed: int = 0
    multiview: bool = True
    epipolar: bool = True
    final: Final = "auto"
    lens: Lens = "auto"
    long_side_px: int = 640
    final_long_side_px: int = 1280
    perturb_translation_ratio: float = 0.045
    perturb_translation_units: float = 0.0
    perturb_rotation_deg: float = 0.5
    threads: int = 0
    features: str = "sift"
    matcher: str = "nearest"
    model: str = ""
    matcher_model: str = ""

    def __post_init__(self) -> None:
        ranges: dict[str, tuple[float, float]] = {
            "iterations": (1, 100),
            "candidates": (1, 64),
            "long_side_px": (64, 8192),
            "final_long_side_px": (64, 8192),
            "perturb_translation_ratio": (1e-4, 1.0),
            "perturb_translation_units": (0.0, 1e6),
            "perturb_rotation_deg": (0.0, 45.0),
            "threads": (0, 256),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise RefineError(f"The option {name} is {value}; give a value from {low:g} to {high:g}.")
        for name, values in choices().items():
            if getattr(self, name) not in values:
                raise RefineError(f"The option {name} is '{getattr(self, name)}'; give one of {', '.join(values)}.")

    @property
    def has_final_stage(self) -> bool:
        """Whether the loop's answer is refined further; the paper's ablations end with the loop."""
        return self.final != "none" and self.multiview and self.epipolar

    def perturb_translation(self, median_depth: float) -> float:
        """Deviation of the candidates' centres in scene units, where the median rendered depth is `median_depth`."""
        return self.perturb_translation_units or self.perturb_translation_ratio * median_depth


def choices() -> dict[str, tuple[str, ...]]:
    """The allowed words of every option that takes a word."""
    hints = get_type_hints(RefineSettings)
    return {name: words for name, hint in hints.items() if (words := get_args(hint))}
