"""Some damaged files of every format; benchmarks/fuzz_formats.py does 10,000 of each by the same rule."""

import tracemalloc

import numpy as np
import pytest
from splat_fuzz import damaged, judge, samples

FILES = 150


@pytest.fixture(autouse=True)
def traced():
    tracemalloc.start()
    yield
    tracemalloc.stop()


@pytest.mark.parametrize("sample", samples(), ids=lambda s: s.name)
def test_a_damaged_file_is_a_scene_or_one_sentence_in_bounded_memory(sample, tmp_path):
    rng = np.random.default_rng(20261124)
    assert judge(sample, sample.data, tmp_path / "scene.bin")[0] == "scene"
    files = FILES if sample.packed != "folder" else FILES // 3  # which are many files each
    outcomes = {judge(sample, damaged(sample, rng), tmp_path / "scene.bin")[0] for _ in range(files)}
    assert outcomes == {"scene", "error"}  # the damage is neither harmless nor hopeless throughout
