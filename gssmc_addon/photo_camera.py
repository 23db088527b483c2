"""The camera of a photograph: made or taken, its lens from EXIF or a camera file, its frame the photo's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy

from ..core.camera import Camera
from ..core.camera_files import read_starts
from ..core.errors import CameraError
from ..core.lens_guess import guess_lens
from ..core.photo import Photo, check_size
from . import camera_bridge, camera_channels, photo_image, properties
from .texts import rpt_

DEFAULT_LENS_MM = 35.0  # on Blender's sensor of 36 mm, as DEFAULT_FOV_DEG of core.lens_guess
PHOTO_SENSOR_MM = 36.0  # the long side of "35 mm" film: Blender then shows the focal length photographers know


def find_camera(scene: bpy.types.Scene, path: str, photo: Photo) -> Camera:
    """The camera of the file that names this photo, or its only one.

    Raises CameraError when none names the photo or no splat can carry the pose, PhotoError when the shapes differ.
    """
    if not scene.gssmc.splat:
        raise CameraError(rpt_("The camera file's pose needs a splat to stand in; import the splat first."))
    camera_bridge.splat_similarity(scene.gssmc.splat)
    cameras = read_starts(Path(bpy.path.abspath(path)))
    name = Path(photo.file).name
    named = [c for c in cameras if Path(c.file).name == name]
    if not named and len(cameras) == 1:
        named = cameras
    if not named:
        raise CameraError(
            rpt_(
                'The camera file "{file}" has no camera for "{photo}"; add one whose "file" is that name.',
                file=Path(path).name,
                photo=name,
            )
        )
    camera = named[0].camera(guess_lens(photo).intrinsics)
    return replace(camera, intrinsics=check_size(photo, camera.intrinsics))


def choose_camera(context: bpy.types.Context, mode: str, photo_name: str) -> bpy.types.Object:
    """The camera object a photo goes to, by `mode`: AUTO, NEW or SCENE. Raises CameraError when there is none to take."""
    current = context.scene.camera
    usable = current is not None and current.type == "CAMERA"
    if mode == "SCENE" and not usable:
        raise CameraError(rpt_("The scene has no camera to take; choose New Camera."))
    view = _region_3d(context)
    free = usable and photo_image.camera_photo(current) is None and (view is None or view.view_perspective == "CAMERA")
    if mode == "SCENE" or (mode == "AUTO" and free):
        return current
    return new_camera(context, Path(photo_name).stem, view)


def new_camera(context: bpy.types.Context, name: str, view: bpy.types.RegionView3D | None) -> bpy.types.Object:
    """A new camera at the current view, or where the scene camera stands."""
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    current = context.scene.camera
    if view and view.view_perspective != "CAMERA":
        camera.matrix_world = view.view_matrix.inverted()
        camera.data.lens = context.area.spaces.active.lens
    elif current:
        camera.matrix_world = current.matrix_world.normalized()
        if current.type == "CAMERA":
            camera.data.lens = current.data.lens
    else:
        camera.data.lens = DEFAULT_LENS_MM
    context.scene.collection.objects.link(camera)
    return camera


def fit_camera(
    context: bpy.types.Context,
    camera: bpy.types.Object,
    photo: Photo,
    image: bpy.types.Image,
    given: Camera | None,
    set_resolution: bool,
) -> list[str]:
    """Gives the camera its photo, lens and, from a camera file, its pose. Sentences on what was found and set."""
    scene, data = context.scene, camera.data
    if given:
        camera_channels.check_writable(camera)
    scene.camera = camera
    notes = list(photo.notes)
    data.gssmc.photo = image  # its update shows it behind the camera
    notes += frame(scene, photo.width, photo.height, set_resolution)
    if given:
        camera_bridge.write_camera(scene, camera, scene.gssmc.splat, given)
        camera_channels.write_keyframes(scene, camera)
        guessed = rpt_("Pose and lens are those of the camera file (the lens is a guess).")
        notes.append(guessed if given.focal_guessed else rpt_("Pose and lens are those of the camera file."))
    else:
        data.gssmc.lens_calibrated = False
        notes.append(_lens_from_exif(scene, data, photo))
    properties.note_verdict(data, "none", (), 0, 0.0)
    return notes


def _lens_from_exif(scene: bpy.types.Scene, data: bpy.types.Camera, photo: Photo) -> str:
    if not photo.focal_35mm:
        render = scene.render
        data.gssmc.frame_x, data.gssmc.frame_y = render.resolution_x, render.resolution_y
        return rpt_(
            "The photo tells no focal length: Refine starts from the camera's ({lens:.3g} mm) and solves for it.",
            lens=data.lens,
        )
    data.type, data.sensor_fit, data.sensor_width = "PERSP", "AUTO", PHOTO_SENSOR_MM
    wanted = replace(guess_lens(photo).intrinsics, dist=camera_bridge.read_distortion(data))
    camera_bridge.write_intrinsics(scene, data, wanted)
    return rpt_("Lens {lens:.3g} mm from the photo's EXIF, a start that Refine improves.", lens=data.lens)


def frame(scene: bpy.types.Scene, width: int, height: int, allowed: bool) -> list[str]:
    """Gives the render the photo's resolution where its shape differs, if `allowed`. Sentences on what was done."""
    render = scene.render
    before = render.resolution_x, render.resolution_y
    if before[0] * height == before[1] * width or not allowed:
        return []
    render.resolution_x, render.resolution_y = width, height
    return [rpt_("The render resolution was {x} x {y} and is now the photo's.", x=before[0], y=before[1])]


def look_through(context: bpy.types.Context, camera: bpy.types.Object) -> None:
    """Selects the camera and turns the viewport to it."""
    for other in context.selected_objects:
        other.select_set(False)
    camera.select_set(True)
    context.view_layer.objects.active = camera
    view = _region_3d(context)
    if view:
        view.view_perspective = "CAMERA"


def _region_3d(context: bpy.types.Context) -> bpy.types.RegionView3D | None:
    area = context.area
    return area.spaces.active.region_3d if area and area.type == "VIEW_3D" else None


def find_view(context: bpy.types.Context) -> bpy.types.RegionView3D | None:
    """The view of the viewport that the mouse is in, else of the first one of any window."""
    areas = (area for window in context.window_manager.windows for area in window.screen.areas)
    first = next((area for area in areas if area.type == "VIEW_3D"), None)
    return _region_3d(context) or (first.spaces.active.region_3d if first else None)
