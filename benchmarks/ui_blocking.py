"""How long Blender's window is held up while the extension works. Runs inside a window, not in background mode:

    blender --enable-event-simulate --python benchmarks/ui_blocking.py

with the extension installed and enabled. Its panel is opened. A timer that wants to run every 5 ms notes its largest gap in
each phase: that is how long no click would have been answered, whoever was at work. Beside it stands how much of one gap, at
most, was the extension's own code in the main thread. Rows of "Blender alone" are changes of the same kind that Blender makes
by itself, with nothing of the extension at work. Makes its own scans: the built-in room, and the same with each Gaussian 25
times (one million, SH degree 3, 248 MB). Prints one table and quits.
"""

from __future__ import annotations

import platform
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import bpy
import gpu
import numpy as np
from mathutils import Quaternion

MODULE = "bl_ext.user_default.gssmc"
BEAT_S = 0.005
SLOW_S = 0.09  # a longer gap than any of the machine's other work makes
SETTLE_LIMIT_S = 20.0
MOVES_S = 4.0
COPIES = 25
LIMIT_S = 100.0
REFINE_S = 8.0  # of the refinement in the large scan that are watched before it is cancelled
rows: list[tuple[str, str, str]] = []


def module(name: str):
    __import__(f"{MODULE}.{name}")
    return sys.modules[f"{MODULE}.{name}"]


class Beat:
    """The timer; `phase()` gives the largest gap since the last call, and the largest share that the extension's own code in
    the main thread had in one gap (drawing splats included, and panels).
    """

    def __init__(self) -> None:
        self._last, self._largest, self._own, self._largest_own, self._depth = time.perf_counter(), 0.0, 0.0, 0.0, 0
        self._slow_at = self._last
        bpy.app.timers.register(self._tick, persistent=True)
        jobs, stage = module("gssmc_addon.refine.job"), module("gssmc_addon.viewport.stage").Stage
        panels, photos = module("gssmc_addon.refine.panel"), module("gssmc_addon.photo.panel")
        for owner, names in (
            (stage, ("draw", "tick")),
            (module("gssmc_addon.jobs.operator").JobOperator, ("execute", "begin", "modal")),
            (jobs, ("prepare", "apply_report")),
            (panels.GSSMC_PT_main, ("draw",)),
            (photos.GSSMC_PT_photos, ("draw",)),
        ):
            for name in names:
                setattr(owner, name, self._timed(getattr(owner, name), flush=(owner, name) == (stage, "draw")))

    def _timed(self, function, flush):
        def timed(*args):
            if flush:  # what Blender has asked the graphics for, but not waited for, is not ours
                gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, "FLOAT")
            self._depth += 1
            start = time.perf_counter()
            try:
                return function(*args)
            finally:
                self._depth -= 1
                if self._depth == 0:
                    self._own += time.perf_counter() - start

        two, three = (lambda a, b: timed(*(a, b))), (lambda a, b, c: timed(*(a, b, c)))
        return {2: two, 3: three}.get(function.__code__.co_argcount, timed)  # Blender counts the parameters of what it calls

    def _tick(self) -> float:
        now = time.perf_counter()
        gap, self._last = now - self._last, now
        if gap > SLOW_S:
            self._slow_at = now
        self._largest, self._largest_own, self._own = max(self._largest, gap), max(self._largest_own, self._own), 0.0
        return BEAT_S

    def settle(self) -> Iterator[float]:
        """Waits until nothing has held the window up for a second."""
        yield from self.settle_after(0.0)
        self.phase()

    def settle_after(self, seconds: float) -> Iterator[float]:
        """Lets the phase go on for a while, and until the window is free again."""
        yield seconds
        start = time.perf_counter()
        while time.perf_counter() - self._slow_at < 1.0 and time.perf_counter() - start < SETTLE_LIMIT_S:
            yield 0.05

    def phase(self) -> str:
        self._tick()
        largest, own = self._largest, self._largest_own
        self._largest = self._largest_own = 0.0
        return f"{1000 * largest:.0f} | {1000 * own:.0f}"


def view3d():
    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    return area, area.spaces.active


def in_view(operator, *args, **kwargs):
    window, (area, _) = bpy.context.window_manager.windows[0], view3d()
    region = next(r for r in area.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def escape() -> None:
    window, (area, _) = bpy.context.window_manager.windows[0], view3d()
    x, y = area.x + area.width // 3, area.y + area.height // 3
    window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
    for value in ("PRESS", "RELEASE"):
        window.event_simulate(type="ESC", value=value, x=x, y=y)


def modal() -> bool:
    return any(o.bl_idname.startswith("GSSMC") for w in bpy.context.window_manager.windows for o in w.modal_operators)


def until(condition, what: str) -> Iterator[float]:
    start = time.perf_counter()
    while not condition():
        if time.perf_counter() - start > LIMIT_S:
            raise RuntimeError(f"{what}: not within {LIMIT_S:.0f} s")
        yield 0.02


def views() -> list:
    return list(module("gssmc_addon.viewport.handlers")._handler.stage._views.values())


def shown() -> bool:
    return any(view.canvas.shows for view in views())


def complete() -> bool:
    """Every Gaussian has been drawn in the view as it is, not in an earlier one."""

    def is_complete(view) -> bool:
        if not (view.live and view.rested and view.count == view.limit and view.canvas.shows):
            return False
        ((stamp, count, _, _), _), shrink = view.canvas._shown_key
        return (stamp, count, shrink) == ((view.version, view.stamp), view.limit, 1)

    return any(map(is_complete, views()))


def say(what: str, seconds: float | None, gap: str) -> None:
    rows.append((what, "" if seconds is None else f"{seconds:.2f}", gap))
    print(rows[-1], flush=True)


def large_scan(folder: Path) -> Path:
    scene = module("core.synthetic.room").make_scene(0)
    rng = np.random.default_rng(0)
    many = {n: np.repeat(getattr(scene, n), COPIES, axis=0) for n in ("means", "scales", "rotations", "opacities")}
    many["means"] += (rng.normal(size=many["means"].shape) * many["scales"].min(axis=1, keepdims=True)).astype(np.float32)
    sh = np.zeros((len(many["means"]), 16, 3), np.float32)
    sh[:, : scene.sh.shape[1]] = np.repeat(scene.sh, COPIES, axis=0)
    module("core.splats.ply.reader").write_ply(folder / "large.ply", replace(scene, sh=sh, **many))
    return folder / "large.ply"


def open_panel(category: str) -> Iterator[float]:
    area, space = view3d()
    space.show_region_ui = True
    yield 1.0
    next(r for r in area.regions if r.type == "UI").active_panel_category = category
    yield 1.0


def moves(beat: Beat, what: str, move) -> Iterator[float]:
    """As many redraws as there is time for, each after a small change."""
    yield from beat.settle()
    begun, count = time.perf_counter(), 0
    while time.perf_counter() - begun < MOVES_S:
        move(count)
        count += 1
        yield 0.001
    say(what, (time.perf_counter() - begun) / count, beat.phase())


def turn(_: int) -> None:
    area, space = view3d()
    space.region_3d.view_rotation = space.region_3d.view_rotation @ Quaternion((0, 1, 0), 0.02)
    area.tag_redraw()


def nudge(_: int) -> None:
    bpy.context.scene.camera.location.x += 0.001


def blender_alone(beat: Beat) -> Iterator[float]:
    """Before anything of the extension is in the scene."""
    workspace = bpy.context.window_manager.windows[0].workspace
    yield from moves(beat, "Blender alone: text in the status bar", lambda n: workspace.status_text_set(f"Text {n}"))
    workspace.status_text_set(None)
    sidebar = next(r for r in view3d()[0].regions if r.type == "UI")
    yield from moves(beat, "Blender alone: its own sidebar (View) drawn anew", lambda _: sidebar.tag_redraw())
    yield from open_panel("GS-SMC")
    yield from moves(beat, "Blender alone: an empty viewport turned, s per move", turn)
    yield from beat.settle()
    in_view(bpy.ops.mesh.primitive_grid_add, "INVOKE_DEFAULT", x_subdivisions=999, y_subdivisions=999, size=4)
    yield from beat.settle_after(1.0)
    say("Blender alone: a grid of 1M vertices added (Add > Mesh)", None, beat.phase())
    yield from moves(beat, "Blender alone: the view of that grid turned, s per move", turn)
    bpy.data.meshes.remove(bpy.context.object.data)


def import_large(beat: Beat, path: Path) -> Iterator[float]:
    scene = bpy.context.scene
    yield from beat.settle()
    in_view(bpy.ops.gssmc.import_splats, filepath=str(path), wait=False)
    yield 0.4
    pressed = time.perf_counter()
    escape()
    yield from until(lambda: not modal(), "cancelling the import")
    say("import of 1M cancelled by Esc", time.perf_counter() - pressed, beat.phase())
    assert not bpy.data.pointclouds
    yield from beat.settle()
    start = time.perf_counter()
    in_view(bpy.ops.gssmc.import_splats, filepath=str(path), wait=False)
    yield from until(lambda: scene.gssmc.splat, "the import")
    say("import of 1M, 248 MB: object there", time.perf_counter() - start, beat.phase())
    yield from until(shown, "the first display")
    say("and first display (sample of the Gaussians)", time.perf_counter() - start, beat.phase())
    yield from until(complete, "the complete picture")
    say("and every Gaussian drawn, in slices", time.perf_counter() - start, beat.phase())


def turn_large(beat: Beat) -> Iterator[float]:
    own = bpy.context.scene.gssmc.splat.gssmc
    yield from moves(beat, "turning the view of 1M, s per move", turn)
    own.show_as = "BOX"
    yield 0.5
    yield from moves(beat, "Blender alone: the same, shown as a box, s per move", turn)
    own.show_as = "SPLATS"


def begin_refine(beat: Beat, files, what: str) -> Iterator[float]:
    in_view(bpy.ops.gssmc.add_photo, filepath=str(files.photo), camera="NEW", camera_file=str(files.start))
    yield 1.0
    yield from until(complete, "the picture through the camera")
    yield from beat.settle()
    in_view(bpy.ops.gssmc.refine, "INVOKE_DEFAULT")
    job = module("gssmc_addon.jobs.slot").active()
    start = time.perf_counter()
    yield from until(lambda: job._copying is None, "the splat's copy")
    say(f"refine in {what}: the splat copied", time.perf_counter() - start, beat.phase())


def refine_and_cancel(beat: Beat, files) -> Iterator[float]:
    yield from begin_refine(beat, files, "1M")
    yield REFINE_S
    say("refine in 1M: while it runs", None, beat.phase())
    pressed = time.perf_counter()
    escape()
    yield from until(lambda: not modal(), "cancelling the refinement")
    say("refine in 1M cancelled by Esc", time.perf_counter() - pressed, beat.phase())


def refine_to_end(beat: Beat, files) -> Iterator[float]:
    start, job = time.perf_counter(), module("gssmc_addon.jobs.slot")
    yield from begin_refine(beat, files, "the room (40,000)")
    yield from until(lambda: job.active() is None or job.active().fraction > 0.9, "the refinement")
    say("refine in the room: while it runs", None, beat.phase())
    yield from until(lambda: not modal(), "the refinement")
    seconds = time.perf_counter() - start
    yield from beat.settle_after(1.0)
    say("refine in the room: its end, and the view drawn anew", seconds, beat.phase())
    yield from moves(beat, "that camera moved, s per move", nudge)
    bpy.context.scene.gssmc.splat.gssmc.show_as = "BOX"
    yield 0.5
    yield from moves(beat, "Blender alone: the same, shown as a box, s per move", nudge)


def steps() -> Iterator[float]:
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sample, large = module("core.synthetic").write_sample(folder), large_scan(folder)
        yield from open_panel("View")
        beat = Beat()
        yield from beat.settle()
        yield 3.0
        say("nothing, for comparison", None, beat.phase())
        yield from blender_alone(beat)
        yield from import_large(beat, large)
        yield from turn_large(beat)
        yield from refine_and_cancel(beat, sample)
        bpy.data.objects.remove(bpy.context.scene.gssmc.splat)
        in_view(bpy.ops.gssmc.import_splats, filepath=str(sample.scene))
        yield from refine_to_end(beat, sample)
    print(f"\n{gpu.platform.renderer_get()}; Blender {bpy.app.version_string}; {platform.system()}\n")
    print("| what | s | window held up at most, ms | of that ours, ms |\n|---|---|---|---|")
    for row in rows:
        print("| " + " | ".join(row) + " |")
    sys.stdout.flush()


def main() -> None:
    work = steps()

    def tick() -> float | None:
        try:
            return next(work)
        except StopIteration:
            bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(tick, first_interval=1.0)


if __name__ == "__main__":
    main()
