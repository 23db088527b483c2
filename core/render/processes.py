"""Views drawn side by side in processes that share one scene's tables: threads would wait for each other's interpreter lock."""

from __future__ import annotations

import logging
import os
import threading
import weakref
from collections.abc import Callable, Mapping
from types import TracebackType

import numpy as np

from ..errors import Cancelled
from ..geometry.camera import FloatArray, Intrinsics, Pose
from ..processes.channel import Channel, ChildEndedError
from ..processes.child import ONE_THREAD, Child
from ..splats.scene import GaussianScene
from ..support.scratch import ScratchFolder
from .renderer import Renderer
from .tables import SceneTables, TablesFile, build_tables
from .view import RenderedView, RenderSettings, ViewRenderer

log = logging.getLogger(__name__)

# This process is one of them. A refinement draws six or seven views at a time.
MAX_PROCESSES = 8
# The views of a smaller scene are drawn before a child is ready.
MIN_GAUSSIANS = 20_000
# For one view, and for mapping the tables. A child that needs longer is stuck, and its view is drawn in this process.
LIMIT_S = 300.0
# Where this process is interactive, the priority of the children is lower by this much, so that the window stays responsive.
NICE = 3
StartChild = Callable[[str, Mapping[str, str]], Child]


def views_at_once(threads: int) -> int:
    """How many views are drawn side by side where `threads` are wanted, 0 = one per core."""
    return min(threads or os.cpu_count() or 1, MAX_PROCESSES)


class ProcessRenderer:
    """Draws one scene's views, each on one thread, in up to `settings.threads` processes: this one and its children. With
    `interactive` (this process has a window to keep alive) the children draw all views, once they are ready.

    `render` may be called from any thread, and from as many at once as there are processes; more wait for their turn. Until a
    child is ready, views are drawn in this process. A child that ends, for whatever reason, costs nothing but its share of the
    speed. Views are those of `Renderer`, to the bit. `sole` draws a view that no other is drawn beside: the threads of this
    process share it, unless this process is interactive.
    """

    def __init__(
        self,
        scene: GaussianScene | SceneTables,
        settings: RenderSettings,
        start: StartChild = Child,
        *,
        interactive: bool = False,
    ) -> None:
        """Where no process can be started, nothing is raised and all views are drawn in this process."""
        count = views_at_once(settings.threads)
        tables = scene if isinstance(scene, SceneTables) else build_tables(scene)
        self._children = _Children(count, interactive, start)
        self._finish = weakref.finalize(self, _Children.close, self._children)
        self._children.begin(tables, settings.near)
        self._here = Renderer(tables, RenderSettings(settings.near, threads=1))
        self._sole = None if interactive else Renderer(tables, settings)

    def __enter__(self) -> ProcessRenderer:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @property
    def sole(self) -> ViewRenderer:
        """The renderer for a view that is drawn by itself; see `view.sole_renderer`."""
        return self._sole or self

    def close(self) -> None:
        """Ends the processes at once; views being drawn in them raise Cancelled, as do later ones. Harmless when repeated."""
        self._finish()

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        """Render as a pinhole (distortion ignored). Raises Cancelled when this was closed."""
        while (channel := self._children.take()) is not None:
            try:
                view = _ask(channel, intrinsics, pose)
            except ChildEndedError as end:
                self._children.lose(channel, end)
                continue
            except BaseException as error:
                self._children.lose(channel, error)  # its channel has ended it
                raise
            self._children.give_back(channel)
            return view
        try:
            return self._here.render(intrinsics, pose)
        finally:
            self._children.give_back(None)


def _ask(channel: Channel, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
    """The view, drawn by a child. Raises ChildEndedError."""
    k = intrinsics
    lens = np.array([k.fx, k.fy, k.cx, k.cy])
    _, images = channel.ask({"size": [k.width, k.height]}, [lens, pose.R, pose.t], limit_s=LIMIT_S)
    return RenderedView(*images)


class _Children:
    """The children, and how many more views may be drawn in this process at the same time (`_here`).

    A child that becomes ready takes over one of those views, and gives it back when it ends, so that exactly `count` views can
    be drawn at a time.
    """

    def __init__(self, count: int, interactive: bool, start: StartChild) -> None:
        self._here, self._start = count, start
        self._wanted, self._nice = (count, NICE) if interactive else (count - 1, 0)
        self._all: set[Channel] = set()
        self._ready: list[Channel] = []
        self._changed = threading.Condition()
        self._closed = False
        self._starting = 0
        self._folder: ScratchFolder | None = None

    def begin(self, tables: SceneTables, near: float) -> None:
        """Starts the children, where the scene is large enough for them to be of use."""
        if not self._wanted or len(tables) < MIN_GAUSSIANS:
            return
        try:
            file = tables.file or self._file_of(tables)
        except OSError as error:
            log.warning("Views are drawn in one process, for the scan cannot be shared with others (%s)", error)
            self._forget_file()
            return
        first = {"file": file.path, "offset": file.offset, "rows": len(tables.block), "count": len(tables)}
        first |= {"near": near, "nice": self._nice, "antialiased": tables.antialiased}
        self._starting = self._wanted
        for _ in range(self._wanted):
            try:
                threading.Thread(target=self._bring_up, args=(first, tables.origin), name="gssmc-start", daemon=True).start()
            except RuntimeError as error:  # the system has no more threads to give
                log.warning("A process for drawing cannot be started: %s", error)
                self._started()

    def _file_of(self, tables: SceneTables) -> TablesFile:
        """Writes the tables to a file of their own."""
        self._folder = ScratchFolder()
        file = self._folder.path / "tables"
        tables.block.tofile(file)
        return TablesFile(str(file), 0)

    def _bring_up(self, first: dict[str, object], origin: FloatArray) -> None:
        """Starts one child and takes it in once it is ready to draw."""
        try:
            channel = Channel(self._start("render.worker", ONE_THREAD))
            with self._changed:
                self._all.add(channel)
                closed = self._closed
            if closed:
                channel.kill()
            channel.ask(first, [origin], limit_s=LIMIT_S)
        except OSError as error:
            log.warning("A process for drawing cannot be started: %s", error)
        except ChildEndedError as end:
            self._remove(channel, end)
        else:
            self._take_in(channel)
        finally:
            self._started()

    def _take_in(self, channel: Channel) -> None:
        with self._changed:
            if not self._closed:
                self._ready.append(channel)
                self._here -= 1
                self._changed.notify()
                return
        channel.close()

    def _started(self) -> None:
        """Notes that one more child has mapped the tables, or never will. After the last one their file is removed, so that a
        process that is killed leaves none behind. A system that keeps files which are in use removes it in `close`.
        """
        with self._changed:
            self._starting -= 1
            last = self._starting == 0
        if last:
            self._forget_file()

    def _forget_file(self) -> None:
        if self._folder is not None:
            self._folder.remove()

    def take(self) -> Channel | None:
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

    def give_back(self, channel: Channel | None) -> None:
        with self._changed:
            if channel is None:
                self._here += 1
            else:
                self._ready.append(channel)
            self._changed.notify()

    def lose(self, channel: Channel, reason: BaseException) -> None:
        """A child that was taken has ended; another view may be drawn here instead."""
        self._remove(channel, reason)
        with self._changed:
            self._here += 1
            self._changed.notify()

    def _remove(self, channel: Channel, reason: BaseException) -> None:
        """Forgets a child that has ended, with a warning, unless all were ended on purpose."""
        channel.close()
        with self._changed:
            self._all.discard(channel)
            closed = self._closed
        if not closed:
            log.warning("A process for drawing has ended (%s); its views are drawn in this one", reason)

    def close(self) -> None:
        with self._changed:
            self._closed = True
            channels = list(self._all)
            self._ready = []
            self._changed.notify_all()
        for channel in channels:
            channel.kill()
        for channel in channels:
            channel.close()
        self._forget_file()
