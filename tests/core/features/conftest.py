"""What the tests of features share."""

import gc

import pytest
from process_ends import alive

from core.features.nets.process import NetProcess
from core.processes.child import Child


@pytest.fixture
def children(monkeypatch):
    """The processes started during the test; all must have ended with it."""
    started = []

    class Watched(Child):
        def __init__(self, *args):
            super().__init__(*args)
            started.append(self._process.pid)

    monkeypatch.setattr(NetProcess.__init__, "__defaults__", (*NetProcess.__init__.__defaults__[:-1], Watched))
    yield started
    gc.collect()
    assert [pid for pid in started if alive(pid)] == []
