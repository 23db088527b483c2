"""Camera JSON: what it holds comes back exactly; what it lacks is named."""

import json
import re

import numpy as np
import pytest

from core.cameras.files import camera_from_dict, camera_to_dict, read_cameras, read_starts, write_cameras
from core.errors import CameraError
from core.geometry.camera import Camera, Intrinsics, Pose
from core.geometry.lie import so3_exp

GOOD = {
    "file": "a.jpg",
    "width": 640,
    "height": 480,
    "fx": 500.0,
    "fy": 501,
    "cx": 320.5,
    "cy": 239.5,
    "dist": [0.1, -0.2, 0.003, 0.004],
    "R": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "t": [1, 2, 3],
}


@pytest.fixture
def put(tmp_path):
    def write(data, name="cams.json"):
        path = tmp_path / name
        path.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
        return path

    return write


def test_one_camera(put):
    (camera,) = read_cameras(put(GOOD))
    assert camera.intrinsics == Intrinsics(640, 480, 500.0, 501.0, 320.5, 239.5, (0.1, -0.2, 0.003, 0.004, 0.0))
    np.testing.assert_array_equal(camera.pose.R, GOOD["R"])
    np.testing.assert_array_equal(camera.pose.t, [1, 2, 3])
    assert camera.file == "a.jpg"


def test_frames_keep_their_order(put):
    cameras = read_cameras(put({"scene": "x", "frames": [GOOD | {"file": name} for name in "cab"]}))
    assert [c.file for c in cameras] == ["c", "a", "b"]


def test_file_and_dist_may_be_left_out(put):
    (camera,) = read_cameras(put({key: value for key, value in GOOD.items() if key not in ("file", "dist")}))
    assert camera.file == ""
    assert not camera.intrinsics.has_distortion


def test_a_byte_order_mark_is_no_obstacle(put):
    assert len(read_cameras(put("\ufeff" + json.dumps(GOOD)))) == 1


@pytest.mark.parametrize("count", [1, 3])
def test_round_trip_is_exact(tmp_path, count):
    rng = np.random.default_rng(count)
    cameras = []
    for i in range(count):
        lens = Intrinsics(800 + i, 600, *rng.uniform(300, 900, 4), tuple(rng.normal(0, 0.1, 4 + i % 2)))
        cameras.append(Camera(lens, Pose(so3_exp(rng.normal(size=3)), rng.normal(size=3)), f"{i}.jpg"))
    write_cameras(tmp_path / "out.json", cameras)
    for a, b in zip(cameras, read_cameras(tmp_path / "out.json"), strict=True):
        assert a.intrinsics == b.intrinsics
        assert a.file == b.file
        np.testing.assert_allclose(a.pose.R, b.pose.R, atol=1e-15)
        np.testing.assert_array_equal(a.pose.t, b.pose.t)
    assert all(len(camera_to_dict(c)["dist"]) == (5 if c.intrinsics.dist[4] else 4) for c in cameras)


BAD = {
    "no R": ({k: v for k, v in GOOD.items() if k != "R"}, "lacks R;"),
    "no lens": ({k: v for k, v in GOOD.items() if k not in ("fx", "cy")}, "lacks fx, cy;"),
    "text for a number": (GOOD | {"fx": "500"}, 'has the entry "fx", which is not a number'),
    "null": (GOOD | {"cx": None}, 'has the entry "cx", which is not a number'),
    "yes for a number": (GOOD | {"cx": True}, 'has the entry "cx", which is not a number'),
    "half a pixel": (GOOD | {"width": 640.5}, 'the entry "width" of 640.5 pixels'),
    "a strip": (GOOD | {"width": 1_000_000, "height": 1}, "1000000 x 1 pixels; the long side may be at most 100 times"),
    "a thread": (GOOD | {"width": 3, "height": 303}, "3 x 303 pixels; the long side may be at most 100 times"),
    "no photo's size": (GOOD | {"width": 30_000, "height": 30_000}, "30000 x 30000 pixels; at most 400 megapixels"),
    "no pixels": (GOOD | {"height": 0}, "640 x 0 pixels"),
    "no focal length": (GOOD | {"fy": -1}, "must be positive"),
    "t of 2": (GOOD | {"t": [1, 2]}, '"t", which is not 3 numbers'),
    "ragged R": (GOOD | {"R": [[1, 0], [0, 1, 0], [0, 0, 1]]}, '"R", which is not 3 rows'),
    "flat R": (GOOD | {"R": [1, 0, 0, 0, 1, 0, 0, 0, 1]}, '"R", which is not 3 rows'),
    "mirror": (GOOD | {"R": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "is not a rotation"),
    "scaled": (GOOD | {"R": [[2, 0, 0], [0, 2, 0], [0, 0, 2]]}, "is not a rotation"),
    "six dist": (GOOD | {"dist": [0.1] * 6}, "6 distortion values"),
    "nested dist": (GOOD | {"dist": [[0.1]]}, '"dist", which is not a list of numbers'),
    "dist of words": (GOOD | {"dist": ["a"]}, '"dist", which is not a list of numbers'),
    "number for a file": (GOOD | {"file": 7}, '"file", which is not text'),
    "no camera": (7, "is not a JSON object"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_camera_is_named_with_what_is_wrong(put, case):
    data, words = BAD[case]
    with pytest.raises(CameraError, match=re.escape(words)) as caught:
        read_cameras(put({"frames": [GOOD, data]}))
    assert str(caught.value).startswith("Camera 2 of 'cams.json'")
    assert str(caught.value).endswith(".")


@pytest.mark.parametrize("word", ["NaN", "Infinity", "1e999"])
def test_numbers_that_are_not_finite(put, word):
    with pytest.raises(CameraError, match='"t", which is not 3 numbers'):
        read_cameras(put(json.dumps(GOOD).replace("[1, 2, 3]", f"[1, {word}, 3]")))


FILES = {
    "no json": ("{", "is no valid JSON (line 1"),
    "no frames": ('{"frames": []}', 'no list of cameras under "frames"'),
    "frames of one": ('{"frames": {}}', 'no list of cameras under "frames"'),
    "deep": ("[" * 100_000, "is no valid JSON"),
    "empty": ("", "is no valid JSON"),
    "endless number": (json.dumps(GOOD).replace("640", "6" * 5000), "is no valid JSON"),
}


@pytest.mark.parametrize("case", FILES)
def test_bad_file(put, case):
    text, words = FILES[case]
    with pytest.raises(CameraError, match=re.escape(words)):
        read_cameras(put(text))


def test_missing_file_and_folder_and_binary(tmp_path):
    with pytest.raises(CameraError, match="There is no camera file"):
        read_cameras(tmp_path / "none.json")
    with pytest.raises(CameraError, match="cannot be read"):
        read_cameras(tmp_path)
    (tmp_path / "b.json").write_bytes(b"\xff\xfe\xfa")
    with pytest.raises(CameraError, match="no valid JSON"):
        read_cameras(tmp_path / "b.json")


def test_unnamed_camera():
    with pytest.raises(CameraError, match=r"^The camera lacks"):
        camera_from_dict({})


@pytest.mark.parametrize(
    ("lens", "guessed"), [("focal", True), ("radial", True), ("full", True), ("fixed", False), ("35 mm", False)]
)
def test_a_lens_that_was_solved_for_is_no_calibration_of_the_next_start(tmp_path, lens, guessed):
    """A result is a camera with the verdict's words; "lens" says what of it was solved for."""
    record = {"file": "a.jpg", "width": 60, "height": 90, "fx": 80.0, "fy": 80.0, "cx": 30.0, "cy": 45.0, "lens": lens}
    record |= {"R": np.eye(3).tolist(), "t": [0, 0, 2.0], "verdict": "trusted"}
    (tmp_path / "result.json").write_text(json.dumps(record))
    (start,) = read_starts(tmp_path / "result.json")
    assert start.focal_guessed is guessed
    assert start.intrinsics.fx == 80.0
