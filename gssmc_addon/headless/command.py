"""`blender --command gssmc ARGS`: the engine's command line, plus `--blend OUT.blend`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from ...core.cli import main as cli
from ...core.cli.outcome import Outcome

PROGRAM = "blender --command gssmc"


def main(argv: Sequence[str]) -> int:
    """Runs the engine's command line; its exit code."""
    return cli.main(list(argv), prog=PROGRAM, add_options=_add_blend, on_outcome=_save_blend)


def _add_blend(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--blend", type=_blend_path, metavar="OUT.blend", help="also save a scene with splat, cameras and photos"
    )
    parser.add_argument(
        "--up",
        choices=("auto", "y-down", "y-up", "z-up", "z-down"),
        default="auto",
        help="the splat's up axis (auto: by its format)",
    )


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
