"""What a scan tells of its photographs: the side they were taken from, the distance, and what a place sees all around."""

import numpy as np
import pytest

from core.locate.viewpoints.candidates import candidate_views, measured_ratio, spread_out
from core.locate.viewpoints.panorama import CELLS, cell_directions, cube_cells, panorama_at, view_directions
from core.locate.viewpoints.sieve import sieved
from core.locate.viewpoints.surface import Surface, sample_surface
from core.render.constants import SH_C0
from core.splats.scene import GaussianScene
from core.support.steps import run_to_end

TOWARDS = np.array([0.3, -0.5, -0.81])  # where the photographs of the wall were taken from
SH_ORDER = [1, 2, 0]  # the first-degree coefficients go with y, z and x of the direction


def wall(rng, *, sh=False, haze=False, sizes=False, count=1500):
    """A textured wall in the plane z = 0 whose Gaussians carry the asked signs of having been seen from `TOWARDS`."""
    means = np.column_stack([rng.uniform(-1, 1, (count, 2)), 0.01 * rng.normal(size=count)])
    colors = rng.uniform(0.1, 0.9, (count, 3))
    harmonics = np.zeros((count, 4 if sh else 1, 3))
    harmonics[:, 0] = (colors - 0.5) / SH_C0
    if sh:
        # Colour rises with contrast towards the photographers; SH of degree 1 are -y, z, -x of the ray from the camera.
        gradient = 0.1 * (colors - 0.5)[:, None, :] * -TOWARDS[:, None]
        harmonics[:, 1:] = gradient[:, SH_ORDER] * np.array([-1, 1, -1])[:, None]
    scales = np.full((count, 3), 0.02)
    if sizes:
        means[:, 2] = 0.05 * np.abs(rng.normal(size=count))
        scales *= np.exp(10 * means[:, 2:])
    opacities = np.full(count, 0.9)
    if haze:
        before = means[: count // 3] + TOWARDS * rng.uniform(0.05, 0.5, (count // 3, 1))
        means, opacities = np.concatenate([means, before]), np.concatenate([opacities, np.full(len(before), 0.03)])
        scales = np.concatenate([scales, scales[: len(before)]])
        harmonics = np.concatenate([harmonics, harmonics[: len(before)]])
    rotations = np.zeros((len(means), 4))
    rotations[:, 0] = 1
    return GaussianScene(*(np.ascontiguousarray(a, np.float32) for a in (means, scales, rotations, opacities, harmonics)))


@pytest.mark.parametrize("signs", [{"sh": True}, {"haze": True}, {"sizes": True}, {"sh": True, "haze": True, "sizes": True}])
def test_a_wall_faces_those_who_photographed_it(signs):
    surface = sample_surface(wall(np.random.default_rng(3), **signs), 1000, np.random.default_rng(0))
    inner = np.abs(surface.points[:, :2]).max(axis=1) < 0.8  # at the border the haze and the neighbours are one-sided
    right = surface.facing[inner] @ np.array([0, 0, -1] if signs == {"sizes": True} else TOWARDS) > 0
    assert right.mean() > 0.95


def test_a_scan_without_opaque_gaussians_has_no_surface_and_no_viewpoints():
    scene = wall(np.random.default_rng(0))
    faint = GaussianScene(scene.means, scene.scales, scene.rotations, np.full_like(scene.opacities, 0.1), scene.sh)
    surface = sample_surface(faint, 100, np.random.default_rng(0))
    assert len(surface) == 0
    assert list(candidate_views(surface, (50.0,), 5, np.random.default_rng(0))) == []


def test_one_gaussian_is_a_surface():
    scene = wall(np.random.default_rng(0), count=1)
    assert np.isfinite(sample_surface(scene, 100, np.random.default_rng(0)).facing).all()


def test_every_cell_of_the_cube_holds_its_own_direction():
    assert (cube_cells(7 * cell_directions()) == np.arange(CELLS)).all()


def test_the_view_directions_are_even():
    directions = view_directions()
    nearest = np.sort(directions @ directions.T, axis=1)[:, -2]
    assert len(directions) == 42
    assert np.degrees(np.arccos(nearest)).min() > 30


def shell(radius, rng, count=20_000, facing=-1.0):
    points = rng.normal(size=(count, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    area = np.full(count, 3 * 4 * np.pi * radius**2 / count)  # three times opaque
    arrays = (points, np.full(count, radius / 50), area, facing * 0.9 * points / radius)
    return Surface(*(np.asarray(a, np.float32) for a in arrays))


def test_inside_a_shell_every_direction_is_filled_and_outside_few_are():
    surface = shell(2.0, np.random.default_rng(1))
    inside = panorama_at(surface, np.zeros(3, np.float32), 50 * surface.width, 0.5)
    outside = panorama_at(surface, np.array([0, 0, 9], np.float32), 50 * surface.width, 0.5)
    assert inside.filled_share > 0.98
    assert outside.filled_share < 0.05
    assert inside.weight.mean() > 20 * outside.weight.mean()


def test_what_stands_behind_is_hidden():
    rng = np.random.default_rng(2)
    near, far = shell(1.0, rng), shell(3.0, rng)
    both = Surface(*(np.concatenate([getattr(s, n) for s in (near, far)]) for n in ("points", "width", "area", "facing")))
    seen = panorama_at(both, np.zeros(3, np.float32), 50 * both.width, 0.5).seen
    assert seen[: len(near)].mean() > 4 * seen[len(near) :].mean()


@pytest.mark.parametrize("ratio", [50.0, 130.0])
def test_the_distance_of_the_photographs_is_measured(ratio):
    """A shell that was photographed from its middle: the radius is the distance."""
    surface = shell(2.0, np.random.default_rng(1))
    surface = Surface(surface.points, np.full(len(surface), 2.0 / ratio, np.float32), surface.area, surface.facing)
    measured = measured_ratio(surface, 12, np.random.default_rng(0))
    assert ratio / 1.6 < measured < ratio * 1.6


def test_viewpoints_lie_on_the_side_that_the_surface_faces():
    surface = sample_surface(wall(np.random.default_rng(3), sh=True, haze=True, count=6000), 4000, np.random.default_rng(0))
    found = [one for some in candidate_views(surface, (60.0,), 60, np.random.default_rng(0)) for one in some]
    best = [one.viewpoint for one, _ in zip(spread_out(found), range(10), strict=False)]
    assert len(best) == 10
    assert np.mean([view.centre @ TOWARDS > 0 for view in best]) >= 0.9


def test_a_small_thing_in_the_void_has_viewpoints_around_it():
    """A ball of coarse Gaussians fills less than half of any view from where it was photographed."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(300, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    arrays = (points, np.full(300, 0.1), np.full(300, 0.2), 0.9 * points)
    ball = Surface(*(np.asarray(a, np.float32) for a in arrays))
    shares = []
    found = run_to_end(sieved(ball, np.random.default_rng(0)), shares.append)
    assert shares == sorted(shares)
    assert shares[-1] <= 1
    centres = np.array([one.centre for one in found.ahead])
    assert len(centres) >= 100
    assert np.median(np.linalg.norm(centres, axis=1)) > 1.5
    assert np.abs(np.mean(centres / np.linalg.norm(centres, axis=1, keepdims=True), axis=0)).max() < 0.3


def test_the_order_covers_before_it_repeats():
    surface = shell(2.0, np.random.default_rng(1))
    found = [one for some in candidate_views(surface, (50.0,), 40, np.random.default_rng(0)) for one in some]
    order = list(spread_out(found))
    assert len(order) == len(found)
    first = np.array([one.viewpoint.direction for one in order[:6]])
    assert (first @ first.T - 2 * np.eye(6)).max() < 0.9  # no two of the first six look the same way
