"""The camera of a photograph: made or taken, its lens from EXIF or a camera file, its frame the photo's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.cameras import camera_file
from ...core.cameras.unplaced import Unplaced
from ...core.errors import CameraError
from ...core.geometry import conventions
from ...core.geometry.camera import Camera, Intrinsics, Pose
from ...core.geometry.pinhole_cut import WideCamera
from ...core.photos.fit import fit_camera as fit_to_photo
from ...core.photos.fit import fit_lens, fit_wide, fit_wide_camera
from ...core.photos.lens_guess import guess_lens
from ...core.photos.photo import Photo
from ...core.photos.wide.cut import central_photo
from ..camera import bridge as camera_bridge
from ..camera import channels as camera_channels
from ..camera import frame as camera_frame
from ..registration import camera_props
from ..splat import object as splat_object
from ..support.texts import rpt_
from . import image as photo_image

DEFAULT_LENS_MM = 35.0  # The same angle as DEFAULT_FOV_DEG of core.photos.lens_guess, on Blender's sensor of 36 mm.
PHOTO_SENSOR_MM = 36.0  # the long side of "35 mm" film: Blender then shows the focal length photographers know


@dataclass(frozen=True)
class ViewportView:
    """A 3D viewport: its `region` (RegionView3D), lens (mm, as the viewport takes it) and size in pixels."""

    region: bpy.types.RegionView3D
    lens: float
    size: tuple[int, int]

    @property
    def is_free(self) -> bool:
        """Whether the view does not look through a camera."""
        return self.region.view_perspective != "CAMERA"


def find_camera(scene: bpy.types.Scene, path: str, photo: Photo, may_cut: bool = False) -> Camera | Unplaced:
    """The camera that the file has for this photo, or its lens where there is no pose, by the same rules as on the command
    line, in the splat object's coordinates.

    `may_cut`: the photo can be cut (`cut_photo`), so that a wide lens is handed on. Raises CameraError when none or several
    name the photo or no splat can carry the pose, PhotoError when the shapes differ, or a wide lens may not be cut.
    """
    wanted = camera_file(Path(bpy.path.abspath(path))).record_of(photo.file, Path(path).name)
    if isinstance(wanted, Unplaced):
        return _unplaced(photo, wanted, may_cut)
    if not scene.gssmc.splat:
        raise CameraError(rpt_("The camera file's pose needs a splat to stand in; import the splat first."))
    camera_bridge.splat_similarity(scene.gssmc.splat)
    given = wanted.camera(guess_lens(photo).intrinsics, photo.orientation)
    if may_cut and isinstance(given, WideCamera):
        found: Camera = fit_wide_camera(photo, given)
    else:
        found = fit_to_photo(photo, given)
    return found.relative_to(splat_object.origin_of(scene.gssmc.splat))


def _unplaced(photo: Photo, wanted: Unplaced, may_cut: bool) -> Unplaced:
    """What the file knows of a camera without a pose, in the photo's upright pixels. Raises as `find_camera`."""
    if wanted.wide is not None:
        wide = fit_wide(photo, wanted.wide, wanted.pixel_order)
        if not may_cut:
            fit_to_photo(photo, WideCamera.of(wide, Pose()))
        return replace(wanted, wide=wide, pixel_order="upright")
    lens = wanted.intrinsics and fit_lens(photo, wanted.intrinsics, wanted.pixel_order)
    return replace(wanted, intrinsics=lens, pixel_order="upright")


def cut_photo(photo: Photo, given: Camera | Unplaced | None) -> tuple[Photo, Camera | Unplaced | None]:
    """A photo of a wide lens as the pinhole picture of its middle, with the camera of that; any other as it is.

    Raises PhotoError of a panorama.
    """
    lens = given.lens if isinstance(given, WideCamera) else given.wide if isinstance(given, Unplaced) else None
    if given is None or lens is None:
        return photo, given
    made = central_photo(photo, lens)
    k = made.cut.intrinsics
    if isinstance(given, Unplaced):
        return made.photo, replace(given, intrinsics=k, wide=None)
    return made.photo, Camera(k, given.pose, given.file)


CAMERA_ITEMS = (
    (
        "AUTO",
        "Automatic",
        "The scene camera while it has no photo and you look through it, else a new camera at the current view",
    ),
    ("NEW", "New Camera", "A new camera at the current view"),
    ("SCENE", "Scene Camera", "The scene camera, where it stands"),
)


def choose_camera(context: bpy.types.Context, mode: str, photo_name: str, photo: Photo) -> bpy.types.Object:
    """The camera object a photo goes to, by `mode`: AUTO, NEW or SCENE. Raises CameraError when there is none to take."""
    current = context.scene.camera
    usable = current is not None and current.type == "CAMERA"
    if mode == "SCENE" and not usable:
        raise CameraError(rpt_("The scene has no camera to take; choose New Camera."))
    view = _view_here(context)
    free = usable and photo_image.camera_photo(current) is None and (view is None or not view.is_free)
    if mode == "SCENE" or (mode == "AUTO" and free):
        return current
    return new_camera(context, Path(photo_name).stem, view, (photo.width, photo.height))


def new_camera(context: bpy.types.Context, name: str, view: ViewportView | None, size: tuple[int, int]) -> bpy.types.Object:
    """A new camera whose picture of `size` shows what the view shows; without a view, one where the scene camera stands."""
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    current = context.scene.camera
    if view and view.is_free:
        camera.matrix_world = view.region.view_matrix.inverted()
        _take_lens(context.scene, camera.data, view, size)
    elif current:
        camera.matrix_world = current.matrix_world.normalized()
        if current.type == "CAMERA":
            camera.data.lens = current.data.lens
    else:
        camera.data.lens = DEFAULT_LENS_MM
    context.scene.collection.objects.link(camera)
    return camera


def _take_lens(scene: bpy.types.Scene, data: bpy.types.Camera, view: ViewportView, size: tuple[int, int]) -> None:
    """Gives the camera the lens with which a picture of `size` shows what the view shows."""
    (width, height), ax, ay = size, scene.render.pixel_aspect_x, scene.render.pixel_aspect_y
    focal = conventions.focal_px_from_view(view.lens, view.size, (width * ax, height * ay))
    camera_bridge.write_intrinsics(scene, data, Intrinsics(width, height, focal / ax, focal / ay, width / 2, height / 2))


@dataclass(frozen=True)
class LoadedPhoto:
    """A photo, its image in Blender, and the camera or the lens alone that a file gives for it, None where none does."""

    photo: Photo
    image: bpy.types.Image
    given: Camera | Unplaced | None


def fit_camera(context: bpy.types.Context, camera: bpy.types.Object, loaded: LoadedPhoto, set_resolution: bool) -> list[str]:
    """Gives the camera its photo, lens and, from a camera file, its pose. Sentences on what was found and set."""
    scene, data, photo, given = context.scene, camera.data, loaded.photo, loaded.given
    lens = given.intrinsics if given else None
    if isinstance(given, Camera):
        camera_channels.check_writable(camera)
    scene.camera = camera
    notes = list(photo.notes)
    data.gssmc.photo = loaded.image  # The update function of the property shows it behind the camera.
    pixel = conventions.pixel_shape(lens) if lens else None if photo.pixel_aspect == 1 else photo.pixel_aspect
    notes += frame(scene, (photo.width, photo.height), set_resolution, pixel)
    if isinstance(given, Camera):
        camera_bridge.write_camera(scene, camera, scene.gssmc.splat, given)
        camera_channels.write_keyframes(scene, camera)
        guessed = rpt_("Pose and lens are those of the camera file (the lens is a guess).")
        notes.append(guessed if given.focal_guessed else rpt_("Pose and lens are those of the camera file."))
    elif lens:
        camera_bridge.write_intrinsics(scene, data, lens)
        notes.append(rpt_("The lens is that of the camera file, which has no pose for the photo; use Find Camera."))
    else:
        notes.append(_lens_from_exif(scene, data, photo))
        notes += [rpt_("The camera file has neither pose nor lens for the photo; use Find Camera.")] if given else []
    data.gssmc.lens_state = "CALIBRATED" if given and lens and not given.focal_guessed else "GUESSED"
    camera_props.keep_verdict(data, "none", (), 0, 0.0)
    return notes


def _lens_from_exif(scene: bpy.types.Scene, data: bpy.types.Camera, photo: Photo) -> str:
    if not photo.focal_35mm:
        camera_bridge.move_to_render(scene, data, photo.width, photo.height)
        if photo.pixel_aspect != 1:
            lens = camera_bridge.photo_intrinsics(scene, data, photo.width, photo.height)
            camera_bridge.write_intrinsics(scene, data, replace(lens, fx=lens.fy / photo.pixel_aspect))
        return rpt_(
            "The photo does not say its focal length; the camera's ({lens:.3g} mm) is a first guess, and is solved for.",
            lens=data.lens,
        )
    data.type, data.sensor_fit, data.sensor_width = "PERSP", "AUTO", PHOTO_SENSOR_MM
    wanted = replace(guess_lens(photo).intrinsics, dist=camera_bridge.read_distortion(data))
    camera_bridge.write_intrinsics(scene, data, wanted)
    return rpt_("Lens {lens:.3g} mm from the photo's EXIF, a first guess that is solved for.", lens=data.lens)


def frame(scene: bpy.types.Scene, size: tuple[int, int], allowed: bool, pixel: float | None = None) -> list[str]:
    """Gives the render the photo's resolution where its shape differs, if `allowed`. Returns sentences on what was done.

    `pixel`: width over height of the photo's pixels, which the render's take too; None: those of the render as they are. The
    other cameras of the scene follow, so that each keeps its fit.
    """
    render = scene.render
    now = render.pixel_aspect_x / render.pixel_aspect_y
    shape = pixel if pixel and abs(pixel - now) > camera_bridge.SAME_PIXEL * now else None
    before = render.resolution_x, render.resolution_y
    if not allowed or (shape is None and before[0] * size[1] == before[1] * size[0]):
        return []
    notes = [rpt_("The render resolution was {x} x {y} and is now the photo's.", x=before[0], y=before[1])]
    render.resolution_x, render.resolution_y = size
    if shape:
        render.pixel_aspect_x, render.pixel_aspect_y = conventions.pixel_aspects(shape)
        notes.append(rpt_("Its pixels are {ratio:.4f} times as wide as high now, as the photo's.", ratio=shape))
    camera_frame.fit_all(scene)
    return notes


def look_through(context: bpy.types.Context, camera: bpy.types.Object) -> None:
    """Selects the camera and turns the viewport to it."""
    for other in context.selected_objects:
        other.select_set(False)
    camera.select_set(True)
    context.view_layer.objects.active = camera
    view = _view_here(context)
    if view:
        view.region.view_perspective = "CAMERA"


def stop_moving_with_view() -> None:
    """Switches off Lock Camera to View, because turning the view would otherwise move a solved camera."""
    areas = (area for screen in bpy.data.screens for area in screen.areas)
    for space in (space for area in areas for space in area.spaces if space.type == "VIEW_3D"):
        space.lock_camera = False


def find_view(context: bpy.types.Context) -> ViewportView | None:
    """The viewport that the mouse is in, else the first one of any window."""
    areas = (area for window in context.window_manager.windows for area in window.screen.areas)
    first = next((area for area in areas if area.type == "VIEW_3D"), None)
    return _view_here(context) or (_view_of(first) if first else None)


def _view_here(context: bpy.types.Context) -> ViewportView | None:
    area = context.area
    return _view_of(area) if area and area.type == "VIEW_3D" else None


def _view_of(area: bpy.types.Area) -> ViewportView:
    space, region = area.spaces.active, next(r for r in area.regions if r.type == "WINDOW")
    return ViewportView(space.region_3d, space.lens, (max(1, region.width), max(1, region.height)))
