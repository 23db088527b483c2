"""How long Blender's window is held up while the extension works. Runs inside a window, not in background mode:

    blender --enable-event-simulate --python benchmarks/ui_blocking.py

with the extension installed and enabled. A timer that wants to run every 5 ms notes its largest gap in each phase: that is how
long no click would have been answered, whoever was at work. Beside it stands the longest call of the extension's own code.
Makes its own scans: the built-in room, and the same with each Gaussian 25 times (one million, SH degree 3, 248 MB). Prints one
table and quits.
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

MODULE = "bl_ext.user_default.gssmc"
BEAT_S = 0.005
COPIES = 25
LIMIT_S = 100.0
REFINE_S = 8.0  # of the refinement in the large scan that are watched before it is cancelled
rows: list[tuple[str, str, str]] = []


def module(name: str):
    __import__(f"{MODULE}.{name}")
    return sys.modules[f"{MODULE}.{name}"]


class Beat:
    """The timer; `phase()` gives the largest gap since the last call, and the longest single call of the extension's own code
    in the main thread (drawing splats included, Blender's own drawing not).
    """

    def __init__(self) -> None:
        self._last, self._largest, self._own = time.perf_counter(), 0.0, 0.0
        bpy.app.timers.register(self._tick, persistent=True)
        stage, jobs = module("gssmc_addon.viewport_stage").Stage, module("gssmc_addon.jobs")
        for owner, names in (
            (stage, ("draw", "tick")),
            (module("operators.import_splats").GSSMC_OT_import_splats, ("_advance", "_finish")),
            (jobs.RefineJob, ("tick",)),
            (jobs, ("gather", "apply_report")),
        ):
            for name in names:
                setattr(owner, name, self._timed(getattr(owner, name)))

    def _timed(self, function):
        def timed(*args, **kwargs):
            start = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                self._own = max(self._own, time.perf_counter() - start)

        return timed

    def _tick(self) -> float:
        now = time.perf_counter()
        self._largest, self._last = max(self._largest, now - self._last), now
        return BEAT_S

    def phase(self) -> str:
        self._tick()
        largest, own = self._largest, self._own
        self._largest = self._own = 0.0
        return f"{1000 * largest:.0f} | {1000 * own:.0f}"


def in_view(operator, *args, **kwargs):
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    region = next(r for r in area.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def escape() -> None:
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
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
    return list(module("gssmc_addon.viewport")._slot.stage._views.values())


def shown() -> bool:
    return any(view.canvas._shown is not None for view in views())


def complete() -> bool:
    return any(v.rested and v.count == v.limit and v.canvas._shown_key and v.canvas._shown_key[1] == 1 for v in views())


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
    module("core.splats.ply").write_ply(folder / "large.ply", replace(scene, sh=sh, **many))
    return folder / "large.ply"


def import_large(beat: Beat, path: Path) -> Iterator[float]:
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    in_view(bpy.ops.gssmc.import_splats, filepath=str(path), wait=False)
    yield 0.4
    pressed = time.perf_counter()
    escape()
    yield from until(lambda: not modal(), "cancelling the import")
    say("import of 1M cancelled by Esc", time.perf_counter() - pressed, beat.phase())
    assert not bpy.data.pointclouds
    yield 1.0
    beat.phase()
    start = time.perf_counter()
    in_view(bpy.ops.gssmc.import_splats, filepath=str(path), wait=False)
    yield from until(lambda: scene.gssmc.splat, "the import")
    say("import of 1M, 248 MB: object there", time.perf_counter() - start, beat.phase())
    yield from until(shown, "the first display")
    say("and first display (sample of the Gaussians)", time.perf_counter() - start, beat.phase())
    yield from until(complete, "the complete picture")
    say("and every Gaussian drawn, in slices", time.perf_counter() - start, beat.phase())


def turn_view(beat: Beat) -> Iterator[float]:
    from mathutils import Quaternion

    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    view = area.spaces.active.region_3d
    begun, moves = time.perf_counter(), 0
    beat.phase()
    while time.perf_counter() - begun < 5:
        view.view_rotation = view.view_rotation @ Quaternion((0, 1, 0), 0.02)
        area.tag_redraw()
        moves += 1
        yield 0.001
    say("turning the view of 1M for 5 s, seconds per move", (time.perf_counter() - begun) / moves, beat.phase())


def refine(beat: Beat, files, what: str, to_end: bool) -> Iterator[float]:
    in_view(bpy.ops.gssmc.add_photo, filepath=str(files.photo), camera="NEW", camera_file=str(files.start))
    yield 1.0
    yield from until(complete, "the picture through the camera")
    yield 1.0
    beat.phase()
    start = time.perf_counter()
    in_view(bpy.ops.gssmc.refine, "INVOKE_DEFAULT")
    yield 0.2
    say(f"refine in {what}: start", None, beat.phase())
    if to_end:
        yield from until(lambda: not modal(), "the refinement")
        say(f"refine in {what}: to its end", time.perf_counter() - start, beat.phase())
        return
    yield REFINE_S
    say(f"refine in {what}: while it runs", None, beat.phase())
    pressed = time.perf_counter()
    escape()
    yield from until(lambda: not modal(), "cancelling the refinement")
    say(f"refine in {what} cancelled by Esc", time.perf_counter() - pressed, beat.phase())


def steps() -> Iterator[float]:
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sample, large = module("core.synthetic").write_sample(folder), large_scan(folder)
        yield 2.0
        beat = Beat()
        yield 3.0
        beat.phase()
        yield 3.0
        say("nothing, for comparison", None, beat.phase())
        yield from import_large(beat, large)
        yield from turn_view(beat)
        yield from refine(beat, sample, "1M", to_end=False)
        bpy.data.objects.remove(bpy.context.scene.gssmc.splat)
        in_view(bpy.ops.gssmc.import_splats, filepath=str(sample.scene))
        yield from refine(beat, sample, "the room (40,000)", to_end=True)
    print(f"\n{gpu.platform.renderer_get()}; Blender {bpy.app.version_string}; {platform.system()}\n")
    print("| what | s | window held up at most, ms | longest call of ours, ms |\n|---|---|---|---|")
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
