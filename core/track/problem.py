"""A shot as a problem: what is known of its frames before they are solved together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..geometry.camera import Intrinsics, Pose
from ..pose.shared.lens import LensPrior
from .evidence import Evidence
from .focal import FocalChange

# The read-out takes this share of the time from frame to frame, give or take, before anything is matched.
READOUT_STD = 0.5


@dataclass(frozen=True, eq=False)
class Link:
    """What the corners followed from frame `a` to frame `b` know of the two cameras."""

    a: int
    b: int
    evidence: Evidence


@dataclass(frozen=True, eq=False)
class ShotProblem:
    """Poses found, evidence of each frame, and links, all with the lens `lens` of the matched pictures. `prior`: what is known
    of it; solve_lens, solve_readout: whether these are unknowns. `change`: how the focal length may change, None where it does
    not; `grow`: the logarithm by frame of the focal length of its evidence over that of `lens`; `anchors`: of the same, what
    is known of some frames as well as `prior` knows the lens. `pinned`: poses that are held as they are; `readout`: that which
    is held, where it is not solved for.
    """

    poses: Mapping[int, Pose]
    ties: Mapping[int, Evidence]
    links: Sequence[Link]
    lens: Intrinsics
    prior: LensPrior
    solve_lens: bool
    solve_readout: bool
    change: FocalChange | None = None
    grow: Mapping[int, float] = field(default_factory=dict)
    anchors: Mapping[int, float] = field(default_factory=dict)
    pinned: Mapping[int, Pose] = field(default_factory=dict)
    readout: float = 0.0

    def grow_of(self, frame: int) -> float:
        """That of the frame's evidence."""
        return self.grow.get(frame, 0.0)
