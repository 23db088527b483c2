"""The fox scan of ../shared, where it is: a start that is off, and the truth."""

import json
from pathlib import Path

import numpy as np

FOX = Path(__file__).parents[3].parent / "shared" / "scenes" / "fox"
DEPTH = 4.8  # its median depth, in the scan's units


def rotation(axis, degrees):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    a = np.radians(degrees)
    return np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * k @ k


def start_and_truth(tmp_path, name):
    """A camera file with the photo's camera 0.2 units and 4 degrees off, and the true frame."""
    frames = json.loads((FOX / "queries.json").read_text())
    frames = frames["frames"] if isinstance(frames, dict) else frames
    truth = next(f for f in frames if Path(f["file"]).name == name)
    r, t = np.array(truth["R"]), np.array(truth["t"])
    centre = -r.T @ t + (0.15, 0.1, -0.1)
    wrong = rotation((1, 2, 3), 4) @ r
    file = tmp_path / "start.json"
    file.write_text(json.dumps(dict(truth, file=name, R=wrong.tolist(), t=(-wrong @ centre).tolist())))
    return file, -r.T @ t, r


def centre_in_file(camera, splat):
    """The camera's centre in the file's coordinates, by Blender's own matrices."""
    return np.array(splat.matrix_world.inverted() @ camera.matrix_world.translation)
