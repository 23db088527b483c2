"""nerfstudio's dataparser_transforms.json: from the world of transforms.json to the one that its splats were trained in.

nerfstudio moves, turns and scales a scene before it trains, and `ns-export` leaves the splat there; the cameras of
transforms.json stay where they were. p_splat = scale * (R p_cameras + t), with `transform` the 3x4 matrix [R | t].
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import CameraError, DatasetError
from ..geometry.conventions import Similarity
from .files import load_json

FILE = "dataparser_transforms.json"


def read_training_world(path: Path) -> Similarity:
    """The similarity from the cameras' world to the splat's. Raises DatasetError or CameraError."""
    data = load_json(path)
    if not isinstance(data, dict) or "transform" not in data or "scale" not in data:
        raise DatasetError(f'\'{path.name}\' lacks "transform" or "scale"; give the {FILE} of the training\'s output folder.')
    matrix = np.eye(4)
    try:
        rows, scale = np.asarray(data["transform"], np.float64), float(data["scale"])
        matrix[:3] = scale * rows[:3]
        return Similarity.from_matrix(matrix)
    except (CameraError, ValueError, TypeError, OverflowError, IndexError):
        raise DatasetError(
            f"'{path.name}' holds no rotation, translation and positive scale; take the file from the training's output anew."
        ) from None
