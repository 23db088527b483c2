"""The text of Report a Problem: versions, machine, scan, and the record of the last job that refined cameras.

It is pasted where everybody reads it. So no pictures, no poses, and no names nor paths, also none that a sentence quotes.
"""

from __future__ import annotations

import importlib
import json
import os
import platform
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy

from ...core.pose.report import RefineReport
from ...core.pose.report_json import report_to_dict
from ...core.render.memory import machine_bytes
from ..registration import preferences
from ..render_gpu import choice
from ..splat import object as splat_object

MODULES = ("numpy", "cv2", "scipy", "plyfile")
TOLD = ("width", "height", "verdict", "reasons", "details", "iterations", "seconds", "quality", "stage", "lens")  # of a report
TOLD_OF_ITERATION = ("views_used", "matches", "inliers", "rms_px_of_photo")
QUOTED = re.compile(r"\"[^\"\n]*\"|(?<!\w)'[^'\n]*'(?!\w)")  # Names and paths stand in quotes; an apostrophe does not open one.
PATHS = re.compile(r"\S*[\\/](?:.*[\\/])?\S*")  # Everything from the first path of a line to the last is removed.


class _Last:
    """The last job of this session that refined cameras: its name, and the reports that it filled in; never saved."""

    def __init__(self) -> None:
        self.job = ""
        self.reports: Mapping[Any, RefineReport] = {}


_last = _Last()


def begin(job: str, reports: Mapping[Any, RefineReport] | None = None) -> None:
    """A job begins: what was kept of the one before goes. `reports`: where it puts its reports, unless it `remember`s them."""
    _last.job, _last.reports = job, {} if reports is None else reports


def remember(report: RefineReport) -> None:
    """Keeps what a refinement found."""
    _last.reports = {**_last.reports, len(_last.reports): report}


def text(context: bpy.types.Context) -> str:
    """The report, to be pasted into an issue."""
    manifest = tomllib.loads((Path(__file__).parents[2] / "blender_manifest.toml").read_text(encoding="utf-8"))
    lines = [
        f"GS-SMC {manifest['version']}",
        f"Blender {bpy.app.version_string}, {bpy.app.build_platform.decode(errors='replace')}",
        f"Python {sys.version.split()[0]}, {platform.platform()}",
        *(f"{name} {_version(name)}" for name in MODULES),
        f"Processor: {os.cpu_count()} threads, {machine_bytes() / 1e9:.0f} GB of memory",
        f"Graphics: {_graphics()}",
        f"Views from the card: {_card(context)}",
        f"Splat: {_splat(context.scene)}",
        f"Last message: {without_names(context.window_manager.gssmc.message) or 'none'}",
        f"Last job: {_summary()}",
    ]
    if _last.reports:
        lines.append("Its last record: " + json.dumps(_record(list(_last.reports.values())[-1]), indent=1))
    return "\n".join(lines) + "\n"


def without_names(sentence: str) -> str:
    """The sentence with "..." for each quoted name, and for every path, quoted or not."""
    return PATHS.sub("...", QUOTED.sub('"..."', sentence))


def _version(name: str) -> str:
    try:
        return str(getattr(importlib.import_module(name), "__version__", "of unknown version"))
    except ImportError as error:
        return f"cannot be loaded ({without_names(str(error))})"


def _graphics() -> str:
    if bpy.app.background:
        return "none, in background mode"
    import gpu

    known = gpu.platform
    return f"{known.renderer_get()}, {known.vendor_get()}, {known.version_get()} ({known.backend_type_get()})"


def _card(context: bpy.types.Context) -> str:
    """Whether the graphics card may draw views, and what its test found."""
    wanted, test = preferences.renderer(context), choice.last_test()
    if test is None:
        return f"{wanted}, not tested"
    found = f"{wanted}, its test view {test.card_s:.3f} s, of one thread {test.thread_s:.3f} s"
    return f"{found}; {without_names(test.fault)}" if test.fault else found


def _splat(scene: bpy.types.Scene) -> str:
    splat = scene.gssmc.splat
    if not splat_object.is_splat(splat):
        return "none"
    bands, others = splat_object.sh_coefficients(splat), sum(splat_object.is_splat(o) for o in scene.objects if o != splat)
    contents = f"{len(splat.data.points):,} Gaussians, {bands} SH coefficients"
    return f"{contents}; {others} other splats in the scene" if others else contents


def _summary() -> str:
    """Describes the last job and its result."""
    if not _last.job:
        return "none in this session"
    counts = Counter(report.verdict for report in _last.reports.values())
    verdicts = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ("trusted", "check", "failed") if counts[verdict])
    return f"{_last.job}: {verdicts or 'no result'}"


def _record(report: RefineReport) -> dict[str, Any]:
    """A report in the words and figures that are told, which are listed: what is added to it elsewhere stays out."""
    whole = report_to_dict(report)
    record = {name: whole[name] for name in TOLD if name in whole}
    for sentences in ("reasons", "details"):
        record[sentences] = [without_names(sentence) for sentence in record[sentences]]
    if record["quality"]:
        record["quality"] = {name: value for name, value in record["quality"].items() if name != "pose"}
    record["lens"] = [f"{name} {number['state']}" for name, number in whole["lens"].items()]
    record["iterations"] = [{name: step[name] for name in TOLD_OF_ITERATION if name in step} for step in whole["iterations"]]
    return record
