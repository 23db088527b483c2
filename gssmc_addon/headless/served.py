"""A command in a thread of its own, while the main thread draws for it and does what Blender allows it alone."""

from __future__ import annotations

import argparse
import threading
from collections.abc import Callable, Generator

from ...core.cli.outcome import INTERRUPTED, Outcome
from ..render_gpu.executor import executor

JOIN_S = 5.0
Save = Callable[[argparse.Namespace, Outcome], None]


class MainThreadOutcome:
    """Runs a command beside the main thread; `save`, called in the command's thread, does the saving in the main one. Main
    thread; a context manager.
    """

    def __init__(self, save: Save) -> None:
        self._save = save
        self._owner = executor.hold()
        self._code = 1
        self._error: BaseException | None = None

    def __enter__(self) -> MainThreadOutcome:
        return self

    def __exit__(self, *error: object) -> None:
        executor.release(self._owner)
        executor.empty()

    def run(self, command: Callable[[], int]) -> int:
        """The command's exit code; raises what it raises."""

        def work() -> None:
            try:
                self._code = command()
            except BaseException as error:  # noqa: BLE001 - it is raised again in the main thread
                self._error = error

        thread = threading.Thread(target=work, name="gssmc-command", daemon=True)
        thread.start()

        def ended(seconds: float) -> bool:
            thread.join(seconds)
            return not thread.is_alive()

        try:
            while not executor.wait(ended, 1.0):
                pass
        except KeyboardInterrupt:  # The command does not hear of it; its views and its end are not waited for.
            executor.close()
            thread.join(JOIN_S)
            return INTERRUPTED
        if self._error is not None:
            raise self._error
        return self._code

    def save(self, args: argparse.Namespace, outcome: Outcome) -> None:
        """Saves the outcome. Raises what saving raises."""

        def steps() -> Generator[None, None, None]:
            self._save(args, outcome)
            yield

        executor.ask(steps, self._owner)
