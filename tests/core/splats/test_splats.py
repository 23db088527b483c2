"""Splat files read right: every layout that INRIA's format allows, against values computed by hand."""

import math

import numpy as np
import plyfile
import pytest
from ply_files import names, ply_bytes, raw_table

from core.errors import Cancelled
from core.splats import GaussianScene, read_splats
from core.splats.ply.reader import detect, write_ply


@pytest.fixture
def put(tmp_path):
    def write(data, name="scene.ply"):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


def assert_is(scene, table, tolerance=2e-6):
    """`scene` holds the activated values of `table`, computed one by one with the math module."""
    rest = sum(name.startswith("f_rest_") for name in table) // 3
    assert scene.sh.shape == (len(table["x"]), rest + 1, 3)
    for i in range(len(table["x"])):
        row = {name: float(values[i]) for name, values in table.items()}
        norm = math.sqrt(sum(row[f"rot_{k}"] ** 2 for k in range(4)))
        np.testing.assert_allclose(scene.means[i], [row["x"], row["y"], row["z"]], rtol=tolerance)
        np.testing.assert_allclose(scene.scales[i], [math.exp(row[f"scale_{k}"]) for k in range(3)], rtol=tolerance)
        np.testing.assert_allclose(scene.rotations[i], [row[f"rot_{k}"] / norm for k in range(4)], atol=tolerance)
        assert scene.opacities[i] == pytest.approx(1 / (1 + math.exp(-row["opacity"])), abs=tolerance)
        for channel in range(3):
            want = [row[f"f_dc_{channel}"]] + [row[f"f_rest_{channel * rest + k}"] for k in range(rest)]
            np.testing.assert_allclose(scene.sh[i, :, channel], want, rtol=tolerance)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_every_degree_and_form(put, degree, form):
    table = raw_table(7, degree)
    scene = read_splats(put(ply_bytes(table, form)))
    assert_is(scene, table)
    assert scene.sh_degree == degree
    assert scene.dropped == 0
    assert all(a.dtype == np.float32 for a in (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh))
    assert all(a.flags.c_contiguous for a in (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh))


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_any_order_types_and_extras(put, form):
    table = raw_table(5, 1)
    table["quality"] = np.arange(5.0)
    table["label"] = np.arange(5.0) * 40
    order = np.random.default_rng(3).permutation(list(table))
    types = {"quality": "double", "label": "uchar", "x": "double", "opacity": "half", "f_dc_1": "float32", "rot_2": "float64"}
    table["opacity"] = table["opacity"].astype(np.float16).astype(np.float64)
    assert_is(read_splats(put(ply_bytes({name: table[name] for name in order}, form, types))), table)


def test_normals_may_be_absent(put):
    table = {name: values for name, values in raw_table(3).items() if name not in ("nx", "ny", "nz")}
    assert_is(read_splats(put(ply_bytes(table))), table)


def test_windows_line_ends_in_the_header(put):
    table = raw_table(3)
    assert_is(read_splats(put(ply_bytes(table, lines_end="\r\n"))), table)


BINARY_FACES = (["element face 2", "property list uchar int vertex_indices"], bytes([1, 9, 0, 0, 0, 2]) + bytes(8))
BINARY_PLAIN = (["element camera 2", "property double a", "property uchar b"], bytes(18))
ASCII_FACES = (["element face 2", "property list uchar int vertex_indices"], b"3 0 1 2\n1 0\n")


@pytest.mark.parametrize(
    ("form", "before"), [("binary_little_endian", BINARY_FACES), ("binary_little_endian", BINARY_PLAIN), ("ascii", ASCII_FACES)]
)
def test_other_elements_around_the_vertices(put, form, before):
    table = raw_table(4)
    after = (["element edge 1", "property int v"], b"1\n\0\0" if form != "ascii" else b"12\n")
    assert_is(read_splats(put(ply_bytes(table, form, before=[before], after=[after]))), table)


def test_large_file_comes_in_chunks_with_progress(put):
    rng = np.random.default_rng(1)
    table = rng.normal(size=(20_000, len(names(2)))).astype("<f4")
    head = ["ply", "format binary_little_endian 1.0", "element vertex 20000", *(f"property float {n}" for n in names(2))]
    path = put(("\n".join(head) + "\nend_header\n").encode() + table.tobytes())
    seen = []
    scene = read_splats(path, seen.append)
    assert len(seen) > 2
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    column = names(2).index
    np.testing.assert_array_equal(scene.means, table[:, :3])
    np.testing.assert_array_equal(scene.sh[:, 5, 1], table[:, column(f"f_rest_{8 + 4}")])  # green begins after 8 reds


def test_progress_may_stop_the_reading(put):
    def stop(fraction):
        raise Cancelled("Stopped.")

    with pytest.raises(Cancelled):
        read_splats(put(ply_bytes(raw_table(3))), stop)


@pytest.mark.parametrize("form", ["binary_little_endian", "ascii"])
def test_opaque_invisible_and_flat_gaussians_stay(put, form):
    """The logit of 1 and of 0 is infinite, and so is the logarithm of a flat Gaussian's third scale."""
    table = raw_table(6, 1)
    table["opacity"][[0, 1]], table["scale_2"][[1, 4]] = (math.inf, -math.inf), -math.inf
    scene = read_splats(put(ply_bytes(table, form)))
    assert (len(scene), scene.dropped) == (6, 0)
    assert (scene.opacities[:2].tolist(), scene.scales[[1, 4], 2].tolist()) == ([1, 0], [0, 0])


@pytest.mark.parametrize("form", ["binary_little_endian", "ascii"])
@pytest.mark.parametrize(
    ("name", "value"),
    [("x", math.nan), ("opacity", math.nan), ("f_rest_4", -math.inf), ("scale_1", math.inf), ("scale_0", 1e4)],
)
def test_gaussians_that_are_not_finite_are_dropped_and_counted(put, form, name, value):
    table = raw_table(6, 1)
    table[name][[1, 4]] = value
    scene = read_splats(put(ply_bytes(table, form)))
    assert scene.dropped == 2
    assert_is(scene, {key: np.delete(values, [1, 4]) for key, values in table.items()})


def test_zero_quaternion_is_dropped_and_a_tiny_one_normalised(put):
    table = raw_table(3)
    for k in range(4):
        table[f"rot_{k}"][0] = 0
        table[f"rot_{k}"][1] = 1e-25
    scene = read_splats(put(ply_bytes(table)))
    assert scene.dropped == 1
    np.testing.assert_allclose(scene.rotations[0], 0.5, rtol=1e-6)


@pytest.mark.filterwarnings("error")
def test_extreme_but_finite_values_pass_without_warnings(put):
    table = raw_table(2)
    table["opacity"][:] = [-200, 200]
    table["scale_0"][:] = [-200, 80]
    scene = read_splats(put(ply_bytes(table)))
    np.testing.assert_allclose(scene.opacities, [0, 1], atol=1e-30)
    assert scene.scales[0, 0] == 0
    assert scene.scales[1, 0] == pytest.approx(math.exp(80), rel=1e-5)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_written_file_is_read_back_by_plyfile_and_by_us(put, tmp_path, degree):
    table = raw_table(50, degree)
    scene = read_splats(put(ply_bytes(table)))
    path = tmp_path / "out" / "copy.ply"
    write_ply(path, scene)
    vertex = plyfile.PlyData.read(path)["vertex"]
    assert [p.name for p in vertex.properties] == names(degree)
    for name in set(table) - {"nx", "ny", "nz", "rot_0", "rot_1", "rot_2", "rot_3"}:
        np.testing.assert_allclose(vertex[name], table[name], rtol=1e-4, atol=1e-5)
    again = read_splats(path)
    for name in ("means", "scales", "rotations", "opacities", "sh"):
        np.testing.assert_allclose(getattr(again, name), getattr(scene, name), rtol=1e-5, atol=1e-6)
    assert [p.name for p in path.parent.iterdir()] == ["copy.ply"]


def test_writing_opaque_and_flat_gaussians_loses_none(tmp_path):
    scene = GaussianScene(
        np.zeros((2, 3), np.float32),
        np.array([[0, 1, 1], [1, 1, 1]], np.float32),
        np.tile(np.float32([1, 0, 0, 0]), (2, 1)),
        np.array([0, 1], np.float32),
        np.zeros((2, 1, 3), np.float32),
    )
    write_ply(tmp_path / "a.ply", scene)
    again = read_splats(tmp_path / "a.ply")
    assert again.dropped == 0
    np.testing.assert_allclose(again.opacities, scene.opacities, atol=1e-6)
    np.testing.assert_allclose(again.scales, scene.scales, atol=1e-30)


def test_detect():
    assert detect(b"ply\nformat")
    assert detect(b"ply\r\nformat")
    assert not detect(b"plywood")
    assert not detect(b"\x1f\x8b")
