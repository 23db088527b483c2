"""`demo`: placeholder until the procedural sample is in place."""

from __future__ import annotations

import argparse
from pathlib import Path

from .outcome import OK, Outcome


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    return commands.add_parser("demo", help="build the sample scene and refine a photo of it")


def run(args: argparse.Namespace) -> Outcome:
    return Outcome(OK, Path())
