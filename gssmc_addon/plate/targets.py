"""What a job on a plate works on, by session id, for Blender's data may change under it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...core.errors import RefineError
from ..support.session_ids import by_uid
from ..support.texts import rpt_


@dataclass(frozen=True)
class PlateTargets:
    """The session ids of scene, splat and camera."""

    scene: int
    splat: int
    camera: int

    @classmethod
    def of(cls, scene: bpy.types.Scene, splat: bpy.types.Object, camera: bpy.types.Object) -> PlateTargets:
        return cls(scene.session_uid, splat.session_uid, camera.session_uid)

    def find(self) -> tuple[bpy.types.Scene, bpy.types.Object, bpy.types.Object]:
        """The live scene, splat and camera. Raises RefineError when something is gone."""
        scene = by_uid(bpy.data.scenes, self.scene)
        splat, camera = (by_uid(scene.objects, uid) if scene else None for uid in (self.splat, self.camera))
        if splat is None or camera is None:
            raise RefineError(rpt_("The splat or the camera was removed while the plate was refined; nothing was changed."))
        return scene, splat, camera
