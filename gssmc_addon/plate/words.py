"""What is said of a plate's frames: their numbers, and why they are not good."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from ...core.pose.report import RefineReport
from ..support.texts import rpt_

SHOWN_FRAMES = 12
FIGURES = re.compile(r"\d+(\.\d+)?")


def first_reason(report: RefineReport) -> str:
    return report.reasons[0] if report.reasons else rpt_("No camera was found.")


def by_sentence(frames: Mapping[int, str]) -> list[str]:
    """A line for each sentence with its frames. Sentences that differ in their figures alone share one, with the first's."""
    groups: dict[str, list[int]] = {}
    for frame in sorted(frames):
        groups.setdefault(FIGURES.sub("0", frames[frame]), []).append(frame)
    lines = []
    for same in groups.values():
        values = {"frames": frame_list(same), "first": same[0], "reason": frames[same[0]]}
        if len(same) == 1:
            lines.append(rpt_("Frame {frames}: {reason}", **values))
        elif len({frames[frame] for frame in same}) == 1:
            lines.append(rpt_("Frames {frames}: {reason}", **values))
        else:
            lines.append(rpt_("Frames {frames}, with the figures of {first}: {reason}", **values))
    return lines


def frame_list(frames: Iterable[int]) -> str:
    """The frames in words, the first dozen of them."""
    numbers = sorted(frames)
    shown = ", ".join(map(str, numbers[:SHOWN_FRAMES]))
    more = len(numbers) - SHOWN_FRAMES
    return rpt_("{frames} and {count} more", frames=shown, count=more) if more > 0 else shown
