"""GaussianScene <-> point cloud object, in the attribute layout of Blender 5.3's native splats.

position, scale (linear), rotation (w x y z), radiance:base (f_dc_0..2 and opacity), radiance:sh_0, radiance:sh_1 ... one
attribute per SH coefficient above degree 0. Positions stay in the file's coordinates.
"""

from __future__ import annotations

from typing import TypeGuard

import bpy
import numpy as np

from ...core.errors import RefineError, SplatFormatError
from ...core.splats.scene import SH_COEFFICIENTS, GaussianScene
from ..support.texts import rpt_

BASE = "radiance:base"
# A custom property of the point cloud, with double precision: the scene's origin, as in GaussianScene.
ORIGIN = "gssmc_origin"
ANTIALIASED = "gssmc_antialiased"  # a custom property of the point cloud, as in GaussianScene; there where it is true
SH_PREFIX = "radiance:sh_"
REQUIRED = ("position", "scale", "rotation", BASE)
COMPONENTS = {"FLOAT_VECTOR": 3, "QUATERNION": 4, "FLOAT_COLOR": 4, "FLOAT4": 4}


def is_splat(obj: bpy.types.Object | None) -> TypeGuard[bpy.types.Object]:
    """True for a point cloud object in the layout above, whoever made it; cheap enough for a panel's draw()."""
    return obj is not None and obj.type == "POINTCLOUD" and is_splat_cloud(obj.data)


def origin_of(obj: bpy.types.Object) -> tuple[float, float, float]:
    """Where the object's own coordinates begin in those of its file."""
    x, y, z = obj.data.get(ORIGIN, (0.0, 0.0, 0.0))
    return float(x), float(y), float(z)


def is_splat_cloud(cloud: bpy.types.PointCloud) -> bool:
    """Whether the point cloud has the attributes of a splat, by name alone."""
    return all(name in cloud.attributes for name in REQUIRED)


def picked(scene: bpy.types.Scene, splat: bpy.types.Object | None) -> bpy.types.Object:
    """The splat to work on.

    Raises RefineError when none is picked, or when the user has deleted it (the pick keeps it in the file), SplatFormatError
    when it is something else.
    """
    if splat is None:
        raise RefineError(rpt_("No splat is picked; import one with File > Import > Gaussian Splats, or pick it in the panel."))
    if splat.name not in scene.objects:
        raise RefineError(
            rpt_('The splat "{name}" is no longer in the scene; import one, or pick another in the panel.', name=splat.name)
        )
    check_splat(splat)
    return splat


def check_splat(obj: bpy.types.Object) -> None:
    """Raises SplatFormatError when the object is no splat."""
    if not is_splat(obj):
        raise SplatFormatError(
            rpt_('"{name}" holds no Gaussian splats; pick one made by File > Import > Gaussian Splats.', name=obj.name)
        )


def splat_attributes(scene: GaussianScene, base: np.ndarray) -> list[tuple[str, str, np.ndarray]]:
    """Name, type and values of each attribute that holds `scene`; `base` (N, 4) is f_dc and opacity."""
    shape = [("position", "FLOAT_VECTOR", scene.means), ("scale", "FLOAT_VECTOR", scene.scales)]
    shape += [("rotation", "QUATERNION", scene.rotations), (BASE, _base_type(), base)]
    return shape + [(f"{SH_PREFIX}{k - 1}", "FLOAT_VECTOR", scene.sh[:, k]) for k in range(1, scene.sh.shape[1])]


def sh_coefficients(obj: bpy.types.Object) -> int:
    """SH coefficients per channel that a copy would hold: 1, 4, 9 or 16."""
    return 1 + sh_bands(obj.data) if is_splat(obj) else 1


def sh_bands(cloud: bpy.types.PointCloud) -> int:
    """How many SH coefficients above degree 0 to read: 0, 3, 8 or 15 (a native splat's degree 4 is read up to degree 3)."""
    present = 0
    while f"{SH_PREFIX}{present}" in cloud.attributes:
        present += 1
    return max(k - 1 for k in SH_COEFFICIENTS if k - 1 <= present)


def ensure_attribute(cloud: bpy.types.PointCloud, name: str, kind: str) -> bpy.types.Attribute:
    """The point attribute, made of that Blender type (`kind`) where it is missing."""
    return cloud.attributes.get(name) or cloud.attributes.new(name, kind, "POINT")


def write_attribute(cloud: bpy.types.PointCloud, name: str, kind: str, values: np.ndarray) -> None:
    """Fills the attribute, made where it is missing, from `values` (N, components), which become float32."""
    attribute = ensure_attribute(cloud, name, kind)
    attribute.data.foreach_set(_value_name(attribute), np.ascontiguousarray(values, np.float32).ravel())


def check_attribute(cloud: bpy.types.PointCloud, name: str, components: int) -> bpy.types.Attribute:
    """The attribute. Raises KeyError when there is none, SplatFormatError when it is of another type."""
    attribute = cloud.attributes[name]
    if attribute.domain != "POINT" or COMPONENTS.get(attribute.data_type) != components:
        raise SplatFormatError(
            rpt_(
                'The attribute "{name}" is of type {kind}, not one of {count} floats per point; import the splat file again.',
                name=name,
                kind=attribute.data_type,
                count=components,
            )
        )
    return attribute


def read_attribute(cloud: bpy.types.PointCloud, name: str, components: int, into: np.ndarray | None = None) -> np.ndarray:
    """A copy (N, components), in the memory of `into` (N * components,) float32 if given. Raises as `check_attribute`."""
    attribute = check_attribute(cloud, name, components)
    values = np.empty(len(cloud.points) * components, np.float32) if into is None else into
    attribute.data.foreach_get(_value_name(attribute), values)
    return values.reshape(-1, components)


def _value_name(attribute: bpy.types.Attribute) -> str:
    """The property that carries the value: "vector", "value" or "color", by attribute type and Blender version."""
    kinds = {"FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color", "QUATERNION": "value"}
    if attribute.data_type in kinds:
        return kinds[attribute.data_type]
    names = attribute.data[0].bl_rna.properties
    # Older versions have no FLOAT4, hence the lookup.
    return next(name for name in ("vector", "value", "color") if name in names)


def _base_type() -> str:
    kinds = bpy.types.AttributeGroupPointCloud.bl_rna.functions["new"].parameters["type"].enum_items.keys()
    return "FLOAT4" if "FLOAT4" in kinds else "FLOAT_COLOR"


def is_native(cloud: bpy.types.PointCloud) -> bool:
    """True when Blender itself draws this cloud's splats: 5.3 and later do, of a cloud that has the type for it."""
    native = _native_type(cloud)
    return native is not None and getattr(cloud, native[0]) == native[1]


def _native_type(cloud: bpy.types.PointCloud) -> tuple[str, str] | None:
    for prop in cloud.bl_rna.properties:
        if prop.type == "ENUM":
            for item in [entry.identifier for entry in prop.enum_items]:
                if "SPLAT" in item.upper():
                    return prop.identifier, item
    return None


def set_native_type(cloud: bpy.types.PointCloud) -> None:
    """Leaves the drawing to Blender, where it can."""
    native = _native_type(cloud)
    if native:
        setattr(cloud, *native)
