"""The near plane follows the size of the scan."""

from dataclasses import replace

import numpy as np

from core.render import Renderer, RenderSettings
from core.synthetic import make_scene, sample_cameras


def test_a_room_keeps_inrias_near_plane_and_a_thimble_does_not_lose_its_front():
    scene = make_scene(gaussians=4_000)
    assert RenderSettings.for_scene(scene, 3) == RenderSettings(near=0.2, threads=3)
    camera = sample_cameras()[0]
    small = replace(scene, means=scene.means * np.float32(0.01), scales=scene.scales * np.float32(0.01))
    near = replace(camera.pose, t=camera.pose.t * 0.01)
    lens = camera.intrinsics.pinhole().resized(80, 60)
    want = Renderer(scene, RenderSettings.for_scene(scene)).render(lens, camera.pose)
    got = Renderer(small, RenderSettings.for_scene(small)).render(lens, near)
    assert Renderer(small, RenderSettings()).render(lens, near).alpha.max() == 0  # all of it lies nearer than 0.2
    np.testing.assert_allclose(got.color, want.color, atol=0.02)
