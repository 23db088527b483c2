"""The real scan and its real photos, through Blender: the answer fits wherever the splat object stands."""

import numpy as np
import pytest
from fox import DEPTH, FOX, centre_in_file, start_and_truth

pytestmark = pytest.mark.skipif(not FOX.exists(), reason="the fox scan (../shared/scenes/fox) is not here")


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
    assert np.linalg.norm(centre_in_file(camera, splat) - centre) < 0.003 * DEPTH
    looking = np.array((splat.matrix_world.inverted() @ camera.matrix_world).to_3x3().normalized()) @ (0, 0, -1)
    assert np.degrees(np.arccos(np.clip(looking @ r[2], -1, 1))) < 0.2
