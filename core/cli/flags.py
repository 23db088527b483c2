"""Command-line flags made from a settings dataclass: names, defaults and help all come from its fields."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Collection
from dataclasses import fields, replace
from typing import Any

from ..cameras import short
from ..cameras.training_world import AXES
from ..errors import UsageError
from ..features.frontend import check_choice
from ..pose.settings import RefineSettings
from ..support.options import options_of

SCENE_HELP = "splat file: .ply (INRIA, compressed, 2DGS, Mip-Splatting), .spz, .sog, .ksplat, .glb, .usdc or .splat"


CAMERAS_HELP = "cameras: our JSON, COLMAP, nerfstudio and every other layout of docs/formats.md"
MASK_HELP = "what to leave out of matching: a picture, or a folder of them named as the photos; white: use, black: leave out"


def add_axes_flag(parser: argparse.ArgumentParser) -> None:
    """--axes: in which world the cameras are that a command is given."""
    text = (
        "the cameras given are in the coordinates of the scan's file, or in the world of the training (COLMAP's, y down); "
        "auto: the former, unless they show nothing of the scan or lead nowhere there; results are in the file's (auto)"
    )
    parser.add_argument("--axes", choices=AXES, default=AXES[0], help=text)


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of printing the usage."""

    def error(self, message: str) -> Any:
        message = message.removeprefix("argument ")
        raise UsageError(f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.")


def whole_number(text: str) -> int:
    """A number of an option. Raises ArgumentTypeError with a sentence of ours."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{short(text)}' is no whole number; give one, such as 3") from None


def number(text: str) -> float:
    """A finite number of an option. Raises ArgumentTypeError with a sentence of ours."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{short(text)}' is no number; give one, such as 0.5")
    return value


NUMBERS: dict[type, Callable[[str], float]] = {int: whole_number, float: number}


def add_settings_flags(parser: argparse.ArgumentParser, skip: Collection[str] = ()) -> None:
    """One flag per field of RefineSettings: --name-with-dashes VALUE, or --no-name for a switch that is on."""
    group, options = parser.add_argument_group("refinement options"), options_of(RefineSettings)
    for field in fields(RefineSettings):
        if field.name in skip:
            continue
        option = options[field.name]
        flag, text = field.name.replace("_", "-"), option.whole_help.replace("%", "%%")
        common: dict[str, Any] = {"dest": field.name, "default": argparse.SUPPRESS}
        if isinstance(field.default, bool):
            group.add_argument(f"--no-{flag}", action="store_false", help=f"switch off: {text}", **common)
        elif option.choices:
            group.add_argument(f"--{flag}", choices=tuple(option.choices), help=f"{text} ({field.default})", **common)
        elif isinstance(field.default, str):
            group.add_argument(f"--{flag}", metavar="FILE", help=text, **common)
        else:
            kind, help_text = NUMBERS[type(field.default)], f"{text} ({field.default})"
            group.add_argument(f"--{flag}", type=kind, metavar="N", help=help_text, **common)


def settings_from(args: argparse.Namespace, base: RefineSettings | None = None) -> RefineSettings:
    """`base` (the defaults) with what the given flags say. Raises RefineError when a number is out of range, FeatureError when
    the features cannot be used: before a large scan is read.
    """
    given = {f.name: getattr(args, f.name) for f in fields(RefineSettings) if hasattr(args, f.name)}
    settings = replace(base or RefineSettings(), **given)
    check_choice(settings)
    return settings
