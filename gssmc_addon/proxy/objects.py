"""The proxies of a splat, as objects: which they are, what they are used for, where they are kept.

A proxy is a mesh object whose `gssmc.proxy_of` points at its splat and whose `gssmc.proxy_use` is one of `uses.USES`. Its mesh
is in the coordinates of the splat's object, and it is the splat's child without a transform of its own, so that it goes where
the splat goes.
"""

from __future__ import annotations

import bpy

from .uses import NONE


def is_proxy(obj: bpy.types.Object) -> bool:
    """Whether the object was made as a proxy; cheap enough for a panel's draw()."""
    return obj.type == "MESH" and obj.gssmc.proxy_use != NONE and obj.gssmc.proxy_of is not None


def proxies_of(splat: bpy.types.Object) -> list[bpy.types.Object]:
    """The proxies of a splat object that are in a scene, by name; those that the user deleted are left out."""
    return [obj for obj in bpy.data.objects if is_proxy(obj) and obj.gssmc.proxy_of == splat and obj.users_scene]
