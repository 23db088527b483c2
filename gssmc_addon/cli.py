"""`blender --command gssmc ARGS`: the engine's command line, plus `--blend OUT.blend`."""

from __future__ import annotations

from collections.abc import Sequence


def main(argv: Sequence[str]) -> int:
    """Runs the engine's command line; the exit code is its own."""
    from ..core.cli import main as engine_main

    return engine_main(list(argv))
