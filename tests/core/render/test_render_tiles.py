"""Which tiles are blended together: every tile that lists anything once, in bounded batches."""

import numpy as np

from core.render.blend import ROUND_PAIRS
from core.render.tiles import BATCH_PAIRS, TileLists, _expand, join_bands, plan_batches


def test_batches_hold_every_listed_tile_once_longest_first() -> None:
    count = np.random.default_rng(1).integers(0, 900, 5000)
    batches = plan_batches(count)
    order = np.concatenate(batches)
    assert np.array_equal(np.sort(order), np.flatnonzero(count))
    assert (np.diff(count[order]) <= 0).all()
    pairs = [count[b].sum() for b in batches]
    assert max(pairs) <= BATCH_PAIRS + count.max()
    assert max(pairs[-5:]) <= BATCH_PAIRS / 4 + count.max(), "the last are small, so that threads end together"


def test_a_batch_of_short_lists_fits_a_round_and_no_lists_make_no_batch() -> None:
    assert max(map(len, plan_batches(np.ones(100_000, np.intp)))) <= ROUND_PAIRS
    assert plan_batches(np.zeros(7, np.intp)) == []


def test_joined_bands_list_what_each_listed() -> None:
    a = TileLists(np.array([5, 3, 9], np.int32), np.array([0, 2]), np.array([2, 1]))
    b = TileLists(np.array([4], np.int32), np.array([0, 0]), np.array([0, 1]))
    both = join_bands([a, b])
    lists = [both.splats[s : s + n].tolist() for s, n in zip(both.start, both.count, strict=True)]
    assert lists == [[5, 3], [9], [], [4]]


def test_numbers_are_expanded_in_their_order() -> None:
    rng = np.random.default_rng(4)
    values, counts = rng.integers(0, 1 << 50, 300), rng.integers(1, 20, 300)
    want = [v + i for v, n in zip(values.tolist(), counts.tolist(), strict=True) for i in range(n)]
    assert _expand(values, counts).tolist() == want
    assert _expand(values[:0], counts[:0]).tolist() == []
