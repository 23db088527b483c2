"""Sets a scene up so that F12 gives the finished picture, and puts it back.

All that is touched is noted first (`state.GssmcComposite` on the scene), and nothing is touched before all checks are passed.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import bpy

from ...core.errors import CameraError
from ...core.geometry import conventions
from ...core.pictures.overscan import MOST, overscan_ratio
from ..camera import bridge as camera_bridge
from ..camera import channels as camera_channels
from ..camera import frame as camera_frame
from ..camera import solution as camera_solution
from ..support.texts import n_, rpt_
from . import host, lens, look, plate, record, shared, stage, tree
from .plate import Backplate
from .state import GssmcComposite

BEND, STRAIGHTEN = "CG", "PLATE"
LENS_ITEMS = (
    (BEND, "On the CG", "The photo stays as it is, and the CG is bent as the photo's lens bends"),
    (STRAIGHTEN, "Off the Photo", "A copy of the photo without lens distortion lies behind the CG, which stays straight"),
)
PHOTO, SPLAT = "PHOTO", "SPLAT"
BEHIND_ITEMS = (
    (PHOTO, "Photo", "The scene camera's photo or plate lies behind the CG"),
    (SPLAT, "Splat", "The frames that Render Splat made lie behind the CG, for shots without a photo"),
)
ZOOM = 1e-3  # a relative change of the focal length below which a lens does not zoom
SET_UP = n_('F12 renders CG into "{photo}" at {width} x {height}.')


@dataclass(frozen=True)
class CompositeShot:
    """What a composite is made of, all checked: the camera, what lies behind it, a straight copy of that where it is wanted."""

    camera: bpy.types.Object
    plate: Backplate
    straight: bpy.types.Image | None

    @property
    def ratio(self) -> float:
        """How much more than the photo the render has to show."""
        return 1.0 if self.straight else overscan_ratio(self.plate.lens)


def set_up(scene: bpy.types.Scene, lens_on: str = BEND, behind: str = PHOTO) -> list[str]:
    """Sets the scene up for its camera, anew where a composite is there already. Returns sentences for the artist.

    Raises CameraError or PhotoError, with nothing changed, when camera or photo is missing.
    """
    shot = check(scene, lens_on, behind)
    if scene.gssmc.composite.is_set_up:
        remove(scene)
    shared.free_lenses()
    if behind == PHOTO:
        shot = replace(shot, plate=plate.of_camera(scene, shot.camera))
    kept = scene.gssmc.composite
    depth_pass = f'view_layers["{bpy.utils.escape_identifier(tree.layer_of(scene))}"].use_pass_z'
    paths = (*record.SCENE_PATHS, depth_pass) if behind == SPLAT else record.SCENE_PATHS
    kept.before = json.dumps(record.values(scene, paths))
    kept.engine, kept.camera = scene.render.engine, shot.camera
    try:
        notes = _apply(scene, shot, kept)
    except Exception:
        remove(scene)  # Whatever went wrong, nothing stays half done.
        raise
    width, height = shot.plate.size
    return [rpt_(SET_UP, photo=shot.plate.name, width=width, height=height), *notes]


def _apply(scene: bpy.types.Scene, shot: CompositeShot, kept: GssmcComposite) -> list[str]:
    """Makes every change. Returns sentences for the artist."""
    shown, notes = look.of_scene(scene), []
    if shot.plate.frames is None and not shot.camera.data.gssmc.solution:
        notes.append(rpt_('The camera "{name}" was not solved here; its place is a file\'s, or yours.', name=shot.camera.name))
    notes += _set_frame(scene, shot, kept)
    by_depth = shot.plate.frames is not None and not stage.used_proxies(scene)
    notes += stage.set_stage(scene, kept, shot.plate.frames is not None)
    notes += look.make_plain(scene)
    scene.render.film_transparent = scene.render.use_compositing = True
    scene.render.dither_intensity = 0  # It would be added to the plate.
    scene.render.use_crop_to_border = False  # Blender would squeeze the whole plate into the border.
    if by_depth:
        scene.view_layers[tree.layer_of(scene)].use_pass_z = True
    parts = tree.Parts(_behind(shot, kept), _map(shot, kept), shown, by_depth)
    return notes + tree.build(scene, host.begin(scene, kept), parts)


def check(scene: bpy.types.Scene, lens_on: str, behind: str = PHOTO) -> CompositeShot:
    """What the composite is made of. Raises CameraError or PhotoError, with nothing changed."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        raise CameraError(rpt_("The scene has no camera; add a photo, or pick one on the list."))
    camera_bridge.check_perspective(camera)
    if behind == SPLAT:
        return CompositeShot(camera, plate.of_splat(scene), None)
    return _check_photo(scene, camera, lens_on)


def _check_photo(scene: bpy.types.Scene, camera: bpy.types.Object, lens_on: str) -> CompositeShot:
    behind = plate.of_camera(scene, camera)
    other = shared.holder(camera.data, scene)
    if other is not None and (behind.lens.has_distortion or camera.data.gssmc.overscan != 1):
        raise CameraError(
            rpt_(
                'The camera "{name}" is in the composite of the scene "{scene}"; remove that one first, or give this scene a '
                "camera of its own.",
                name=camera.name,
                scene=other.name,
            )
        )
    straightens = lens_on == STRAIGHTEN and behind.lens.has_distortion
    if not straightens and behind.lens.has_distortion and not camera_channels.is_lens_writable(camera.data):
        raise CameraError(
            rpt_(
                'The lens of the camera "{name}" is driven or linked and cannot show more than the photo; make it its own, '
                "or take the lens off the photo.",
                name=camera.name,
            )
        )
    return CompositeShot(camera, behind, plate.straight_copy(behind) if straightens else None)


def remove(scene: bpy.types.Scene) -> list[str]:
    """Puts back all that was touched. Returns sentences on what did not take its value."""
    kept = scene.gssmc.composite
    host.end(scene, kept)
    cameras = [item for item in kept.cameras if item.data and not shared.leave_camera(scene, item)]
    unchanged = [item for item in cameras if record.of_camera(item.data) == item.after]
    refused = record.put(scene, json.loads(kept.before))
    for item in unchanged:
        record.put_camera(item.data, item.before)
    kept.camera = None
    shared.free_lenses()
    camera_frame.fit_all(scene)
    for item in kept.objects:
        if item.object and not shared.leave_object(scene, item):
            record.put(item.object, json.loads(item.before))
    _forget(kept)
    shared.free_objects()
    return [rpt_("These settings did not take back their value: {names}.", names=", ".join(refused))] if refused else []


def _forget(kept: GssmcComposite) -> None:
    images = [item.image for item in kept.images if item.image]
    for collection in (kept.images, kept.objects, kept.cameras):
        collection.clear()
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)
    kept.before = kept.engine = kept.host = ""
    kept.camera = kept.tree = kept.own_tree = None


def _set_frame(scene: bpy.types.Scene, shot: CompositeShot, kept: GssmcComposite) -> list[str]:
    """Gives the render the photo's resolution, and the camera a frame that holds all that its lens bends into the photo."""
    data, render = shot.camera.data, scene.render
    for camera in {obj.data for obj in scene.objects if obj.type == "CAMERA" and obj.data.is_editable}:
        item = kept.cameras.add()
        item.data, item.before = camera, record.of_camera(camera)
    if shot.plate.frames is None and not data.gssmc.frame_x and data.is_editable:
        camera_bridge.move_to_render(scene, data, *shot.plate.size)  # A lens that was set by hand is to follow the resolution.
    (render.resolution_x, render.resolution_y), render.resolution_percentage = shot.plate.size, 100
    if shot.plate.frames is None:
        render.pixel_aspect_x, render.pixel_aspect_y = conventions.pixel_aspects(data.gssmc.photo_pixel or 1.0)
    camera_frame.fit_all(scene)
    if shot.ratio > 1:
        record.zoom_out(data, shot.ratio)
    for item in kept.cameras:
        item.after = record.of_camera(item.data)
    notes = []
    if shot.plate.frames is None and camera_solution.change(scene, shot.camera):
        notes.append(rpt_("The camera is no longer what was solved; Back to Solution puts it back."))
    if shot.straight is None and shot.plate.lens.has_distortion and _zooms(data):
        notes.append(rpt_("The lens zooms, and the CG is bent as the lens bends at the present frame."))
    if shot.ratio == MOST:
        notes.append(rpt_("The lens bends so much that the corners of the photo get no CG."))
    return notes


def _zooms(data: bpy.types.Camera) -> bool:
    """Whether keys change the focal length."""
    keys = (curve.keyframe_points for curve in camera_channels.curves(data) if curve.data_path == "lens")
    values = [point.co.y for points in keys for point in points]
    return bool(values) and max(values) - min(values) > ZOOM * max(values)


def _behind(shot: CompositeShot, kept: GssmcComposite) -> Backplate:
    if shot.plate.frames:
        first, last = kept.frames_range
        image = bpy.data.images.load(str(plate.frame_file(shot.plate.frames, first)))
        image.source = "SEQUENCE" if first < last else "FILE"  # of one frame at all times
        kept.images.add().image = image
        return replace(shot.plate, image=image)
    if shot.straight is None:
        return shot.plate
    kept.images.add().image = shot.straight
    return replace(shot.plate, image=shot.straight, user=None)


def _map(shot: CompositeShot, kept: GssmcComposite) -> bpy.types.Image | None:
    if shot.straight is not None or not shot.plate.lens.has_distortion:
        return None
    made = lens.map_image(shot.plate.lens, shot.ratio)
    kept.images.add().image = made
    return made
