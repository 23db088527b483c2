"""Cameras that are known beside a scan: they saw what the splat was trained on, so that maps begin with them."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from pathlib import Path

from ..cameras import detect, inria, nerfstudio, read_usable
from ..cameras.files import load_json, start_from_dict
from ..cameras.training_world import FILE as WORLD_FILE
from ..cameras.training_world import read_training_world
from ..cameras.types import bad_note
from ..cameras.unplaced import is_unplaced
from ..errors import CameraError, DatasetError
from ..geometry.camera import Camera, Intrinsics, Pose

log = logging.getLogger(__name__)

# A view of the map is drawn with any lens that sees what the photo saw: about that of a phone.
USUAL = Intrinsics(640, 480, 320 / math.tan(math.radians(30)), 320 / math.tan(math.radians(30)), 320.0, 240.0)


def read_known(path: Path) -> list[Camera]:
    """The cameras at `path`, in any layout (of the training split, where there is one), in the splat file's coordinates.

    Results of a refinement count where they are trusted. The log tells of records that cannot be used, which are left out.
    Raises DatasetError or CameraError.
    """
    if detect(path) == "cameras":
        found, bad = _cameras(path)
    else:
        poses = read_usable(path, "train")
        found, bad = [(frame.name, frame.pose, frame.intrinsics) for frame in poses.frames], poses.bad
    for note in bad_note(bad, path.name):
        log.warning("%s", note)
    if not found:
        raise DatasetError(f"'{path}' holds no camera that is known; give cameras with poses, or trusted results.")
    return [Camera(lens or USUAL, pose, name) for name, pose, lens in found]


def cameras_beside(scan: Path) -> tuple[Path, list[Camera]] | None:
    """From where, and which cameras a training left beside the splat file `scan`, in its coordinates; the log says so as well.
    None where there are none, or what is there cannot be used, of which the log says why.

    Looked for are cameras.json, transforms.json (with dataparser_transforms.json, where that is there) and sparse/0 in the
    scan's folder and, for a scan in point_cloud/iteration_N, in the folder of the training.
    """
    folder = scan.absolute().parent
    folders = [folder]
    if folder.name.startswith("iteration_") and folder.parent.name == "point_cloud":
        folders.append(folder.parent.parent)
    for place in (folder / name for folder in folders for name in (inria.FILE, nerfstudio.FILE, "sparse/0")):
        layout = detect(place) if place.exists() else None
        if layout not in ("inria", "nerfstudio", "colmap"):
            continue
        try:
            found = read_known(place)
            if layout == "nerfstudio" and (world := place.with_name(WORLD_FILE)).is_file():
                similarity = read_training_world(world)
                found = [replace(camera, pose=similarity.pose_to_scene(camera.pose)) for camera in found]
        except (DatasetError, CameraError) as error:
            log.warning("The cameras in '%s' cannot be used: %s", place, error)
            continue
        log.info("known cameras read from '%s' (%d)", place, len(found))
        return place, found
    return None


def _cameras(path: Path) -> tuple[list[tuple[str, Pose, Intrinsics | None]], tuple[str, ...]]:
    """Name, pose and lens of our own JSON's cameras, but for those whose verdict is a doubt, and why others are left out."""
    data = load_json(path)
    records = data.get("frames", [data]) if isinstance(data, dict) else data
    if not isinstance(records, list):
        raise DatasetError(f"'{path.name}' has no list of cameras under \"frames\"; give at least one camera there.")
    out, bad = [], []
    for number, record in enumerate(records, 1):
        if is_unplaced(record) or (isinstance(record, dict) and record.get("verdict", "trusted") != "trusted"):
            continue
        try:
            start = start_from_dict(record, f"Camera {number} of '{path.name}'")
        except CameraError as error:
            bad.append(str(error))
            continue
        out.append((start.file, start.pose, start.intrinsics))
    if bad and not out:
        raise CameraError(bad[0])
    return out, tuple(bad)
