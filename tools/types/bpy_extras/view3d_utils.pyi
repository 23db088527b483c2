from typing import Any

from mathutils import Vector

def location_3d_to_region_2d(region: Any, rv3d: Any, coord: Any, /) -> Vector | None: ...
