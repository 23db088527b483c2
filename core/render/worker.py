"""A process that draws views of one scene for render/processes.py.

The first message is {"file", "offset", "rows", "count", "near", "nice", "antialiased"} with the tables' origin, answered by {}
when the file is mapped; each further one is {"size": [width, height]} with fx fy cx cy, R and t, answered by the view's four
images. It ends when its input does.
"""

from __future__ import annotations

import os
import sys

import cv2
import numpy as np

from ..geometry.camera import Intrinsics, Pose
from ..processes.requests import Requests
from .renderer import Renderer
from .tables import SceneTables
from .view import RenderSettings


def main() -> int:
    """Draws a view for each request, until there are no more."""
    requests = Requests()
    cv2.setNumThreads(1)
    header, (origin,) = requests.next()
    if hasattr(os, "nice"):
        os.nice(header["nice"])
    block = np.memmap(header["file"], np.float32, "r", header["offset"], (header["rows"], header["count"]))
    tables = SceneTables(origin, np.asarray(block), header["antialiased"])
    renderer = Renderer(tables, RenderSettings(header["near"], threads=1))
    requests.answer({})
    while True:
        header, (lens, R, t) = requests.next()
        view = renderer.render(Intrinsics(*header["size"], *lens.tolist()), Pose.as_it_is(R, t))
        requests.answer({}, [view.color, view.depth, view.alpha, view.depth_variance])


if __name__ == "__main__":
    sys.exit(main())
