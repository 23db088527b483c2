"""A proxy from beginning to end: views drawn, fused, the surface taken out, cleaned, decimated and coloured."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ProxyError
from ..geometry.camera import Camera, FloatArray
from ..render import RenderSettings
from ..splats.scene import GaussianScene
from ..support.steps import converted, run_to_end
from .blocks import CHUNK, Blocks, allocated, fused, surface_cells
from .decimate import decimated
from .mesh import ProxyMesh, coloured
from .pieces import IntArray, compacted, with_holes_closed, without_floaters
from .planes import PlaneRenderer
from .settings import OVERSAMPLING, ProxySettings
from .space import GridSpace
from .surface import surface_nets
from .views import DepthView, covering

NEAREST_PCT = 2.0  # percentile of the depth at which the surfaces begin
COUNTED = 4.0  # pixels: cells of this size are counted to tell how many there would be of others
FINEST = 1.0  # pixels: no voxel is smaller than this at the surface's beginning
FACES_PER_CELL = 3.0
WIDEST_HOLE = 0.25  # of the distance from the grid's centre, or of its radius: a wider opening is a border
# Shares of the progress at which the stages begin: drawing, fusing, decimating.
FUSING, DECIMATING = 0.45, 0.7


@dataclass(frozen=True)
class ProxyStep:
    """One step: what is done, and the `fraction` 0..1 of the whole; while views are drawn, which of how many."""

    step: str
    fraction: float
    view: int = 0
    views: int = 0


def iterate_proxy(
    scene: GaussianScene,
    cameras: Sequence[Camera],
    settings: ProxySettings | None = None,
    should_stop: Callable[[], bool] = lambda: False,
) -> Generator[ProxyStep, None, ProxyMesh]:
    """The mesh of what the cameras see, in the coordinates of the scene's means, as the cameras. Yields after each step, and
    can be closed there. Raises ProxyError when there is no camera, or the cameras show nothing of the scan; Cancelled soon
    after `should_stop`, which may be asked in other threads, says True.
    """
    settings = settings or ProxySettings()
    if not cameras:
        raise ProxyError("There is no camera to make a proxy from; give at least one.")
    views = yield from _drawn(scene, cameras, settings, should_stop)
    space = GridSpace.around([view.camera for view in views], _nearest(views))
    voxel = _voxel(views, space, settings)
    vertices, faces = yield from _surface(views, space, voxel)
    if settings.close_holes:
        distance = np.linalg.norm(vertices, axis=1)
        vertices, faces = with_holes_closed(vertices, faces, WIDEST_HOLE * np.maximum(distance, space.radius))
    cell = voxel * space.scale(vertices).astype(np.float64)
    vertices, faces = yield from converted(decimated(vertices, faces, settings.faces, cell), _reducing)
    vertices = vertices + space.centre
    return ProxyMesh(vertices, faces, coloured(vertices, views))


def make_proxy(scene: GaussianScene, cameras: Sequence[Camera], settings: ProxySettings | None = None) -> ProxyMesh:
    """As `iterate_proxy`, in one go."""
    return run_to_end(iterate_proxy(scene, cameras, settings))


def _drawn(
    scene: GaussianScene, cameras: Sequence[Camera], settings: ProxySettings, should_stop: Callable[[], bool]
) -> Generator[ProxyStep, None, list[DepthView]]:
    """The cameras' views, without those that show nothing. Raises ProxyError when none is left."""
    yield ProxyStep("preparing the splat", 0.0)
    renderer = PlaneRenderer(scene, RenderSettings.for_scene(scene, settings.threads))
    views = []
    for number, camera in enumerate(cameras, 1):
        yield ProxyStep("drawing views", FUSING * (number - 1) / len(cameras), number, len(cameras))
        own = Camera(covering(camera.intrinsics).with_long_side(settings.long_side_px), camera.pose, camera.file)
        view = DepthView.of(own, *renderer.render(own, should_stop), settings.smooth_px)
        if (view.depth > 0).any():
            views.append(view)
    if not views:
        raise ProxyError("The cameras show nothing of the scan; check that they belong to it, and turn them towards it.")
    return views


def _reducing(fraction: float) -> ProxyStep:
    return ProxyStep("reducing triangles", DECIMATING + (1 - DECIMATING) * fraction)


def _nearest(views: Sequence[DepthView]) -> float:
    """The depth at which the surfaces begin, scene units."""
    return float(np.percentile(np.concatenate([view.depth[view.depth > 0] for view in views]), NEAREST_PCT))


def _voxel(views: Sequence[DepthView], space: GridSpace, settings: ProxySettings) -> float:
    """A voxel's side, grid units: as small as the budget of triangles pays for, and the views' pixels."""
    pixel = _nearest(views) / max(view.camera.intrinsics.focal for view in views)
    cells = len(surface_cells(views, space, COUNTED * pixel))
    wanted = settings.faces * OVERSAMPLING / FACES_PER_CELL
    return max(FINEST * pixel, COUNTED * pixel * float(np.sqrt(cells / wanted)))


def _surface(
    views: Sequence[DepthView], space: GridSpace, voxel: float
) -> Generator[ProxyStep, None, tuple[FloatArray, IntArray]]:
    """Vertices (V, 3), relative to the grid's centre, and faces (F, 3) without floaters. Raises ProxyError where there is
    none.
    """
    yield ProxyStep("finding surfaces", FUSING)
    keys = allocated(surface_cells(views, space, voxel))
    parts = []
    for part in fused(keys, views, space, voxel):
        parts.append(part)
        share = min(1.0, len(parts) * CHUNK / len(keys))
        yield ProxyStep("fusing depth", FUSING + (DECIMATING - FUSING) * share)
    places, faces = surface_nets(Blocks(keys, np.concatenate(parts), voxel))
    vertices, faces = compacted(space.from_grid(voxel * places).astype(np.float64), without_floaters(faces, len(places)))
    if len(faces) == 0:
        raise ProxyError("The cameras show no surface of the scan; check that they belong to it, or take other ones.")
    return vertices, faces
