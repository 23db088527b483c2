"""Scans in map coordinates: read without rounding, drawn, written, and answered for in the coordinates of their file."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from cli_place import FAST, SIZE
from ply_files import ply_bytes, raw_table
from render_scenes import make_scene

from core.batch.place import into_file
from core.cameras.files import camera_from_dict, camera_to_dict, write_cameras
from core.cli.main import main
from core.errors import SplatFormatError
from core.geometry.camera import Camera, Intrinsics, Pose, pose_error
from core.geometry.conventions import Similarity
from core.geometry.lie import so3_exp
from core.render import Renderer, RenderSettings
from core.splats import read_splats
from core.splats.ply.reader import write_ply
from core.splats.splat import write_splat
from core.splats.spz.write import write_spz
from core.splats.transform import transformed
from core.synthetic import make_photo, perturb_camera, sample_cameras
from core.synthetic import make_scene as make_room

UTM = np.array([412345.678, 5654321.123, 287.5])
DOUBLE = dict.fromkeys("xyz", "double")


def far_table(count=50):
    table = raw_table(count, 1)
    for axis, value in zip("xyz", UTM, strict=True):
        table[axis] = table[axis] + value
    return table


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
@pytest.mark.parametrize("types", ["some", "all"])
def test_places_keep_their_digits(tmp_path, form, types):
    table = far_table()
    kinds = DOUBLE if types == "some" else dict.fromkeys(table, "double")
    (tmp_path / "a.ply").write_bytes(ply_bytes(table, form, kinds))
    scene = read_splats(tmp_path / "a.ply")
    places = scene.means.astype(np.float64) + scene.origin
    np.testing.assert_allclose(places, np.stack([table[a] for a in "xyz"], axis=1), rtol=0, atol=1e-6)
    assert np.abs(scene.means).max() < 10
    write_ply(tmp_path / "b.ply", scene)
    again = read_splats(tmp_path / "b.ply")
    np.testing.assert_allclose(again.means + np.array(again.origin), places, rtol=0, atol=1e-6)
    np.testing.assert_allclose(again.scales, scene.scales, rtol=1e-6)


def test_a_scan_at_its_origin_has_none(tmp_path):
    for kinds in ({}, DOUBLE):
        (tmp_path / "a.ply").write_bytes(ply_bytes(raw_table(20), types=kinds))
        assert read_splats(tmp_path / "a.ply").origin == (0, 0, 0)


def test_formats_without_room_for_it_are_refused(tmp_path):
    far = replace(make_scene(np.zeros((3, 3)), 0.1), origin=tuple(UTM))
    for write in (write_spz, write_splat):
        with pytest.raises(SplatFormatError, match="too far from its origin"):
            write(tmp_path / "a", far)


def test_moving_a_far_scan_moves_its_cameras_alike():
    scene = replace(make_scene(np.random.default_rng(0).normal(size=(40, 3)), 0.2), origin=tuple(UTM))
    move = Similarity(2.0, so3_exp(np.array([0.3, -0.5, 0.2])), np.array([5.0, -7.0, 11.0]))
    moved = transformed(scene, move, "Z_UP")
    places = scene.means.astype(np.float64) + scene.origin
    np.testing.assert_allclose(moved.means + np.array(moved.origin), move.to_scene(places), rtol=0, atol=1e-5)
    assert np.abs(moved.means).max() < 50


def test_every_pose_of_a_record_is_told_in_the_files_coordinates():
    pose = Pose(so3_exp(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2.0, 3.0]))
    camera = Camera(Intrinsics(64, 48, 50, 50, 32, 24), pose, "a.png")
    near = camera.relative_to(UTM)
    np.testing.assert_allclose(near.pose.centre, pose.centre - UTM, atol=1e-8)
    record = {**camera_to_dict(near), "start": camera_to_dict(near), "iterations": [{"pose": camera_to_dict(near)}], "x": None}
    told = into_file(record, UTM)
    for one in (told, told["start"], told["iterations"][0]["pose"]):
        assert pose_error(camera_from_dict(one).pose, pose)[0] < 1e-8
    assert into_file(record, (0, 0, 0)) is record


@pytest.mark.loop
def test_a_photo_of_a_far_scan_comes_home(tmp_path, capsys):
    """The camera is told in the file's coordinates, as near to the truth as that of the same scan at its origin."""
    room = make_room(0, 8_000)
    truth = replace(sample_cameras(1)[0], intrinsics=sample_cameras(1)[0].intrinsics.resized(*SIZE), file="photo.png")
    photo = make_photo(Renderer(room, RenderSettings(threads=1)), truth, 0)
    cv2.imwrite(str(tmp_path / "photo.png"), photo.pixels[..., ::-1])
    errors = []
    for name, origin in (("near", (0.0, 0.0, 0.0)), ("far", tuple(UTM))):
        write_ply(tmp_path / f"{name}.ply", replace(room, origin=origin))
        start = perturb_camera(truth, 0.1, 2.0, 0).relative_to(-np.array(origin))
        write_cameras(tmp_path / f"{name}.json", [start])
        out = tmp_path / f"{name}_out.json"
        files = [tmp_path / f"{name}.ply", tmp_path / "photo.png", "--camera", tmp_path / f"{name}.json", "--out", out]
        main(["refine", *map(str, files), "--no-locate", "--threads", "1", *FAST])
        record = json.loads(out.read_text())
        errors.append(pose_error(camera_from_dict(record).pose.relative_to(origin), truth.pose))
        assert record["verdict"] != "failed"
    assert errors[1][0] < errors[0][0] + 0.002 and errors[0][0] < 0.05
