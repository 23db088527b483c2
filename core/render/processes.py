"""Views drawn side by side in processes that share one scene's tables: threads would wait for each other's interpreter lock."""

from __future__ import annotations

import contextlib
import logging
import os
import tempfile
import threading
import weakref
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType

import numpy as np

from ..errors import Cancelled
from ..geometry.camera import FloatArray, Intrinsics, Pose
from ..processes.child import ONE_THREAD, Child
from ..processes.wire import WireError, receive, send
from ..splats.scene import GaussianScene
from .renderer import Renderer
from .tables import SceneTables, build_tables
from .view import RenderedView, RenderSettings, ViewRenderer

log = logging.getLogger(__name__)

MAX_PROCESSES = 8  # this one included; a refinement draws six or seven views at a time
MIN_GAUSSIANS = 20_000  # a smaller scene's views are drawn before a process has come up
NICE = 3  # of others, where this process is spared: its window comes first
Start = Callable[[str, Mapping[str, str]], Child]


class ProcessRenderer:
    """Draws one scene's views, each on one thread, in up to `settings.threads` processes: this one and others like it, or,
    with `spare` (a window lives here), others alone, once they have come up.

    `render` may be called from any thread, and from as many at once as there are processes; more wait for their turn. The
    others are taken in as they come up, until when views are drawn here. One that ends for whatever reason costs nothing but
    its share of the speed. Views are those of `Renderer`, to the bit. `alone` is one, for views that no other is drawn
    beside: the threads of this process share each, unless it is spared.
    """

    def __init__(self, scene: GaussianScene, settings: RenderSettings, start: Start = Child, *, spare: bool = False) -> None:
        """Raises nothing where no process can be started: all views are drawn here then."""
        count = min(settings.threads or os.cpu_count() or 1, MAX_PROCESSES)
        tables = build_tables(scene)
        self._team = _Team(count, spare, start)
        self._finish = weakref.finalize(self, _Team.close, self._team)
        self._team.begin(tables, settings.near)
        self._here = Renderer(tables, RenderSettings(settings.near, threads=1))
        self._together = None if spare else Renderer(tables, settings)

    def __enter__(self) -> ProcessRenderer:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @property
    def alone(self) -> ViewRenderer:
        return self._together or self

    def close(self) -> None:
        """Ends the processes at once; views being drawn in them raise Cancelled, as do later ones. Harmless when repeated."""
        self._finish()

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        """Render as a pinhole (distortion ignored). Raises Cancelled when this was closed."""
        while (child := self._team.take()) is not None:
            view = _ask(child, intrinsics, pose)
            if view is not None:
                self._team.give_back(child)
                return view
            self._team.bury(child)
        try:
            return self._here.render(intrinsics, pose)
        finally:
            self._team.give_back(None)


def _ask(child: Child, intrinsics: Intrinsics, pose: Pose) -> RenderedView | None:
    """The view, drawn by the child; None when it has ended."""
    k = intrinsics
    try:
        send(child.stdin, {"size": [k.width, k.height]}, [np.array([k.fx, k.fy, k.cx, k.cy]), pose.R, pose.t])
        answer = receive(child.stdout)
    except (OSError, ValueError, WireError):
        return None
    return RenderedView(*answer[1]) if answer else None


class _Team:
    """Who draws: children that are ready, and `here`, how many more views may be drawn in this process meanwhile."""

    def __init__(self, count: int, spare: bool, start: Start) -> None:
        self._here, self._start = count, start
        self._wanted, self._nice = (count, NICE) if spare else (count - 1, 0)
        self._all: set[Child] = set()
        self._ready: list[Child] = []
        self._changed = threading.Condition()
        self._closed = False
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def begin(self, tables: SceneTables, near: float) -> None:
        """Starts the children, where the scene is large enough for them to be of use."""
        if not self._wanted or len(tables) < MIN_GAUSSIANS:
            return
        try:
            self._folder = tempfile.TemporaryDirectory(prefix="gssmc-", ignore_cleanup_errors=True)
            file = Path(self._folder.name) / "tables"
            tables.block.tofile(file)
        except OSError as error:
            log.warning("Views are drawn in one process, for the scan cannot be shared with others (%s)", error)
            return
        first = {"file": str(file), "rows": len(tables.block), "count": len(tables), "near": near, "nice": self._nice}
        for _ in range(self._wanted):
            threading.Thread(target=self._bring_up, args=(first, tables.origin), name="gssmc-start", daemon=True).start()

    def _bring_up(self, first: dict[str, object], origin: FloatArray) -> None:
        """Starts one child and takes it in once it is ready to draw."""
        try:
            child = self._start("render.worker", ONE_THREAD)
        except OSError as error:
            log.warning("A process for drawing cannot be started: %s", error)
            return
        with self._changed:
            self._all.add(child)
        try:
            send(child.stdin, first, [origin])
            ready = receive(child.stdout) is not None
        except (OSError, ValueError, WireError):
            ready = False
        with self._changed:
            if ready and not self._closed:
                self._ready.append(child)
                self._here -= 1
                self._changed.notify()
                return
        self.bury(child)

    def take(self) -> Child | None:
        """A child to draw the next view, or None when it is to be drawn here; waits until there is either."""
        with self._changed:
            while True:
                if self._closed:
                    raise Cancelled("Rendering was cancelled.")
                if self._ready:
                    return self._ready.pop()
                if self._here > 0:
                    self._here -= 1
                    return None
                self._changed.wait()

    def give_back(self, child: Child | None) -> None:
        with self._changed:
            if child is None:
                self._here += 1
            else:
                self._ready.append(child)
            self._changed.notify()

    def bury(self, child: Child) -> None:
        """Ends a child that gave no answer; another view may be drawn here instead."""
        child.kill()
        if not self._closed:
            log.warning("A process for drawing has ended (%s); its views are drawn in this one", child.last_words())
        child.close()
        with self._changed:
            self._all.discard(child)
            self._here += 1
            self._changed.notify()

    def close(self) -> None:
        with self._changed:
            self._closed = True
            children = list(self._all)
            idle, self._ready = self._ready, []
            self._changed.notify_all()
        for child in children:
            child.kill()
        for child in idle:
            child.close()
        if self._folder is not None:
            with contextlib.suppress(OSError):
                self._folder.cleanup()
