"""Command-line flags made from a settings dataclass: names, defaults and help all come from its fields and docstring."""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection
from dataclasses import Field, fields, replace
from typing import Any

from ..errors import UsageError
from ..features.frontend import check_choice
from ..features.registry import AUTO, EXTRACTORS, MATCHERS
from ..pose.settings import RefineSettings, choices

FEATURE_CHOICES = {"features": (*EXTRACTORS, AUTO), "matcher": tuple(MATCHERS)}

SCENE_HELP = "splat file: .ply (INRIA, compressed, 2DGS, Mip-Splatting), .spz or .splat"


MASK_HELP = "what to leave out of matching: a picture, or a folder of them named as the photos; white: use, black: leave out"


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of printing the usage."""

    def error(self, message: str) -> Any:
        raise UsageError(f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.")


def add_settings_flags(parser: argparse.ArgumentParser, skip: Collection[str] = ()) -> None:
    """One flag per field of RefineSettings: --name-with-dashes VALUE, or --no-name for a switch that is on."""
    group = parser.add_argument_group("refinement options")
    texts, words = field_texts(RefineSettings), {**choices(), **FEATURE_CHOICES}
    for field in fields(RefineSettings):
        if field.name in skip:
            continue
        flag, text = field.name.replace("_", "-"), texts[field.name]
        if isinstance(field.default, bool):
            group.add_argument(
                f"--no-{flag}", dest=field.name, action="store_false", default=argparse.SUPPRESS, help=f"switch off: {text}"
            )
        elif field.name in words:
            help_text = f"{text} ({field.default})"
            group.add_argument(
                f"--{flag}", dest=field.name, choices=words[field.name], default=argparse.SUPPRESS, help=help_text
            )
        elif isinstance(field.default, str):
            group.add_argument(f"--{flag}", dest=field.name, default=argparse.SUPPRESS, metavar="FILE", help=text)
        else:
            kind = type(field.default)
            help_text = f"{text} ({field.default})"
            group.add_argument(f"--{flag}", dest=field.name, type=kind, default=argparse.SUPPRESS, metavar="N", help=help_text)


def settings_from(args: argparse.Namespace, base: RefineSettings | None = None) -> RefineSettings:
    """`base` (the defaults) with what the given flags say. Raises RefineError when a number is out of range, FeatureError when
    the features cannot be used: before a large scan is read.
    """
    given = {f.name: getattr(args, f.name) for f in fields(RefineSettings) if hasattr(args, f.name)}
    settings = replace(base or RefineSettings(), **given)
    check_choice(settings)
    return settings


def field_texts(settings: Any) -> dict[str, str]:
    """Field name to its text in the dataclass's docstring, whose lines read `name: text`."""
    known: tuple[Field[Any], ...] = fields(settings)
    names = "|".join(re.escape(f.name) for f in known)
    found = re.findall(rf"^\s*({names}): (.+?)(?=^\s*(?:{names}|Raises)\b|\Z)", settings.__doc__ or "", re.M | re.S)
    texts = {name: " ".join(text.split()).rstrip(".").replace("%", "%%") for name, text in found}
    return {f.name: texts.get(f.name, f.name.replace("_", " ")) for f in known}
