"""What else sets a camera's transform and lens. Constraints, drivers and NLA are refused; keyframes are written along."""

from __future__ import annotations

import bpy

from ...core.errors import CameraError
from ..support.texts import rpt_

WRITTEN_CHANNELS = ("location", "rotation", "lens", "shift")
DRIVEN_CHANNELS = (*WRITTEN_CHANNELS, "scale", "delta_")  # A driver on one of these would move what was just written.
ROTATION_PATHS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}
LENS_PATHS = ("lens", "shift_x", "shift_y")


def check_writable(camera: bpy.types.Object) -> None:
    """Raises CameraError when something would undo, or forbid, a new pose at the scene's present frame: a constraint, a driver,
    NLA, a curve that takes no key or does not follow its keys, a library.

    Keyframes of the active action are no obstacle: `write_keyframes` adds one at the current frame.
    """
    if not (camera.is_editable and camera.data.is_editable):
        raise CameraError(rpt_('The camera "{name}" comes from a linked library; make it local first.', name=camera.name))
    active = [c.name for c in camera.constraints if c.enabled and c.influence > 0]
    if active:
        raise CameraError(
            rpt_(
                'The constraint "{constraint}" holds the camera "{name}"; disable or apply it first.',
                constraint=active[0],
                name=camera.name,
            )
        )
    for block in (camera, camera.data):
        _check_animation(block, camera.name)


def _check_animation(block: bpy.types.ID, name: str) -> None:
    animation = block.animation_data
    if animation is None:
        return
    driven = next((d.data_path for d in animation.drivers if d.data_path.startswith(DRIVEN_CHANNELS)), None)
    if driven:
        raise CameraError(rpt_('The camera "{name}" is driven ({path}); remove that driver first.', name=name, path=driven))
    tracks = [track.name for track in animation.nla_tracks if track.strips and not track.mute]
    if animation.use_nla and tracks:
        raise CameraError(
            rpt_('The NLA track "{track}" moves the camera "{name}"; mute or bake it first.', track=tracks[0], name=name)
        )
    _check_curves(block, name)


def _check_curves(block: bpy.types.ID, name: str) -> None:
    """Raises CameraError when a curve that gets a key would refuse it, or would not pass through it: Blender says so only by
    a returned False, or not at all.
    """
    own = [curve for curve in curves(block) if curve.data_path.startswith(WRITTEN_CHANNELS)]
    if own and not block.animation_data.action.is_editable:
        raise CameraError(
            rpt_('The action of the camera "{name}" comes from a linked library; make it local first.', name=name)
        )
    for curve in own:
        values = {"name": name, "path": curve.data_path}
        if curve.lock or (curve.group and curve.group.lock):
            raise CameraError(rpt_('The curve {path} of the camera "{name}" is locked; unlock it first.', **values))
        if curve.mute or (curve.group and curve.group.mute):
            raise CameraError(rpt_('The curve {path} of the camera "{name}" is muted; unmute or delete it first.', **values))
        if any(not modifier.mute for modifier in curve.modifiers):
            raise CameraError(
                rpt_('A modifier changes the curve {path} of the camera "{name}"; remove or bake it first.', **values)
            )


def write_keyframes(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """Keys the channels just written, where the camera is animated, at the current frame: else the next frame change would
    take them back. What was keyed, as a sentence; empty when nothing was.
    """
    frame = scene.frame_current_final
    rotation = rotation_path(camera)
    pose = _animated(camera, ("location", "rotation", "scale"))
    lens = _animated(camera.data, LENS_PATHS)
    for path in ("location", rotation, "scale") if pose else ():
        camera.keyframe_insert(path, frame=frame)
    for path in LENS_PATHS if lens else ():
        camera.data.keyframe_insert(path, frame=frame)
    if not (pose or lens):
        return ""
    if pose and lens:
        return rpt_("It is animated, so its pose and lens got a keyframe at frame {frame}.", frame=scene.frame_current)
    if pose:
        return rpt_("It is animated, so its pose got a keyframe at frame {frame}.", frame=scene.frame_current)
    return rpt_("It is animated, so its lens got a keyframe at frame {frame}.", frame=scene.frame_current)


def is_lens_writable(data: bpy.types.Camera) -> bool:
    """Whether a lens that is written stays: no library, driver or NLA track in the way. Keyframes see `scale_lens_keys`."""
    animation = data.animation_data
    if not data.is_editable or animation is None:
        return data.is_editable
    driven = any(driver.data_path in LENS_PATHS for driver in animation.drivers)
    keys = [curve for curve in curves(data) if curve.data_path in LENS_PATHS]
    made = any(len(curve.modifiers) or len(curve.sampled_points) for curve in keys)  # not by keyframes alone
    return not driven and not made and not (animation.use_nla and any(t.strips and not t.mute for t in animation.nla_tracks))


def scale_lens_keys(data: bpy.types.Camera, factor: float) -> None:
    """Multiplies the keyframes of lens and shifts, which all stand in the same proportion to the frame."""
    for curve in curves(data):
        if curve.data_path not in LENS_PATHS:
            continue
        for point in curve.keyframe_points:
            for part in (point.co, point.handle_left, point.handle_right):
                part.y *= factor
        curve.update()


def key_frames(camera: bpy.types.Object) -> list[int]:
    """The whole frames at which the camera's pose has a key."""
    paths = ("location", *ROTATION_PATHS.values(), "rotation_euler")
    points = (point for curve in curves(camera) if curve.data_path in paths for point in curve.keyframe_points)
    return sorted({round(point.co.x) for point in points})


def key_types(camera: bpy.types.Object) -> dict[int, str]:
    """Blender's word for the type of the keys of the camera's place, by frame."""
    points = (point for curve in curves(camera) if curve.data_path == "location" for point in curve.keyframe_points)
    return {round(point.co.x): point.type for point in points}


def has_lens_keys(data: bpy.types.Camera) -> bool:
    """Whether keyframes set the focal length or the shifts."""
    return any(curve.data_path in LENS_PATHS for curve in curves(data))


def rotation_path(camera: bpy.types.Object) -> str:
    """The channel that turns the camera, by its rotation mode."""
    return ROTATION_PATHS.get(camera.rotation_mode, "rotation_euler")


def _animated(block: bpy.types.ID, starts: tuple[str, ...]) -> bool:
    return any(curve.data_path.startswith(starts) for curve in curves(block))


def curves(block: bpy.types.ID) -> list[bpy.types.FCurve]:
    """The curves that move this block."""
    animation = block.animation_data
    if animation is None or animation.action is None or animation.action_slot is None:
        return []
    strips = [strip for layer in animation.action.layers for strip in layer.strips]
    bags = [strip.channelbag(animation.action_slot) for strip in strips]
    return [curve for bag in bags if bag for curve in bag.fcurves]
