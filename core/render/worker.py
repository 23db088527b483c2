"""A process that draws views of one scene for `process_renderer`.

The first message is {"file", "rows", "count", "near", "nice"} with the tables' origin, answered by {} when the file is mapped;
each further one is {"size": [width, height]} with (fx, fy, cx, cy), R and t, answered by the view's four images. It ends when
its input does.
"""

from __future__ import annotations

import os
import sys

import cv2
import numpy as np

from ..geometry.camera import Intrinsics, Pose
from ..processes.child import pipes
from ..processes.wire import receive, send
from .renderer import Renderer
from .tables import SceneTables
from .view import RenderSettings


def main() -> int:
    """Draw what is asked for."""
    requests, answers = pipes()
    cv2.setNumThreads(1)
    first = receive(requests)
    if first is None:
        return 0
    header, (origin,) = first
    if hasattr(os, "nice"):
        os.nice(header["nice"])
    block = np.memmap(header["file"], np.float32, "r", shape=(header["rows"], header["count"]))
    renderer = Renderer(SceneTables(origin, np.asarray(block)), RenderSettings(header["near"], threads=1))
    send(answers, {})
    while (message := receive(requests)) is not None:
        header, (lens, R, t) = message
        view = renderer.render(Intrinsics(*header["size"], *lens.tolist()), Pose.as_it_is(R, t))
        send(answers, {}, [view.color, view.depth, view.alpha, view.depth_variance])
    return 0


if __name__ == "__main__":
    sys.exit(main())
