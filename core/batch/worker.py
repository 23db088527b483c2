"""A batch worker: one process that holds the scene and refines the photos it is handed, one request each.

A process of its own, because a damaged photo or model can end a process inside OpenCV, and that must cost one photo only.
The first request is {"scene", "settings"}, answered by {"dropped": n} or {"error": sentence}; each further one is
{"camera", "photo", "mask"} (the last may be null), answered by the photo's record. It ends when its input does, at once.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2

from ..cameras.files import camera_from_dict
from ..errors import GssmcError
from ..pose.report_json import error_to_dict, report_to_dict
from ..pose.settings import RefineSettings
from ..processes.requests import Requests
from ..render import Renderer, RenderSettings
from ..splats import read_splats
from .refine_one import read_masked_photo, refine_photo


def main() -> int:
    """Serve requests from stdin on stdout."""
    requests = Requests()
    cv2.setNumThreads(1)
    first, _ = requests.next()
    try:
        scene = read_splats(first["scene"])
    except GssmcError as error:
        requests.answer({"error": str(error)})
        # No request comes, because whoever receives that answer ends this process.
        requests.next()
        return 0
    renderer, settings = Renderer(scene, RenderSettings.for_scene(scene, threads=1)), RefineSettings(**first["settings"])
    requests.answer({"dropped": scene.dropped})
    del scene
    while True:
        request, _ = requests.next()
        mask = Path(request["mask"]) if request.get("mask") else None
        requests.answer(refine_record(renderer, settings, request["camera"], Path(request["photo"]), mask))


def refine_record(
    renderer: Renderer, settings: RefineSettings, camera_dict: dict[str, Any], photo: Path, mask: Path | None = None
) -> dict[str, Any]:
    """The record of one photo; what cannot be used becomes a record that says so."""
    camera = camera_from_dict(camera_dict)
    try:
        return report_to_dict(refine_photo(renderer, read_masked_photo(photo, mask), camera, settings))
    except GssmcError as error:
        return error_to_dict(camera, str(error))
    except MemoryError:
        return error_to_dict(camera, "The photo does not fit into memory beside the scan; use fewer --workers.")


if __name__ == "__main__":
    sys.exit(main())
