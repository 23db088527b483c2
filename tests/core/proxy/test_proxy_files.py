"""Proxies as files, read by other people's readers where there is one."""

import json
import struct

import numpy as np
import pytest
from plyfile import PlyData

from core.errors import ProxyError
from core.proxy import ProxyMesh
from core.proxy.file import write_proxy

MESH = ProxyMesh(
    np.array([[0.0, 0, 5], [1, 0, 5], [0, 1, 5], [1_000_000.25, 1, 6]]),
    np.array([[0, 1, 2], [1, 3, 2]]),
    np.array([[0, 0.5, 1], [1, 1, 1], [0, 0, 0], [0.2, 0.4, 0.6]], np.float32),
)


def test_ply(tmp_path):
    write_proxy(tmp_path / "a.ply", MESH)
    read = PlyData.read(str(tmp_path / "a.ply"))
    vertex = read["vertex"]
    assert np.array_equal(np.column_stack([vertex[name] for name in "xyz"]), MESH.vertices)
    assert vertex["green"].tolist() == [128, 255, 0, 102]
    assert [list(face) for face in read["face"]["vertex_indices"]] == MESH.faces.tolist()


def test_obj(tmp_path):
    write_proxy(tmp_path / "a.OBJ", MESH)
    lines = [line.split() for line in (tmp_path / "a.OBJ").read_text().splitlines()]
    places = np.array([line[1:] for line in lines if line[0] == "v"], float)
    assert np.allclose(places, np.hstack([MESH.vertices, MESH.colors]), atol=1e-3)
    assert [[int(n) - 1 for n in line[1:]] for line in lines if line[0] == "f"] == MESH.faces.tolist()


def test_glb(tmp_path):
    write_proxy(tmp_path / "a.glb", MESH)
    data = (tmp_path / "a.glb").read_bytes()
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    length = struct.unpack_from("<I", data, 12)[0]
    text, body = json.loads(data[20 : 20 + length]), data[28 + length :]
    assert len(body) == text["buffers"][0]["byteLength"] and len(data) % 4 == 0

    def values(accessor, kind):
        view = text["bufferViews"][text["accessors"][accessor]["bufferView"]]
        return np.frombuffer(body[view["byteOffset"] :][: view["byteLength"]], kind)

    attributes = text["meshes"][0]["primitives"][0]["attributes"]
    assert np.allclose(values(attributes["POSITION"], "<f4").reshape(-1, 3), MESH.vertices)
    assert np.array_equal(values(text["meshes"][0]["primitives"][0]["indices"], "<u4").reshape(-1, 3), MESH.faces)
    assert values(attributes["COLOR_0"], "<f4")[1] == pytest.approx(0.21404, abs=1e-4)  # 0.5 of sRGB in linear light


def test_another_suffix_is_refused_and_writes_nothing(tmp_path):
    with pytest.raises(ProxyError, match=r"'a.stl' is no kind of mesh file that is written; give one of .ply, .obj, .glb"):
        write_proxy(tmp_path / "a.stl", MESH)
    assert list(tmp_path.iterdir()) == []
