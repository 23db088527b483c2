"""Asking a child: one request at a time, a time limit on each, and one way of ending a child that gave no answer."""

from __future__ import annotations

import errno
import threading
from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

from .child import Child
from .wire import Arrays, Header, WireError, receive, send

# A child whose pipes are closed has so long to say why and to end by itself.
LAST_WORDS_S = 1.0


class ChildEndedError(Exception):
    """A child gave no answer and has been ended. str() tells why in a few words, fit for brackets in a sentence.

    `code`: its exit code, negative when a signal ended it, also ours; `late`: it was ended for taking too long.
    """

    def __init__(self, words: str, code: int, late: bool) -> None:
        super().__init__(words)
        self.code, self.late = code, late


class Channel:
    """A child to be asked. Any thread may ask or `close`; requests wait for each other."""

    def __init__(self, child: Child) -> None:
        self._child = child
        self._turn = threading.Lock()

    def ask(self, header: Header, arrays: Sequence[NDArray[Any]] = (), *, limit_s: float) -> tuple[Header, Arrays]:
        """The child's answer. Raises ChildEndedError when there is none within `limit_s` seconds, or what comes is no
        message; the child has ended then, and its pipes are closed. Raises OSError where no thread can be started, which is to
        watch the time; nothing was asked then.
        """
        with self._turn:
            late, problem = threading.Event(), ""
            timer = threading.Timer(limit_s, self._end_late, (late,))
            timer.daemon = True
            try:
                timer.start()
            except RuntimeError:  # too little memory, or too many threads already
                raise OSError(errno.EAGAIN, "no thread can be started") from None
            answer = None
            try:
                send(self._child.stdin, header, arrays)
                answer = receive(self._child.stdout)
            except WireError as error:
                problem = f"its answer is no message: {error}"
            except (OSError, ValueError):  # a pipe that is broken, or closed already
                pass
            except BaseException:
                self._child.kill()  # or its answer to this request would be taken for the next one's
                raise
            finally:
                timer.cancel()
            if answer is None or late.is_set():
                raise self._buried(f"no answer in {limit_s:.0f} s" if late.is_set() else problem, late.is_set())
            return answer

    def kill(self) -> None:
        """End the child at once, also in the middle of a request, which then raises ChildEndedError. Returns at once."""
        self._child.kill()

    def close(self) -> None:
        """`kill`, wait for a request to notice, and close the pipes. Harmless when repeated."""
        self._child.kill()
        with self._turn:
            self._child.close()

    def _end_late(self, late: threading.Event) -> None:
        late.set()
        self._child.kill()

    def _buried(self, problem: str, late: bool) -> ChildEndedError:
        """Ends what is left of a child that gave no answer. `problem` takes the place of its last words."""
        self._child.exit_code(LAST_WORDS_S)
        self._child.kill()
        code = self._child.exit_code()
        words = problem or _words(self._child)
        self._child.close()
        return ChildEndedError(words, code if code is not None else 0, late)


def _words(child: Child) -> str:
    try:
        return child.last_words()
    except ValueError:  # closed by another request's end
        return "it has ended"
