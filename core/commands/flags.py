"""Command-line flags made from a settings dataclass: names, defaults and help all come from its fields and docstring."""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection
from dataclasses import Field, fields
from typing import Any

from ..errors import GssmcError
from ..pose.settings import RefineSettings

SCENE_HELP = "splat file: .ply (INRIA, compressed, 2DGS, Mip-Splatting), .spz or .splat"


MASK_HELP = "what to leave out of matching: a picture, or a folder of them named as the photos; white: use, black: leave out"


class UsageError(GssmcError):
    """The command line itself is wrong."""


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of printing the usage."""

    def error(self, message: str) -> Any:
        raise UsageError(f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.")


def add_settings_flags(parser: argparse.ArgumentParser, skip: Collection[str] = ()) -> None:
    """One flag per field of RefineSettings: --name-with-dashes VALUE, or --no-name for a switch that is on."""
    group = parser.add_argument_group("refinement options")
    texts = field_texts(RefineSettings)
    for field in fields(RefineSettings):
        if field.name in skip:
            continue
        flag, text = field.name.replace("_", "-"), texts[field.name]
        if isinstance(field.default, bool):
            group.add_argument(f"--no-{flag}", dest=field.name, action="store_false", help=f"switch off: {text}")
        else:
            kind = type(field.default)
            group.add_argument(
                f"--{flag}", dest=field.name, type=kind, default=field.default, metavar="N", help=f"{text} ({field.default})"
            )


def settings_from(args: argparse.Namespace) -> RefineSettings:
    """The settings that the flags say. Raises RefineError when a number is out of range."""
    return RefineSettings(**{f.name: getattr(args, f.name) for f in fields(RefineSettings) if hasattr(args, f.name)})


def field_texts(settings: Any) -> dict[str, str]:
    """Field name to its text in the dataclass's docstring, whose lines read `name: text`."""
    known: tuple[Field[Any], ...] = fields(settings)
    names = "|".join(re.escape(f.name) for f in known)
    found = re.findall(rf"^\s*({names}): (.+?)(?=^\s*(?:{names}|Raises)\b|\Z)", settings.__doc__ or "", re.M | re.S)
    texts = {name: " ".join(text.split()).rstrip(".").replace("%", "%%") for name, text in found}
    return {f.name: texts.get(f.name, f.name.replace("_", " ")) for f in known}
