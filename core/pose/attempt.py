"""One run of a refinement, and which of two is the better: where a doubt is left, others follow the first."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .final.solution import FittedCamera
from .report import EvidenceOf, PoseQuality, RefineProgress, Verdict
from .search.loop import LoopResult
from .verdict import sentences
from .verdict.verdict import Apart, sits_well

# Most further runs where a doubt is left, and the share of the progress that is done by then.
MORE_TRIES = 2
DONE = 0.97
# From the worst to the best.
VERDICTS: tuple[Verdict, ...] = ("failed", "check", "trusted")


@dataclass(frozen=True)
class Judgement:
    """The verdict with its words, and the evidence where a pose was found."""

    verdict: Verdict
    reasons: tuple[str, ...]
    details: tuple[str, ...] = ()
    quality: PoseQuality | None = None

    def is_of(self, pose: EvidenceOf) -> bool:
        """Whether there is evidence and it belongs to the pose named."""
        return self.quality is not None and self.quality.of == pose


@dataclass(frozen=True)
class Attempt:
    """One run of loop and last stage: the verdict on what it found, that itself, and what the loop came to."""

    judgement: Judgement
    solution: FittedCamera | None
    loop: LoopResult

    @property
    def merit(self) -> tuple[int, int]:
        """Greater for the better of two: by the verdict, then by how much of the photo the render sits on."""
        quality = self.judgement.quality
        return VERDICTS.index(self.judgement.verdict), quality.region_corners if quality else 0


def later(progress: RefineProgress, done: float) -> RefineProgress:
    """The progress of a further run, which begins when `done` (0..1) of the whole is."""
    return replace(progress, fraction=done + (1 - DONE) / MORE_TRIES * progress.fraction)


def better(best: Attempt, other: Attempt) -> tuple[Attempt, bool]:
    """The better of two runs, with what the other one came to among its details, and whether both found the same camera."""
    winner, loser = (other, best) if other.merit > best.merit else (best, other)
    judgement, quality, beaten = winner.judgement, winner.judgement.quality, loser.judgement.quality
    if quality is None or beaten is None:
        note, same = sentences.tried_in_vain(), False
    else:
        apart = Apart.of(quality, beaten)
        note, same = sentences.tried_again(apart.distance_pct, apart.degrees, apart.is_same), apart.is_same
        if not same and judgement.verdict != "failed" and sits_well(beaten):
            reasons = tuple(r for r in judgement.reasons if judgement.verdict == "check")
            judgement = replace(
                judgement, verdict="check", reasons=(sentences.two_places(apart.distance_pct, apart.degrees), *reasons)
            )
    return replace(winner, judgement=replace(judgement, details=(*judgement.details, note))), same
