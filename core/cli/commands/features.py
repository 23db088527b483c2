"""`features`: which local features and matchers there are, which work here, and why the others do not."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from ...features.nets.models import KNOWN, recognise
from ...features.registry import AUTO, EXTRACTORS, MATCHERS, ExtractorKind, MatcherKind, missing
from ..console import say
from ..outcome import OK, Outcome

AUTO_TEXT = "SIFT; with a model of ALIKED (--model), that takes over where SIFT finds no answer"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("features", help="list the local features and matchers, and which of them work here")
    help_text = "also say what this file is; may be given more than once"
    parser.add_argument("--model", "--matcher-model", type=Path, action="append", default=[], metavar="FILE", help=help_text)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    say("features")
    _table(EXTRACTORS, "--model")
    say(_line(AUTO, "", AUTO_TEXT))
    say("matchers")
    _table(MATCHERS, "--matcher-model")
    say("models known by their sha256")
    for model in KNOWN:
        say(f"  {model.name}: {model.title} for {model.features}, {model.bytes} bytes, {model.licence}, {model.source}")
    for path in args.model:
        say(f"{path}: {describe(path)}")
    return Outcome(OK, None)


def describe(path: Path) -> str:
    """What a model file is, for people."""
    if not path.is_file():
        return "there is no such file."
    model = recognise(path)
    return f"{model.title} ({model.licence}), for {model.features}." if model else "not one of the known models; it may work."


def _table(kinds: Mapping[str, ExtractorKind] | Mapping[str, MatcherKind], flag: str) -> None:
    for name, kind in kinds.items():
        reason = missing(kind) or (f"needs a model file ({flag} FILE.onnx)" if kind.needs_model else "")
        say(_line(name, reason, kind.text))


def _line(name: str, reason: str, text: str) -> str:
    return f"  {name:<12}{reason or 'available':<48}{text}"
