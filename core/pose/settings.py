"""Options of a refinement. Command-line flags, Blender properties and tests all derive from this dataclass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from ..errors import RefineError
from ..features.registry import AUTO, EXTRACTORS, MATCHERS
from ..support.options import Choice, check_options, option

Final = Literal["auto", "joint", "epipolar", "depth", "none"]
Lens = Literal["auto", "fixed", "focal", "full"]

FINALS = {
    "auto": Choice("Auto", "the one that best explains matches held out from the fit"),
    "joint": Choice("Joint", "epipolar lines and rendered depth in one problem"),
    "epipolar": Choice("Epipolar", "epipolar lines alone"),
    "depth": Choice("Depth", "rendered depth alone"),
    "none": Choice("None", "the loop's own answer"),
}
LENSES = {
    "auto": Choice("Auto", "all of the lens where its focal length is a guess, else nothing"),
    "fixed": Choice("Fixed", "nothing"),
    "focal": Choice("Focal", "the focal length"),
    "full": Choice("Full", "focal length, principal point and distortion"),
}
FEATURES = {
    **{name: Choice(kind.title, kind.text) for name, kind in EXTRACTORS.items()},
    AUTO: Choice("Auto", "SIFT, and ALIKED takes over where that finds no answer, if there is a model of it"),
}
PAIRINGS = {name: Choice(kind.title, kind.text) for name, kind in MATCHERS.items()}
# The largest value of a signed 32-bit integer, which every interface can hold.
SEED_LIMIT = 2**31 - 1


@dataclass(frozen=True)
class RefineSettings:
    """Every option of a refinement, with units in the names. Raises RefineError for a value that its option does not accept."""

    iterations: int = field(
        default=5,
        metadata=option(
            "most iterations of the loop; it stops earlier once the answer lies inside the fan of rendered views",
            low=1,
            high=100,
            soft_high=20,
        ),
    )
    candidates: int = field(
        default=6,
        metadata=option(
            "L, rendered views around the current pose besides the pose itself", low=1, high=64, soft_low=2, soft_high=16
        ),
    )
    seed: int = field(
        default=0, metadata=option("of every random draw; the same seed gives the same answer", low=0, high=SEED_LIMIT)
    )
    multiview: bool = field(
        default=True,
        metadata=option(
            "the coarse multi-view consistency stage; off = the reference view alone (paper's ablation), no last stage either",
        ),
    )
    epipolar: bool = field(
        default=True,
        metadata=option("the fine epipolar stage; off = the coarse answer as it is (paper's ablation), no last stage either"),
    )
    final: Final = field(default="auto", metadata=option("the last stage, on finer renders", choices=FINALS))
    lens: Lens = field(default="auto", metadata=option("what of the lens is solved for", choices=LENSES))
    long_side_px: int = field(
        default=640,
        metadata=option(
            "photo and renders are matched at this size of the long side",
            low=64,
            high=8192,
            soft_low=320,
            soft_high=2048,
            unit="px",
        ),
    )
    final_long_side_px: int = field(
        default=1280,
        metadata=option(
            "the same for the last stage, which looks for sub-pixel places instead of matches",
            low=64,
            high=8192,
            soft_low=320,
            soft_high=4096,
            unit="px",
        ),
    )
    perturb_translation_ratio: float = field(
        default=0.045,
        metadata=option(
            "deviation of the candidates' centres, as a share of the median rendered depth",
            low=1e-4,
            high=1.0,
            soft_low=0.005,
            soft_high=0.2,
        ),
    )
    perturb_translation_units: float = field(
        default=0.0,
        metadata=option(
            "the same deviation in scene units, where the scan's unit is known (paper: metres); 0 = the ratio",
            low=0.0,
            high=1e6,
            soft_high=10.0,
            unit="units",
        ),
    )
    perturb_rotation_deg: float = field(
        default=0.5,
        metadata=option("deviation of the candidates' rotation about each axis", low=0.0, high=45.0, soft_high=5.0, unit="deg"),
    )
    threads: int = field(
        default=0, metadata=option("views rendered and matched side by side, 0 = one per core", low=0, high=256, soft_high=32)
    )
    features: str = field(default="sift", metadata=option("the local features", choices=FEATURES))
    matcher: str = field(default="nearest", metadata=option("how features are paired", choices=PAIRINGS))
    model: str = field(default="", metadata=option("network file (.onnx) of learned features"))
    matcher_model: str = field(default="", metadata=option("network file (.onnx) of a learned matcher"))

    def __post_init__(self) -> None:
        check_options(self, RefineError)

    @property
    def has_final_stage(self) -> bool:
        """Whether the loop's answer is refined further; the paper's ablations end with the loop."""
        return self.final != "none" and self.multiview and self.epipolar

    def perturb_translation(self, median_depth: float) -> float:
        """Deviation of the candidates' centres in scene units, where the median rendered depth is `median_depth`."""
        return self.perturb_translation_units or self.perturb_translation_ratio * median_depth
