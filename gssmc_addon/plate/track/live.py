"""The camera shown while its plate is tracked: frame and pose go along, and go back before anything is written."""

from __future__ import annotations

import logging
import time

import bpy

from ....core.errors import GssmcError
from ....core.geometry.camera import Pose
from ...camera import bridge as camera_bridge
from ...camera import keys as camera_keys

log = logging.getLogger(__name__)
SHOW_S = 1.0  # Seconds between two frames that are shown: evaluating and drawing a scene takes time from the work.


# Scene, splat and camera, as PlateTargets finds them.
LiveObjects = tuple[bpy.types.Scene, bpy.types.Object, bpy.types.Object]


class LiveCamera:
    """Shows poses on a camera without keying them. It ends by itself when the user goes to another frame."""

    def __init__(self, scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
        self._frame, self._part = scene.frame_current, scene.frame_subframe
        self._kept = {name: tuple(getattr(camera, name)) for name in camera_keys.TRANSFORM}
        self._shown: int | None = None  # the frame that was shown last
        self._at, self._ended = 0.0, False

    def show(self, live: LiveObjects, frame: int, pose: Pose) -> None:
        """Goes to the frame and shows the pose there, where the last one was shown long enough ago."""
        now = time.perf_counter()
        scene, splat, camera = live
        if self._ended or now - self._at < SHOW_S:
            return
        if scene.frame_current != (self._frame if self._shown is None else self._shown):
            self._ended = True
            return
        try:
            scene.frame_set(frame)
            self._shown, self._at = frame, now
            camera_bridge.write_pose(scene, camera, splat, pose)
        except GssmcError as error:  # Writing the keys says what is wrong.
            log.info("The camera is not shown while its plate is tracked: %s", error)
            self._ended = True

    def put_back(self, live: LiveObjects) -> None:
        """Frame and camera as they were, but for a frame that the user went to. Harmless where nothing was shown."""
        scene, _, camera = live
        if self._shown is None:
            return
        if scene.frame_current == self._shown:
            scene.frame_set(self._frame, subframe=self._part)
        for name, value in self._kept.items():
            setattr(camera, name, value)
        for layer in scene.view_layers:
            layer.update()
        self._shown, self._ended = None, True
