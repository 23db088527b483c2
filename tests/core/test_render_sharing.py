"""Work shared out between the calling thread and its helpers: results in order, the first error ends it."""

from __future__ import annotations

import threading

import pytest

from core.render.sharing import Workers


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_stand_in_the_order_of_the_items(threads: int) -> None:
    with Workers(threads) as workers:
        assert workers.run(lambda a, b: a * b, range(50), [2] * 50) == [2 * a for a in range(50)]
        assert workers.run(str, []) == []


def test_two_threads_work_at_the_same_time() -> None:
    meeting = threading.Barrier(2, timeout=10)  # breaks, and fails the test, where one thread does both items
    with Workers(2) as workers:
        workers.run(lambda _: meeting.wait(), range(2))


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_is_raised_and_ends_the_work(threads: int) -> None:
    done: list[int] = []

    def fail_at_third(i: int) -> None:
        if i == 2:
            raise ValueError("third")
        done.append(i)

    with Workers(threads) as workers:
        with pytest.raises(ValueError, match="third"):
            workers.run(fail_at_third, range(100_000))
        assert len(done) < 100_000
        assert workers.run(str, [1, 2]) == ["1", "2"]


def test_an_error_of_a_helper_reaches_the_caller() -> None:
    main, meeting = threading.get_ident(), threading.Barrier(2, timeout=10)

    def fail_elsewhere(_: int) -> None:
        meeting.wait()
        if threading.get_ident() != main:
            raise ValueError("helper")

    with Workers(2) as workers, pytest.raises(ValueError, match="helper"):
        workers.run(fail_elsewhere, range(2))
