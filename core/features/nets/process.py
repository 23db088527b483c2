"""Our side of the process that runs foreign networks: started on first use, asked one thing at a time, ended with `close`."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ...errors import FeatureError
from ...processes.channel import Channel, ChildEndedError
from ...processes.child import Child
from ...processes.wire import Arrays, Header, WireError
from ..types import Features, Grey, Mask, Matches, no_features, no_matches
from .messages import pack_features, unpack_features, unpack_matches

log = logging.getLogger(__name__)

# For one image or one pair of them. A network that needs longer hangs.
LIMIT_S = 300.0
# The exit codes of a division by zero under POSIX and Windows. OpenCV 5.0 ends the process so where a network finds nothing and
# gathers zero rows. That is an empty answer and no broken model.
FOUND_NOTHING = frozenset({-8, 0xC0000094, 0xC0000094 - (1 << 32)})
ENDED = "The refinement has ended, and the model's process with it."


@dataclass(frozen=True)
class Nets:
    """What to run: registry names of extractor and matcher, "" for one that needs no network, and their model files.

    `threads` for OpenCV, 0 = one per core.
    """

    extractor: str = ""
    model: str = ""
    matcher: str = ""
    matcher_model: str = ""
    threads: int = 0


class NetProcess:
    """The process. Thread-safe; `close` may come from another thread than the one that waits for an answer."""

    def __init__(self, nets: Nets, limit_s: float = LIMIT_S, start: Callable[[str], Child] = Child) -> None:
        self._nets = nets
        self._limit_s = limit_s
        self._start = start
        # The process answers one request at a time.
        self._turn = threading.Lock()
        # The guard protects the two attributes below.
        self._guard = threading.Lock()
        self._channel: Channel | None = None
        self._closed = False

    def ask(self, model: str, header: Header, arrays: Sequence[NDArray[Any]]) -> tuple[Header, Arrays] | None:
        """The answer, or None where the network found nothing at all and died of it. `model` names the file in messages.

        Raises FeatureError when the network does not work, ended its process, took too long, or this was closed.
        """
        with self._turn:
            channel, fresh = self._living()
            try:
                if fresh:
                    channel.ask(vars(self._nets), limit_s=self._limit_s)
                answer = channel.ask(header, arrays, limit_s=self._limit_s)
            except ChildEndedError as end:
                self._judge(end, model)
                return None
        if "error" in answer[0]:
            raise FeatureError(f"The model '{model}' does not work: {answer[0]['error']}")
        return answer

    def close(self) -> None:
        """Ends the process at once, also in the middle of a request; later requests are refused. Harmless when repeated."""
        with self._guard:
            self._closed = True
            channel, self._channel = self._channel, None
        if channel is not None:
            channel.close()

    def _living(self) -> tuple[Channel, bool]:
        """The channel, and whether its process is a new one. Raises FeatureError."""
        with self._guard:
            if self._closed:
                raise FeatureError(ENDED)
            if self._channel is not None:
                return self._channel, False
            try:
                self._channel = Channel(self._start("features.nets.worker"))
            except OSError as error:
                raise FeatureError(f"The process for the model cannot be started ({error.strerror or error}).") from error
            return self._channel, True

    def _judge(self, end: ChildEndedError, model: str) -> None:
        """Forgets a process that has ended, so that the next request gets a new one; raises FeatureError unless its network
        only found nothing.
        """
        with self._guard:
            self._channel = None
            if self._closed:
                raise FeatureError(ENDED) from None
        if end.late:
            raise FeatureError(f"The model '{model}' gave no answer in {self._limit_s:.0f} s; use another file.") from None
        if end.code in FOUND_NOTHING:
            log.info("%s found nothing and ended its process", model)
            return
        raise FeatureError(
            f"The model '{model}' ended the process that ran it ({end}); use another file or other features."
        ) from None


@dataclass(frozen=True)
class RemoteExtractor:
    """An Extractor whose network runs in `process`; `name` is its file's, for messages."""

    process: NetProcess
    name: str

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of `grey` (H, W) uint8. Raises FeatureError."""
        answer = self.process.ask(self.name, {"do": "extract"}, [grey])
        if answer is None:
            return no_features((grey.shape[1], grey.shape[0]), 1)
        try:
            return unpack_features(*answer).where(mask)
        except WireError:
            raise FeatureError(f"The model '{self.name}' does not work: its numbers are not those of features.") from None


@dataclass(frozen=True)
class RemoteMatcher:
    """A Matcher whose network runs in `process`; `name` is its file's, for messages."""

    process: NetProcess
    name: str

    def match(self, a: Features, b: Features) -> Matches:
        """Raises FeatureError."""
        if len(a) == 0 or len(b) == 0:
            return no_matches()
        (head_a, arrays_a), (head_b, arrays_b) = pack_features(a), pack_features(b)
        answer = self.process.ask(self.name, {"do": "match", "a": head_a, "b": head_b}, [*arrays_a, *arrays_b])
        if answer is None:
            return no_matches()
        try:
            return unpack_matches(answer[1], len(a), len(b))
        except WireError:
            raise FeatureError(f"The model '{self.name}' does not work: its numbers are no matches.") from None
