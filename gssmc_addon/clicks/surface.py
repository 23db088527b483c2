"""The surface of a splat as something to click at: rendered where the mouse is, at the view of the moment."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass
from functools import partial

import bpy
import numpy as np
from mathutils import Vector

from ...core.geometry.camera import Intrinsics, Pose
from ...core.geometry.conventions import pixel_centres, pose_from_blender
from ...core.geometry.viewport import intrinsics_from_projection
from ...core.pose.pins.lift import surface_point
from ...core.render.view import ViewRenderer
from ..camera import bridge as camera_bridge
from ..jobs.machine import Job
from ..splat import object as splat_object
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer

Preparation = Generator[str, None, "SplatSurface"]


@dataclass(frozen=True)
class SeenView:
    """What a region of the viewport shows, as the engine's camera in the coordinates of a splat's object."""

    lens: Intrinsics
    pose: Pose

    @classmethod
    def of(cls, region: bpy.types.Region, view: bpy.types.RegionView3D, splat: bpy.types.Object) -> SeenView:
        """The view as it is drawn now. Raises CameraError of an orthographic one, or of a splat that is scaled unevenly."""
        lens = intrinsics_from_projection(np.array(view.window_matrix), region.width, region.height)
        camera = np.array(view.view_matrix.inverted())
        return cls(lens, pose_from_blender(camera, camera_bridge.splat_similarity(splat)))

    def pixel(self, x: int, y: int) -> tuple[float, float]:
        """The pixel of the view at the mouse's place in the region, which Blender counts from below."""
        column, row = pixel_centres(1, x)[0], pixel_centres(1, self.lens.height - 1 - y)[0]
        return float(column), float(row)


class SplatSurface:
    """A splat that clicks land on; its renderer holds a copy of the Gaussians."""

    def __init__(self, renderer: ViewRenderer) -> None:
        self._renderer = renderer

    def point(self, lens: Intrinsics, pose: Pose, pixel: tuple[float, float]) -> tuple[float, float, float] | None:
        """The point of the splat, in its object's coordinates, that is seen at a pixel; None where nothing is."""
        found = surface_point(self._renderer, lens, pose, pixel)
        if found is None:
            return None
        x, y, z = (float(value) for value in found)
        return x, y, z

    def under_mouse(self, view: SeenView, x: int, y: int) -> tuple[float, float, float] | None:
        """The same of the mouse's place in a region."""
        return self.point(view.lens, view.pose, view.pixel(x, y))


class SurfaceJob(Job):
    """Makes the surface of a splat beside the window; its result is that."""

    def __init__(self, copying: SplatCopying) -> None:
        super().__init__(partial(_prepared, SplatRenderer(copying, single=True)), copying)


def _prepared(renderer: SplatRenderer) -> Preparation:
    yield "Preparing the splat"
    return SplatSurface(renderer.get())


def job_of(splat: bpy.types.Object) -> SurfaceJob:
    """The job that makes the surface of a splat: run() it, or start() and tick() it. Raises SplatFormatError."""
    return SurfaceJob(SplatCopying(splat))


def in_scene(splat: bpy.types.Object, point: tuple[float, float, float]) -> Vector:
    """A point of the splat's object, in the scene."""
    return camera_bridge.world_matrix(splat) @ Vector(point)


def in_splat(splat: bpy.types.Object, point: Iterable[float]) -> tuple[float, float, float]:
    """A point of the scene, among those of the splat's object."""
    x, y, z = camera_bridge.world_matrix(splat).inverted() @ Vector(point)
    return x, y, z


def fresh(context: bpy.types.Context) -> bpy.types.Object:
    """As `check`, with all objects where a script has just put them."""
    context.view_layer.update()
    return check(context.scene)


def check(scene: bpy.types.Scene) -> bpy.types.Object:
    """The scene's splat. Raises RefineError where there is none, CameraError where it is scaled unevenly."""
    splat = splat_object.picked(scene, scene.gssmc.splat)
    camera_bridge.splat_similarity(splat)
    return splat
