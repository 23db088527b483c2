"""Whether the graphics card draws the views: by the preference, by what device there is, and by a test of it."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import bpy
import gpu
import numpy as np

from ...core.errors import GssmcError
from ...core.geometry.camera import Intrinsics, Pose
from ...core.render import Renderer, RenderSettings
from ...core.render.processes import views_at_once
from ...core.render.view import RenderedView
from ...core.splats.scene import GaussianScene
from ...core.support.steps import run_to_end
from ..viewport.gpu import is_software
from .draw import GpuScan, ViewRequest
from .executor import Holder, executor
from .shaders import Shaders
from .tables import scan_texels, seen_points

log = logging.getLogger(__name__)

Wanted = Literal["AUTO", "CPU", "GPU"]
TEST_GAUSSIANS, TEST_CAMERA = 40_000, Intrinsics(320, 240, 280.0, 280.0, 160.0, 120.0)
# Of the test's pixels so many may differ by a decision at a threshold that falls the other way; by less than this in colour.
ODD_SHARE, EQUAL, ODD = 2e-3, 1e-3, 0.05


@dataclass(frozen=True)
class DeviceTest:
    """What the test found: seconds of one view on the card and on one thread, and what is wrong with the card's, "" nothing."""

    card_s: float
    thread_s: float
    fault: str = ""


class _Session:
    """What is known of this Blender's device: the shaders, and the test's result once it was made."""

    def __init__(self) -> None:
        self.shaders: Shaders | None = None
        self.test: DeviceTest | None = None


_session = _Session()  # compiled shaders and the test are the process's own


@dataclass(frozen=True)
class Plan:
    """Whether a scan's views may come from the card; `forced`: also where that does not pay. `reason`: why not, or ""."""

    card: bool
    forced: bool = False
    reason: str = ""


def plan(wanted: Wanted) -> Plan:
    """The plan before the test, which costs nothing but, in background mode, a GPU context. Main thread."""
    if wanted == "CPU":
        return Plan(False)
    forced = wanted == "GPU"
    if bpy.app.background and not forced and not _device_is_there():
        return Plan(False, reason="this machine has no graphics device")
    if reason := _no_context():
        return Plan(False, forced, reason)
    if not forced and is_software():
        return Plan(False, reason=told("{device} is no graphics card", device=gpu.platform.renderer_get()))
    return Plan(True, forced)


def told(template: str, **values: object) -> str:
    """A reason for the log, which is English; its {names} filled with `values`."""
    return template.format(**values)


def _device_is_there() -> bool:
    """False where Linux says that no graphics device is there: making a context only to learn that takes seconds."""
    if sys.platform != "linux":
        return True
    return any(Path("/dev/dri").glob("renderD*")) or os.path.exists("/dev/nvidiactl")


def _no_context() -> str:
    """Why nothing can be drawn; "" when it can. Makes the context of background mode."""
    try:
        if bpy.app.background:
            if not hasattr(gpu, "init"):
                return told("Blender {version} has no GPU in background mode", version=bpy.app.version_string)
            gpu.init()
        gpu.platform.renderer_get()
    except (SystemError, RuntimeError, AttributeError) as error:
        return str(error)
    return ""


def shaders() -> Shaders:
    """The compiled shaders of this Blender. Main thread."""
    if _session.shaders is None:
        _session.shaders = Shaders()
    return _session.shaders


def tested(owner: Holder) -> DeviceTest:
    """The test's result; it is made once. Any thread; `owner` holds the executor."""
    if _session.test is None:
        _session.test = _test(owner)
        log.info("Graphics card test: %s", _session.test)
    return _session.test


def last_test() -> DeviceTest | None:
    """What the test found, None where none was made in this session."""
    return _session.test


def refusal(test: DeviceTest, forced: bool, threads: int) -> str:
    """Why the card is not used after its test; "" when it is. The processor draws a view on each of `threads` side by side."""
    if test.fault:
        return test.fault
    side_by_side = views_at_once(threads)
    if not forced and test.card_s * side_by_side >= test.thread_s:
        values = {"card": test.card_s, "threads": side_by_side, "thread": test.thread_s}
        return told("its test view took {card:.3f} s, that of one of {threads} threads {thread:.3f} s", **values)
    return ""


def forget() -> None:
    """Lets shaders and test go. Main thread."""
    _session.shaders = _session.test = None


def _test(owner: Holder) -> DeviceTest:
    scene = _cloud()
    settings = RenderSettings(threads=1)
    processor = Renderer(scene, settings)
    start = time.perf_counter()
    right = processor.render(TEST_CAMERA, Pose())
    thread_s = time.perf_counter() - start
    scan = scan_texels(scene)
    request = ViewRequest(TEST_CAMERA, Pose(), seen_points(scan, TEST_CAMERA, Pose(), settings.near))

    def work() -> Generator[None, None, tuple[RenderedView, float]]:
        there = GpuScan(shaders(), scan)
        yield from there.send(scan)
        yield from there.draw(request)  # shaders are compiled in the first
        begin = time.perf_counter()
        view = run_to_end(there.draw(request))
        return view, time.perf_counter() - begin

    try:
        view, card_s = executor.ask(work, owner)
    except GssmcError:
        raise
    except Exception as error:  # noqa: BLE001 - as a shader that does not compile: Blender raises Exception itself
        return DeviceTest(0.0, thread_s, told("its test view failed ({error})", error=error))
    return DeviceTest(card_s, thread_s, difference(view, right))


def difference(view: RenderedView, right: RenderedView) -> str:
    """What is wrong with a view of the card; "" when it is the processor's, up to float32 rounding."""
    if fault := unfit(view):
        return fault
    color, alpha = np.abs(view.color - right.color).max(axis=2), np.abs(view.alpha - right.alpha)
    solid = right.alpha > 0.1
    depth = np.abs(view.depth - right.depth) > EQUAL * right.depth
    variance = np.abs(view.depth_variance - right.depth_variance)
    varies = variance > EQUAL * right.depth_variance + 1e-5 * right.depth**2
    off = (color > EQUAL) | (alpha > EQUAL) | (solid & (depth | varies))
    if off.mean() > ODD_SHARE or color.max() > ODD:
        return told("its test view differs from the processor's in {share:.1%} of the pixels", share=off.mean())
    return ""


def unfit(view: RenderedView) -> str:
    """What no view may hold; "" when all is well."""
    if not all(np.isfinite(part).all() for part in (view.color, view.depth, view.alpha, view.depth_variance)):
        return "it drew values that are no numbers"
    if view.alpha.size and not (view.alpha.min() >= -1e-3 and view.alpha.max() <= 1 + 1e-3):
        return "it drew opacities outside of 0 to 1"
    return ""


def _cloud() -> GaussianScene:
    """Gaussians before the camera, as sizes and opacities are spread in a trained scan."""
    rng, n = np.random.default_rng(11), TEST_GAUSSIANS
    depth = rng.uniform(2.0, 6.0, (n, 1))
    means = np.hstack([rng.uniform(-0.6, 0.6, (n, 1)) * depth, rng.uniform(-0.45, 0.45, (n, 1)) * depth, depth])
    turns = rng.normal(size=(n, 4))
    return GaussianScene(
        means=means.astype(np.float32),
        scales=np.exp(rng.normal(-4.0, 0.7, (n, 3))).astype(np.float32),
        rotations=(turns / np.linalg.norm(turns, axis=1, keepdims=True)).astype(np.float32),
        opacities=rng.beta(0.8, 0.8, n).astype(np.float32),
        sh=(rng.normal(size=(n, 4, 3)) * 0.3).astype(np.float32),
    )
