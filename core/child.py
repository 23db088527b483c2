"""A process of our own that runs one module of the engine: started the same way under Python and inside Blender."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO

NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # Windows would open a console beside Blender


class Child:
    """A running child. `stdin` and `stdout` are its binary pipes; what it says on stderr is kept for `last_words`."""

    def __init__(self, module: str, environment: Mapping[str, str] | None = None) -> None:
        """`module` is dotted and below the engine's package, such as "commands.worker". Raises OSError."""
        package = Path(__file__).resolve().parent
        # Inside Blender the engine's package has another name; the child imports it from its folder, by its own name.
        search = os.pathsep.join([str(package.parent), *(p for p in sys.path if p)])
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        self._process = subprocess.Popen(
            [sys.executable, "-m", f"{package.name}.{module}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env={**os.environ, **(environment or {}), "PYTHONPATH": search},
            creationflags=NO_WINDOW,
        )

    @property
    def stdin(self) -> IO[bytes]:
        assert self._process.stdin is not None
        return self._process.stdin

    @property
    def stdout(self) -> IO[bytes]:
        assert self._process.stdout is not None
        return self._process.stdout

    def exit_code(self, timeout_s: float = 0.0) -> int | None:
        """Negative when a signal ended it; None when it still runs after `timeout_s`."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def last_words(self) -> str:
        """Waits for its end, then: "exit code N", and the last line that it said when it ended by itself."""
        code = self._process.wait()
        self._said.seek(0)
        lines = self._said.read().decode("utf-8", "replace").strip().splitlines()
        return f"exit code {code}" + (f", {lines[-1].strip()[:200].rstrip('.')}" if lines and code > 0 else "")

    def kill(self) -> None:
        """End the process. The thread that waits for its answer hears of it as of any death; it alone may `close`."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()

    def close(self) -> None:
        self.kill()
        for pipe in (self._process.stdin, self._process.stdout, self._said):
            with contextlib.suppress(OSError):  # the unsent rest of a dead child's job
                pipe.close()  # type: ignore[union-attr]
