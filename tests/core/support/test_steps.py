"""Work that is a generator: run to its end, converted, and stopped."""

import pytest

from core.support.steps import converted, run_to_end


class Counted:
    """Counts to three, and remembers whether it was closed."""

    def __init__(self):
        self.closed = False

    def work(self):
        try:
            yield from (1, 2, 3)
            return "done"
        finally:
            self.closed = True


def test_every_step_is_told_and_the_result_comes_back():
    told = []
    assert run_to_end(Counted().work(), told.append) == "done"
    assert told == [1, 2, 3]
    assert run_to_end(Counted().work()) == "done"


def test_what_the_listener_raises_stops_the_work():
    counted, told = Counted(), []

    def stop(number):
        told.append(number)
        raise KeyError(number)

    with pytest.raises(KeyError):
        run_to_end(counted.work(), stop)
    assert told == [1] and counted.closed


def test_converted_work_keeps_its_result_and_ends_with_its_owner():
    told = []
    assert run_to_end(converted(Counted().work(), lambda n: 10 * n), told.append) == "done"
    assert told == [10, 20, 30]
    counted = Counted()
    outer = converted(counted.work(), str)
    assert next(outer) == "1"
    outer.close()
    assert counted.closed
