"""The motions that put a splat on its floor and give it its size, in the coordinates of the scene."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.errors import SplatFormatError
from ...core.splats.floor import FloorHints, find_floor, vertical_of
from ..camera import bridge as camera_bridge
from ..photo import image as photo_image
from ..splat import object as splat_object
from ..splat.object import BASE, COMPONENTS, read_attribute
from ..support.texts import rpt_

UP = Vector((0.0, 0.0, 1.0))
# Three points whose triangle is flatter than this (height over its longest side) do not hold a plane well enough.
FLAT = 0.1
MOST_POINTS = 200_000
# Gaussians that are larger than all but so many are the sky, or fog; they count no more than these.
COVER_QUANTILE = 0.95


def onto_floor(splat: bpy.types.Object, points: Sequence[Vector], cameras: Sequence[Vector] = ()) -> Matrix:
    """The motion that brings the plane through three points of the scene to z = 0, with as little turning as that takes. Above
    are the `cameras`, or where there are none the side that was up before. Raises SplatFormatError when it is no plane.
    """
    a, b, c = points
    normal, longest = (b - a).cross(c - a), max((b - a).length, (c - a).length, (c - b).length)
    if normal.length < FLAT * longest**2 or longest == 0:
        raise SplatFormatError(rpt_("The three points lie nearly on one line; set them so that they span the floor."))
    normal.normalize()
    above = sum((normal.dot(place - a) for place in cameras), 0.0) or normal.z
    return _to_ground((a + b + c) / 3, normal if above >= 0 else -normal)


def _to_ground(middle: Vector, normal: Vector) -> Matrix:
    """Turns `normal` upwards about `middle`, which then goes down to z = 0."""
    turn = normal.rotation_difference(UP).to_matrix().to_4x4()
    return Matrix.Translation((middle.x, middle.y, 0.0)) @ turn @ Matrix.Translation(-middle)


def onto_dominant_plane(scene: bpy.types.Scene, splat: bpy.types.Object) -> Matrix:
    """The same of the plane that most of the splat's surface below the cameras lies in, level as the photos say. Raises
    SplatFormatError when there is none.
    """
    similarity = camera_bridge.splat_similarity(splat)
    step = max(1, len(splat.data.points) // MOST_POINTS)
    means = read_attribute(splat.data, "position", COMPONENTS["FLOAT_VECTOR"])[::step].astype(np.float64)
    opacities = read_attribute(splat.data, BASE, COMPONENTS["FLOAT_COLOR"])[::step, 3].astype(np.float64)
    sizes = np.sort(read_attribute(splat.data, "scale", COMPONENTS["FLOAT_VECTOR"])[::step].astype(np.float64), axis=1)
    area = sizes[:, 1] * sizes[:, 2]
    covered = opacities * np.minimum(area, np.quantile(area, COVER_QUANTILE))
    cameras = photo_cameras(scene, splat)
    turns = np.array([np.array(camera_bridge.world_matrix(obj))[:3, :3] for obj in cameras]).reshape(-1, 3, 3)
    centres = np.array([tuple(camera_bridge.world_matrix(obj).translation) for obj in cameras]).reshape(-1, 3)
    up = vertical_of(turns[:, :, 0], turns[:, :, 1])
    hints = FloorHints(np.array(UP) if up is None else up, centres)
    floor = find_floor(similarity.to_scene(means), covered, hints)
    if floor is None:
        raise SplatFormatError(rpt_("No plane of the splat looks like a floor; click three points of it instead."))
    return _to_ground(Vector(floor.point), Vector(floor.normal))


def to_scale(points: Sequence[Vector], distance: float) -> Matrix:
    """The motion after which two points of the scene are `distance` apart; the height 0, and what lies between the points, stay
    where they are. Raises SplatFormatError when that is no size.
    """
    a, b = points
    apart = (b - a).length
    if distance <= 0 or apart <= 1e-9 * max(a.length, b.length, 1.0):
        raise SplatFormatError(
            rpt_("The two points lie at one place, or the distance is none; give two points that are apart, and how far.")
        )
    middle = (a + b) / 2
    ground = Vector((middle.x, middle.y, 0.0))
    return Matrix.Translation(ground) @ Matrix.Scale(distance / apart, 4) @ Matrix.Translation(-ground)


def photo_cameras(scene: bpy.types.Scene, splat: bpy.types.Object) -> list[bpy.types.Object]:
    """The cameras whose place in the splat is known: those that were solved, by photos or by pins."""
    if splat != scene.gssmc.splat or not splat_object.is_splat(splat):
        return []
    solved = ("TRUSTED", "CHECK", "PINNED")
    cameras = (obj for obj in scene.objects if obj.type == "CAMERA" and photo_image.camera_photo(obj) is not None)
    return [obj for obj in cameras if obj.data.gssmc.verdict in solved]
