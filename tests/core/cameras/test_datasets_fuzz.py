"""Files damaged at random places: poses, or one sentence; never anything else."""

import json
import random

import pytest
from dataset_files import (
    CAMBRIDGE_LINE,
    CAMBRIDGE_TITLE,
    LINE,
    OPENGL,
    POSE,
    binary_cameras,
    binary_images,
    cambridge,
    put,
    seven_scenes,
)

from core import cameras as datasets
from core.cameras.files import camera_to_dict
from core.errors import GssmcError
from core.geometry.camera import Camera, Intrinsics

JUNK = [b"nan", b"1e999", b"-1", b"", b"\0", b"\xff", b"9" * 400, b"9" * 5000, b"null", b"true", b'"x"', b"[]", b"{}", b"0"]
JUNK += [b" ", b"\n", b"#", b"1_0", b"inf", b"1e308", "\u0661".encode()]
CAMERA = camera_to_dict(Camera(Intrinsics(8, 6, 5, 5, 4, 3), POSE, "a.png"))
FRAME = {"file_path": "a.png", "transform_matrix": OPENGL, "w": 8, "h": 6, "fl_x": 5, "cx": 4, "cy": 3}


def sources(root):
    """Layout to (path to read, files that get damaged)."""
    rooms, town, model = seven_scenes(root / "rooms", 1), cambridge(root / "town"), root / "model"
    put(
        town / "reconstruction.nvm",
        "NVM_V3\n\n2\nseq2/frame00001.jpg 9 1 0 0 0 0 0 0 0 0\nseq2/frame00002.jpg 9 1\n\n9\n",
    )
    images = put(model / "images.txt", f"# Images\n1 {LINE} 1 a.png\n1 2 -1\n2 {LINE} 1 b.png\n\n")
    binary = root / "binary"
    parts = [put(binary / "images.bin", binary_images(["a.png", "b.png"]))]
    parts += [put(binary / "cameras.bin", binary_cameras([(1, 0, 8, 6, 5, 4, 3), (2, 1, 8, 6, 5, 5, 4, 3)]))]
    lenses = put(model / "cameras.txt", "1 OPENCV 8 6 5 5 4 3 0.1 0.2 0 0\n")
    return {
        "7scenes": (rooms, [rooms / "TestSplit.txt", *rooms.glob("*/*.pose.txt")]),
        "cambridge": (town, [town / "dataset_test.txt", town / "reconstruction.nvm", *town.glob("*/*.png")]),
        "cambridge list": (put(root / "d.txt", CAMBRIDGE_TITLE + f"a.png {CAMBRIDGE_LINE}\n"), [root / "d.txt"]),
        "colmap": (model, [images, lenses]),
        "binary colmap": (binary, parts),
        "nerfstudio": (put(root / "t.json", json.dumps({"frames": [FRAME]})), [root / "t.json"]),
        "cameras": (put(root / "c.json", json.dumps({"frames": [CAMERA]})), [root / "c.json"]),
        "poses": (put(root / "p.txt", f"a.png {LINE}\nb.png {LINE} 525\n"), [root / "p.txt"]),
    }


def damaged(data, rng):
    out = bytearray(data)
    for _ in range(rng.randint(1, 3)):
        start = rng.randrange(len(out) + 1)
        out[start : start + rng.choice([0, 1, 2, 5, 30])] = rng.choice(JUNK)
    return bytes(out[: rng.randrange(len(out) + 1)] if rng.random() < 0.1 else out)


@pytest.mark.parametrize(
    "layout", ["7scenes", "cambridge", "cambridge list", "colmap", "binary colmap", "nerfstudio", "cameras", "poses"]
)
def test_damage_ends_in_poses_or_in_one_sentence(tmp_path, layout):
    rng, sentences = random.Random(layout), 0
    path, files = sources(tmp_path)[layout]
    assert datasets.read(path).frames
    for _ in range(150):
        file = rng.choice(files)
        whole = file.read_bytes()
        file.write_bytes(damaged(whole, rng))
        for ask in (datasets.read, datasets.queries):
            try:
                assert ask(path)
            except GssmcError as error:
                sentences += 1
                assert str(error).endswith(".")
                assert "\n" not in str(error)
                assert len(str(error)) < 700
        file.write_bytes(whole)
    assert sentences > 10
