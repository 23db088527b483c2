"""Options of a refinement. Command-line flags, Blender properties and tests all derive from this dataclass."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RefineSettings:
    """Every option of a refinement, with units in the names.

    iterations: most iterations of the loop; it stops early when the pose has settled.
    candidates: L, rendered views around the current pose besides the pose itself.
    seed: of every random draw; the same seed gives the same answer.
    multiview: the coarse multi-view consistency stage (paper: L_mvc); off = reference view only.
    epipolar: the fine epipolar stage.
    long_side_px: photo and renders are matched at this size of the long side.
    threads: CPU threads, 0 = all cores.
    """

    iterations: int = 4
    candidates: int = 6
    seed: int = 0
    multiview: bool = True
    epipolar: bool = True
    long_side_px: int = 640
    threads: int = 0
