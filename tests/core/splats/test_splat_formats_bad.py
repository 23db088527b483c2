"""Bad files of the packed formats: one sentence each, and no memory spent on what a header merely claims."""

import gzip
import re
import struct

import pytest
from ply_files import ply_bytes, raw_table
from splat_files import (
    chunk_ply_bytes,
    random_chunk_ply,
    splat_bytes,
    splat_records,
    spz4_bytes,
    spz_bytes,
    spz_header,
    spz_rows,
)

from core.errors import SplatFormatError
from core.splats import inspect_splats, read_splats
from core.splats.spz import payload as spz_payload

ROWS = spz_rows(40, 1)
SPZ = spz_bytes(ROWS, 3, 1)
SPZ4 = spz4_bytes(ROWS, 1)
COMPRESSED, CHUNKS, WORDS, SH = random_chunk_ply(300, 1)
FLAT = {name: values for name, values in raw_table(3).items() if name != "scale_2"}
BOMB = gzip.compress(spz_header(3, 4_000_000, 0) + bytes(20 * 4_000_000))


def swapped(data, old, new):
    assert old in data
    return data.replace(old, new, 1)


CASES = {
    "splat cut": (splat_bytes(splat_records(40))[:-5], "no whole number of 32-byte records"),
    "splat all invalid": (splat_bytes(splat_records(1))[:28] + bytes([128] * 4), "of an unknown format"),
    "spz cut": (SPZ[:-40], "cut off or damaged"),
    "spz cut in header": (gzip.compress(b"NGSP\x03\0\0\0"), "cut off inside its header"),
    "spz wrong checksum": (SPZ[:-8] + b"\1\2\3\4" + SPZ[-4:], "cut off or damaged"),
    "spz fewer than promised": (spz_bytes(ROWS, 3, 1, count=41), "cut off or damaged"),
    "spz far fewer than promised": (spz_bytes(ROWS, 3, 1, count=4_000_000_000), "too many to be a scan"),
    "spz bomb": (BOMB, "too many to be a scan"),
    "spz much more than promised": (gzip.compress(gzip.decompress(SPZ) + bytes(3 << 20)), "unpacks to more than"),
    "spz zero Gaussians": (spz_bytes([], 3, 0), "has 0 Gaussians"),
    "spz degree": (gzip.compress(spz_header(3, 1, 5) + bytes(999)), "SH degree 5"),
    "spz bits": (gzip.compress(spz_header(3, 1, 0, bits=200) + bytes(20)), "200 fractional bits"),
    "spz version 9": (gzip.compress(spz_header(9, 1, 0) + bytes(20)), "of version 9"),
    "spz version 4 in gzip": (gzip.compress(spz_header(4, 1, 0) + bytes(99)), "of version 4 lies inside gzip"),
    "spz version 3 in the open": (spz_header(3, 1, 0) + bytes(99), "of version 3 is not packed by gzip"),
    "gzip of something else": (gzip.compress(b"hello" * 100), "gzip data without an .spz header"),
    "spz 4 cut": (SPZ4[:-9], "not as long as its header says"),
    "spz 4 cut in header": (SPZ4[:20], "does not fit its header"),
    "spz 4 other count": (spz4_bytes(ROWS, 1, count=39), "not as long as its header says"),
    "spz 4 no streams": (spz4_bytes(ROWS, 1, streams=[]), "table of 0 streams"),
    "spz 4 table far away": (swapped(SPZ4, struct.pack("<I12x", 32), struct.pack("<I12x", 1 << 31)), "does not fit its header"),
    "spz 4 no zstd": (SPZ4[: 32 + 96] + bytes(len(SPZ4) - 128), "cut off or damaged"),
    "compressed cut": (COMPRESSED[:-9], "is cut off"),
    "compressed, more Gaussians": (chunk_ply_bytes(CHUNKS, WORDS, count=1 << 40), "2 chunks, too few"),
    "compressed ascii": (swapped(COMPRESSED, b"binary_little_endian", b"ascii"), "is an ascii file"),
    "compressed without chunks": (swapped(COMPRESSED, b"element chunk", b"element brick"), "has no element 'chunk'"),
    "compressed, half the bounds": (swapped(COMPRESSED, b"float min_scale_x", b"float min_skale_x"), "lacks min_scale_x"),
    "compressed, one colour bound": (swapped(COMPRESSED, b"float min_g", b"float min_q"), "lacks min_g"),
    "compressed, other type": (swapped(COMPRESSED, b"uint packed_scale", b"int packed_scale"), "lacks packed_scale"),
    "compressed, SH as float": (swapped(COMPRESSED, b"uchar f_rest_3", b"float f_rest_3"), "lacks f_rest_3"),
    "compressed, 3 SH values": (chunk_ply_bytes(CHUNKS, WORDS, [[1, 2, 3]] * 300), "3 f_rest values"),
    "compressed, SH for some": (chunk_ply_bytes(CHUNKS, WORDS, SH[:-1]), "SH for 299 of 300"),
    "compressed, a name twice": (swapped(COMPRESSED, b"float max_z", b"float max_y"), "lacks max_z"),
    "compressed, an element twice": (swapped(COMPRESSED, b"element sh", b"element chunk"), "names given twice"),
    "2DGS without opacity": (ply_bytes({n: v for n, v in FLAT.items() if n != "rot_1"}), "lacks the properties rot_1"),
    "2DGS cut": (ply_bytes(FLAT)[:-9], "holds 2 of 3 Gaussians"),
    "Mip-Splatting without scales": (ply_bytes(FLAT | {"filter_3D": FLAT["x"]}), "lacks the properties scale_2"),
    "zip": (b"PK\x03\x04" + bytes(60), "is no .sog scene, or is cut off or damaged"),
    "text": (b"hello\nworld\n" * 9, "is a text, not"),
    "json": (b'{"a": 1}' + b" " * 90, "a JSON, XML or HTML text"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_file_gets_one_sentence(tmp_path, case):
    data, words = CASES[case]
    path = tmp_path / "scene.bin"
    path.write_bytes(data)
    with pytest.raises(SplatFormatError, match=re.escape(words)) as caught:
        read_splats(path)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.endswith(".")
    assert len(sentence) < 300
    assert sentence[0].isupper() or sentence[0] == "'"


@pytest.mark.parametrize("case", ["spz version 9", "spz degree", "compressed without chunks", "splat cut", "zip"])
def test_inspecting_refuses_what_reading_refuses(tmp_path, case):
    data, words = CASES[case]
    path = tmp_path / "scene.bin"
    path.write_bytes(data)
    with pytest.raises(SplatFormatError, match=re.escape(words)):
        inspect_splats(path)


def test_spz_4_without_zstd_says_what_to_do(tmp_path, monkeypatch):
    path = tmp_path / "scene.spz"
    path.write_bytes(SPZ4)
    monkeypatch.setattr(spz_payload, "zstandard", None)
    with pytest.raises(SplatFormatError, match="export it as version 3"):
        read_splats(path)
