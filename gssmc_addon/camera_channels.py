"""What else sets a camera's transform and lens: constraints, drivers, NLA, keyframes. Refused, or written along."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ..core.errors import CameraError

WRITTEN_CHANNELS = ("location", "rotation", "lens", "shift")
ROTATION_PATHS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}
LENS_PATHS = ("lens", "shift_x", "shift_y")


def check_writable(camera: bpy.types.Object) -> None:
    """Raises CameraError when something would undo, or forbid, a new pose: a constraint, a driver, NLA, a library.

    Keyframes of the active action are no obstacle: `write_keyframes` adds one at the current frame.
    """
    if not (camera.is_editable and camera.data.is_editable):
        raise CameraError(f'The camera "{camera.name}" comes from a linked library; make it local first.')
    active = [c.name for c in camera.constraints if c.enabled and c.influence > 0]
    if active:
        raise CameraError(f'The constraint "{active[0]}" holds the camera "{camera.name}"; disable or apply it first.')
    for block in (camera, camera.data):
        _check_animation(block, camera.name)


def _check_animation(block: bpy.types.ID, name: str) -> None:
    animation = block.animation_data
    if animation is None:
        return
    driven = next((d.data_path for d in animation.drivers if d.data_path.startswith(WRITTEN_CHANNELS)), None)
    if driven:
        raise CameraError(f'The camera "{name}" is driven ({driven}); remove that driver first.')
    tracks = [track.name for track in animation.nla_tracks if track.strips and not track.mute]
    if animation.use_nla and tracks:
        raise CameraError(f'The NLA track "{tracks[0]}" moves the camera "{name}"; mute or bake it first.')


def write_keyframes(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """Keys the channels just written, where the camera is animated, at the current frame: else the next frame change would
    take them back. What was keyed, as a sentence; empty when nothing was.
    """
    frame = scene.frame_current_final
    rotation = ROTATION_PATHS.get(camera.rotation_mode, "rotation_euler")
    pose = bool(_animated(camera, ("location", "rotation", "scale")))
    lens = bool(_animated(camera.data, LENS_PATHS))
    for path in ("location", rotation, "scale") if pose else ():
        camera.keyframe_insert(path, frame=frame)
    for path in LENS_PATHS if lens else ():
        camera.data.keyframe_insert(path, frame=frame)
    if not (pose or lens):
        return ""
    what = "pose and lens" if pose and lens else "pose" if pose else "lens"
    return f"It is animated, so its {what} got a keyframe at frame {scene.frame_current}."


def _animated(block: bpy.types.ID, starts: tuple[str, ...]) -> list[str]:
    return [path for path in _keyed_paths(block) if path.startswith(starts)]


def _keyed_paths(block: bpy.types.ID) -> Iterator[str]:
    """Data paths of the curves that move this block."""
    animation = block.animation_data
    if animation is None or not animation.action or not animation.action_slot:
        return
    strips = [strip for layer in animation.action.layers for strip in layer.strips]
    bags = [strip.channelbag(animation.action_slot) for strip in strips]
    yield from (curve.data_path for bag in bags if bag for curve in bag.fcurves)
