"""How far estimated poses are from true ones, as the field's own scripts measure it, and the table that says so.

Facts of the styles (which errors a threshold admits, which thresholds, what a missing query counts) are those of the public
evaluation code of hloc, MCLoc (mcloc_poseref), GS-CPR and STDLoc. All take the distance of the camera centres, the angle of
R_truth^T R, the plain median over a scene's queries, and the mean over scenes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal

import numpy as np

from ..errors import DatasetError
from ..geometry.camera import FloatArray, pose_error
from . import PoseSet, match_names, short


@dataclass(frozen=True)
class Threshold:
    """`translation` in the file's unit (metres, where it has them), `rotation_deg` in degrees."""

    name: str
    translation: float
    rotation_deg: float


@dataclass(frozen=True)
class Style:
    """`inclusive`: an error equal to the threshold is within it. `missing_deg`: the rotation error of a missing query, whose
    translation error is infinite.
    """

    thresholds: tuple[Threshold, ...]
    inclusive: bool = False
    missing_deg: float = math.inf


@dataclass(frozen=True)
class Scores:
    """One scene's figures, or the mean of several scenes' (n and missing are then sums).

    n: queries of the truth; missing: those without an estimate; translations in the file's unit; recall: per cent of the n
    queries within each threshold, by its name.
    """

    n: int
    missing: int
    median_translation: float
    mean_translation: float
    median_rotation_deg: float
    mean_rotation_deg: float
    recall: dict[str, float]


ALL_THRESHOLDS = {
    "1cm1": Threshold("1cm1", 0.01, 1),
    "2cm2": Threshold("2cm2", 0.02, 2),
    "3cm3": Threshold("3cm3", 0.03, 3),
    "5cm5": Threshold("5cm5", 0.05, 5),
    "10cm5": Threshold("10cm5", 0.10, 5),
    "25cm2": Threshold("25cm2", 0.25, 2),
    "50cm5": Threshold("50cm5", 0.50, 5),
    "2m5": Threshold("2m5", 2.0, 5),
    "5m10": Threshold("5m10", 5.0, 10),
    "10m15": Threshold("10m15", 10.0, 15),
}


def _thresholds(*names: str) -> tuple[Threshold, ...]:
    return tuple(ALL_THRESHOLDS[name] for name in names)


STYLES: dict[str, Style] = {
    "ours": Style(_thresholds("1cm1", "2cm2", "3cm3", "5cm5", "10cm5", "25cm2", "50cm5", "2m5", "5m10")),
    "hloc": Style(_thresholds("1cm1", "2cm2", "3cm3", "5cm5", "25cm2", "50cm5", "5m10"), missing_deg=180.0),
    "mcloc": Style(_thresholds("25cm2", "50cm5", "5m10", "10m15")),
    "gs-cpr": Style(_thresholds("1cm1", "2cm2", "5cm5", "10cm5")),
    "stdloc": Style(_thresholds("2cm2", "5cm5", "2m5", "5m10"), inclusive=True),
}


def pose_errors(truth: PoseSet, estimate: PoseSet) -> FloatArray:
    """(N, 2): distance of the centres (the file's unit) and angle (degrees) for each frame of the truth; inf where missing.

    Raises DatasetError when names are ambiguous, or when no estimate is of any frame of the truth.
    """
    found = match_names(truth.names, estimate.names, truth.source, estimate.source)
    if estimate.frames and all(match is None for match in found):
        a, b = short(truth.names[0]), short(estimate.names[0])
        raise DatasetError(f"No name of '{estimate.source}' ('{b}') is one of '{truth.source}' ('{a}'); give the same scene.")
    errors = [
        (math.inf, math.inf) if match is None else pose_error(estimate.frames[match].pose, frame.pose)
        for frame, match in zip(truth.frames, found, strict=True)
    ]
    values = np.array(errors, np.float64).reshape(-1, 2)
    return np.where(np.isfinite(values).all(axis=1, keepdims=True), values, math.inf)


def score(errors: FloatArray, style: Style) -> Scores:
    """The figures of one scene from its errors (N, 2), N >= 1, as `pose_errors` gives them."""
    missing = np.isinf(errors[:, 0])
    translation = errors[:, 0]
    rotation = np.where(missing, style.missing_deg, errors[:, 1])
    within = np.less_equal if style.inclusive else np.less
    hits = {t.name: within(translation, t.translation) & within(rotation, t.rotation_deg) for t in style.thresholds}
    return Scores(
        n=len(errors),
        missing=int(missing.sum()),
        median_translation=float(np.median(translation)),
        mean_translation=float(np.mean(translation)),
        median_rotation_deg=float(np.median(rotation)),
        mean_rotation_deg=float(np.mean(rotation)),
        recall={name: 100 * int(hit.sum()) / len(errors) for name, hit in hits.items()},
    )


def average(scores: Sequence[Scores]) -> Scores:
    """The mean over scenes of each figure, as papers average; n and missing are summed."""

    def mean(values: Sequence[float]) -> float:
        return math.fsum(values) / len(values)

    return Scores(
        n=sum(s.n for s in scores),
        missing=sum(s.missing for s in scores),
        median_translation=mean([s.median_translation for s in scores]),
        mean_translation=mean([s.mean_translation for s in scores]),
        median_rotation_deg=mean([s.median_rotation_deg for s in scores]),
        mean_rotation_deg=mean([s.mean_rotation_deg for s in scores]),
        recall={name: mean([s.recall[name] for s in scores]) for name in scores[0].recall},
    )


def table(rows: Sequence[tuple[str, Scores]], metric: bool) -> str:
    """A Markdown table of named scores; centimetres where the unit is the metre, else the file's own units."""
    unit = "cm" if metric else "units"
    recalls = [_threshold_title(ALL_THRESHOLDS[name], metric) for name in rows[0][1].recall]
    titles = ["scene", "n", "missing", f"median {unit} / deg", f"mean {unit} / deg", *recalls]
    lines = [titles, ["---"] * len(titles), *(_cells(name, scores, metric) for name, scores in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _cells(name: str, s: Scores, metric: bool) -> list[str]:
    median = f"{_length(s.median_translation, metric)} / {rounded(s.median_rotation_deg, 2)}"
    mean = f"{_length(s.mean_translation, metric)} / {rounded(s.mean_rotation_deg, 2)}"
    return [name, str(s.n), str(s.missing), median, mean, *(rounded(percent, 1) for percent in s.recall.values())]


def _threshold_title(threshold: Threshold, metric: bool) -> str:
    return threshold.name if metric else f"{threshold.translation:g} / {threshold.rotation_deg:g}"


def _length(value: float, metric: bool) -> str:
    return rounded(100 * value, 2) if metric else f"{value:.4g}"


def rounded(value: float, digits: int) -> str:
    """`value` with that many decimals, halves up as tables are read; the shortest decimal form of the double is what counts."""
    if not math.isfinite(value):
        return "inf"
    return str(Decimal(repr(round(value, 9))).quantize(Decimal(1).scaleb(-digits), ROUND_HALF_UP))
