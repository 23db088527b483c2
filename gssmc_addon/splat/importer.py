"""From a splat file to a splat object that stands, and shows, in a Blender scene."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import bpy
import numpy as np
from mathutils import Matrix

from ...core.errors import GssmcError, SplatFormatError
from ...core.geometry import conventions
from ...core.geometry.conventions import Orientation
from ...core.splats import OTHER_SUFFIXES, SUFFIXES, SplatInfo, inspect_splats
from ...core.splats.scene import GaussianScene
from ..support.texts import iface_, rpt_
from ..viewport import clouds as viewport_clouds
from ..viewport import handlers as viewport
from ..viewport import props as viewport_props
from . import cloud_size
from . import display as splat_display
from . import object as splat_object
from .up_axis import AXIS_WORDS

ADDING_S = 0.05
FILTER = ";".join(f"*{suffix}" for suffix in (*SUFFIXES, *OTHER_SUFFIXES))


def describe(path: str) -> list[str]:
    """What the import dialog says of the chosen file: format, count and axes; or why it can't be imported.

    Reads the header only, hence fit for draw().
    """
    if not Path(path).is_file():
        return [iface_("Choose a splat file: {suffixes}", suffixes=", ".join(SUFFIXES))]
    try:
        info = inspect_splats(path)
    except GssmcError as error:
        return [str(error)]
    return [
        iface_("Format: {format}", format=info.format),
        iface_("{count:,} Gaussians, SH degree {degree}", count=info.count, degree=info.sh_degree),
        _axes_told(info),
    ]


def _axes_told(info: SplatInfo) -> str:
    """The up axis as a sentence, which says whether the file declares it or it is a guess."""
    axes = iface_(AXIS_WORDS[info.orientation])
    if info.declared:
        return iface_("Up axis: {axes}, as the file says", axes=axes)
    return iface_("Up axis: {axes}, as is usual for this format", axes=axes)


@dataclass(frozen=True)
class ReadSplat:
    """A scene with the attribute that is stored in another shape: base (N, 4), f_dc and opacity."""

    scene: GaussianScene
    base: np.ndarray

    @classmethod
    def of(cls, scene: GaussianScene) -> ReadSplat:
        return cls(scene, np.concatenate([scene.sh[:, 0], scene.opacities[:, None]], axis=1))


@dataclass(frozen=True)
class SplatDisplay:
    """What only the display needs: point radius (N,), and the viewport's tables where the extension draws splats itself."""

    radius: np.ndarray
    viewport: viewport_clouds.Prepared | None

    @classmethod
    def of(cls, read: ReadSplat, viewport: bool) -> SplatDisplay:
        """`viewport`: whether this Blender has one in which the extension draws splats."""
        arrays = read.scene.means, read.scene.scales, read.scene.rotations, read.base
        return cls(splat_display.point_radius(read.scene), viewport_clouds.prepare(arrays) if viewport else None)


@dataclass(frozen=True)
class Placement:
    """How a splat comes into the scene. `orientation` AUTO takes what its format means, or its file declares; `level`: of a
    streamed scan, 0 the finest.
    """

    orientation: Orientation | Literal["AUTO"] = "AUTO"
    scale: float = 1.0
    max_shown: int = viewport_props.MAX_SHOWN
    level: int = 0


def add_splat(
    context: bpy.types.Context, name: str, scene: GaussianScene, orientation: Orientation | Literal["AUTO"]
) -> bpy.types.Object:
    """A new splat object, turned upright, linked, active, and picked as the scene's splat."""
    read = ReadSplat.of(scene)
    building = Building(name, read, Placement(orientation))
    while not building.step():
        pass
    return building.finish(context, SplatDisplay.of(read, viewport_props.is_drawable()))


class Building:
    """A splat object in the making: `step()` until it says True, then `finish()`; or `drop()`.

    Between steps Blender's data may change (undo, another file), so the point cloud is looked up anew for each.
    """

    def __init__(self, name: str, read: ReadSplat, placement: Placement) -> None:
        self.scene, self._name, self._placement = read.scene, name, placement
        cloud = cloud_size.new_cloud(name, len(read.scene))
        self._uid = cloud.session_uid
        self._attributes = splat_object.splat_attributes(read.scene, read.base)
        self._made = self._done = 0  # How many attributes exist, and how many of them are filled.

    @property
    def fraction(self) -> float:
        """The share 0..1 of the attributes that are filled."""
        return self._done / len(self._attributes)

    def step(self) -> bool:
        """Adds some attributes or writes one, some milliseconds for a million Gaussians; True at the end.

        Raises SplatFormatError when the data is gone. After adding, Blender draws every viewport anew, which without a graphics
        card takes longer than anything here: hence as many at a time as the window may wait for.
        """
        cloud, until = self._cloud(), time.perf_counter() + ADDING_S
        if self._made < len(self._attributes):
            while self._made < len(self._attributes) and time.perf_counter() < until:
                splat_object.ensure_attribute(cloud, *self._attributes[self._made][:2])
                self._made += 1
            return False
        splat_object.write_attribute(cloud, *self._attributes[self._done])
        self._done += 1
        return self._done == len(self._attributes)

    def finish(self, context: bpy.types.Context, look: SplatDisplay) -> bpy.types.Object:
        """The object, placed, linked, active and picked."""
        cloud, place, scene = self._cloud(), self._placement, self.scene
        splat_object.set_native_type(cloud)
        if not splat_object.is_native(cloud):
            splat_display.dress_splat(cloud, look.radius)
        if look.viewport:
            viewport.prime(cloud, look.viewport)
        if any(scene.origin):
            cloud[splat_object.ORIGIN] = scene.origin
        if scene.antialiased:
            cloud[splat_object.ANTIALIASED] = True
        obj = bpy.data.objects.new(self._name, cloud)
        axes = scene.orientation if place.orientation == "AUTO" else place.orientation
        obj.matrix_world = Matrix(conventions.orientation_matrix(axes).tolist()) @ Matrix.Scale(place.scale, 4)
        obj.gssmc.max_shown = place.max_shown
        obj.gssmc.up_axis = axes
        viewport_props.apply(obj)
        _pick(context, obj)
        return obj

    def drop(self) -> None:
        """Removes what was made so far."""
        cloud = self._find()
        if cloud is not None:
            bpy.data.pointclouds.remove(cloud)

    def _find(self) -> bpy.types.PointCloud | None:
        return next((cloud for cloud in bpy.data.pointclouds if cloud.session_uid == self._uid), None)

    def _cloud(self) -> bpy.types.PointCloud:
        cloud = self._find()
        if cloud is None:
            raise SplatFormatError(
                rpt_('The splat "{name}" was removed while it was imported; import it again.', name=self._name)
            )
        return cloud


def _pick(context: bpy.types.Context, obj: bpy.types.Object) -> None:
    context.collection.objects.link(obj)
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj
    context.scene.gssmc.splat = obj
    context.view_layer.update()
