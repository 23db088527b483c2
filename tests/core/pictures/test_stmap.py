"""ST maps against exact projection, through OpenEXR files that another reader checks, and as the lens of a photo."""

import json
import struct
import zlib

import cv2
import numpy as np
import pytest
from boxroom import LENS, TRUTH, BoxRoom
from scipy.ndimage import map_coordinates
from wide_photos import fisheye_lens, fisheye_rays

from core.cameras.files import camera_to_dict
from core.cli.main import main
from core.errors import PhotoError
from core.geometry.camera import Camera, Pose
from core.geometry.pinhole_cut import WideCamera
from core.geometry.wide_lens import WideLens
from core.photos.containers.openexr import read_exr, write_exr
from core.pictures.stmap import distort_map, read_stmap, straight_lens, through_map, undistort_map, write_stmap


def places(stmap, size):
    """(N, 2) pixels that a map looks at in a picture of `size`."""
    return stmap.reshape(-1, 2) * (1, -1) * size + (0, size[1])


def test_a_map_looks_where_the_lens_bends():
    u, v = np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5)
    flat = np.column_stack([u.ravel(), v.ravel()])
    K = np.array([[LENS.fx, 0, LENS.cx], [0, LENS.fy, LENS.cy], [0, 0, 1]])
    rays = np.column_stack([(flat - (LENS.cx, LENS.cy)) / (LENS.fx, LENS.fy), np.ones(len(flat))])
    true, _ = cv2.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), K, np.array(LENS.dist))
    got = undistort_map(LENS)
    assert got.shape == (240, 320, 2) and got.dtype == np.float32
    np.testing.assert_allclose(places(got, (320, 240)), true[:, 0], atol=1e-4)
    # The corner's pixel centre of a straight lens, as Nuke counts.
    np.testing.assert_allclose(undistort_map(LENS.pinhole())[0, 0], [0.5 / 320, 1 - 0.5 / 240], atol=1e-7)
    # One map undoes the other: a straight pixel is bent to a photo's, which looks back at the straight one.
    inside = ((true[:, 0] > 1) & (true[:, 0] < (319, 239))).all(axis=1)
    at = true[inside, 0, ::-1].T - 0.5
    back = np.column_stack([map_coordinates(distort_map(LENS)[..., i], at, order=1) for i in range(2)])
    np.testing.assert_allclose(places(back, (320, 240)), flat[inside], atol=0.01)


def test_the_maps_of_a_fisheye_are_those_of_its_cut():
    lens = fisheye_lens(200)
    k = straight_lens(lens)
    rays = fisheye_rays(lens)
    got = distort_map(lens).reshape(-1, 2)
    ahead = rays[:, 2] > 0
    true = rays[ahead, :2] / rays[ahead, 2:] * (k.fx, k.fy) + (k.cx, k.cy)
    np.testing.assert_allclose(got[ahead], true / (k.width, k.height) * (1, -1) + (0, 1), rtol=1e-6, atol=1e-6)
    assert (got[~ahead] == -1).all()
    assert undistort_map(lens).shape == (k.height, k.width, 2)


def test_a_file_comes_back(tmp_path):
    stmap = np.random.default_rng(0).normal(size=(13, 7, 2)).astype(np.float32)
    write_stmap(tmp_path / "map.exr", stmap)
    np.testing.assert_array_equal(read_stmap(tmp_path / "map.exr"), stmap)


def packed(plain):
    """Rows of a chunk as OpenEXR packs them: even bytes, then odd ones, as differences, with 128 added."""
    split = np.frombuffer(plain[0::2] + plain[1::2], np.uint8).astype(int)
    return bytes([split[0], *((np.diff(split) + 128) % 256)])


def run_lengths(plain):
    """Every byte as a run of one, but for the first three, which stand as they are."""
    return struct.pack("<b", -3) + plain[:3] + b"".join(b"\0" + plain[i : i + 1] for i in range(3, len(plain)))


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize(
    ("number", "rows", "squeeze"), [(0, 1, None), (1, 1, run_lengths), (2, 1, zlib.compress), (3, 16, zlib.compress)]
)
def test_compressed_files_are_read(tmp_path, number, rows, squeeze, half):
    """Written here by the format's description; tests/addon reads Blender's own files."""
    path, height, width = tmp_path / "map.exr", 37, 50
    s, t = np.meshgrid(np.linspace(0, 1, width), np.linspace(1, 0, height))
    write_exr(path, {"R": s.astype(np.float32), "G": t.astype(np.float32)})
    data = path.read_bytes()
    header = data[: data.index(b"screenWindowWidth\0")] + b"screenWindowWidth\0float\0\4\0\0\0" + struct.pack("<f", 1) + b"\0"
    header = header.replace(b"compression\0compression\0\1\0\0\0\0", b"compression\0compression\0\1\0\0\0" + bytes([number]))
    kind = np.float16 if half else np.float32
    if half:
        header = header.replace(b"G\0\2\0\0\0", b"G\0\1\0\0\0").replace(b"R\0\2\0\0\0", b"R\0\1\0\0\0")
    chunks = []
    for top in range(0, height, rows):
        plain = b"".join(row.astype(kind).tobytes() for y in range(top, min(top + rows, height)) for row in (t[y], s[y]))
        small = squeeze(packed(plain)) if squeeze else plain
        body = small if len(small) < len(plain) else plain
        chunks.append(struct.pack("<2i", top, len(body)) + body)
    starts = np.cumsum([len(header) + 8 * len(chunks), *(len(chunk) for chunk in chunks[:-1])]).astype("<u8")
    path.write_bytes(header + starts.tobytes() + b"".join(chunks))
    np.testing.assert_array_equal(read_stmap(path), np.stack([s, t], axis=-1).astype(kind).astype(np.float32))


def test_data_beside_the_display_is_left_out(tmp_path):
    path = tmp_path / "map.exr"
    write_exr(path, {"R": np.arange(12, dtype=np.float32).reshape(3, 4), "G": np.zeros((3, 4), np.float32)})
    data = path.read_bytes()
    at = data.index(b"displayWindow\0box2i\0") + len(b"displayWindow\0box2i\0") + 4
    path.write_bytes(data[:at] + struct.pack("<4i", 1, -1, 4, 1) + data[at + 16 :])
    nan = np.nan
    np.testing.assert_array_equal(read_exr(path)["R"], [[nan] * 4, [1, 2, 3, nan], [5, 6, 7, nan]])


def test_damaged_files_are_told_of(tmp_path):
    path = tmp_path / "map.exr"
    write_stmap(path, np.zeros((5, 6, 2), np.float32))
    data, rng = path.read_bytes(), np.random.default_rng(0)
    for cut in range(0, len(data), 7):
        path.write_bytes(data[:cut])
        with pytest.raises(PhotoError, match=r"'map\.exr'"):
            read_exr(path)
    for _ in range(1000):
        damaged = bytearray(data)
        for at in rng.integers(0, len(data), 3):
            damaged[at] = rng.integers(256)
        path.write_bytes(bytes(damaged))
        try:
            read_exr(path)
        except PhotoError as error:
            assert "map.exr" in str(error)
    for wrong, said in (
        (data.replace(b"compression\0compression\0\1\0\0\0\0", b"compression\0compression\0\1\0\0\0\4"), "ZIP"),
        (data[:4] + struct.pack("<i", 0x202) + data[8:], "tiles"),
        (b"no", "is no OpenEXR file"),
    ):
        path.write_bytes(wrong)
        with pytest.raises(PhotoError, match=said):
            read_exr(path)
    write_exr(path, {"A": np.zeros((2, 2), np.float32)})
    with pytest.raises(PhotoError, match="has the channels A; an ST map has R and G"):
        read_stmap(path)


def test_a_photo_through_its_map_is_the_straight_photo():
    room = BoxRoom()
    photo, true = room.photo(LENS, TRUTH), room.photo(LENS.pinhole(), TRUTH)
    made = through_map(photo, undistort_map(LENS), "map.exr")
    seen = made.mask if made.mask is not None else np.ones((240, 320), bool)
    assert seen.mean() > 0.9
    blurred = [cv2.GaussianBlur(one.pixels.astype(np.float32), (0, 0), 2.5) for one in (made, true, photo)]
    inner = cv2.erode(seen.astype(np.uint8), np.ones((15, 15))) > 0
    assert np.abs(blurred[0] - blurred[1])[inner].mean() < 1
    assert np.abs(blurred[2] - blurred[1])[inner].mean() > 3
    with pytest.raises(PhotoError, match="looks nowhere into the photo"):
        through_map(photo, np.full((4, 4, 2), 7, np.float32), "map.exr")


def test_the_command_writes_a_map_for_each_lens(tmp_path, capsys):
    wide = WideCamera.of(fisheye_lens(100), Pose(), "fish.jpg")
    around = WideCamera.of(WideLens.panorama(100, 50), Pose(), "all.jpg")
    cameras = [Camera(LENS, TRUTH, "a.jpg"), Camera(LENS, Pose(), "b.jpg"), wide, around]
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"frames": [camera_to_dict(camera) for camera in cameras]}))
    assert main(["stmap", str(file), str(tmp_path / "maps")]) == 0
    said = capsys.readouterr()
    made = {f"{name}_{way}.exr" for name in ("a", "fish") for way in ("distort", "undistort")}
    assert {path.name for path in (tmp_path / "maps").iterdir()} == made
    assert "'a_undistort.exr' and 'a_distort.exr' (2 cameras): the undistorted picture has 320 x 240 pixels, fx 260" in said.out
    assert "red is s, to the right, green is t, up" in said.out
    assert "The camera of 'all.jpg' is a panorama, and no map is written for it." in said.err
    np.testing.assert_array_equal(read_stmap(tmp_path / "maps" / "fish_distort.exr"), distort_map(wide.lens))
