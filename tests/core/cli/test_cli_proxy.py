"""`proxy` on the command line: what it writes, and what it refuses before any work."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mesh_depth import mesh_depth
from plyfile import PlyData

from core.cameras.files import camera_to_dict
from core.cli.main import main
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene, sample_cameras
from core.synthetic.truth import exact_depth


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    write_ply(folder / "room.ply", make_scene(0, 12_000))
    cameras = [replace(c, intrinsics=c.intrinsics.resized(160, 120)) for c in sample_cameras(3)]
    (folder / "cameras.json").write_text(json.dumps({"frames": [camera_to_dict(c) for c in cameras]}))
    return folder, cameras


def run(folder, *more):
    return main(["proxy", str(folder / "room.ply"), str(folder / "cameras.json"), *map(str, more), "--threads", "1"])


def test_it_writes_the_mesh_and_says_how_large_it_is(room, tmp_path, capsys):
    folder, cameras = room
    out = tmp_path / "proxy.ply"
    assert run(folder, "--out", out, "--faces", 3000, "--every", 2) == 0
    said = capsys.readouterr()
    assert "triangles from 2 cameras; the mesh is in" in said.out and "drawing views, 2 of 2" in said.err
    read = PlyData.read(str(out))
    vertices = np.column_stack([read["vertex"][name] for name in "xyz"])
    faces = np.vstack(read["face"]["vertex_indices"])
    assert 1500 < len(faces) <= 3000
    camera = replace(cameras[0], intrinsics=cameras[0].intrinsics.pinhole())
    truth, depth = exact_depth(camera), mesh_depth(vertices, faces, camera)
    both = np.isfinite(truth) & (depth > 0)
    assert both.mean() > 0.85 and np.median(np.abs(depth / truth - 1)[both]) < 0.01


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--out", "a.stl"], "is no kind of mesh file"),
        (["--out", "a.ply", "--faces", "7"], "The option faces is 7; give a whole number from 100"),
        (["--out", "a.ply", "--every", "0"], "--every is 0; give 1 or more."),
        (["--out", "{folder}/room.ply"], "would overwrite the scan"),
    ],
)
def test_wrong_input_is_one_sentence_and_nothing_is_written(room, tmp_path, monkeypatch, capsys, more, said):
    folder, _ = room
    monkeypatch.chdir(tmp_path)
    before = (folder / "room.ply").read_bytes()
    assert run(folder, *[text.format(folder=folder) for text in more]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert (folder / "room.ply").read_bytes() == before and list(tmp_path.iterdir()) == []


def test_cameras_that_failed_are_left_out_and_doubted_ones_told(room, tmp_path, capsys):
    folder, cameras = room
    verdicts = ["trusted", "failed", "check"]
    records = [camera_to_dict(c) | {"verdict": v} for c, v in zip(cameras, verdicts, strict=True)]
    file, out = tmp_path / "results.json", tmp_path / "proxy.ply"
    file.write_text(json.dumps({"frames": records}))
    command = ["proxy", str(folder / "room.ply"), str(file), "--out", str(out), "--faces", "500", "--long-side-px", "80"]
    assert main([*command, "--threads", "1"]) == 0
    said = capsys.readouterr()
    assert "from 2 cameras" in said.out
    assert "Left out of 'results.json': 1 of 3 cameras, which failed." in said.err
    assert "1 camera should be checked by eye" in said.err
    out.unlink()
    file.write_text(json.dumps({"frames": [records[1]]}))
    assert main(command) == 2
    assert "Every camera of 'results.json' failed" in capsys.readouterr().err and not out.exists()
