"""glTF with Gaussians: another program's own file against what it was made from, nodes, integers, and damaged files."""

import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from ply_files import ply_bytes, raw_table

from core.errors import SplatFormatError
from core.geometry.conventions import Similarity
from core.geometry.lie import so3_exp
from core.geometry.quaternion import rotations_of
from core.splats import inspect_splats, read_splats
from core.splats.spz.write import write_spz
from core.splats.transform import transformed

# raw_table(24, 1, seed=5) as splat-transform 2.7.1 writes it, which turns it by 180 degrees about z.
THEIRS = Path(__file__).parents[2] / "data" / "by_splat_transform.glb"
TURN = np.diag([-1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    path = tmp_path_factory.mktemp("source") / "a.ply"
    path.write_bytes(ply_bytes(raw_table(24, 1, seed=5)))
    return read_splats(path)


def moved(source, scale=1.0, rotation=TURN, translation=(0, 0, 0)):
    return transformed(source, Similarity(scale, rotation, np.array(translation, float)), "Y_UP")


def same(scene, truth):
    for name in ("means", "scales", "opacities", "sh"):
        np.testing.assert_allclose(getattr(scene, name), getattr(truth, name), rtol=1e-5, atol=1e-5, err_msg=name)
    assert np.abs((scene.rotations * truth.rotations).sum(axis=1)).min() > 1 - 1e-6


def model():
    """Their JSON and their numbers."""
    data = THEIRS.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def gltf(path, content, numbers):
    """As a .gltf whose numbers stand in the text."""
    content["buffers"] = [{"byteLength": len(numbers), "uri": "data:;base64," + base64.b64encode(numbers).decode()}]
    path.write_text(json.dumps(content))
    return path


def test_a_file_of_splat_transform_is_what_it_was_made_from(source):
    scene, info = read_splats(THEIRS), inspect_splats(THEIRS)
    same(scene, moved(source))
    assert (info.format, info.count, info.sh_degree, info.orientation) == ("glTF", 24, 1, "Y_UP")


def test_nodes_move_what_they_hold(source, tmp_path):
    content, numbers = model()
    angle = np.array([0.3, -0.2, 0.5])
    half = np.linalg.norm(angle) / 2
    turn = [*(np.sin(half) * angle / (2 * half)), np.cos(half)]
    outer = {"children": [1], "translation": [1, 2, 3], "rotation": turn, "scale": [2, 2, 2]}
    content["nodes"] = [outer, {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}]
    scene = read_splats(gltf(tmp_path / "a.gltf", content, numbers))
    rotation = so3_exp(angle)
    shift = rotation @ (2 * np.array([5.0, 6, 7])) + [1, 2, 3]
    same(scene, moved(source, 2.0, rotation @ TURN, shift))
    content["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [9, 0, 0]}]
    assert len(read_splats(gltf(tmp_path / "b.gltf", content, numbers))) == 48


def test_numbers_may_be_integers(source, tmp_path):
    content, numbers = model()
    at = content["meshes"][0]["primitives"][0]["attributes"]["KHR_gaussian_splatting:OPACITY"]
    shares = np.rint(moved(source).opacities * 255).astype(np.uint8)
    content["bufferViews"].append({"buffer": 0, "byteOffset": len(numbers), "byteLength": 24})
    view = len(content["bufferViews"]) - 1
    content["accessors"][at] = {"bufferView": view, "componentType": 5121, "count": 24, "type": "SCALAR", "normalized": True}
    scene = read_splats(gltf(tmp_path / "a.gltf", content, numbers + shares.tobytes()))
    np.testing.assert_allclose(scene.opacities, shares / 255, atol=1e-6)


def spz_model(source, tmp_path, name="KHR_gaussian_splatting_compression_spz_2"):
    """JSON and numbers of a model whose one primitive is an .spz file, which itself has y up."""
    write_spz(tmp_path / "inner.spz", source)
    data = (tmp_path / "inner.spz").read_bytes()
    accessors = [{"componentType": 5126, "count": len(source), "type": "VEC3"}]
    extension = {"KHR_gaussian_splatting": {"extensions": {name: {"bufferView": 0}}}}
    primitive = {"attributes": {"POSITION": 0}, "mode": 0, "extensions": extension}
    views = [{"buffer": 0, "byteOffset": 4, "byteLength": len(data)}]
    meshes = [{"primitives": [primitive]}]
    return {"asset": {"version": "2.0"}, "accessors": accessors, "bufferViews": views, "meshes": meshes}, bytes(4) + data


def shapes(scene):
    """The covariances of the Gaussians."""
    matrices = np.array([rotations_of(q.astype(np.float64)) for q in scene.rotations])
    return np.einsum("nij,nj,nkj->nik", matrices, scene.scales.astype(np.float64) ** 2, matrices)


@pytest.mark.parametrize("name", ["KHR_gaussian_splatting_compression_spz", "KHR_gaussian_splatting_compression_spz_2"])
def test_an_spz_inside_is_turned_to_the_axes_of_gltf(source, tmp_path, name):
    """x left, y up, z front, as the extension has it: half a turn about y from the .spz, about z from the .ply."""
    content, numbers = spz_model(source, tmp_path, name)
    scene, info = read_splats(gltf(tmp_path / "a.gltf", content, numbers)), inspect_splats(tmp_path / "a.gltf")
    inner = transformed(read_splats(tmp_path / "inner.spz"), Similarity(1.0, np.diag([-1.0, 1, -1]), np.zeros(3)), "Y_UP")
    for value in ("means", "scales", "opacities", "sh"):
        np.testing.assert_allclose(getattr(scene, value), getattr(inner, value), rtol=1e-5, atol=1e-5, err_msg=value)
    np.testing.assert_allclose(shapes(scene), shapes(inner), rtol=1e-4, atol=1e-5)
    assert np.abs(scene.means - moved(source).means).max() < 1e-4
    assert (info.format, info.count, info.sh_degree, scene.orientation) == ("glTF", 24, 1, "Y_UP")


def test_an_spz_inside_may_stand_beside_other_primitives(source, tmp_path):
    content, numbers = model()
    inner, data = spz_model(source, tmp_path)
    content["bufferViews"].append({"buffer": 0, "byteOffset": len(numbers) + 4, "byteLength": len(data) - 4})
    primitive = inner["meshes"][0]["primitives"][0]
    extension = primitive["extensions"]["KHR_gaussian_splatting"]["extensions"]
    extension["KHR_gaussian_splatting_compression_spz_2"]["bufferView"] = len(content["bufferViews"]) - 1
    content["meshes"][0]["primitives"].append(primitive)
    scene = read_splats(gltf(tmp_path / "a.gltf", content, numbers + data))
    assert len(scene) == 48
    assert np.abs(scene.means[:24] - scene.means[24:]).max() < 1e-4


def test_a_damaged_spz_inside_is_one_sentence(source, tmp_path):
    content, numbers = spz_model(source, tmp_path)
    content["bufferViews"][0]["byteLength"] -= 30
    with pytest.raises(SplatFormatError, match="spz file is cut off or damaged"):
        read_splats(gltf(tmp_path / "a.gltf", content, numbers))
    content["bufferViews"][0]["byteLength"] = 10**9
    with pytest.raises(SplatFormatError, match="are damaged"):
        read_splats(gltf(tmp_path / "a.gltf", content, numbers))


def hurt(content, case):
    primitive = content["meshes"][0]["primitives"][0]
    if case == "no splats":
        del primitive["extensions"]
    elif case == "compressed":
        primitive["extensions"]["KHR_gaussian_splatting"]["extensions"] = {"EXT_other_compression": {}}
        del content["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]
    elif case == "no rotations":
        del primitive["attributes"]["KHR_gaussian_splatting:ROTATION"]
    elif case == "too long":
        content["accessors"][0]["count"] = 10**9
    elif case == "circle":
        content["nodes"] = [{"children": [1]}, {"mesh": 0, "children": [2]}, {"children": [2]}]
    elif case == "sheared":
        content["nodes"] = [{"mesh": 0, "scale": [1, 2, 1]}]
    return content


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("no splats", "holds no Gaussian splats"),
        ("compressed", "are compressed .EXT_other_compression.; export it without"),
        ("no rotations", "are damaged, or are stored in a way"),
        ("too long", "are damaged, or are stored in a way"),
        ("circle", "are damaged, or are stored in a way"),
        ("sheared", "are damaged, or are stored in a way"),
    ],
)
def test_a_bad_file_ends_in_one_sentence(tmp_path, case, words):
    content, numbers = model()
    with pytest.raises(SplatFormatError, match=words) as caught:
        read_splats(gltf(tmp_path / "a.gltf", hurt(content, case), numbers))
    assert str(caught.value).endswith(".")


def test_damaged_files_end_in_a_scene_or_one_sentence(tmp_path):
    good, rng = THEIRS.read_bytes(), np.random.default_rng(4)
    for _ in range(150):
        data = bytearray(good)
        for at in rng.integers(0, 2000, 3):
            data[at] = rng.integers(256)
        cut = rng.integers(20, len(data) + 1) if rng.random() < 0.2 else len(data)
        (tmp_path / "a.glb").write_bytes(bytes(data[:cut]))
        try:
            read_splats(tmp_path / "a.glb")
        except SplatFormatError as error:
            assert str(error).endswith(".")
