"""Memory estimates: above what was measured, below what would refuse ordinary work; and the sentence of a refusal."""

import pytest

from core.render.memory import MemoryLimitError, check, find_bytes, import_bytes, machine_bytes, refine_bytes

PIXELS = 640 * 480


@pytest.mark.parametrize(
    ("gaussians", "threads", "measured_gb"),
    [(12_000, 1, 0.438), (300_000, 1, 0.448), (300_000, 2, 0.708), (1_000_000, 2, 1.317), (1_000_000, 4, 2.267)],
)
def test_the_estimate_is_above_what_was_measured_and_not_far_above(gaussians, threads, measured_gb):
    estimate = refine_bytes(gaussians, 4, PIXELS, threads) / 1e9
    assert measured_gb < estimate < 2 * measured_gb


def test_a_search_counts_the_scan_that_is_kept_and_the_map():
    kept = 4 * (11 + 3 * 4) * 1_000_000
    more = find_bytes(1_000_000, 4, 2, 80) - refine_bytes(1_000_000, 4, 0, 2)
    assert kept + 262e6 < more < kept + 400e6  # 262 bytes a Gaussian were measured
    assert find_bytes(1_000_000, 4, 2, 2000) - find_bytes(1_000_000, 4, 2, 80) > 1920 * 1200 * 140  # landmarks of full views


def test_an_import_counts_the_file(tmp_path):
    (tmp_path / "a.ply").write_bytes(b"x" * 1000)
    (tmp_path / "a.spz").write_bytes(b"x" * 1000)
    assert import_bytes(tmp_path / "a.spz") > import_bytes(tmp_path / "a.ply") > import_bytes(tmp_path / "none.ply")


def test_a_refusal_is_one_sentence_and_0_is_no_limit():
    check("The work", 10**12, 0)
    check("The work", 10, 11)
    with pytest.raises(MemoryLimitError, match=r"The work would take about 2\.0 GB of memory, and 1\.0 GB are allowed;"):
        check("The work", 2 * 10**9, 10**9)
    assert machine_bytes() >= 0
