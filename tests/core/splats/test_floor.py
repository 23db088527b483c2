"""The floor of a scan and the vertical of its photos, of made places whose floor is known."""

import numpy as np
import pytest

from core.geometry.lie import so3_exp
from core.splats.floor import FloorHints, find_floor, vertical_of


def place(seed=0, lean=(0.15, -0.1, 0.4)):
    """A leaning room of a floor, two larger walls and things that stand about; and the rotation that leans it."""
    rng = np.random.default_rng(seed)
    turn = so3_exp(lean)
    floor = np.column_stack([rng.uniform(-3, 3, (3000, 2)), rng.normal(0, 0.01, 3000)])
    wall = np.column_stack([np.full(4000, 3.0), rng.uniform(-3, 3, 4000), rng.uniform(0, 4, 4000)])
    back = np.column_stack([rng.uniform(-3, 3, 4000), np.full(4000, 3.0), rng.uniform(0, 4, 4000)])
    things = rng.uniform((-2, -2, 0), (2, 2, 1.5), (3000, 3))
    dust = rng.uniform((-4, -4, -1), (4, 4, 5), (200, 3))
    return np.concatenate([floor, wall, back, things, dust]) @ turn.T + (1.0, 2.0, -0.5), turn


@pytest.mark.parametrize("seed", range(3))
def test_the_floor_is_found_below_walls_that_are_larger(seed):
    points, turn = place(seed)
    up = so3_exp([0.1, 0.1, 0]) @ turn[:, 2]  # told to some eight degrees
    found = find_floor(points, np.ones(len(points)), FloorHints(up, np.array([[1.0, 2.0, 1.0]])), seed)
    assert np.degrees(np.arccos(found.normal @ turn[:, 2])) < 0.3
    assert abs((found.point - (1.0, 2.0, -0.5)) @ turn[:, 2]) < 0.01


def test_a_ceiling_and_a_heap_are_no_floor():
    points, turn = place()
    assert find_floor(points[3000:], np.ones(len(points) - 3000), FloorHints(turn[:, 2])) is None
    upside_down = FloorHints(-turn[:, 2])
    assert find_floor(points, np.ones(len(points)), upside_down) is None, "all lies below that plane"
    assert find_floor(points[:2], np.ones(2), FloorHints(turn[:, 2])) is None


def test_photos_that_look_about_tell_the_vertical_however_they_are_tilted():
    rng = np.random.default_rng(0)
    right, up = [], []
    for heading in np.linspace(0, 2.5, 8):
        tilt = rng.uniform(0.1, 0.6)  # all look down
        axes = so3_exp([0, 0, heading]) @ so3_exp([np.pi / 2 - tilt, 0, 0]) @ so3_exp([0, 0, rng.normal(0, 0.01)])
        right.append(axes[:, 0])
        up.append(axes[:, 1])
    lean = so3_exp([0.3, -0.2, 0])
    found = vertical_of(np.array(right) @ lean.T, np.array(up) @ lean.T)
    assert np.degrees(np.arccos(found @ lean[:, 2])) < 1.0
    one = vertical_of(np.array(right[:1]), np.array(up[:1]))
    np.testing.assert_allclose(one, up[0], atol=1e-12)
    assert vertical_of(np.zeros((0, 3)), np.zeros((0, 3))) is None
