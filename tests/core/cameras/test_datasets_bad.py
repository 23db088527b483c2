"""Hostile and damaged files: one named sentence each, that says where and what to do."""

import json
import re

import pytest
from dataset_files import (
    CAMBRIDGE_TITLE,
    CAMERA_TO_WORLD,
    LINE,
    OPENGL,
    binary_cameras,
    binary_images,
    cambridge,
    put,
    seven_scenes,
)

from core import cameras as datasets
from core.cameras.text import MAX_LINE_BYTES
from core.errors import CameraError, DatasetError, GssmcError

TEXTS = {
    "empty list": ("p.txt", "", "holds no poses"),
    "comments only": ("p.txt", "# a\n\n# b\n", "holds no poses"),
    "binary": ("p.txt", b"\x89PNG\0\0\0", "is no text file (line 1)"),
    "not UTF-8": ("p.txt", b"a\xff\xfe " + LINE.encode(), "it is not UTF-8"),
    "UTF-16": ("p.txt", f"a.png {LINE}\n".encode("utf-16"), "is no text file"),
    "few columns": ("p.txt", f"a.png {LINE}\nb.png 1 0 0\n", "Line 2 of 'p.txt' has 4 columns"),
    "cut off": ("p.txt", f"a.png {LINE}\nb.png {LINE}"[:-3], "Line 2 of 'p.txt' has 7 columns"),
    "word for a number": ("p.txt", f"a.png {LINE.replace('2', 'two')}\n", "Line 1 of 'p.txt' has a value that is no usable"),
    "NaN": ("p.txt", f"a.png {LINE.replace('-1', 'nan')}\n", "no usable number"),
    "infinite": ("p.txt", f"a.png {LINE.replace('3', '-inf')}\n", "no usable number"),
    "beyond all scale": ("p.txt", f"a.png {LINE.replace('3', '1e300')}\n", "no usable number"),
    "zero quaternion": ("p.txt", "a.png 0 0 0 0 1 2 3\n", "The quaternion has length 0 instead of 1"),
    "centre first": ("p.txt", "a.png 1 2 3 0.5 0.5 -0.5 0.5\n", "its order must be w x y z"),
    "twice": ("p.txt", f"a.png {LINE}\na.png {LINE}\n", "holds 'a.png' more than once"),
    "cambridge columns": (
        "dataset_test.txt",
        CAMBRIDGE_TITLE + "a.png 1 2 3\n",
        "should hold a photo's name and X Y Z W P Q R",
    ),
    "cambridge order": ("dataset_test.txt", CAMBRIDGE_TITLE + f"a.png {LINE}\n", "Line 4 of 'dataset_test.txt' cannot be used"),
    "cambridge empty": ("dataset_test.txt", CAMBRIDGE_TITLE, "holds no poses"),
    "colmap with half a point": ("images.txt", f"1 {LINE} 1 a.png\n5 6\n2 {LINE} 1 b.png\n\n", "give two lines to each image"),
    "colmap cut off": ("images.txt", f"1 {LINE} 1 a.png\n\n2 0.5 -0.5", "Line 3 of 'images.txt' has 3 columns"),
    "colmap twice": ("images.txt", f"1 {LINE} 1 a.png\n\n2 {LINE} 1 a.png\n\n", "more than once"),
    "no json": ("c.json", "{", "is no valid JSON"),
    "json of nothing": ("c.json", "{}", "lacks R, t"),
    "frames of one": ("c.json", '{"frames": {}}', "no list of cameras"),
    "no frames": ("c.json", '{"frames": []}', "holds no poses"),
    "frames of numbers": ("c.json", "[1, 2]", "Camera 1 of 'c.json' is not a JSON object"),
    "deep": ("c.json", "[" * 100_000, "is no valid JSON"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_bad_file(tmp_path, case):
    name, text, words = TEXTS[case]
    with pytest.raises((DatasetError, CameraError), match=re.escape(words)) as caught:
        datasets.read(put(tmp_path / name, text))
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_a_line_without_end(tmp_path):
    with pytest.raises(DatasetError, match="is no text file"):
        datasets.read(put(tmp_path / "p.txt", b"a" * (MAX_LINE_BYTES + 10)))


def test_nothing_there_and_a_folder_of_something_else(tmp_path):
    with pytest.raises(DatasetError, match="There is nothing at"):
        datasets.read(tmp_path / "none.txt")
    put(tmp_path / "notes.txt", "hello")
    assert datasets.detect(tmp_path) is None
    with pytest.raises(DatasetError, match=r"is no folder of poses; it should hold TestSplit.txt"):
        datasets.read(tmp_path)
    with pytest.raises(DatasetError, match="give one of these layouts: 7scenes, cambridge"):
        datasets.queries(put(tmp_path / "p.txt", f"a.png {LINE}\n"))


BINARY = {
    "no images": (b"\0" * 8, "", "holds no poses"),
    "empty": (b"", "", "is damaged or cut off"),
    "a count beyond the file": (b"\xff" * 8, "", "is damaged or cut off"),
    "points beyond the file": (binary_images(["a.png"], points=0)[:-8] + b"\xff" * 8, "", "is damaged or cut off"),
    "a name without end": (binary_images(["a" * 9000]), "", "is damaged or cut off"),
    "a name in no encoding": (binary_images(["a.png"]).replace(b"a.png", b"\xff.png"), "", "is damaged or cut off"),
    "no rotation": (binary_images(["a.png"], quaternion=(0, 0, 0, 0)), "", "Image 1 of 'images.bin' cannot be used"),
    "not a number": (binary_images(["a.png"], quaternion=(float("nan"), 0, 0, 0)), "", "no usable number"),
    "a new model": (binary_images(["a.png"]), binary_cameras([(1, 77, 640, 480)]), "unknown model 77"),
    "no focal length": (binary_images(["a.png"]), binary_cameras([(1, 0, 640, 480, 0, 3, 4)]), "must be positive"),
    "camera cut off": (binary_images(["a.png"]), binary_cameras([(1, 4, 640, 480, 5)]), "is damaged or cut off"),
}


@pytest.mark.parametrize("case", BINARY)
def test_bad_binary_colmap_model(tmp_path, case):
    images, cameras, words = BINARY[case]
    put(tmp_path / "sparse/0/images.bin", images)
    if cameras:
        put(tmp_path / "sparse/0/cameras.bin", cameras)
    with pytest.raises(DatasetError, match=words):
        datasets.read(tmp_path)


CAMERAS = {
    "few parameters": ("1 PINHOLE 640 480 500\n", "is no camera"),
    "no model": ("1\n", "is no camera"),
    "numbers alone": ("1 640 480 500 500 1 2\n", "is no camera"),
    "word": ("1 PINHOLE 640 480 500 x 1 2\n", "no usable number"),
    "no focal length": ("1 PINHOLE 640 480 0 500 1 2\n", "both must be positive"),
    "no photo's shape": ("1 PINHOLE 1000000 1 500 500 1 2\n", "at most 100 times the short one"),
}


@pytest.mark.parametrize("case", CAMERAS)
def test_bad_colmap_camera(tmp_path, case):
    text, words = CAMERAS[case]
    put(tmp_path / "images.txt", f"1 {LINE} 1 a.png\n\n")
    put(tmp_path / "cameras.txt", text)
    with pytest.raises(DatasetError, match=f"Line 1 of 'cameras.txt'.*{words}"):
        datasets.read(tmp_path)


POSES = {
    "empty": ("", "is no 4x4 camera-to-world matrix"),
    "three rows": ("".join(CAMERA_TO_WORLD.splitlines(keepends=True)[:3]), "is no 4x4"),
    "five rows": (CAMERA_TO_WORLD + "0 0 0 1\n", "is no 4x4"),
    "last row": (CAMERA_TO_WORLD.replace("0 0 0 1\n", "0 0 1 1\n"), "is no 4x4"),
    "lost tracking": (CAMERA_TO_WORLD.replace("3", "-inf"), "no usable number"),
    "mirror": (CAMERA_TO_WORLD.replace("0 0 1 1", "0 0 -1 1"), "is not a rotation"),
    "binary": (b"\0\1\2", "is no text file"),
    "very long": ("1 " * 100_000, "is no 4x4"),
}


@pytest.mark.parametrize("case", POSES)
def test_bad_7_scenes_pose_is_named(tmp_path, case):
    text, words = POSES[case]
    root = seven_scenes(tmp_path / "chess")
    put(root / "seq-02/frame-000001.pose.txt", text)
    with pytest.raises(DatasetError, match=re.escape(words)) as caught:
        datasets.read(root)
    assert "frame-000001.pose.txt" in str(caught.value)


def test_7_scenes_folders_that_are_not_unpacked(tmp_path):
    root = seven_scenes(tmp_path / "chess")
    put(root / "TestSplit.txt", "sequence9\n")
    with pytest.raises(DatasetError, match="lists sequence 9, whose folder is missing; unpack"):
        datasets.read(root)
    put(root / "TestSplit.txt", "chess\n")
    with pytest.raises(DatasetError, match=r"Line 1 of 'TestSplit.txt' names no sequence"):
        datasets.read(root)
    put(root / "TestSplit.txt", "sequence2\n")
    for photo in root.glob("*/*.png"):
        photo.unlink()
    with pytest.raises(DatasetError, match="has no frame"):
        datasets.queries(root)


TRANSFORMS = {
    "no name": ({"transform_matrix": OPENGL}, "lacks"),
    "no matrix": ({"file_path": "a"}, "lacks"),
    "three by three": ({"file_path": "a", "transform_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "is not a finite 4x4"),
    "ragged": ({"file_path": "a", "transform_matrix": [[1, 0, 0], [0, 1]]}, "not made of numbers"),
    "words": ({"file_path": "a", "transform_matrix": [["a"] * 4] * 4}, "not made of numbers"),
    "scaled": ({"file_path": "a", "transform_matrix": [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]]}, "is not a rotation"),
    "mirrored": ({"file_path": "a", "transform_matrix": [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}, "is not a rotation"),
    "huge": ({"file_path": "a", "transform_matrix": [[10**400, 0, 0, 0]] * 3}, "cannot be used"),
}


@pytest.mark.parametrize("case", TRANSFORMS)
def test_bad_nerfstudio_frame(tmp_path, case):
    frame, words = TRANSFORMS[case]
    good = {"file_path": "0", "transform_matrix": OPENGL}
    with pytest.raises(DatasetError, match=words) as caught:
        datasets.read(put(tmp_path / "transforms.json", json.dumps({"frames": [good, frame]})))
    assert str(caught.value).startswith("Camera 2 of 'transforms.json'")


@pytest.mark.parametrize("text", ["NVM_V3\n\nmany\n", "NVM_V3\n\n2\nseq2/frame00001.jpg\n", "", b"\0"])
def test_bad_nvm(tmp_path, text):
    root = cambridge(tmp_path / "Shop")
    put(root / "reconstruction.nvm", text)
    with pytest.raises(GssmcError) as caught:
        datasets.queries(root)
    assert "reconstruction.nvm" in str(caught.value)
