"""Every layout gives the pose that was worked out by hand, and every writer's file comes back as it was."""

import json
from dataclasses import replace

import numpy as np
import pytest
from dataset_files import (
    CAMBRIDGE_LINE,
    CAMBRIDGE_TITLE,
    CENTRE,
    LINE,
    OPENGL,
    POSE,
    R,
    T,
    binary_cameras,
    binary_images,
    cambridge,
    put,
    same,
    seven_scenes,
)

from core import cameras as datasets
from core.cameras import colmap, nerfstudio, pose_list
from core.cameras.files import write_cameras
from core.errors import DatasetError
from core.geometry.camera import Camera, Intrinsics, Pose
from core.geometry.lie import so3_exp

LENS = Intrinsics(640, 480, 500.0, 501.0, 321.0, 239.5)


def test_the_hand_made_pose_is_one():
    np.testing.assert_allclose(-R @ CENTRE, T)
    assert np.linalg.det(R) == pytest.approx(1)
    np.testing.assert_allclose(POSE.transform([CENTRE + np.array([5, 0, 0])]), [[0, 0, 5]], atol=1e-12)  # ahead
    np.testing.assert_allclose(POSE.transform([CENTRE + np.array([0, 0, 5])]), [[0, -5, 0]], atol=1e-12)  # above


# ---- readers


def one(path, layout, name):
    assert datasets.detect(path) == layout
    poses = datasets.read(path)
    assert poses.names == [name]
    same(poses.frames[0].pose)
    return poses


def test_pose_list(tmp_path):
    text = f"# name and pose\n\n a/1.png {LINE} 525.0 whatever\r\n"
    assert one(put(tmp_path / "p.txt", "\ufeff" + text), "poses", "a/1.png").metric


@pytest.mark.parametrize("layout", ["", "sparse/0", "sparse"])
def test_colmap_folder(tmp_path, layout):
    cameras = "1 SIMPLE_RADIAL 640 480 500 321 239.5 0.1\n7 THIN_PRISM_FISHEYE 640 480 1 2 3 4 5 6 7 8 9 10 11 12\n"
    put(tmp_path / layout / "cameras.txt", "# Camera list\n" + cameras)
    put(tmp_path / layout / "images.txt", f"# Image list\n1 {LINE} 1 a b/1.png\n\n9 {LINE} 7 c.png\n1.5 2.5 -1 3 4 17\n")
    assert datasets.detect(tmp_path) == "colmap"
    poses = datasets.read(tmp_path)
    assert poses.names == ["a b/1.png", "c.png"]
    assert not poses.metric
    assert poses.frames[0].intrinsics == Intrinsics(640, 480, 500, 500, 321, 239.5, (0.1, 0, 0, 0, 0))
    assert poses.frames[1].intrinsics is None  # a fisheye, whose pose can be compared all the same
    for frame in poses.frames:
        same(frame.pose)


@pytest.mark.parametrize("given", ["folder", "file"])
def test_binary_colmap_model(tmp_path, given):
    opencv = (2, 4, 640, 480, 500.5, 510, 321, 239.5, 0.1, -0.2, 0.001, 0.002)
    put(
        tmp_path / "sparse/0/cameras.bin",
        binary_cameras([(1, 2, 640, 480, 500, 321, 239.5, 0.1), opencv, (3, 7, 8, 6, 1, 2, 3, 4, 5)]),
    )
    put(tmp_path / "sparse/0/images.bin", binary_images(["a b/1.png", "2.png", "c.png"]))
    poses = datasets.read(tmp_path if given == "folder" else tmp_path / "sparse/0/images.bin")
    assert poses.names == ["a b/1.png", "2.png", "c.png"] and not poses.metric
    assert poses.frames[0].intrinsics == Intrinsics(640, 480, 500, 500, 321, 239.5, (0.1, 0, 0, 0, 0))
    assert poses.frames[1].intrinsics == Intrinsics(640, 480, 500.5, 510, 321, 239.5, (0.1, -0.2, 0.001, 0.002, 0))
    assert poses.frames[2].intrinsics is None  # FOV
    for frame in poses.frames:
        same(frame.pose)


def test_text_goes_before_binary(tmp_path):
    put(tmp_path / "images.bin", binary_images(["old.png"]))
    one_file = put(tmp_path / "images.txt", f"1 {LINE} 1 new.png\n\n")
    assert datasets.read(one_file.parent).names == ["new.png"]


def test_colmap_images_under_another_name(tmp_path):
    one(put(tmp_path / "model.txt", f"1 {LINE} 1 1.png\n\n"), "colmap", "1.png")


def test_7_scenes_folder(tmp_path):
    root = seven_scenes(tmp_path / "chess")
    assert datasets.detect(root) == "7scenes"
    test, train = datasets.read(root), datasets.read(root, "train")
    assert test.names == [f"seq-{s:02d}/frame-{f:06d}.color.png" for s in (3, 2) for f in (0, 1)]  # in the split's order
    assert train.names == [f"seq-01/frame-{f:06d}.color.png" for f in (0, 1)]
    for frame, x in zip(test.frames, (3.0, 3.1, 2.0, 2.1), strict=True):
        same(frame.pose, Pose.from_centre(R, [x, 2, 3]))
    assert test.metric


def test_a_single_sequence_and_a_scene_without_split_files(tmp_path):
    root = seven_scenes(tmp_path / "chess", frames=1)
    assert datasets.read(root / "seq-02").names == ["seq-02/frame-000000.color.png"]
    (root / "TestSplit.txt").unlink()
    (root / "TrainSplit.txt").unlink()
    assert datasets.detect(root) == "7scenes"
    assert datasets.read(root).names == [f"seq-{s:02d}/frame-000000.color.png" for s in (1, 2, 3)]


def test_cambridge_folder_and_its_list_alone(tmp_path):
    root = cambridge(tmp_path / "ShopFacade", ("seq2/frame00001.png",))
    assert one(root, "cambridge", "seq2/frame00001.png").metric
    one(root / "dataset_test.txt", "cambridge", "seq2/frame00001.png")
    one(put(tmp_path / "copy.txt", CAMBRIDGE_TITLE + f"a.png {CAMBRIDGE_LINE}"), "cambridge", "a.png")
    assert datasets.read(root, "train").names == ["seq1/frame00001.png"]


def test_nerfstudio(tmp_path):
    frame = {"file_path": "./images/1.png", "transform_matrix": OPENGL}
    top = {"w": 640, "h": 480, "fl_x": 500, "fl_y": 501, "cx": 321, "cy": 239.5, "k1": 0.1}
    put(tmp_path / "transforms.json", json.dumps({**top, "frames": [frame, {**frame, "file_path": "2", "fl_x": 400, "k1": 0}]}))
    assert datasets.detect(tmp_path) == datasets.detect(tmp_path / "transforms.json") == "nerfstudio"
    poses = datasets.read(tmp_path)
    assert not poses.metric
    for each in poses.frames:
        same(each.pose)
    assert [f.intrinsics for f in poses.frames] == [
        Intrinsics(640, 480, 500, 501, 321, 239.5, (0.1, 0, 0, 0, 0)),
        Intrinsics(640, 480, 400, 501, 321, 239.5),
    ]


def test_nerf_with_a_field_of_view_only(tmp_path):
    frame = {"file_path": "./train/r_0", "transform_matrix": OPENGL}
    data = {"camera_angle_x": np.pi / 2, "w": 640, "h": 480, "cx": 320, "cy": 240, "frames": [frame]}
    poses = one(put(tmp_path / "transforms_train.json", json.dumps(data)), "nerfstudio", "./train/r_0")
    assert poses.frames[0].intrinsics.fx == pytest.approx(320)
    data["w"], data["h"] = 1_000_000, 1  # no photo has that shape
    assert one(put(tmp_path / "strip.json", json.dumps(data)), "nerfstudio", "./train/r_0").frames[0].intrinsics is None
    del data["w"]
    assert one(put(tmp_path / "bare.json", json.dumps(data)), "nerfstudio", "./train/r_0").frames[0].intrinsics is None


def test_our_cameras_and_results(tmp_path):
    write_cameras(tmp_path / "c.json", [Camera(LENS, POSE, "a/1.png")])
    assert one(tmp_path / "c.json", "cameras", "a/1.png").frames[0].intrinsics == LENS
    camera = json.loads((tmp_path / "c.json").read_text())
    lost = camera | {"file": "2.png", "verdict": "failed", "error": "The photo cannot be decoded."}
    failed = camera | {"file": "3.png", "verdict": "failed"}
    put(tmp_path / "results", json.dumps({"frames": [camera | {"verdict": "trusted"}, lost, failed]}))
    poses = datasets.read(tmp_path / "results")
    assert poses.names == ["a/1.png", "3.png"]  # what was never tried has no pose
    assert poses.unsolved == 1


# ---- queries


def test_7_scenes_queries(tmp_path):
    root = seven_scenes(tmp_path / "chess")
    for file in root.glob("*/*.pose.txt"):
        file.unlink()  # photos can be placed without the truth
    found = datasets.queries(root)
    assert [q.name for q in found] == [f"seq-{s:02d}/frame-{f:06d}.color.png" for s in (3, 2) for f in (0, 1)]
    assert all(q.photo == root / q.name and q.photo.is_file() for q in found)
    assert {q.intrinsics for q in found} == {Intrinsics(640, 480, 525, 525, 320, 240)}
    assert {q.intrinsics.fx for q in datasets.queries(root, 585)} == {585}


def test_cambridge_lenses_come_from_the_flag_the_list_or_the_model(tmp_path):
    root = cambridge(tmp_path / "Shop")
    with pytest.raises(DatasetError, match=r"neither cameras.txt nor reconstruction.nvm; give the focal length in pixels"):
        datasets.queries(root)
    nvm = ["NVM_V3", "", "3", "seq1/frame00001.jpg\t20.5 1 0 0 0 0 0 0 0 0", "seq2/frame00002.jpg 22.5 1 0 0 0 0 0 0 0 0"]
    put(root / "reconstruction.nvm", "\n".join([*nvm, "seq2/frame00001.jpg 21.5 1 0 0 0 0 0 0 -0.1 0", "", "1000000", "junk"]))
    found = datasets.queries(root)
    assert [q.name for q in found] == ["seq2/frame00001.png", "seq2/frame00002.png"]
    assert [q.intrinsics for q in found] == [Intrinsics(16, 9, f, f, 8, 4.5) for f in (21.5, 22.5)]
    lines = "seq2/frame00002.png SIMPLE_RADIAL 16 9 30 8 4.5 -0.05\nseq2/frame00001.png PINHOLE 16 9 31 32 8 4\n"
    put(root / "cameras.txt", lines)
    assert [q.intrinsics.fx for q in datasets.queries(root)] == [31, 30]
    put(root / "cameras.txt", "1 PINHOLE 16 9 33 33 8 4\n")
    assert [q.intrinsics.fx for q in datasets.queries(root)] == [33, 33]
    broken = root / "seq2/frame00001.png"
    for content in (b"no photo", broken.read_bytes()[:16] + bytes(8), b""):  # it fails alone, when its turn comes
        broken.write_bytes(content)
        assert [(q.intrinsics.fx, q.intrinsics.width) for q in datasets.queries(root, 40)] == [(40, 1920), (40, 16)]


def test_a_model_that_lacks_a_photo_is_named(tmp_path):
    root = cambridge(tmp_path / "Shop")
    put(root / "reconstruction.nvm", "NVM_V3\n\n1\nseq2/frame00001.jpg 21.5 1 0 0 0 0 0 0 0 0\n\n0\n")
    with pytest.raises(DatasetError, match=r"lacks the lens of 1 of 2 test photos \('seq2/frame00002.png'\)"):
        datasets.queries(root)


# ---- writers


def many_cameras(count=12):
    rng = np.random.default_rng(4)
    dists = [(0.0,) * 5, (0.1, -0.2, 0.003, 0.004, 0.0), (0.1, -0.2, 0.003, 0.004, 0.5)]
    return [
        Camera(
            Intrinsics(640, 480 + k % 3, *rng.uniform(300, 900, 4), dists[k % 3]),
            Pose(so3_exp(rng.normal(size=3) * k), 100 * rng.normal(size=3)),
            f"a photo/{k}.jpg",
        )
        for k in range(count)
    ]


def test_pose_list_round_trip(tmp_path):
    cameras = many_cameras()
    pose_list.write(tmp_path / "p.txt", [(c.file.replace(" ", "_"), c.pose) for c in cameras])
    back = datasets.read(tmp_path / "p.txt")
    for camera, frame in zip(cameras, back.frames, strict=True):
        same(frame.pose, camera.pose, 1e-13)
        assert frame.name == camera.file.replace(" ", "_")
    for name in ("", "a b.png", "a\nb", "#a"):
        with pytest.raises(DatasetError, match="cannot stand in a pose list"):
            pose_list.write(tmp_path / "q.txt", [(name, POSE)])
    assert not (tmp_path / "q.txt").exists()


@pytest.mark.parametrize("shared", [False, True])
def test_colmap_round_trip(tmp_path, shared):
    cameras = [replace(c, intrinsics=LENS) if shared else c for c in many_cameras()]
    colmap.write_model(tmp_path / "sparse" / "0", cameras)
    back = datasets.read(tmp_path)
    for camera, frame in zip(cameras, back.frames, strict=True):
        same(frame.pose, camera.pose, 1e-13)
        assert (frame.name, frame.intrinsics) == (camera.file, camera.intrinsics)
    lenses = [line.split() for line in (tmp_path / "sparse/0/cameras.txt").read_text().splitlines()[1:]]
    assert len(lenses) == (1 if shared else len(cameras))
    assert {line[1] for line in lenses} == ({"PINHOLE"} if shared else {"PINHOLE", "OPENCV", "FULL_OPENCV"})
    points = (tmp_path / "sparse/0/points3D.txt").read_text().splitlines()
    assert all(line.startswith("#") for line in points)


def test_colmap_text_is_colmaps_own(tmp_path):
    """Column by column, as COLMAP's documentation gives the format."""
    colmap.write_model(tmp_path, [Camera(LENS, POSE, "1.png")])
    image, empty = (tmp_path / "images.txt").read_text().splitlines()[2:]
    assert [image.split()[0], *image.split()[8:]] == ["1", "1", "1.png"]
    np.testing.assert_allclose([float(x) for x in image.split()[1:8]], [float(x) for x in LINE.split()], atol=1e-15)
    assert empty == ""
    camera = (tmp_path / "cameras.txt").read_text().splitlines()[1]
    assert camera == "1 PINHOLE 640 480 500.0 501.0 321.0 239.5"


@pytest.mark.parametrize("shared", [False, True])
def test_nerfstudio_round_trip(tmp_path, shared):
    cameras = [replace(c, intrinsics=LENS) if shared else c for c in many_cameras()]
    nerfstudio.write_transforms(tmp_path / "transforms.json", cameras)
    back = datasets.read(tmp_path)
    for camera, frame in zip(cameras, back.frames, strict=True):
        same(frame.pose, camera.pose, 1e-11)
        assert (frame.name, frame.intrinsics) == (camera.file, camera.intrinsics)


def test_nerfstudio_matrix_is_the_hand_made_one(tmp_path):
    nerfstudio.write_transforms(tmp_path / "transforms.json", [Camera(LENS, POSE, "1.png")])
    data = json.loads((tmp_path / "transforms.json").read_text())
    np.testing.assert_allclose(data["frames"][0]["transform_matrix"], OPENGL, atol=1e-12)
    assert (data["w"], data["h"], data["fl_x"], data["fl_y"], data["cx"], data["cy"]) == (640, 480, 500, 501, 321, 239.5)


def test_photos_that_colmap_cannot_name(tmp_path):
    for name in ("", " a.png", "a\nb.png"):
        with pytest.raises(DatasetError, match="Camera 1 has the photo"):
            colmap.write_model(tmp_path, [Camera(LENS, POSE, name)])
