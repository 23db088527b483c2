import bpy
from mathutils import Vector

def location_3d_to_region_2d(region: bpy.types.Region, rv3d: bpy.types.RegionView3D, coord: Vector) -> Vector | None: ...
