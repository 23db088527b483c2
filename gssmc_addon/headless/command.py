"""`blender --command gssmc ARGS`: the engine's command line, plus `--blend OUT.blend` and `--renderer`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

import bpy

from ...core.cli import main as cli
from ...core.cli.outcome import Outcome
from ...core.render import ProcessRenderer, RenderSettings
from ...core.splats.scene import GaussianScene
from ..registration import preferences
from ..render_gpu.choice import Wanted
from ..render_gpu.offer import CardOffer
from ..render_gpu.renderer import ClosingRenderer
from . import served

PROGRAM = "blender --command gssmc"
DRAWING = ("refine", "locate", "demo")  # the commands whose views the graphics card may draw


def main(argv: Sequence[str]) -> int:
    """Runs the engine's command line; its exit code."""
    if not argv or argv[0] not in DRAWING:
        return cli.main(list(argv), prog=PROGRAM, add_options=_add_options, on_outcome=_save_blend)
    offer = CardOffer(_wanted(argv), preferences.memory_limit(bpy.context), 0)
    add_options = partial(_add_options, offer=offer)
    if not offer.asks:
        return cli.main(list(argv), prog=PROGRAM, add_options=add_options, on_outcome=_save_blend)
    # The card is drawn with in this thread, so the command runs in another, and hands back what is Blender's.
    with served.MainThreadOutcome(_save_blend) as saving:
        return saving.run(partial(cli.main, list(argv), prog=PROGRAM, add_options=add_options, on_outcome=saving.save))


def _wanted(argv: Sequence[str]) -> Wanted:
    """What is to draw, before the command line is parsed: making a context belongs to the beginning, in the main thread."""
    parser = argparse.ArgumentParser(add_help=False, exit_on_error=False, allow_abbrev=False)
    parser.add_argument("--renderer")
    try:
        said = (parser.parse_known_args(argv)[0].renderer or "").upper()
    except argparse.ArgumentError:
        said = ""
    for wanted in ("AUTO", "CPU", "GPU"):
        if said == wanted:
            return wanted
    return preferences.renderer(bpy.context)


def _add_options(parser: argparse.ArgumentParser, offer: CardOffer | None = None) -> None:
    parser.add_argument(
        "--blend", type=_blend_path, metavar="OUT.blend", help="also save a scene with splat, cameras and photos"
    )
    parser.add_argument(
        "--up",
        choices=("auto", "y-down", "y-up", "z-up", "z-down"),
        default="auto",
        help="the splat's up axis (auto: by its format)",
    )
    if parser.prog.split()[-1] in DRAWING:
        parser.add_argument(
            "--renderer",
            choices=("auto", "cpu", "gpu"),
            help="what draws the views: the processor, or the graphics card (auto: where it pays; default: the preference)",
        )
    if offer is not None:
        parser.set_defaults(make_renderer=partial(_renderer, offer))


def _renderer(offer: CardOffer, scene: GaussianScene, settings: RenderSettings) -> closing[ClosingRenderer]:
    return closing(offer.renderer(scene, settings, lambda: ProcessRenderer(scene, settings)))


def _save_blend(args: argparse.Namespace, outcome: Outcome) -> None:
    if args.blend:
        from . import blend_file

        blend_file.save(args.blend, outcome, getattr(args, "out", None), args.up.replace("-", "_").upper())


def _blend_path(text: str) -> Path:
    """Checks the folder before the work begins, so that a long run does not end without a place for its result."""
    path = Path(text)
    if not path.resolve().parent.is_dir():
        raise argparse.ArgumentTypeError(f"the folder '{path.parent}' does not exist; create it or give another path.")
    return path
