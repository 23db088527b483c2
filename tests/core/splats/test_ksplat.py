"""The .ksplat of GaussianSplats3D: its own files against what they were made from and another program's reading; damage."""

import struct
from pathlib import Path

import numpy as np
import pytest
from ply_files import ply_bytes, raw_table

from core.errors import SplatFormatError
from core.splats import inspect_splats, read_splats
from core.splats.activate import SH_C0

# raw_table(24, 2, seed=5) as GaussianSplats3D 0.4 writes it, in another order; its level 2 as splat-transform 2.7.1 reads it.
DATA = Path(__file__).parents[2] / "data"
LEVELS = [DATA / f"by_gaussian_splats_3d_level_{level}.ksplat" for level in range(3)]
READ_BY_OTHERS = DATA / "level_2_by_splat_transform.ply"


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    path = tmp_path_factory.mktemp("source") / "a.ply"
    path.write_bytes(ply_bytes(raw_table(24, 2, seed=5)))
    return read_splats(path)


# Level 2 keeps SH in 255 steps over their whole range, and rounds down: 0.0251 here.
TOLERANCES = [(0, 1e-7, 1e-6, 1e-6), (1, 1e-4, 1e-3, 2e-3), (2, 1e-4, 1e-3, 0.0252)]


@pytest.mark.parametrize(("level", "place", "share", "rest"), TOLERANCES)
def test_their_own_files_are_what_they_were_made_from(source, level, place, share, rest):
    scene, info = read_splats(LEVELS[level]), inspect_splats(LEVELS[level])
    assert (info.format, info.count, info.sh_degree, info.orientation) == (f"ksplat level {level}", 24, 2, "Y_DOWN")
    order = np.linalg.norm(scene.means[:, None] - source.means, axis=2).argmin(axis=1)
    assert sorted(order) == list(range(24))
    np.testing.assert_allclose(scene.means, source.means[order], atol=place)
    np.testing.assert_allclose(scene.scales, source.scales[order], rtol=share)
    np.testing.assert_allclose(scene.opacities, source.opacities[order], atol=1 / 255)
    assert np.abs((scene.rotations * source.rotations[order]).sum(axis=1)).min() > 1 - 1e-5
    colours = np.clip(source.sh[order, 0], -0.5 / SH_C0, 0.5 / SH_C0)
    np.testing.assert_allclose(scene.sh[:, 0], colours, atol=1.01 / 255 / SH_C0)
    np.testing.assert_allclose(scene.sh[:, 1:], source.sh[order, 1:], atol=rest)


def test_level_2_is_read_as_another_program_reads_it():
    scene, truth = read_splats(LEVELS[2]), read_splats(READ_BY_OTHERS)
    for name in ("means", "scales", "opacities", "sh"):
        np.testing.assert_allclose(getattr(scene, name), getattr(truth, name), rtol=1e-5, atol=2e-6, err_msg=name)


def sections(count, buckets, partial, size=2):
    """A file of level 1 without SH, whose Gaussians lie in the middle of their buckets; `buckets`: the centres by section."""
    fields = (0, 1, len(buckets), len(buckets), count, count, 1, 0, 0, 0, 0, 0)
    header = struct.pack("<BB2xIIIIH2x3fff", *fields).ljust(4096, b"\0")
    table, body = b"", b""
    for centres, rest in zip(buckets, partial, strict=True):
        full = len(centres) - len(rest)
        own = full * size + sum(rest)
        fields = (own, own, size, len(centres), 2.0, 12, 0, full, len(rest), 0)
        table += struct.pack("<IIIIfH2xI4xIIH", *fields).ljust(1024, b"\0")
        one = struct.pack("<3H3e4e4B", *(32767,) * 3, *(0.5,) * 3, 1, 0, 0, 0, 255, 0, 0, 128)
        body += struct.pack(f"<{len(rest)}I", *rest) + np.float32(centres).tobytes() + own * one
    return header + table + body


def test_buckets_and_sections(tmp_path):
    """By hand: two sections, in the first a full bucket and two that are not."""
    data = sections(6, [[(0, 0, 0), (5, 0, 0), (9, 0, 0)], [(0, 7, 0)]], [[1, 1], []])
    (tmp_path / "a.ksplat").write_bytes(data)
    scene = read_splats(tmp_path / "a.ksplat")
    assert scene.means.tolist() == [[0, 0, 0], [0, 0, 0], [5, 0, 0], [9, 0, 0], [0, 7, 0], [0, 7, 0]]
    np.testing.assert_allclose(scene.scales, 0.5)
    np.testing.assert_allclose(scene.sh[:, 0, 0], 0.5 / SH_C0, rtol=1e-6)


GOOD = LEVELS[1].read_bytes()


def put(offset, *values, form="I"):
    data = bytearray(GOOD)
    struct.pack_into(f"<{len(values)}{form}", data, offset, *values)
    return bytes(data)


@pytest.mark.parametrize(
    "data",
    [
        GOOD[:-20],
        GOOD[:4500],
        put(16, 10**9),
        put(4096, 10**9, 10**9),
        put(4096 + 12, 10**9),
        put(4096 + 32, 3),
        put(4096 + 40, 9, form="H"),
        put(4096 + 20, 13, form="H"),
        put(4096 + 16, np.nan, form="f"),
    ],
    ids=["cut", "no section", "count", "section's count", "buckets", "full", "degree", "bucket's width", "block"],
)
def test_a_bad_file_ends_in_one_sentence(tmp_path, data):
    (tmp_path / "a.ksplat").write_bytes(data)
    with pytest.raises(SplatFormatError, match=r"\.ksplat file is cut off or damaged"):
        read_splats(tmp_path / "a.ksplat")
