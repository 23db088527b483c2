"""A batch worker: one process that holds the scene and refines the photos it is handed, one JSON line each.

A process of its own, because a damaged photo or model can end a process inside OpenCV, and that must cost one photo only.
The first line it gets is {"scene", "settings"}, answered by {"dropped": n} or {"error": sentence}; each further line is
{"camera", "photo", "mask"} (the last may be null), answered by the photo's record. It ends when its input does.
"""

from __future__ import annotations

import json
import sys
from io import BufferedIOBase
from pathlib import Path
from typing import Any

import cv2

from ..cameras.files import camera_from_dict
from ..errors import GssmcError
from ..pose.report_json import error_to_dict, report_to_dict
from ..pose.settings import RefineSettings
from ..processes.child import pipes
from ..render import Renderer, RenderSettings
from ..splats import read_splats
from .refine_one import refine_photo


def main() -> int:
    """Serve jobs from stdin on stdout."""
    jobs, answers = pipes()
    cv2.setNumThreads(1)
    first = json.loads(jobs.readline())
    try:
        scene = read_splats(first["scene"])
    except GssmcError as error:
        _answer(answers, {"error": str(error)})
        return 0
    renderer, settings = Renderer(scene, RenderSettings.for_scene(scene, threads=1)), RefineSettings(**first["settings"])
    _answer(answers, {"dropped": scene.dropped})
    del scene
    for line in jobs:
        job = json.loads(line)
        mask = Path(job["mask"]) if job.get("mask") else None
        _answer(answers, refine_record(renderer, settings, job["camera"], Path(job["photo"]), mask))
    return 0


def refine_record(
    renderer: Renderer, settings: RefineSettings, camera_dict: dict[str, Any], photo: Path, mask: Path | None = None
) -> dict[str, Any]:
    """The record of one photo; what cannot be used becomes a record that says so."""
    camera = camera_from_dict(camera_dict)
    try:
        return report_to_dict(refine_photo(renderer, photo, camera, settings, mask=mask))
    except GssmcError as error:
        return error_to_dict(camera, str(error))
    except MemoryError:
        return error_to_dict(camera, "The photo does not fit into memory beside the scan; use fewer --workers.")


def _answer(answers: BufferedIOBase, data: dict[str, Any]) -> None:
    answers.write(json.dumps(data).encode() + b"\n")
    answers.flush()


if __name__ == "__main__":
    sys.exit(main())
