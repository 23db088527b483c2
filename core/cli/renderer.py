"""The renderer of a command that refines: the processor's, unless the program that the command line runs in brings another."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import Protocol

from ..render import ProcessRenderer, RenderSettings
from ..render.view import ViewRenderer
from ..splats import GaussianScene


class ClosableRenderer(ViewRenderer, Protocol):
    """A renderer that holds something until it is closed."""

    def close(self) -> None: ...


MakeRenderer = Callable[[GaussianScene, RenderSettings], ClosableRenderer]


@contextmanager
def scene_renderer(args: argparse.Namespace, scene: GaussianScene, threads: int) -> Iterator[ViewRenderer]:
    """The scene's renderer, closed in the end; `args.make_renderer`, where a host program has set it, makes it."""
    make: MakeRenderer = getattr(args, "make_renderer", None) or ProcessRenderer
    with closing(make(scene, RenderSettings.for_scene(scene, threads))) as renderer:
        yield renderer
