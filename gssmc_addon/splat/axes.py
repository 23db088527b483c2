"""Cameras of other programs beside a splat object: in the coordinates of its file, or in the world of its training."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.cameras.training_world import MOST_POINTS, ScanAxes, training_turns
from . import object as splat_object
from . import up_axis
from .object import BASE, COMPONENTS, read_attribute

_FILE = ("FILE", "Splat File", "The cameras are in the coordinates of the splat's file")
_TRAINING = (
    "TRAINING",
    "Training",
    "The cameras are in the world of the training, which is COLMAP's and has y down",
)
EXPORT_ITEMS = (_FILE, _TRAINING)
IMPORT_ITEMS = (
    ("AUTO", "Automatic", "Those of the splat's file, unless the cameras see the splat only in the world of its training"),
    _FILE,
    _TRAINING,
)


def of(splat: bpy.types.Object) -> ScanAxes:
    """What tells where cameras of the splat are; its Gaussians are left out where both worlds are the same. Raises
    SplatFormatError, KeyError.
    """
    orientation = up_axis.of(splat)
    turns = training_turns(orientation)
    if not turns:
        return ScanAxes(np.zeros((0, 3)), np.zeros(0), ())
    step = max(1, len(splat.data.points) // MOST_POINTS)
    means = read_attribute(splat.data, "position", COMPONENTS["FLOAT_VECTOR"])[::step].astype(np.float64)
    weights = read_attribute(splat.data, BASE, COMPONENTS["FLOAT_COLOR"])[::step, 3].astype(np.float64)
    return ScanAxes(means + splat_object.origin_of(splat), weights, turns, orientation)
