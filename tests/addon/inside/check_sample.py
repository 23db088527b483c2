"""The built-in sample refined through the operators, with exact truth, wherever the splat object stands."""

import json
import runpy
from pathlib import Path

import cv2
import numpy as np
import plan
import pytest

from core.cameras.files import read_cameras
from core.synthetic import write_sample

EXAMPLE = Path(__file__).parents[3] / "examples" / "composite.py"


@pytest.fixture(scope="module")
def sample(tmp_path_factory):
    return write_sample(tmp_path_factory.mktemp("sample"))


@pytest.mark.main_only
def test_the_camera_comes_home(bpy, sample):
    bpy.ops.gssmc.import_splats(filepath=str(sample.scene))
    scene = bpy.context.scene
    splat = scene.gssmc.splat
    splat.location, splat.rotation_euler, splat.scale = (2, -1, 0.5), (0.2, -0.3, 0.9), (3.0,) * 3
    bpy.ops.gssmc.add_photo(filepath=str(sample.photo), camera_file=str(sample.start))
    camera = scene.camera
    start = camera.matrix_world.copy()
    assert bpy.ops.gssmc.refine() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert camera.matrix_world != start
    assert camera.data.gssmc.verdict == "TRUSTED"
    assert camera.data.gssmc.iterations_done >= 1
    truth = read_cameras(sample.truth)[0]
    centre = np.array(splat.matrix_world.inverted() @ camera.matrix_world.translation)
    assert np.linalg.norm(centre - truth.pose.centre) < 0.005  # metres, from a start 0.38 off
    view = np.array((splat.matrix_world.inverted() @ camera.matrix_world).to_3x3().normalized()) @ (0, 0, -1)
    assert np.degrees(np.arccos(np.clip(view @ truth.pose.R[2], -1, 1))) < 0.1


@pytest.mark.main_only
@pytest.mark.asked
def test_the_same_seed_gives_the_same_camera(bpy, sample):
    bpy.ops.gssmc.import_splats(filepath=str(sample.scene))
    ends = []
    for _ in range(2):
        bpy.ops.gssmc.add_photo(filepath=str(sample.photo), camera="NEW", camera_file=str(sample.start))
        bpy.ops.gssmc.refine(seed=5, iterations=1, long_side_px=320, candidates=4, final="none")
        ends.append([x for row in bpy.context.scene.camera.matrix_world for x in row])
    assert ends[0] == ends[1]


@pytest.mark.main_only
@pytest.mark.asked
def test_a_guessed_focal_length_is_solved_and_written_back(bpy, sample, tmp_path):
    """A start that is 20 % too long; the lens of the file, in a frame of another shape than the photo's."""
    start, truth = json.loads(sample.start.read_text()), read_cameras(sample.truth)[0].intrinsics
    start |= {"fx": 1.2 * start["fx"], "fy": 1.2 * start["fy"], "focal_guessed": True}
    (tmp_path / "guess.json").write_text(json.dumps(start))
    bpy.ops.gssmc.import_splats(filepath=str(sample.scene))
    scene = bpy.context.scene
    bpy.ops.gssmc.add_photo(filepath=str(sample.photo), camera_file=str(tmp_path / "guess.json"))
    data = scene.camera.data
    assert data.gssmc.lens_state == "GUESSED"
    assert bpy.ops.gssmc.refine() == {"FINISHED"}
    render = scene.render
    assert (render.resolution_x, render.resolution_y) == (1920, 1080)
    focal_in_frame = data.lens / data.sensor_width * render.resolution_x
    along_height = focal_in_frame * truth.height / render.resolution_y  # the frame has square pixels, the lens not quite
    assert along_height == pytest.approx(truth.fy, rel=2e-3)
    assert data.gssmc.lens_state == "SOLVED"
    assert data.gssmc.k1 == pytest.approx(truth.dist[0], abs=0.01)


def test_the_example_renders_the_finished_picture(bpy, sample, tmp_path):
    """From scan and photo: a blue ball behind the chest, with its shadow at its right. Other Blenders spare the refinement."""
    steps, quick = runpy.run_path(str(EXAMPLE), run_name="example"), bpy.app.version[:2] != plan.MAIN
    verdict = steps["make_picture"](sample.scene.parent, tmp_path, 2, quick=quick)
    assert verdict == ("NONE" if quick else "TRUSTED")
    picture = cv2.imread(str(tmp_path / "composite.png")).astype(int)
    photo = cv2.imread(str(sample.photo)).astype(int)
    assert (
        np.percentile(np.abs(picture - photo)[:250], 95) <= 1
    )  # With two samples, some rays miss light that the ball takes away.
    blue = picture[..., 0] - picture[..., 2] > 30
    assert blue[340:375, 392:412].mean() > 0.9  # beside the chest
    assert blue[345:385, 340:370].mean() < 0.05  # behind it
    assert (photo - picture)[390:402, 405:425].mean() > 10
    assert (tmp_path / "composite.blend").exists()
