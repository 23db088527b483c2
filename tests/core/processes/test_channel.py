"""One way to ask a child: its answer, or within the limit the reason why there is none and a child that has ended."""

import threading
import time

import numpy as np
import pytest
from children import Scripted

from core.processes.channel import Channel, ChildEndedError

ECHO = """
while True:
    header, arrays = requests.next()
    time.sleep(header.get("wait", 0))
    requests.answer({"got": header["n"]}, arrays)
"""


@pytest.fixture
def echo():
    child = Scripted(ECHO)
    channel = Channel(child)
    assert channel.ask({"n": 0}, limit_s=60)[0] == {"got": 0}
    yield channel, child
    channel.close()
    assert child.exit_code() is not None


def ended(code, limit_s=60.0):
    child = Scripted(code)
    channel = Channel(child)
    began = time.monotonic()
    with pytest.raises(ChildEndedError) as caught:
        channel.ask({"n": 1}, limit_s=limit_s)
    assert child.exit_code() is not None
    assert child.stdin.closed and child.stdout.closed
    channel.close()
    return caught.value, time.monotonic() - began


def test_many_threads_get_their_own_answers(echo):
    got = {}

    def ask(n):
        header, (array,) = echo[0].ask({"n": n}, [np.full(3, n)], limit_s=60)
        got[n] = (header["got"], array.tolist())

    threads = [threading.Thread(target=ask, args=(n,)) for n in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert got == {n: (n, [n] * 3) for n in range(12)}


def test_a_child_that_gives_no_answer_is_ended_after_the_limit():
    error, seconds = ended("requests.next(); time.sleep(600)", limit_s=2.0)
    assert (str(error), error.late) == ("no answer in 2 s", True)
    assert 2 <= seconds < 30


def test_a_child_that_ends_leaves_its_code_and_last_words():
    error, _ = ended("requests.next(); print('so it goes.', file=sys.stderr); sys.stderr.flush(); os._exit(7)")
    assert (str(error), error.code, error.late) == ("exit code 7, so it goes", 7, False)


def test_a_child_that_closes_its_pipes_and_lives_on_is_ended():
    """Waiting for its end would be waiting for ever."""
    error, seconds = ended("requests.next(); requests._answers.close(); os.close(1); time.sleep(600)")
    assert not error.late
    assert seconds < 30


@pytest.mark.parametrize("line", [b"{}\n", b"nonsense\n", b'{"arrays": [', b'{"arrays": [["<f8", [100]]]}\nshort'])
def test_an_answer_that_is_no_message_ends_the_child(line):
    error, seconds = ended(f"requests.next(); os.write(requests._answers.fileno(), {line!r}); os._exit(0)")
    assert str(error).startswith("its answer is no message: ")
    assert not error.late
    assert seconds < 30


def test_closing_ends_a_request_in_the_middle(echo):
    channel, _ = echo
    said = []

    def ask():
        try:
            channel.ask({"n": 1, "wait": 600}, limit_s=900)
        except ChildEndedError as error:
            said.append(error.late)

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    time.sleep(0.3)
    began = time.monotonic()
    channel.close()
    for thread in threads:
        thread.join(30)
    assert said == [False] * 3
    assert time.monotonic() - began < 10


def test_an_interrupted_request_leaves_no_answer_for_the_next(echo, monkeypatch):
    """Ctrl-C comes while the answer is on its way."""
    import core.processes.channel as module

    receive = module.receive

    def interrupted(stream):
        monkeypatch.setattr(module, "receive", receive)
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "receive", interrupted)
    with pytest.raises(KeyboardInterrupt):
        echo[0].ask({"n": 1}, limit_s=60)
    with pytest.raises(ChildEndedError):
        echo[0].ask({"n": 2}, limit_s=60)


def test_no_thread_for_the_time_limit_is_an_error_of_the_system(monkeypatch):
    def none(self):
        raise RuntimeError("can't start new thread")

    channel = Channel(Scripted("requests.next()"))
    monkeypatch.setattr(threading.Timer, "start", none)
    with pytest.raises(OSError, match="no thread can be started"):
        channel.ask({}, limit_s=9)
    channel.close()
