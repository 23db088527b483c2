"""A process of our own that runs one module of the engine: started the same way under Python and inside Blender."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import cast

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1")
# Without this flag, Windows would open a console beside Blender.
NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)


def pipes() -> tuple[io.BufferedIOBase, io.BufferedIOBase]:
    """In the child: where the requests come from and where the answers go. Ctrl-C reaches the whole group of processes; it is
    left to the parent to decide when to end us.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    # Whatever a library prints goes to stderr, so that it does not get between the answers.
    os.dup2(2, 1)
    return os.fdopen(os.dup(0), "rb"), answers


def search_path(package: Path) -> str:
    """PYTHONPATH of a child: the folder that holds the engine's package, then where this process looks, but never in its
    working folder. That may be a downloaded scan's, and a `json.py` in it would be run.
    """
    try:
        here = _name(os.getcwd())
    except OSError:  # a folder that is no more
        here = ""
    # A relative entry would mean another folder in the child, and one that contains the separator would mean two folders.
    own = [p for p in sys.path if os.path.isabs(p) and os.pathsep not in p and _name(p) != here]
    return os.pathsep.join([str(package.parent), *own])


def _name(folder: str) -> str:
    """The same for one folder however it is spelt."""
    return os.path.normcase(os.path.realpath(folder))


class Child:
    """A running child. `stdin` and `stdout` are its binary pipes; what it says on stderr is kept for `last_words`."""

    def __init__(self, module: str, environment: Mapping[str, str] | None = None) -> None:
        """`module` is dotted and below the engine's package, such as "batch.worker". Raises OSError."""
        # Inside Blender the engine's package has another name; the child imports it from its folder, by its own name.
        package = Path(__file__).resolve().parents[1]
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        try:
            self._process = subprocess.Popen(
                # -P: `-m` alone would put the working folder before everything else that is searched
                [sys.executable, "-P", "-m", f"{package.name}.{module}"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
                env={**os.environ, **(environment or {}), "PYTHONPATH": search_path(package)},
                creationflags=NO_WINDOW,
            )
        except BaseException:
            self._said.close()
            raise

    @property
    def stdin(self) -> io.BufferedIOBase:
        return cast(io.BufferedIOBase, self._process.stdin)

    @property
    def stdout(self) -> io.BufferedIOBase:
        return cast(io.BufferedIOBase, self._process.stdout)

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
        """End the process; the pipes stay open for whoever still reads from them."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """End the process and close its pipes, which nobody may be using then. Harmless when repeated."""
        self.kill()
        for pipe in (self._process.stdin, self._process.stdout, self._said):
            with contextlib.suppress(OSError):  # the unsent rest of a dead child's job
                pipe.close()  # type: ignore[union-attr]
