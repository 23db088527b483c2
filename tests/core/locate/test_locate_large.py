"""A scan of a million Gaussians: the map's making takes little memory beside it."""

import tracemalloc

import numpy as np
import pytest

from core.locate import MapSettings, build_map
from core.locate.viewpoints import explore, sieve
from core.splats.scene import GaussianScene
from core.synthetic.room import make_scene

PARTS = 50
BYTES_A_GAUSSIAN = 230


@pytest.fixture(scope="module")
def large():
    """The room, each of its Gaussians as PARTS smaller ones in its plane."""
    room = make_scene(gaussians=20_000)
    rng = np.random.default_rng(0)
    scales = np.repeat(room.scales, PARTS, axis=0)
    flat = room.scales.argmin(axis=1) == 2
    assert flat.mean() > 0.9
    from_axes = rng.normal(size=scales.shape).astype(np.float32) * scales
    w, x, y, z = np.repeat(room.rotations, PARTS, axis=0).T
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    second = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)
    means = np.repeat(room.means, PARTS, axis=0) + from_axes[:, :1] * first + from_axes[:, 1:2] * second
    arrays = (means, scales / np.sqrt(PARTS), np.repeat(room.rotations, PARTS, axis=0), np.repeat(room.opacities, PARTS))
    out = [np.ascontiguousarray(array, np.float32) for array in arrays]
    return GaussianScene(*out, np.repeat(room.sh, PARTS, axis=0))


def test_a_map_of_a_million_gaussians_stays_within_its_memory(large, monkeypatch):
    """Not by the whole search, which takes long, but by every part of it: the sieve, looks, and a view."""
    monkeypatch.setattr(sieve, "POSITIONS", 40)
    monkeypatch.setattr(sieve, "RATIO_POSITIONS", 3)
    monkeypatch.setattr(explore, "FIRST_LOOKS", 4)
    assert len(large) == 1_000_000
    tracemalloc.start()
    *_, last = build_map(large, MapSettings(views=1, side_px=320), key="large")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(last.map) == 1
    assert last.map.landmarks > 100
    assert peak < BYTES_A_GAUSSIAN * len(large)
