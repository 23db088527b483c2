"""The packed splat formats read right: hand-made bytes against values computed one by one with the math module."""

import gzip
import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ply_files import ply_bytes, raw_table
from splat_files import (
    REST,
    SH_C0,
    chunk_ply_bytes,
    random_chunk_ply,
    splat_bytes,
    splat_records,
    spz4_bytes,
    spz_bytes,
    spz_rows,
)

from core.errors import Cancelled, SplatFormatError
from core.splats import FORMATS, check_splat_file, inspect_splats, read_splats
from core.splats.ply.reader import write_ply_axes_kept
from core.splats.spz.write import write_spz


@pytest.fixture
def put(tmp_path):
    def write(data, name="scene.bin"):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


def assert_valid(scene):
    """What every scene promises, whatever it came from."""
    arrays = (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh)
    assert all(a.dtype == np.float32 and a.flags.c_contiguous and np.isfinite(a).all() for a in arrays)
    np.testing.assert_allclose(np.linalg.norm(scene.rotations, axis=1), 1, atol=1e-6)
    assert (scene.scales >= 0).all()
    assert scene.opacities.min() >= 0
    assert scene.opacities.max() <= 1


def test_splat_records(put):
    records = splat_records(40)
    scene = read_splats(put(splat_bytes(records)))
    assert_valid(scene)
    assert (scene.format, scene.sh_degree, scene.orientation, scene.dropped) == ("splat", 0, "Y_DOWN", 0)
    for i, (position, scale, rgba, q) in enumerate(records):
        np.testing.assert_array_equal(scene.means[i], np.float32(position))
        np.testing.assert_array_equal(scene.scales[i], np.float32(scale))
        assert scene.opacities[i] == pytest.approx(rgba[3] / 255, abs=1e-7)
        np.testing.assert_allclose(scene.sh[i, 0], [(v / 255 - 0.5) / SH_C0 for v in rgba[:3]], atol=1e-6)
        w = [(v - 128) / 128 for v in q]
        np.testing.assert_allclose(scene.rotations[i], [v / math.hypot(*w) for v in w], atol=1e-6)


def test_a_large_splat_file_comes_in_chunks_with_progress(put):
    records = splat_records(300) * 120
    seen = []
    scene = read_splats(put(splat_bytes(records)), seen.append)
    assert len(scene) == 36_000
    assert len(seen) == 3
    assert seen[-1] == 1
    np.testing.assert_array_equal(scene.means[35_999], np.float32(records[-1][0]))


def test_splat_records_that_are_no_gaussians_are_dropped(put):
    good = splat_records(40)
    position, scale, rgba, q = good[0]
    bad = [(position, [-1, 1, 1], rgba, q), ([math.nan, 0, 0], scale, rgba, q), (position, scale, rgba, [128] * 4)]
    scene = read_splats(put(splat_bytes(good + bad)))
    assert scene.dropped == 3
    assert len(scene) == 40


def quaternion_of(row, version):
    """w x y z of an SPZ row, by the format's own words."""
    if version < 3:
        x, y, z = (v / 127.5 - 1 for v in row.xyz)
        q = [math.sqrt(max(0, 1 - x * x - y * y - z * z)), x, y, z]
    else:
        small = [(-1 if sign else 1) * size / 511 * math.sqrt(0.5) for sign, size in row.small]
        xyzw = list(small)
        xyzw.insert(row.largest, math.sqrt(1 - sum(v * v for v in small)))
        q = [xyzw[3], *xyzw[:3]]
    return [v / math.hypot(*q) for v in q]


def assert_is_spz(scene, rows, version, bits, coefficients):
    assert_valid(scene)
    assert scene.sh.shape == (len(rows), coefficients, 3)
    for i, row in enumerate(rows):
        position = row.half if version == 1 else [v / 2**bits for v in row.position]
        np.testing.assert_allclose(scene.means[i], position, rtol=1e-6)
        np.testing.assert_allclose(scene.scales[i], [math.exp(v / 16 - 10) for v in row.scale], rtol=1e-6)
        assert scene.opacities[i] == pytest.approx(row.alpha / 255, abs=1e-7)
        np.testing.assert_allclose(scene.rotations[i], quaternion_of(row, version), atol=1e-6)
        np.testing.assert_allclose(scene.sh[i, 0], [(v / 255 - 0.5) / 0.15 for v in row.colour], atol=1e-5)
        for k in range(1, coefficients):
            np.testing.assert_array_equal(scene.sh[i, k], [(v - 128) / 128 for v in row.sh[k - 1]])


@pytest.mark.parametrize("version", [1, 2, 3, 4])
@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4])
def test_spz(put, version, degree):
    rows = spz_rows(30, degree, seed=version)
    data = spz4_bytes(rows, degree, bits=11) if version == 4 else spz_bytes(rows, version, degree, bits=11)
    path = put(data)
    scene = read_splats(path)
    assert (scene.format, scene.orientation) == (f"spz version {version}", "Y_UP")
    assert_is_spz(scene, rows, version, 11, 1 + min(REST[degree], 15))
    info = inspect_splats(path)
    assert (info.count, info.sh_degree, info.format) == (30, min(degree, 3), scene.format)


def test_spz_of_several_blocks_and_with_a_trailer(put):
    rows = spz_rows(500, 1)
    seen = []
    scene = read_splats(put(spz_bytes(rows * 140, 3, 1, flags=2, trailer=b"extension")), seen.append)
    assert len(scene) == 70_000
    assert seen == sorted(seen)
    assert seen[-1] == 1
    np.testing.assert_array_equal(scene.sh[-1, 3], [(v - 128) / 128 for v in rows[-1].sh[2]])
    np.testing.assert_allclose(scene.means[-1], [v / 4096 for v in rows[-1].position], rtol=1e-6)


def test_spz_half_floats_that_are_not_finite_are_dropped(put):
    rows = spz_rows(5, 0)
    rows[2].half[1] = math.inf
    scene = read_splats(put(spz_bytes(rows, 1, 0)))
    assert scene.dropped == 1
    np.testing.assert_allclose(scene.means[2], rows[3].half, rtol=1e-6)


AXES = {"R": (1, 0, 0), "L": (-1, 0, 0), "U": (0, 1, 0), "D": (0, -1, 0), "B": (0, 0, 1), "F": (0, 0, -1)}
# 1 to 16 in Niantic's library
FRAMES = [a + b + c for b, c in ("DB", "UB", "DF", "UF", "BD", "BU", "FD", "FU") for a in "LR"]


@pytest.mark.parametrize("frame", FRAMES)
def test_spz_4_may_declare_its_axes(put, frame):
    number = FRAMES.index(frame) + 1
    records = struct.pack("<II3s", 0x12340001, 3, b"abc") + struct.pack("<III", 0xADBE0003, 4, number)
    path = put(spz4_bytes(spz_rows(3, 0), 0, records=records))
    if np.linalg.det([AXES[letter] for letter in frame]) < 0:
        with pytest.raises(SplatFormatError, match=f"axes number {number}, which mirror"):
            read_splats(path)
    else:
        letter = frame[1] if frame[1] in "UD" else frame[2]
        want = ("Y" if frame[1] == letter else "Z") + ("_UP" if letter == "U" else "_DOWN")
        assert inspect_splats(path).orientation == read_splats(path).orientation == want


def test_spz_4_without_declared_axes(put):
    records = struct.pack("<II3s", 0x12340001, 3, b"abc") + struct.pack("<III", 0xADBE0003, 4, 0)
    assert read_splats(put(spz4_bytes(spz_rows(3, 0), 0, records=records))).orientation == "Y_UP"


def expected_chunk_row(chunk, word, colours):
    """Means, scales, quaternion w x y z, opacity, f_dc of one packed Gaussian."""
    position, rotation, scale, color = word

    def three(value, low, high):
        parts = (value >> 21) / 2047, (value >> 11 & 1023) / 1023, (value & 2047) / 2047
        return [a + (b - a) * t for a, b, t in zip(low, high, parts, strict=True)]

    small = [((rotation >> shift & 1023) / 1023 - 0.5) * math.sqrt(2) for shift in (20, 10, 0)]
    q = list(small)
    q.insert(rotation >> 30, math.sqrt(1 - sum(v * v for v in small)))
    rgb = [(color >> shift & 255) / 255 for shift in (24, 16, 8)]
    if colours:
        rgb = [a + (b - a) * t for a, b, t in zip(chunk[12:15], chunk[15:18], rgb, strict=True)]
    scales = [math.exp(v) for v in three(scale, chunk[6:9], chunk[9:12])]
    dc = [(v - 0.5) / SH_C0 for v in rgb]
    return three(position, chunk[0:3], chunk[3:6]), scales, [v / math.hypot(*q) for v in q], (color & 255) / 255, dc


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("colours", [True, False])
@pytest.mark.parametrize("order", ["little", "big"])
def test_compressed_ply(put, degree, colours, order):
    data, chunks, words, sh = random_chunk_ply(300, degree, colours=colours, order=order)
    path = put(data)
    scene = read_splats(path)
    assert_valid(scene)
    assert (scene.format, scene.orientation, scene.sh_degree) == ("compressed ply", "Y_DOWN", degree)
    assert inspect_splats(path).count == 300
    assert inspect_splats(path).sh_degree == degree
    for i, word in enumerate(words):
        means, scales, q, opacity, dc = expected_chunk_row(chunks[i // 256], word, colours)
        np.testing.assert_allclose(scene.means[i], means, atol=1e-6)
        np.testing.assert_allclose(scene.scales[i], scales, rtol=1e-5)
        np.testing.assert_allclose(scene.rotations[i], q, atol=1e-6)
        assert scene.opacities[i] == pytest.approx(opacity, abs=1e-7)
        np.testing.assert_allclose(scene.sh[i, 0], dc, atol=1e-5)
        for k in range(REST[degree]):
            codes = [sh[i][channel * REST[degree] + k] for channel in range(3)]
            want = [{0: -4, 255: 4}.get(c, ((c + 0.5) / 256 - 0.5) * 8) for c in codes]
            np.testing.assert_allclose(scene.sh[i, k + 1], want, atol=1e-6)


def test_compressed_ply_drops_a_chunk_that_is_not_finite(put):
    _, chunks, words, _ = random_chunk_ply(300)
    chunks[0][0] = math.nan
    scene = read_splats(put(chunk_ply_bytes(chunks, words)))
    assert scene.dropped == 256
    assert len(scene) == 44


def test_2dgs_discs(put):
    table = {name: values for name, values in raw_table(20, 1).items() if name != "scale_2"}
    scene = read_splats(put(ply_bytes(table)))
    assert_valid(scene)
    assert scene.format == "2DGS ply"
    for i in range(20):
        flat = [math.exp(table["scale_0"][i]), math.exp(table["scale_1"][i])]
        np.testing.assert_allclose(scene.scales[i], [*flat, min(flat) / 1000], rtol=2e-6)
        assert scene.sh[i, 2, 1] == np.float32(table["f_rest_4"][i])


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_mip_splatting_filter_is_applied(put, form):
    table = raw_table(20, 1)
    table["filter_3D"] = np.float32(np.random.default_rng(4).uniform(0.01, 2, 20)).astype(np.float64)
    scene = read_splats(put(ply_bytes(table, form)))
    assert_valid(scene)
    assert (scene.format, scene.dropped) == ("Mip-Splatting ply", 0)
    for i in range(20):
        squares = [math.exp(2 * table[f"scale_{k}"][i]) for k in range(3)]
        widened = [s + table["filter_3D"][i] ** 2 for s in squares]
        np.testing.assert_allclose(scene.scales[i], [math.sqrt(v) for v in widened], rtol=2e-6)
        share = math.sqrt(math.prod(squares) / math.prod(widened))
        assert scene.opacities[i] == pytest.approx(share / (1 + math.exp(-table["opacity"][i])), rel=1e-5)


def test_a_mip_splatting_gaussian_that_is_not_finite_is_dropped(put):
    table = raw_table(6)
    table["filter_3D"] = np.array([0.1, np.nan, 0.1, np.inf, 0.1, 0.1])
    table["opacity"][4] = np.nan
    assert read_splats(put(ply_bytes(table))).dropped == 3


@pytest.mark.parametrize("kind", ["half", "double"])
def test_every_property_half_or_double(put, kind):
    table = {name: values.astype(np.float16).astype(np.float64) for name, values in raw_table(9, 2).items()}
    scene = read_splats(put(ply_bytes(table, types=dict.fromkeys(table, kind))))
    assert_valid(scene)
    np.testing.assert_array_equal(scene.means[:, 1], table["y"].astype(np.float32))
    np.testing.assert_array_equal(scene.sh[:, 8, 2], table["f_rest_23"].astype(np.float32))


DATA = Path(__file__).parents[2] / "data"
SAMPLES = {
    "ply": ply_bytes(raw_table(3)),
    "2DGS ply": ply_bytes({n: v for n, v in raw_table(3).items() if n != "scale_2"}),
    "Mip-Splatting ply": ply_bytes(raw_table(3) | {"filter_3D": np.ones(3)}),
    "compressed ply": random_chunk_ply(3)[0],
    "splat": splat_bytes(splat_records(3)),
    "spz": spz_bytes(spz_rows(3, 0), 3, 0),
    "glTF": (DATA / "by_splat_transform.glb").read_bytes(),
    "sog": (DATA / "by_splat_transform.sog").read_bytes(),
    "ksplat": (DATA / "by_gaussian_splats_3d_level_0.ksplat").read_bytes(),
}
# Files that are no scene by themselves, or are read by a library that is not everywhere.
STARTS = {"streamed sog": (DATA / "streamed_by_splat_transform" / "lod-meta.json").read_bytes(), "OpenUSD": b"#usda 1.0\n"}


@pytest.mark.parametrize("name", [*SAMPLES, *STARTS])
def test_content_tells_the_format_whatever_the_name(put, name):
    assert check_splat_file(put((SAMPLES | STARTS)[name], "wrong.name")).name == name


def test_no_format_is_left_without_a_sample():
    assert {one.name for one in FORMATS} == {*SAMPLES, *STARTS}


@pytest.mark.parametrize("name", SAMPLES)
def test_every_reader_can_be_stopped(put, name):
    def stop(fraction):
        raise Cancelled("Stopped.")

    with pytest.raises(Cancelled):
        read_splats(put(SAMPLES[name]), stop)


@pytest.mark.parametrize(
    ("comment", "axes", "soft"),
    [
        ("Vertical Axis: z", "Z_UP", False),
        ("Vertical Axis: y", "Y_UP", False),
        ("SplatRenderMode: mip", "Y_DOWN", True),
        ("SplatRenderMode: default", "Y_DOWN", False),
        ("antialiased 1", "Y_DOWN", True),
        ("antialiased 0", "Y_DOWN", False),
        ("Vertical Axis: z and more", "Y_DOWN", False),
    ],
)
def test_what_a_ply_says_of_axes_and_drawing_counts(put, comment, axes, soft):
    """nerfstudio, Brush and Postshot write these comments."""
    data = ply_bytes(raw_table(5, 1)).replace(b"comment made for a test", f"comment {comment}".encode())
    path = put(data)
    scene, info = read_splats(path), inspect_splats(path)
    assert (scene.orientation, scene.antialiased) == (axes, soft)
    assert (info.orientation, info.declared) == (axes, axes != "Y_DOWN")
    write_ply_axes_kept(path, scene)
    again = read_splats(path)
    assert (again.orientation == "Z_UP", again.antialiased) == (axes == "Z_UP", soft)


@pytest.mark.parametrize("version", [2, 3])
def test_the_antialiased_bit_of_spz_counts(put, tmp_path, version):
    scene = read_splats(put(ply_bytes(raw_table(5, 1))))
    for soft in (True, False):
        write_spz(tmp_path / "a.spz", replace(scene, antialiased=soft), version)
        assert read_splats(tmp_path / "a.spz").antialiased == soft
    data = bytearray(gzip.decompress((tmp_path / "a.spz").read_bytes()))
    data[14] |= 1  # the flags, as Niantic's page on the format has them
    assert read_splats(put(gzip.compress(bytes(data)))).antialiased
