"""A batch worker: one process that holds the scene and refines the photos it is handed, one request each.

A process of its own, because a damaged photo or model can end a process inside OpenCV, and that must cost one photo only.
The first request is {"scene", "digest", "settings", "axes", "map", "key"}, answered by {"dropped": n} or {"error": sentence};
"digest" is that of the scan which the answers will stand for (`keys.scan_file_digest`). Each request after that is {"camera",
"photo", "mask"} (the last may be null), answered by the photo's record. With a "map", a file that has the map of that "key",
photos are found without their start; without one they are refined from it. It ends when its input does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2

from ..cameras.files import camera_from_dict
from ..cameras.training_world import ScanAxes
from ..cameras.unplaced import Unplaced, wanted_from_dict
from ..errors import GssmcError
from ..geometry.camera import Camera
from ..locate import LandmarkMap, find_camera, read_map
from ..pose.report_json import error_to_dict, report_to_dict
from ..pose.settings import RefineSettings
from ..processes.requests import Requests
from ..render import Renderer
from ..render.scan.opening import open_scan
from .find_one import find_target, found_to_dict, whole_found
from .keys import check_unchanged
from .place import into_file, starts_in_scene
from .refine_one import read_masked_photo, refine_starts

Record = dict[str, Any]
Starts = Sequence[tuple[Camera, str]]


def main() -> int:
    """Serve requests from stdin on stdout."""
    requests = Requests()
    cv2.setNumThreads(1)
    first, _ = requests.next()
    try:
        scan = open_scan(Path(first["scene"]))
        check_unchanged(Path(first["scene"]), first["digest"])
        landmarks = read_map(first["map"], first["key"]) if first.get("map") else None
    except GssmcError as error:
        requests.answer({"error": str(error)})
        # No request comes, because whoever receives that answer ends this process.
        requests.next()
        return 0
    renderer, settings = Renderer(scan.tables, scan.settings(threads=1)), RefineSettings(**first["settings"])
    requests.answer({"dropped": scan.sample.dropped})
    origin, scan_axes, axes = scan.sample.origin, ScanAxes.of(scan.sample), first.get("axes", "auto")
    while True:
        job, _ = requests.next()
        mask = Path(job["mask"]) if job.get("mask") else None
        if landmarks is None:
            starts = starts_in_scene(camera_from_dict(job["camera"]), scan_axes, axes, origin)
            record = refine_record(renderer, settings, starts, Path(job["photo"]), mask)
        else:
            record = RecordFinder(renderer, settings, landmarks).record(job["camera"], Path(job["photo"]), mask)
        requests.answer(into_file(record, origin))


def refine_record(
    renderer: Renderer, settings: RefineSettings, starts: Starts, photo: Path, mask: Path | None = None
) -> Record:
    """The record of one photo; what cannot be used becomes a record that says so."""
    return _guarded(
        starts[0][0], lambda: report_to_dict(refine_starts(renderer, read_masked_photo(photo, mask), starts, settings))
    )


class RecordFinder:
    """Finds photos in one scan by one map."""

    def __init__(self, renderer: Renderer, settings: RefineSettings, landmarks: LandmarkMap) -> None:
        self._renderer, self._settings, self._landmarks = renderer, settings, landmarks

    def record(self, camera_dict: Record, photo: Path, mask: Path | None = None) -> Record:
        """The record of one photo, whose pose in `camera_dict` plays no part; what cannot be used becomes a record that says
        so.
        """
        given = wanted_from_dict(camera_dict)
        wanted = given if isinstance(given, Unplaced) else Unplaced.of(given)
        return _guarded(wanted, lambda: self._found(wanted, photo, mask))

    def _found(self, wanted: Unplaced, photo: Path, mask: Path | None) -> Record:
        picture = read_masked_photo(photo, mask)
        found = find_camera(self._renderer, find_target(picture, wanted), self._landmarks, self._settings)
        return found_to_dict(whole_found(picture, found, wanted), wanted)


def _guarded(wanted: Camera | Unplaced, work: Callable[[], Record]) -> Record:
    try:
        return work()
    except GssmcError as error:
        return error_to_dict(wanted, str(error))
    except MemoryError:
        return error_to_dict(wanted, "The photo does not fit into memory beside the scan; use fewer --workers.")


if __name__ == "__main__":
    sys.exit(main())
