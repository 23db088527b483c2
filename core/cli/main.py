"""The command line, the same under `python -m core` and inside Blender.

Exit code 0, 2 for bad input, 3 when a refinement ended in "failed", 130 when it was interrupted; errors are one sentence on
stderr.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

from ..errors import GssmcError
from .commands import batch, convert, demo, evaluate, features, locate, merge, pins, proxy, refine, render, stmap, track
from .commands import map as make_map
from .console import message
from .flags import OneLineParser
from .outcome import BAD_INPUT, INTERRUPTED, Outcome

COMMANDS = {
    "render": render,
    "refine": refine,
    "locate": locate,
    "pins": pins,
    "batch": batch,
    "merge": merge,
    "map": make_map,
    "demo": demo,
    "evaluate": evaluate,
    "convert": convert,
    "stmap": stmap,
    "track": track,
    "proxy": proxy,
    "features": features,
}
WITHOUT_SCENE = frozenset(
    {"evaluate", "convert", "stmap", "features", "map", "merge", "pins", "track", "proxy"}
)  # a caller that saves scenes has nothing to add to them


def build_parser(
    prog: str = "python -m core", add_options: Callable[[argparse.ArgumentParser], None] | None = None
) -> argparse.ArgumentParser:
    """The parser with all subcommands; `add_options` may add to each of them. Wrong usage raises UsageError."""
    parser = OneLineParser(prog=prog, description="Finds the exact camera of a photo inside a 3D Gaussian Splatting scan.")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in COMMANDS.items():
        sub = module.add_parser(commands)
        if add_options is not None and name not in WITHOUT_SCENE:
            add_options(sub)
    return parser


def main(
    argv: Sequence[str] | None = None,
    *,
    prog: str = "python -m core",
    add_options: Callable[[argparse.ArgumentParser], None] | None = None,
    on_outcome: Callable[[argparse.Namespace, Outcome], None] | None = None,
) -> int:
    """Run one command and return its exit code.

    `add_options` is called with each subcommand's parser before parsing; `on_outcome` with the parsed arguments and the
    outcome after a command that ran to its end on a scene, also when a verdict was "failed". Errors it raises are treated as
    the command's own.
    """
    try:
        args = build_parser(prog, add_options).parse_args(argv, argparse.Namespace(outcome_used=on_outcome is not None))
        outcome: Outcome = COMMANDS[args.command].run(args)
        if on_outcome is not None and outcome.scene is not None:
            on_outcome(args, outcome)
        return outcome.exit_code
    except SystemExit as end:  # --help
        return int(end.code or 0)
    except GssmcError as error:
        return _complain(str(error))
    except OSError as error:
        where = f" '{error.filename}'" if error.filename else ""
        return _complain(
            f"The file{where} cannot be used ({error.strerror or error}); check the path, its permissions and the disk."
        )
    except MemoryError:
        return _complain("The memory is used up; end other programs, or take a smaller scan. What was finished is kept.")
    except KeyboardInterrupt:
        message("Interrupted; run the command again for what is missing.")
        return INTERRUPTED


def _complain(sentence: str) -> int:
    message(" ".join(sentence.split()))
    return BAD_INPUT
