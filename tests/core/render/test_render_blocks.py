"""The tables in spatial order and in blocks: nothing that a view shows is left out, and the order of the file still counts."""

import numpy as np
import pytest
from render_scenes import assert_same_view, cloud, make_scene

from core.geometry.camera import Intrinsics, Pose
from core.geometry.lie import so3_exp
from core.render import Renderer, render_reference
from core.render.project import SplatBuffers, ViewProjection, project_part, seen_blocks
from core.render.scan.blocks import BLOCK, Part, parts_of
from core.render.scan.order import spatial_order
from core.render.tables import SceneTables, build_tables
from core.splats.scene import GaussianScene

CAMERA = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)
WORLD = 40_000


@pytest.fixture(scope="module")
def world() -> SceneTables:
    rng = np.random.default_rng(2)
    means = rng.normal(size=(WORLD, 3)) * np.where(rng.random((WORLD, 1)) < 0.9, 5.0, 300.0)
    return build_tables(make_scene(means, np.exp(rng.normal(-2.5, 1.0, (WORLD, 3))), opacity=0.7))


def poses(count: int) -> list[Pose]:
    rng = np.random.default_rng(8)
    return [Pose.from_centre(so3_exp(2 * rng.normal(size=3)), rng.normal(size=3) * 6) for _ in range(count)]


@pytest.mark.parametrize("pose", poses(12))
def test_every_gaussian_that_a_view_may_show_lies_in_a_seen_block(world: SceneTables, pose: Pose) -> None:
    view = ViewProjection(world, CAMERA, pose, 0.2)
    whole = Part([slice(0, len(world))], slice(0, len(world)))
    shown = project_part(world, view, whole, SplatBuffers(len(world)))
    seen = seen_blocks(world, view)
    assert set(shown // BLOCK) <= set(seen)
    assert 0 < len(shown) < len(world) / 2


def test_threads_change_no_bit_of_the_tables() -> None:
    means, scales = cloud(WORLD, seed=3)
    one, three = (build_tables(make_scene(means, scales, coefficients=16), threads) for threads in (1, 3))
    assert np.array_equal(one.block.view(np.uint32), three.block.view(np.uint32))


def test_a_narrow_view_reads_few_blocks() -> None:
    means = np.random.default_rng(4).uniform(-10, 10, (WORLD, 3))
    tables, narrow = build_tables(make_scene(means, 0.02)), Intrinsics(60, 60, 600.0, 600.0, 30.0, 30.0)
    view = ViewProjection(tables, narrow, Pose(t=np.array([0.0, 0.0, 12.0])), 0.2)
    assert 0 < len(seen_blocks(tables, view)) < len(tables.blocks) / 3


def test_parts_share_the_blocks_and_find_their_columns() -> None:
    count, blocks = 9 * BLOCK + 5, np.array([0, 1, 4, 5, 6, 9])
    rows, want = np.arange(count), [b * BLOCK + i for b in blocks for i in range(BLOCK) if b * BLOCK + i < count]
    parts = parts_of(blocks, count, 2 * BLOCK)
    assert len(parts) % 2 == 0
    assert [p.slots.start for p in parts] == [0, *(p.slots.stop for p in parts[:-1])]
    assert parts[-1].slots.stop == len(want)
    assert np.concatenate([p.columns(rows) for p in parts]).tolist() == want
    for part in parts:
        columns = part.columns(rows)
        index = np.arange(0, len(columns), 7)
        assert part.places(index).tolist() == columns[index].tolist()
    assert parts_of(blocks[:0], count, BLOCK) == []


def test_neighbours_in_space_are_neighbours_in_the_tables() -> None:
    places = np.random.default_rng(3).uniform(-1, 1, (20_000, 3)).astype(np.float32)
    order = spatial_order(places, np.ones(len(places), np.float32))
    assert np.array_equal(np.sort(order), np.arange(len(places)))
    sides = [np.ptp(places[order[a : a + BLOCK]], axis=0).mean() for a in range(0, len(places) - BLOCK, BLOCK)]
    assert np.median(sides) < 0.7, "a block that holds an eightieth of a cube of side 2 is little wider than that needs"
    assert spatial_order(places[:0], places[:0, 0]).tolist() == []
    assert spatial_order(np.zeros((4, 3), np.float32), np.zeros(4, np.float32)).tolist() == [0, 1, 2, 3]


def test_the_widest_stand_behind_all_others() -> None:
    reach = np.ones(1000, np.float32)
    reach[::50] = 30
    order = spatial_order(np.random.default_rng(3).normal(size=(1000, 3)).astype(np.float32), reach)
    assert sorted(order[-20:].tolist()) == list(range(0, 1000, 50))


def test_the_order_of_the_file_does_not_change_the_picture() -> None:
    means, scales = cloud(3 * BLOCK, seed=5)
    scene, mixed = make_scene(means, scales), np.random.default_rng(1).permutation(len(means))
    arrays = (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh)
    other_scene = GaussianScene(*(array[mixed] for array in arrays))
    plain, other = (Renderer(one).render(CAMERA, Pose()) for one in (scene, other_scene))
    assert plain.alpha.max() > 0.5
    np.testing.assert_allclose(other.depth, plain.depth, atol=1e-4)
    np.testing.assert_allclose(other.alpha, plain.alpha, atol=1e-5)


def test_of_one_depth_the_earlier_in_the_file_is_in_front() -> None:
    """A wall seen head-on, larger than a block: its Gaussians are all equally deep and overlap."""
    places = np.random.default_rng(6).uniform(-1.5, 1.5, (2 * BLOCK, 2))
    wall = make_scene(np.hstack([places, np.full((len(places), 1), 3.0)]), 0.1, opacity=0.8)
    small = Intrinsics(24, 20, 20.0, 20.0, 12.0, 10.0)
    assert_same_view(Renderer(wall).render(small, Pose()), render_reference(wall, small, Pose()))
