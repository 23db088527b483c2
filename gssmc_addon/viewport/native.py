"""Splats of files that an older Blender saved, in a Blender that draws splats itself."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..splat import display as splat_display
from ..splat import object as splat_object

SINCE = (5, 3, 0)  # The first Blender whose point clouds have a type for splats.


def take_over(clouds: Iterable[tuple[bpy.types.PointCloud, tuple[int, ...]]]) -> None:
    """Leaves the splats among `clouds` to Blender; beside each stands the version of the Blender that saved it.

    An older one could not say that a point cloud is a splat. From a newer one, points are what the user chose.
    """
    for cloud, saved_by in clouds:
        if tuple(saved_by) < SINCE and splat_object.is_splat_cloud(cloud) and not splat_object.is_native(cloud):
            splat_object.set_native_type(cloud)
            if splat_object.is_native(cloud):
                splat_display.undress(cloud)


def open_file() -> Iterable[tuple[bpy.types.PointCloud, tuple[int, ...]]]:
    """The point clouds of the open file, those of linked files among them, each with the version that it was saved by."""
    for cloud in bpy.data.pointclouds:
        yield cloud, cloud.library.version if cloud.library else bpy.data.version


def imported(context: bpy.types.BlendImportContext) -> Iterable[tuple[bpy.types.PointCloud, tuple[int, ...]]]:
    """As `open_file`, of what was just linked or appended."""
    for item in context.import_items:
        if isinstance(item.id, bpy.types.PointCloud):
            yield item.id, item.source_library.version if item.source_library else bpy.data.version
