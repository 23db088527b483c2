"""From a splat object, whoever made it, to a .ply file in the layout that every splat program reads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import bpy
import numpy as np

from ...core.errors import SplatFormatError
from ...core.geometry.conventions import Similarity, orientation_matrix
from ...core.splats.ply.reader import write_ply_axes_kept
from ...core.splats.scene import GaussianScene
from ...core.splats.transform import transformed
from ..support.texts import rpt_
from . import object as splat_object
from .copy import read_splat

Coordinates = Literal["OBJECT", "SCENE", "SCENE_Y_DOWN"]


@dataclass(frozen=True)
class Written:
    """What went into the file, and what could not: `dropped` Gaussians with values that are not finite, SH above degree 3."""

    scene: GaussianScene
    sh_left_out: bool


def splat_of(context: bpy.types.Context) -> bpy.types.Object | None:
    """The splat that an export is about: the active object if it is one, else the scene's picked splat."""
    active = context.active_object
    if active is not None and active.select_get() and splat_object.is_splat(active):
        return active
    picked = context.scene.gssmc.splat
    return picked if splat_object.is_splat(picked) else None


def write(path: Path, splat: bpy.types.Object, coordinates: Coordinates) -> Written:
    """Writes the splat as `path`; the file appears whole or not at all.

    OBJECT keeps the object's own coordinates. SCENE applies the object's rotation, uniform scale and place to means, sizes,
    rotations and SH; z is up in the file then, and with SCENE_Y_DOWN y is down, as the layout's readers expect. Raises
    CameraError when the object is mirrored or scaled unevenly, SplatFormatError when it is no splat or can't be written.
    """
    scene = read_splat(splat)
    if coordinates == "OBJECT":
        scene = replace(scene, origin=splat_object.origin_of(splat))
    if coordinates != "OBJECT":
        scene = transformed(scene, _into_file(splat, coordinates), "Z_UP" if coordinates == "SCENE" else "Y_DOWN")
    try:
        write_ply_axes_kept(path, scene)
    except OSError as error:
        text = rpt_("'{path}' cannot be written ({reason}); choose another place.", path=path, reason=error.strerror)
        raise SplatFormatError(text) from error
    return Written(scene, f"{splat_object.SH_PREFIX}{scene.sh.shape[1] - 1}" in splat.data.attributes)


def _into_file(splat: bpy.types.Object, coordinates: Coordinates) -> Similarity:
    matrix = np.array(splat.matrix_world)
    if coordinates == "SCENE_Y_DOWN":
        matrix = orientation_matrix("Y_DOWN").T @ matrix
    return Similarity.from_matrix(matrix)
