"""The text of Report a Problem: versions, and the record of the last refinement. No paths, no pictures."""

from __future__ import annotations

import importlib
import json
import platform
import sys
import tomllib
from pathlib import Path
from typing import Any

import bpy

from ...core.pose.report import RefineReport
from ...core.pose.report_json import report_to_dict

MODULES = ("numpy", "cv2", "scipy", "plyfile")
LEFT_OUT = ("file", "R", "t", "start", "pose")
_last: dict[str, Any] = {}  # of this session; never saved


def remember(report: RefineReport) -> None:
    """Keeps what the last refinement found, without names and poses."""
    _last.clear()
    _last.update(_without_poses(report_to_dict(report)))


def _without_poses(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_poses(item) for key, item in value.items() if key not in LEFT_OUT}
    return [_without_poses(item) for item in value] if isinstance(value, list) else value


def text(context: bpy.types.Context) -> str:
    """The report, to be pasted into an issue."""
    manifest = tomllib.loads((Path(__file__).parents[2] / "blender_manifest.toml").read_text(encoding="utf-8"))
    lines = [
        f"GS-SMC {manifest['version']}",
        f"Blender {bpy.app.version_string}, {bpy.app.build_platform.decode(errors='replace')}",
        f"Python {sys.version.split()[0]}, {platform.platform()}",
        *(f"{name} {_version(name)}" for name in MODULES),
        f"Last message: {context.window_manager.gssmc.message or 'none'}",
        "Last refinement: " + (json.dumps(_last, indent=1) if _last else "none in this session"),
    ]
    return "\n".join(lines) + "\n"


def _version(name: str) -> str:
    try:
        return str(getattr(importlib.import_module(name), "__version__", "of unknown version"))
    except ImportError as error:
        return f"cannot be loaded ({error})"
