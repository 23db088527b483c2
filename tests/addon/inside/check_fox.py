"""The real scan and its real photos, through Blender: the answer fits wherever the splat object stands."""

import json
from pathlib import Path

import numpy as np
import pytest

FOX = Path(__file__).parents[3].parent / "shared" / "scenes" / "fox"

pytestmark = pytest.mark.skipif(not FOX.exists(), reason="the fox scan (../shared/scenes/fox) is not here")


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


@pytest.mark.parametrize("name", ["0009.jpg"])
def test_fox_photo_comes_home(bpy, tmp_path, name):
    bpy.ops.gssmc.import_splats(filepath=str(FOX / "scene.ply"))
    splat = bpy.context.scene.gssmc.splat
    splat.location, splat.rotation_euler, splat.scale = (1, 2, 3), (0.3, -0.2, 1.0), (2.5,) * 3
    start, centre, r = start_and_truth(tmp_path, name)
    bpy.ops.gssmc.add_photo(filepath=str(FOX / "queries" / name), camera_file=str(start))
    assert bpy.ops.gssmc.refine() == {"FINISHED"}
    camera = bpy.context.scene.camera
    bpy.context.view_layer.update()
    assert camera.data.gssmc.verdict in {"TRUSTED", "CHECK"}
    assert np.linalg.norm(centre_in_file(camera, splat) - centre) < 0.003 * 4.8  # 0.3 % of the median depth
    looking = np.array((splat.matrix_world.inverted() @ camera.matrix_world).to_3x3().normalized()) @ (0, 0, -1)
    assert np.degrees(np.arccos(np.clip(looking @ r[2], -1, 1))) < 0.2
