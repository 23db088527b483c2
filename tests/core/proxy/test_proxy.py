"""A proxy of the sample room against its exact truth, and what becomes of cameras that see nothing."""

from dataclasses import replace

import numpy as np
import pytest
from mesh_depth import mesh_depth

from core.errors import Cancelled, ProxyError
from core.geometry.camera import Camera, Pose
from core.proxy import ProxySettings, iterate_proxy, make_proxy
from core.proxy.blocks import SIDE, Blocks, coordinates, keys_of
from core.proxy.pieces import border_loops, open_edges
from core.proxy.planes import PlaneRenderer
from core.proxy.surface import surface_nets
from core.proxy.views import DepthView, sharpened, smoothed
from core.render import RenderSettings
from core.synthetic import make_scene, sample_cameras
from core.synthetic.truth import exact_depth

WIDTH, HEIGHT = 240, 180
SETTINGS = ProxySettings(faces=8_000, long_side_px=WIDTH, threads=1)


@pytest.fixture(scope="module")
def scene():
    return make_scene(0)


@pytest.fixture(scope="module")
def cameras():
    """Small ones, with the sample's lens distortion."""
    return [replace(c, intrinsics=c.intrinsics.resized(WIDTH, HEIGHT)) for c in sample_cameras(6)]


@pytest.fixture(scope="module")
def fused(scene, cameras):
    return make_proxy(scene, cameras[::2], SETTINGS)


@pytest.fixture(scope="module")
def single(scene, cameras):
    return make_proxy(scene, cameras[:1], SETTINGS)


def pinhole(camera):
    return replace(camera, intrinsics=camera.intrinsics.pinhole())


def errors(mesh, camera):
    """Share of the truth's pixels that the mesh covers, and the relative differences in depth there."""
    truth = exact_depth(camera)
    depth = mesh_depth(mesh.vertices, mesh.faces, camera)
    known = np.isfinite(truth)
    both = known & (depth > 0)
    return both.sum() / known.sum(), np.abs(depth / truth - 1)[both]


def test_the_fused_room_is_where_it_truly_is_as_another_camera_sees_it(fused, cameras):
    covered, off = errors(fused, pinhole(cameras[1]))
    assert covered > 0.95
    assert np.median(off) < 0.003 and np.percentile(off, 90) < 0.025


def test_one_camera_is_enough_and_all_of_its_bent_photo_is_covered(single, cameras):
    covered, off = errors(single, pinhole(cameras[0]))
    assert covered > 0.95 and np.median(off) < 0.003
    k = cameras[0].intrinsics
    corners = np.array([[x, y] for x in (1.0, WIDTH - 1.0) for y in (1.0, HEIGHT - 1.0)])
    rays = np.column_stack([k.normalise(corners), np.ones(4)])
    uv = single.uv(cameras[0])
    for ray, corner in zip(rays, corners, strict=True):  # a vertex of the mesh lies near each corner's ray
        local = cameras[0].pose.transform(single.vertices)
        away = np.linalg.norm(local[:, :2] / local[:, 2:] - ray[:2], axis=1) * k.fx
        nearest = away.argmin()
        assert away[nearest] < 12
        assert np.abs(uv[nearest] - (corner / (WIDTH, HEIGHT) * (1, -1) + (0, 1))).max() < 0.06


def test_the_mesh_of_one_camera_is_cut_where_the_depth_jumps(single, cameras):
    """No triangle spans the step between the ball on the chest and the wall behind it."""
    local = cameras[0].pose.transform(single.vertices)[single.faces]
    deep = np.ptp(local[..., 2], axis=1)
    wide = np.linalg.norm(np.ptp(local[..., :2], axis=1), axis=1)
    assert ((deep > 0.4) & (wide < 0.1)).sum() == 0


def test_faces_are_turned_to_the_cameras(fused, cameras):
    corners = fused.vertices[fused.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    eye = np.mean([camera.pose.centre for camera in cameras], axis=0)
    area = np.linalg.norm(normal, axis=1)
    towards = (normal * (eye - corners.mean(axis=1))).sum(axis=1) > 0
    assert area[towards].sum() > 0.9 * area.sum()


def test_colours_are_those_of_the_scan(fused, scene, cameras):
    camera = pinhole(cameras[2])
    view, _ = PlaneRenderer(scene, RenderSettings(threads=1)).render(camera, lambda: False)
    pixels = camera.intrinsics.project(camera.pose.transform(fused.vertices))
    depth = mesh_depth(fused.vertices, fused.faces, camera)
    inside = ((pixels >= 1) & (pixels < (WIDTH - 1, HEIGHT - 1))).all(axis=1)
    column, row = pixels[inside].astype(int).T
    z = camera.pose.transform(fused.vertices[inside])[:, 2]
    seen = np.abs(depth[row, column] / z - 1) < 0.01
    off = np.abs(fused.colors[inside][seen] - view.color[row, column][seen])
    assert seen.sum() > 800 and np.median(off) < 0.02


@pytest.mark.parametrize("budget", [100, 2000])
def test_the_budget_is_kept(scene, cameras, budget):
    mesh = make_proxy(scene, cameras[:1], replace(SETTINGS, faces=budget, long_side_px=160))
    assert 0.5 * budget < len(mesh.faces) <= budget
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    assert (np.diff(np.sort(mesh.faces, axis=1)) > 0).all()


def test_holes_are_closed_when_asked_and_the_border_is_not(scene, cameras, single):
    closed = make_proxy(scene, cameras[:1], replace(SETTINGS, close_holes=True))
    before, after = ([len(loop) for loop in border_loops(mesh.faces)] for mesh in (single, closed))
    assert len(after) < 0.5 * len(before) and max(after) > 50
    camera = pinhole(cameras[0])
    seen = [mesh_depth(mesh.vertices, mesh.faces, camera) > 0 for mesh in (single, closed)]
    assert (~seen[1]).sum() < (~seen[0]).sum()


def test_planes_give_the_depth_of_large_gaussians_seen_aslant(scene, cameras):
    camera = pinhole(cameras[0])
    view, depth = PlaneRenderer(scene, RenderSettings(threads=1)).render(camera, lambda: False)
    truth = exact_depth(camera)
    known = np.isfinite(truth)
    expected, planes = (np.percentile(np.abs(d / truth - 1)[known], 75) for d in (view.depth, depth))
    assert planes < 0.4 * expected


def test_a_pixel_between_two_surfaces_goes_to_the_one_that_it_mostly_shows():
    share = np.array([1, 1, 1, 1, 0.8, 0.3, 0, 0, 0, 0], np.float32)
    depth = np.tile(1 / (share / 2 + (1 - share) / 5), (8, 1)).astype(np.float32)
    assert np.allclose(sharpened(depth)[4], [2] * 5 + [5] * 5)


def test_ripples_go_and_edges_stay():
    x = np.arange(80)
    clean = np.tile(np.where(x < 40, 2.0, 5.0), (60, 1)).astype(np.float32)
    rough = (clean * (1 + np.random.default_rng(0).normal(0, 0.004, clean.shape))).astype(np.float32)
    rough[:, 70:] = 0
    smooth = smoothed(rough, 4.0)
    assert (smooth[:, 70:] == 0).all()
    off = np.abs(smooth / clean - 1)[:, :70]
    assert off.max() < 0.005 and off.mean() < 0.3 * np.abs(rough / clean - 1)[:, :70].mean()


def test_a_steep_plane_has_no_jumps():
    x = np.arange(60, dtype=np.float32)
    depth = np.tile(1 / (0.1 + 0.005 * x), (20, 1)).astype(np.float32)
    assert np.array_equal(sharpened(depth), depth) and np.array_equal(sharpened(depth.T.copy()), depth.T)


def test_the_surface_of_a_ball_is_closed_and_round():
    grid = np.arange(-5, 5)
    keys = np.sort(keys_of(np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)))
    voxels = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1)
    places = SIDE * coordinates(keys)[:, None, None, None] + voxels
    distance = np.clip((np.linalg.norm(places - 0.3, axis=-1) - 10) / 3, -1, 1).astype(np.float32)
    vertices, faces = surface_nets(Blocks(keys, distance, 1.0))
    assert np.abs(np.linalg.norm(vertices - 0.3, axis=1) - 10).max() < 0.05
    assert len(open_edges(faces)) == 0 and len(vertices) - len(faces) / 2 == 2


def test_what_shows_no_scan_is_refused(scene, cameras):
    away = [Camera(c.intrinsics, Pose(c.pose.R, c.pose.t + 1000), c.file) for c in cameras[:2]]
    with pytest.raises(ProxyError, match="show nothing of the scan"):
        make_proxy(scene, away, SETTINGS)
    with pytest.raises(ProxyError, match="give at least one"):
        make_proxy(scene, [], SETTINGS)
    with pytest.raises(ProxyError, match="faces is 3"):
        ProxySettings(faces=3)


def test_it_stops_when_asked_in_the_middle_of_a_view(scene, cameras):
    work = iterate_proxy(scene, cameras[:1], SETTINGS, lambda: True)
    with pytest.raises(Cancelled):
        list(work)


def test_progress_only_grows_and_ends_near_the_whole(scene, cameras):
    steps = list(iterate_proxy(scene, cameras[:2], replace(SETTINGS, long_side_px=120, faces=500)))
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and fractions[0] == 0 and fractions[-1] > 0.95
    assert [step.view for step in steps if step.view] == [1, 2] and {step.views for step in steps if step.view} == {2}


def test_a_view_without_a_surface_at_all_is_left_out(scene, cameras):
    away = Camera(cameras[0].intrinsics, Pose(cameras[0].pose.R, cameras[0].pose.t + 1000), "away")
    mesh = make_proxy(scene, [away, cameras[0]], replace(SETTINGS, long_side_px=120, faces=500))
    assert len(mesh.faces) > 250


def test_depth_view_has_nothing_where_the_scan_is_not(scene, cameras):
    camera = pinhole(cameras[0])
    view, depth = PlaneRenderer(scene, RenderSettings(threads=1)).render(camera, lambda: False)
    thin = replace(view, alpha=np.where(np.arange(WIDTH) < 120, view.alpha, 0.3).astype(np.float32))
    seen = DepthView.of(camera, thin, depth)
    assert (seen.depth[:, 120:] == 0).all() and (seen.weight[:, 120:] == 0).all()
    assert (seen.depth[:, :110] > 0).mean() > 0.99
