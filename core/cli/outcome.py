"""What a subcommand hands back to whoever called it, so that a caller (such as Blender) can go on with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..geometry.camera import Camera
from ..geometry.pinhole_cut import WideCamera
from ..pose.report import RefineReport

OK, BAD_INPUT, FAILED_VERDICT, INTERRUPTED = 0, 2, 3, 130


@dataclass(frozen=True)
class Outcome:
    """The end of a subcommand.

    scene: the splat file, None for a command that needs none; cameras: the cameras drawn, or refined, in the order of the
    input; photos: their photo files, as many as cameras, or none for `render`, None where the camera is not that of the photo
    as it is, but of an undistorted cut; reports: of this run's single refinement, when
    there was one; masks: the masks' files, as many as photos, None where a photo has none.
    """

    exit_code: int
    scene: Path | None = None
    cameras: tuple[Camera, ...] = ()
    photos: tuple[Path | None, ...] = ()
    reports: tuple[RefineReport, ...] = ()
    masks: tuple[Path | None, ...] = ()


def shown(camera: Camera, photo: Path) -> tuple[Camera, Path | None]:
    """A refined camera and its photo for who knows pinholes alone: of a wide lens the cut's camera, and no photo."""
    if not isinstance(camera, WideCamera):
        return camera, photo
    return Camera(camera.intrinsics, camera.pose, camera.file), None


def has_camera(record: Mapping[str, Any]) -> bool:
    """Whether the record of a result holds a camera: a photo that was not found has no pose, one that nobody could read perhaps
    no lens. The outcome of a batch has the cameras of those that do.
    """
    return record["R"] is not None and "width" in record
