"""A .blend made from what the command line found: the splat, and a camera with its photo for each result."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import bpy

from ...core.cameras.files import solved_lens
from ...core.cli.outcome import Outcome, has_camera
from ...core.errors import GssmcError
from ...core.geometry import conventions
from ...core.geometry.camera import Camera
from ...core.geometry.conventions import Orientation
from ...core.photos.photo import read_photo
from ...core.pose.report_json import report_to_dict
from ...core.splats import read_splats
from ...core.support.picture_names import stem_of
from ..camera import bridge as camera_bridge
from ..camera import record as camera_record
from ..camera import solution as camera_solution
from ..camera.record import SolvedCamera
from ..photo import camera as photo_camera
from ..photo import image as photo_image
from ..registration import camera_props
from ..splat import importer as splat_import
from ..splat import object as splat_object


def save(path: Path, outcome: Outcome, results: Path | None, orientation: Orientation | Literal["AUTO"]) -> None:
    """Saves a scene with the outcome at `path`; whatever is open in this Blender is dropped for it.

    `results`: the file of a batch, which holds the verdicts. Raises GssmcError when the scene cannot be saved.
    """
    if outcome.scene is None:
        raise GssmcError("This command reads no splat, so there is no scene to save; leave --blend out.")
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    splat_import.add_splat(bpy.context, outcome.scene.stem, read_splats(outcome.scene), orientation)
    photos: Sequence[Path | None] = outcome.photos or (None,) * len(outcome.cameras)
    masks: Sequence[Path | None] = outcome.masks or (None,) * len(outcome.cameras)
    verdicts = _verdicts(outcome, results)
    for camera, photo, mask, verdict in zip(outcome.cameras, photos, masks, verdicts, strict=True):
        obj = _add_camera(camera, photo, verdict)
        if mask:
            obj.data.gssmc.mask = bpy.data.images.load(str(mask.resolve()), check_existing=True)
    try:
        _make_photos_relative(path.resolve().parent)
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), relative_remap=False)
    except RuntimeError as error:
        raise GssmcError(f"The scene cannot be saved to '{path}'; check that its folder exists and can be written.") from error


def _make_photos_relative(folder: Path) -> None:
    """Makes paths relative, so that .blend and photos can be moved together; a photo on another drive keeps its full path."""
    for image in bpy.data.images:
        if image.source == "FILE" and image.filepath and not image.packed_file and Path(image.filepath).drive == folder.drive:
            image.filepath = bpy.path.relpath(image.filepath, start=str(folder))


def _verdicts(outcome: Outcome, results: Path | None) -> list[dict[str, Any]]:
    """What was said of each camera, as core.pose.report_json writes it; empty for cameras that were only drawn."""
    if outcome.reports:
        return [report_to_dict(report) for report in outcome.reports]
    if outcome.photos and results:
        frames: list[dict[str, Any]] = json.loads(results.read_text(encoding="utf-8"))["frames"]
        return [frame for frame in frames if has_camera(frame)]
    return [{} for _ in outcome.cameras]


def _add_camera(camera: Camera, photo_file: Path | None, verdict: dict[str, Any]) -> bpy.types.Object:
    """A camera object at the engine's camera, with its photo behind it where there is one that can be read."""
    scene = bpy.context.scene
    camera = camera.relative_to(splat_object.origin_of(scene.gssmc.splat))
    name = stem_of(camera.file) or "Camera"
    obj = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    scene.collection.objects.link(obj)
    first = scene.camera is None  # The first photo gives the render its shape; the others are fitted into it.
    try:
        photo = read_photo(photo_file) if photo_file else None
    except GssmcError:  # Only this photo failed in the batch, and its verdict says so.
        photo = None
    if photo and photo_file:
        image = photo_image.load_image(str(photo_file.resolve()), photo)
        loaded = photo_camera.LoadedPhoto(photo, image, camera)
        photo_camera.fit_camera(bpy.context, obj, loaded, set_resolution=first)
    else:
        scene.camera = obj
        lens = camera.intrinsics
        photo_camera.frame(scene, (lens.width, lens.height), allowed=first, pixel=conventions.pixel_shape(lens))
        camera_bridge.write_camera(scene, obj, scene.gssmc.splat, camera)
    if verdict:
        _keep_verdict(obj, camera, verdict)
    return obj


def _keep_verdict(obj: bpy.types.Object, camera: Camera, said: dict[str, Any]) -> None:
    """Keeps on the camera what the refinement said, as `report_to_dict` gives it."""
    scene, rounds = bpy.context.scene, len(said["iterations"])
    if said["verdict"] == "failed":
        camera_props.keep_verdict(obj.data, "failed", said["reasons"], rounds, said["seconds"])
        return
    solved = solved_lens(said) and not camera.focal_guessed
    state = "SOLVED" if solved else obj.data.gssmc.lens_state
    depth = (said.get("quality") or {}).get("median_depth") or 0.0
    reasons = tuple(said["reasons"])
    own = camera_record.own_part(said)
    solution = SolvedCamera(camera, said["verdict"], reasons, rounds, said["seconds"], state, depth, own=own)
    camera_solution.keep(scene, obj, scene.gssmc.splat, solution)
