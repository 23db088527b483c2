"""Exports cameras to files of other programs, in the coordinates of the splat file. camera.import_job imports them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ...core.cameras import colmap, nerfstudio
from ...core.cameras.animated import chan
from ...core.cameras.files import camera_to_dict
from ...core.cameras.training_world import read_training_world
from ...core.errors import CameraError, DatasetError
from ...core.geometry.camera import Camera
from ...core.geometry.turned_photo import stored_camera
from ...core.support.atomic import atomic_write
from ..photo import image as photo_image
from ..plate import source as plate_source
from ..splat import axes as splat_axes
from ..splat import object as splat_object
from ..support.texts import rpt_
from . import bridge as camera_bridge
from . import channels as camera_channels
from . import solution as camera_solution

NAMED = 5  # cameras that a message names


@dataclass(frozen=True)
class Outgoing:
    """A camera on its way out, at its photo's own size; `said`: what a camera JSON tells besides.

    `name`: the camera object's; `verdict` as in camera_props, or CHANGED. `movie_frame`: of a photo that is no file of its own.
    `orientation`: EXIF's, of the photo's file. `scene_frame`: the frame of the scene, of a plate.
    """

    name: str
    camera: Camera
    verdict: str
    said: dict[str, Any]
    movie_frame: int | None = None
    orientation: int = 1
    scene_frame: int | None = None


@dataclass(frozen=True)
class _Picture:
    """A photo that a camera took: name and upright size of its file, which of a movie holds more than one."""

    file: str
    size: tuple[int, int]
    movie_frame: int | None = None
    orientation: int = 1


def collect(scene: bpy.types.Scene, objects: Sequence[bpy.types.Object]) -> list[Outgoing]:
    """What there is to export of each object: one camera, or one for each keyframe of a moving plate.

    Raises GssmcError, naming the camera. The scene ends at the frame where it was.
    """
    if not objects:
        raise CameraError(rpt_("There is no camera to export; select one, or add a photo first."))
    outgoing: list[Outgoing] = []
    for obj in objects:
        plate = plate_source.moving_photo(obj)
        outgoing += _plate_cameras(scene, obj, plate) if plate else [_camera(scene, obj, _still(scene, obj))]
    names = Counter((item.camera.file, item.movie_frame) for item in outgoing)
    twice = next((file for (file, _), count in names.items() if count > 1), None)
    if twice:
        raise DatasetError(
            rpt_(
                'Two cameras have the photo "{photo}", by whose name files tell cameras apart; export one of them.', photo=twice
            )
        )
    return outgoing


def out_of_training_world(outgoing: Sequence[Outgoing], file: Path) -> list[Outgoing]:
    """The cameras in the world of the transforms.json that the splat was trained from. Raises GssmcError."""
    world = read_training_world(file).inverse()
    return [replace(item, camera=replace(item.camera, pose=world.pose_to_scene(item.camera.pose))) for item in outgoing]


def into_training_axes(outgoing: Sequence[Outgoing], splat: bpy.types.Object) -> list[Outgoing]:
    """The cameras with the axes of the splat's training, y down."""
    turned = splat_axes.of(splat).into_training_world([item.camera for item in outgoing])
    return [replace(item, camera=camera) for item, camera in zip(outgoing, turned, strict=True)]


def write(path: Path, kind: str, outgoing: Sequence[Outgoing]) -> list[str]:
    """Writes the cameras: COLMAP into the folder `path`, the others as the file `path`. Raises GssmcError.

    All but JSON cannot tell a verdict: there cameras that failed are left out. Sentences on that. The cameras of COLMAP and
    nerfstudio belong to the photos as they are stored, before EXIF turns them.
    """
    if kind == "CHAN":
        return _write_chan(path, outgoing)
    usable = list(outgoing) if kind == "JSON" else _solved(outgoing)
    cameras = [stored_camera(item.camera, item.orientation) for item in usable]
    try:
        if kind == "COLMAP":
            path.mkdir(parents=True, exist_ok=True)
            colmap.write_model(path, cameras)
        elif kind == "NERFSTUDIO":
            nerfstudio.write_transforms(path, cameras)
        else:
            with atomic_write(path) as file:
                json.dump({"frames": [_record(item) for item in usable]}, file, indent=1)
    except OSError as error:
        text = rpt_("'{path}' cannot be written ({reason}); choose another place.", path=path, reason=error.strerror)
        raise DatasetError(text) from error
    if len(usable) == 1:
        done = rpt_("1 camera was written to '{path}'.", path=path)
    else:
        done = rpt_("{count} cameras were written to '{path}'.", count=len(usable), path=path)
    return [done, *_remarks(outgoing, usable)]


def _write_chan(path: Path, outgoing: Sequence[Outgoing]) -> list[str]:
    """Writes the one plate's cameras for Nuke, at the frames of the scene."""
    frames = [(item.scene_frame, item.camera) for item in outgoing if item.scene_frame is not None]
    if len(frames) < len(outgoing) or len({item.name for item in outgoing}) != 1:
        raise DatasetError(rpt_("A .chan file holds one camera that moves; select the camera of one tracked plate."))
    cameras = [camera for _, camera in frames]
    try:
        chan.write_chan(path, [(frame, camera) for frame, camera in frames if frame is not None])
    except OSError as error:
        text = rpt_("'{path}' cannot be written ({reason}); choose another place.", path=path, reason=error.strerror)
        raise DatasetError(text) from error
    lost = chan.lacking(cameras)
    done = rpt_("{count} cameras were written to '{path}'.", count=len(cameras), path=path)
    return [done, *([lost] if lost else []), *_remarks(outgoing, list(outgoing))]


def _solved(outgoing: Sequence[Outgoing]) -> list[Outgoing]:
    """The cameras that did not fail. Raises DatasetError when none is left, or one shows a movie."""
    usable = [item for item in outgoing if item.verdict != "FAILED"]
    if not usable:
        raise DatasetError(rpt_("Every camera failed to be solved; refine them again, or export camera JSON."))
    movie = next((item for item in usable if item.movie_frame is not None), None)
    if movie:
        raise DatasetError(
            rpt_(
                'The camera "{name}" shows a movie, whose frames are no files that this format could name; '
                "export camera JSON, or use the plate as an image sequence.",
                name=movie.name,
            )
        )
    return usable


def _remarks(outgoing: Sequence[Outgoing], usable: Sequence[Outgoing]) -> Iterator[str]:
    left_out = [item for item in outgoing if item.verdict == "FAILED" and item not in usable]
    if left_out:
        values = {"count": len(left_out), "names": _names(left_out)}
        yield rpt_("{count} that failed to be solved were left out: {names}.", **values)
    changed = [item for item in usable if item.verdict == camera_solution.CHANGED]
    if changed:
        values = {"count": len(changed), "names": _names(changed)}
        yield rpt_("{count} are no longer as they were solved: {names}.", **values)


def _names(items: Sequence[Outgoing]) -> str:
    names = list(dict.fromkeys(item.name for item in items))
    shown, more = ", ".join(names[:NAMED]), len(names) - NAMED
    return rpt_("{names} and {count} more", names=shown, count=more) if more > 0 else shown


def _still(scene: bpy.types.Scene, obj: bpy.types.Object) -> _Picture:
    """The photo's own file and size, which Blender's copy may be turned from, or smaller than; else a render."""
    image = photo_image.camera_photo(obj)
    if image is None:
        return _Picture(f"{obj.name}.png", camera_bridge.lens_frame(scene, obj.data))
    size = photo_image.own_size(obj.data)
    if not all(size):
        raise CameraError(
            rpt_('The photo of the camera "{name}" cannot be read, so its size is not known; add it again.', name=obj.name)
        )
    file = photo_image.photo_file(image).replace("\\", "/")
    return _Picture(Path(file).name or image.name, size, orientation=photo_image.orientation_in_file(image))


def _plate_cameras(scene: bpy.types.Scene, obj: bpy.types.Object, plate: plate_source.MovingPhoto) -> list[Outgoing]:
    """A camera for each frame of the plate that has a key, the present one where none has."""
    first, last = plate.scene_range
    frames = [frame for frame in camera_channels.key_frames(obj) if first <= frame <= last]
    at, data = (scene.frame_current, scene.frame_subframe), obj.data
    if not frames:
        return [_camera(scene, obj, _plate_picture(obj, plate, scene.frame_current))]
    unkeyed = obj.matrix_basis.copy(), data.lens, data.shift_x, data.shift_y
    outgoing = []
    try:
        for frame in frames:
            scene.frame_set(frame)  # A parent or the splat may be animated.
            item = _camera(scene, obj, _plate_picture(obj, plate, frame))
            outgoing.append(replace(item, scene_frame=frame))
    finally:
        scene.frame_set(at[0], subframe=at[1])
        obj.matrix_basis, data.lens, data.shift_x, data.shift_y = unkeyed
    return outgoing


def _plate_picture(obj: bpy.types.Object, plate: plate_source.MovingPhoto, frame: int) -> _Picture:
    number, size = frame + plate.offset, photo_image.own_size(obj.data)
    if not all(size):
        photo = plate.frame_at(frame).read()
        size = photo.width, photo.height
    return _Picture(plate.plate.file(number).name, size, number if plate.plate.is_movie else None)


def _camera(scene: bpy.types.Scene, obj: bpy.types.Object, picture: _Picture) -> Outgoing:
    splat = scene.gssmc.splat
    near = camera_bridge.read_camera(scene, obj, splat).at_size(*picture.size)
    camera = near.relative_to([-value for value in splat_object.origin_of(splat)])
    verdict, props = camera_solution.verdict(scene, obj), obj.data.gssmc
    said: dict[str, Any] = {"lens_state": props.lens_state.lower()}
    if verdict != "NONE":
        changed = [f"{camera_solution.title(scene, obj)}."] if verdict == camera_solution.CHANGED else []
        said |= {"verdict": verdict.lower(), "reasons": changed + props.reasons.splitlines()}
    return Outgoing(obj.name, replace(camera, file=picture.file), verdict, said, picture.movie_frame, picture.orientation)


def _record(item: Outgoing) -> dict[str, object]:
    frame = {} if item.movie_frame is None else {"frame": item.movie_frame}
    return {**camera_to_dict(item.camera), **frame, **item.said}
