"""Point clouds of a wanted number of points: Blender 5.0 can resize them, 4.5 LTS can't."""

from __future__ import annotations

import bpy

from ...core.errors import SplatFormatError
from ..support.texts import rpt_


def new_cloud(name: str, count: int) -> bpy.types.PointCloud:
    """A new point cloud with `count` points, all at the origin. Raises SplatFormatError where Blender refuses."""
    if hasattr(bpy.types.PointCloud, "resize"):
        cloud = bpy.data.pointclouds.new(name)
        cloud.resize(count)
        return cloud
    return _converted(name, count)


def _converted(name: str, count: int) -> bpy.types.PointCloud:
    """The point cloud that Blender 4.5 makes of a mesh with as many vertices: its only way to one of a given size.

    The operator works on an object in the scene; that one, and the mesh, are gone again at the end.
    """
    context = bpy.context
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(count)
    carrier = bpy.data.objects.new(name, mesh)
    context.scene.collection.objects.link(carrier)
    chosen = [carrier]
    try:
        with context.temp_override(
            active_object=carrier, object=carrier, selected_objects=chosen, selected_editable_objects=chosen
        ):
            bpy.ops.object.convert(target="POINTCLOUD")
        if carrier.type != "POINTCLOUD":
            raise RuntimeError("the object stayed a mesh")
        cloud = carrier.data
        cloud.name = name
        if (select := cloud.attributes.get(".select_vert")) is not None:
            cloud.attributes.remove(select)
    except RuntimeError as error:
        raise SplatFormatError(
            rpt_("Blender 4.5 made no point cloud ({reason}); leave Edit Mode and try again.", reason=str(error).strip())
        ) from error
    finally:
        bpy.data.objects.remove(carrier)
        if mesh.users == 0:
            bpy.data.meshes.remove(mesh)
    return cloud
