"""The scan as small views need it looks as the whole scan does, from as far away as it was photographed."""

import numpy as np
import pytest

from core.locate.viewpoints.eye import Eye, square_camera
from core.locate.viewpoints.thin import share_for, thinned
from core.render import Renderer, RenderSettings
from core.splats.scene import GaussianScene
from core.synthetic.room import make_scene
from core.synthetic.sample import sample_cameras


def split(scene, parts, seed=0):
    """Each Gaussian as `parts` smaller ones that lie in its place and look the same together."""
    rng = np.random.default_rng(seed)
    count = len(scene) * parts
    axes = np.repeat(scene.scales, parts, axis=0)
    offset = rng.normal(size=(count, 3)) * axes * np.float32(0.8)
    w, x, y, z = np.repeat(scene.rotations, parts, axis=0).T
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    means = np.repeat(scene.means, parts, axis=0) + np.einsum("ijn,nj->ni", R, offset)
    arrays = (means, axes / np.sqrt(parts), np.column_stack([w, x, y, z]), np.repeat(scene.opacities, parts))
    out = [np.ascontiguousarray(array, np.float32) for array in arrays]
    return GaussianScene(*out, np.repeat(scene.sh, parts, axis=0))


@pytest.fixture(scope="module")
def room():
    return make_scene(gaussians=8000)


def test_a_share_covers_as_much_as_the_whole(room):
    many = split(room, 6)
    half = thinned(many, 0.25, 0)
    assert len(half) == round(0.25 * (many.opacities >= 0.1).sum())
    camera, pose = square_camera(96), sample_cameras(1)[0].pose
    whole, some = (Renderer(s, RenderSettings(threads=1)).render(camera, pose) for s in (many, half))
    assert abs(whole.alpha.mean() - some.alpha.mean()) < 0.03
    assert np.median(np.abs(whole.depth - some.depth) / whole.depth) < 0.02
    blocks = [view.color.reshape(12, 8, 12, 8, 3).mean(axis=(1, 3)) for view in (whole, some)]
    assert np.abs(blocks[0] - blocks[1]).mean() < 0.04


def test_haze_is_left_out_and_depth_is_steadier(room):
    """A cloud of faint Gaussians before a wall makes the depth of its pixels unsteady, whose features are then of no use."""
    rng = np.random.default_rng(0)
    n = 6000
    pose = sample_cameras(1)[0].pose
    ahead = pose.centre + pose.R[2] * rng.uniform(0.5, 2.0, (n, 1)) + rng.normal(size=(n, 3)) * 0.5
    haze = (ahead, np.full((n, 3), 0.06), np.tile([1.0, 0, 0, 0], (n, 1)), np.full(n, 0.06), np.zeros((n, room.sh.shape[1], 3)))
    arrays = zip((room.means, room.scales, room.rotations, room.opacities, room.sh), haze, strict=True)
    hazy = GaussianScene(*(np.concatenate([a, np.asarray(b, np.float32)]) for a, b in arrays))
    seen = [len(Eye(scene).look(pose, square_camera(320), 2.5).points) for scene in (hazy, thinned(hazy, 1.0, 0))]
    assert seen[1] > 1.5 * seen[0]


def test_a_scan_of_haze_alone_stays(room):
    faint = GaussianScene(room.means, room.scales, room.rotations, np.full_like(room.opacities, 0.05), room.sh)
    assert len(thinned(faint, 1.0, 0)) == len(room)


def test_no_more_gaussians_than_pixels_can_show():
    camera = square_camera(96)
    assert share_for(camera, 100.0) == 1.0
    assert share_for(camera, 600.0) == pytest.approx(share_for(camera, 300.0) / 4)
