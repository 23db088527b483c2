"""`evaluate --truth FILE_OR_DIR --estimate FILE`: how far estimated poses are from true ones."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from ...cameras import PoseSet, Split
from ...cameras.evaluate import STYLES, Scores, average, pose_errors, score, table
from ...support.words import counted
from ..console import message, say
from ..outcome import OK, Outcome
from ..scenes import Scene, find_scenes, poses_of

AVERAGE = "average"
START = "start"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("evaluate", help="compare poses with the true ones: median errors and recall")
    what = "camera JSON, COLMAP, pose list, 7-Scenes, Cambridge, nerfstudio"
    parser.add_argument("--truth", type=Path, required=True, metavar="PATH", help=f"true poses, or a folder of scenes ({what})")
    parser.add_argument("--estimate", type=Path, required=True, metavar="PATH", help="estimated poses, in any of these layouts")
    parser.add_argument("--start", type=Path, metavar="PATH", help="also show the errors of the starts, to see what was gained")
    parser.add_argument("--style", choices=list(STYLES), default="ours", help="thresholds and rules of that project (ours)")
    parser.add_argument("--split", choices=get_args(Split), default="test", help="which frames of 7-Scenes or Cambridge")
    parser.add_argument("--unit", choices=("auto", "m", "scene"), default="auto", help="the truth's unit, for printing (auto)")
    parser.add_argument("--json", action="store_true", help="print JSON, translations in the files' unit, infinity as null")
    return parser


def run(args: argparse.Namespace) -> Outcome:
    scenes = find_scenes(args.truth, args.split)
    scores = _scores(scenes, args.estimate, args)
    starts = _scores(scenes, args.start, args) if args.start is not None else None
    metric = args.unit == "m" or (args.unit == "auto" and all(scene.truth.metric for scene in scenes))
    if args.json:
        say(json.dumps(_report(scores, starts)))
        return Outcome(OK)
    rows = []
    for name, mine in _with_average(scores).items():
        if starts is not None:
            rows.append((f"{name}, {START}", _with_average(starts)[name]))
        rows.append((name, mine))
    say(table(rows, metric))
    return Outcome(OK)


def _scores(scenes: list[Scene], path: Path, args: argparse.Namespace) -> dict[str, Scores]:
    """Scene name to its scores, in the order of the scenes."""
    poses = poses_of(path, scenes, args.split)
    out = {}
    for scene in scenes:
        estimate = poses(scene)
        out[scene.name] = score(pose_errors(scene.truth, estimate), STYLES[args.style])
        _say_left_out(scene, estimate, out[scene.name])
    return out


def _say_left_out(scene: Scene, estimate: PoseSet, scores: Scores) -> None:
    if scores.missing:
        missing = f"{scores.missing} of {counted(scores.n, 'photo')} of '{scene.name}'"
        message(f"'{estimate.source}' lacks {missing}, and counts as infinitely wrong there.")
    beside = len(estimate.frames) - (scores.n - scores.missing)
    if beside:
        poses = f"{beside} of {counted(len(estimate.frames), 'pose')} in '{estimate.source}'"
        message(f"'{scene.name}' has no photo for {poses}, which {'does' if beside == 1 else 'do'} not count.")


def _with_average(scores: dict[str, Scores]) -> dict[str, Scores]:
    """A last row for several scenes."""
    return scores if len(scores) == 1 else {**scores, AVERAGE: average(list(scores.values()))}


def _report(scores: dict[str, Scores], starts: dict[str, Scores] | None) -> dict[str, Any]:
    """The average's figures, with each scene's under "scenes" where there are several, and the starts' under "start"."""
    report: dict[str, Any] = asdict(average(list(scores.values())))
    if len(scores) > 1:
        report["scenes"] = {name: asdict(each) for name, each in scores.items()}
    if starts is not None:
        report[START] = _report(starts, None)
    cleaned: dict[str, Any] = _finite(report)
    return cleaned


def _finite(value: Any) -> Any:
    """JSON has no infinity."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
