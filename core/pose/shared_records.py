"""The records of photos (`report_json`) after their lens was shared: camera, evidence, verdict and words of each anew.

A record that another lens changed keeps beneath "own" what the photo's own solution said instead, so that it can be had back
(`own_record`), and shared again with other photos, without refining.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..cameras.files import camera_from_dict, camera_to_dict
from ..errors import CameraError
from ..geometry.camera import Camera, Intrinsics
from ..support.words import counted
from .lens_report import focal_words, lens_sentence, shared_numbers
from .report import LensEvidence, LensNumber, PoseQuality, Verdict
from .report_json import VERDICTS, evidence_from_dict, lens_from_dict, lens_to_dict, quality_from_dict, quality_to_dict
from .shared_lens import SharedLens, SharedPhoto, share_lens
from .verdict.sentences import details, per_cent
from .verdict.verdict import judge

Record = dict[str, Any]
OWN = "own"
# A photo that its shared lens moves by more than this was judged as another camera than it is now.
MAX_MOVED_PCT = 1.0
MAX_MOVED_DEG = 1.0


@dataclass(frozen=True, eq=False)
class PhotoSolution:
    """What a photo's own record says, as far as sharing its lens needs it."""

    camera: Camera
    evidence: LensEvidence
    quality: PoseQuality
    verdict: Verdict
    reasons: tuple[str, ...]
    details: tuple[str, ...]
    lens: tuple[LensNumber, ...]

    @classmethod
    def of(cls, record: Record) -> PhotoSolution | None:
        """None for a photo that solved no lens, or was not placed: it takes no part."""
        known = evidence_from_dict(record.get("lens_evidence")) if takes_part(record) else None
        if known is None:
            return None
        try:
            quality, lens = quality_from_dict(record["quality"]), lens_from_dict(record["lens"])
            words = tuple(record["reasons"]), tuple(record["details"])
            return cls(camera_from_dict(record), known, quality, record["verdict"], *words, lens)
        except (CameraError, LookupError, TypeError, ValueError):
            return None

    def judged(self, quality: PoseQuality) -> tuple[Verdict, list[str]]:
        """The verdict on the evidence `quality` and its reasons. What else spoke against the photo, or was said, stays."""
        verdict, reasons = judge(self.quality)
        by_evidence = [*reasons, lens_sentence(self.lens, self.camera.intrinsics)]
        known = [reason in by_evidence for reason in self.reasons]
        first = known.index(True) if True in known else len(known)
        # What comes before the evidence's own reasons made the verdict: the photo fits another place as well, say.
        before, others = self.reasons[:first], [r for r, is_known in zip(self.reasons, known, strict=True) if not is_known]
        anew, said = judge(quality)
        doubted: Verdict = "check" if before or self.verdict != verdict else "trusted"
        after = [reason for reason in others if reason not in before]
        return max(anew, doubted, key=VERDICTS.index), [*before, *(said if anew != "trusted" or not before else ()), *after]

    def worded(self, quality: PoseQuality) -> list[str]:
        """The details of the evidence `quality`, and what the photo's own ones say beyond the evidence's."""
        return [*details(quality), *(detail for detail in self.details if detail not in details(self.quality))]


@dataclass(frozen=True, eq=False)
class SharedRecords:
    """The lens that photos share, how many do, and the records that it changed, by their index among those that were given;
    `left`: the indices of photos that keep a lens of their own.
    """

    lens: Intrinsics
    numbers: tuple[LensNumber, ...]
    count: int
    records: dict[int, Record]
    left: tuple[int, ...]

    @property
    def focal(self) -> str:
        """The focal length in words."""
        return f"focal length {focal_words(self.numbers[0], self.lens)}"


def takes_part(record: Record) -> bool:
    """Whether the photo was placed, and its lens solved for, so that it can share it."""
    return isinstance(record.get("lens_evidence"), dict) and record.get("verdict") in VERDICTS[:2]


def own_record(record: Record) -> Record:
    """The record as the photo's own solution left it, in the same order."""
    own = record.get(OWN)
    own = own if isinstance(own, dict) else {}
    return {name: own.get(name, value) for name, value in record.items() if name != OWN}


def share_records(records: Sequence[Record], name: str) -> SharedRecords | None:
    """The photos' own records under the lens that the most of them agree on; None where no two do. Photos that take no part
    (see `PhotoSolution`) are left as they are. `name`: what the photos have in common, as in "the other photos of NAME".
    """
    found = {i: solution for i, record in enumerate(records) if (solution := PhotoSolution.of(record)) is not None}
    members = list(found)
    shared = share_lens([found[i].camera for i in members], [found[i].evidence for i in members])
    if shared is None:
        return None
    numbers = shared_numbers(shared.intrinsics, shared.std)
    changed: dict[int, Record] = {}
    for place, i in enumerate(members):
        if place in shared.photos:
            changes = _changes(found[i], shared, shared.photos[place], numbers)
        else:
            sentence = f"Its lens is not that of the other photos of {name}, so it keeps its own."
            changes = {"reasons": [*found[i].reasons, sentence]}
        changed[i] = _with_own(records[i], changes)
    left = tuple(members[place] for place in shared.others)
    return SharedRecords(shared.intrinsics, numbers, len(shared.photos), changed, left)


def _with_own(record: Record, changes: Record) -> Record:
    return {**record, **changes, OWN: {name: record[name] for name in changes}}


def _changes(own: PhotoSolution, shared: SharedLens, photo: SharedPhoto, numbers: tuple[LensNumber, ...]) -> Record:
    """What the shared lens makes of a photo's record."""
    depth = own.quality.median_depth
    quality = replace(
        own.quality,
        pose=photo.camera.pose,
        translation_std_pct=100 * photo.translation_std_units / depth,
        rotation_std_deg=photo.rotation_std_deg,
        focal_std_pct=100 * float(shared.std[0]),
    )
    verdict, reasons = own.judged(quality)
    moved_pct = 100 * photo.moved_units / depth
    if moved_pct > MAX_MOVED_PCT or photo.moved_deg > MAX_MOVED_DEG:
        verdict = "check"
        reasons.insert(0, _moved_far(moved_pct, photo.moved_deg))
    camera = camera_to_dict(photo.camera)
    kept = ("file", "width", "height", "focal_guessed")
    return {
        **{name: value for name, value in camera.items() if name not in kept},
        "verdict": verdict,
        "reasons": [
            *reasons,
            _shared_with(len(shared.photos) - 1, f"focal length {focal_words(numbers[0], shared.intrinsics)}"),
        ],
        "details": own.worded(quality),
        "quality": quality_to_dict(quality),
        "lens": lens_to_dict(numbers),
    }


def _moved_far(moved_pct: float, moved_deg: float) -> str:
    return (
        f"The lens that it shares puts the camera {per_cent(moved_pct)} of the distance to the scene and {moved_deg:.2f} "
        "degrees from where the photo alone put it; compare photo and splat by eye."
    )


def _shared_with(others: int, focal: str) -> str:
    return f"Its lens is shared with {counted(others, 'other photo')}: {focal}."
