"""The map's file: what was written comes back, and nothing else is believed."""

import json
from dataclasses import replace

import numpy as np
import pytest

from core.errors import RefineError
from core.geometry.camera import Camera, Intrinsics, Pose
from core.geometry.lie import so3_exp
from core.locate import LandmarkMap, MapFileError, MapSettings, MapView, map_key, read_map, scan_digest, write_map
from core.locate.viewpoints.candidates import Viewpoint
from core.locate.viewpoints.explore import Exploration
from core.locate.viewpoints.scout import Sight
from core.synthetic.room import make_scene

KEY = "0123abcd"


def made(views=3, key=KEY):
    rng = np.random.default_rng(0)
    out = []
    for k in range(views):
        n = (5, 0, 7)[k % 3]
        descriptors = rng.integers(0, 256, (n, 128), dtype=np.uint8)
        pose = Pose.from_centre(so3_exp(rng.normal(size=3)), rng.normal(size=3))
        out.append(MapView(pose, rng.normal(size=(n, 3)).astype(np.float32), descriptors, 2.5, known=k == 0))
    return LandmarkMap(key, tuple(out), complete=True)


def test_a_map_comes_back_as_it_was(tmp_path):
    path, whole = tmp_path / "room.map", made(30)
    write_map(path, whole)
    back = read_map(path, KEY)
    assert (back.key, back.complete, len(back), back.landmarks) == (KEY, True, 30, 120)
    for a, b in zip(whole.views, back.views, strict=True):
        assert a.pose == b.pose, "to the last bit"
        assert (a.points == b.points).all()
        assert (a.descriptors == b.descriptors).all()
        assert (a.depth, a.known) == (b.depth, b.known)


def searched():
    """A map whose making stopped, with all that its search knew."""
    rng = np.random.default_rng(2)

    def sight(proven):
        n = int(rng.integers(0, 6))
        viewpoint = Viewpoint(rng.normal(size=3), rng.normal(size=3), 1.5)
        points, weight = rng.normal(size=(n, 3)), rng.uniform(size=n)
        return Sight(viewpoint, 2.0, points.astype(np.float32), weight.astype(np.float32), proven)

    ahead = tuple(Viewpoint(rng.normal(size=3), rng.normal(size=3), 1.0) for _ in range(4))
    pool, taken = (sight(False), sight(True)), (sight(True), sight(True), sight(True))
    search = Exploration(120.0, ahead, dict(rng.bit_generator.state), pool, taken, 0.1, (3.0, 2.5))
    return replace(made(), complete=False, search=search)


def test_the_search_for_viewpoints_comes_back_as_it_was(tmp_path):
    whole = searched()
    write_map(tmp_path / "part.map", whole)
    a, b = whole.search, read_map(tmp_path / "part.map", KEY).search
    assert (a.ratio, a.voxel, a.proof, a.rng) == (b.ratio, b.voxel, b.proof, b.rng)
    assert [s.proven for s in b.pool] == [False, True]
    assert len(b.taken) == 3
    for one, other in zip((*a.pool, *a.taken), (*b.pool, *b.taken), strict=True):
        assert np.array_equal(one.points, other.points)
        assert np.array_equal(one.weight, other.weight)
        assert np.array_equal(one.viewpoint.centre, other.viewpoint.centre)
        assert (one.depth, one.viewpoint.depth) == (other.depth, other.viewpoint.depth)
    for one, other in zip(a.ahead, b.ahead, strict=True):
        assert np.array_equal(one.direction, other.direction)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ahead", np.zeros((4, 6))),
        ("ahead", np.full((4, 7), np.nan)),
        ("sights", np.zeros((4, 8))),
        ("sight_counts", np.array([1, 1, 1, 1, -1])),
        ("sight_points", np.zeros((2, 3), np.float32)),
        ("sight_kinds", None),
    ],
)
def test_an_impossible_search_is_refused(tmp_path, name, value):
    path = tmp_path / "bad.map"
    write_map(path, searched())
    with np.load(path) as file:
        arrays = dict(file)
    del arrays[name]
    with open(path, "wb") as file:
        np.savez(file, **arrays, **({} if value is None else {name: value}))
    with pytest.raises(MapFileError, match="impossible"):
        read_map(path, KEY)


@pytest.mark.parametrize(
    "change", [{"ratio": 0}, {"voxel": "x"}, {"proof": [1]}, {"rng": {"bit_generator": "none"}}, {"rng": 3}]
)
def test_an_impossible_number_of_the_search_is_refused(tmp_path, change):
    path = tmp_path / "bad.map"
    write_map(path, searched())
    with np.load(path) as file:
        arrays = dict(file)
    head = json.loads(arrays["head"].tobytes())
    head["search"] |= change
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    with open(path, "wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(MapFileError, match="impossible"):
        read_map(path, KEY)


def test_a_map_without_views_comes_back(tmp_path):
    write_map(tmp_path / "empty.map", LandmarkMap(KEY))
    assert len(read_map(tmp_path / "empty.map", KEY)) == 0


def test_another_scans_map_is_refused(tmp_path):
    write_map(tmp_path / "a.map", made(key="another"))
    with pytest.raises(MapFileError, match="another scan"):
        read_map(tmp_path / "a.map", KEY)


@pytest.mark.parametrize("cut", [0, 1, 100, 2000, -1])
def test_a_map_that_is_cut_off_is_refused(tmp_path, cut):
    path = tmp_path / "cut.map"
    write_map(path, made())
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(MapFileError, match="made again"):
        read_map(path, KEY)


def test_a_changed_byte_anywhere_is_refused_or_does_no_harm(tmp_path):
    path, whole = tmp_path / "bytes.map", made()
    write_map(path, whole)
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    refused = 0
    for at in rng.integers(0, len(data), 150):
        path.write_bytes(data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :])
        try:
            back = read_map(path, KEY)
        except MapFileError:
            refused += 1
            continue
        assert all((a.points == b.points).all() for a, b in zip(whole.views, back.views, strict=True))
    assert refused > 100


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("points", np.full((12, 3), np.nan, np.float32)),
        ("points", np.zeros((11, 3), np.float32)),
        ("points", np.zeros((12, 3), np.float64)),
        ("descriptors", np.zeros((12, 128), np.float32)),
        ("counts", np.array([5, -1, 8])),
        ("counts", np.array([5, 0, 8])),
        ("depth", np.array([1.0, 0.0, 1.0])),
        ("R", np.zeros((3, 3, 3))),
        ("t", np.full((3, 3), np.inf)),
    ],
)
def test_impossible_values_are_refused(tmp_path, name, value):
    path = tmp_path / "bad.map"
    write_map(path, made())
    with np.load(path) as file:
        arrays = dict(file)
    arrays[name] = value
    with open(path, "wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(MapFileError, match="impossible"):
        read_map(path, KEY)


@pytest.mark.parametrize("head", [b"", b"[]", b"{}", b"\xff", b'{"format": "gssmc-map", "version": 99, "key": "0123abcd"}'])
def test_a_foreign_head_is_refused(tmp_path, head):
    path = tmp_path / "foreign.map"
    with open(path, "wb") as file:
        np.savez(file, head=np.frombuffer(head, np.uint8))
    with pytest.raises(MapFileError):
        read_map(path, KEY)


def test_what_is_no_map_at_all_is_refused(tmp_path):
    (tmp_path / "photo.map").write_text(json.dumps({"key": KEY}))
    for path in (tmp_path / "photo.map", tmp_path, tmp_path / "absent.map"):
        with pytest.raises(MapFileError):
            read_map(path, KEY)


def test_the_key_follows_the_scan_the_settings_and_the_cameras_but_not_the_threads():
    scene = make_scene(gaussians=1000)
    brighter = replace(scene, sh=scene.sh + np.float32(0.01))
    known = [Camera(Intrinsics(64, 48, 50, 50, 32, 24), Pose())]
    digest = scan_digest(scene)
    keys = {
        map_key(digest, MapSettings()),
        map_key(scan_digest(brighter), MapSettings()),
        map_key(digest, MapSettings(views=20)),
        map_key(digest, MapSettings(seed=1)),
        map_key(digest, MapSettings(), known),
        map_key(digest, MapSettings(), [replace(known[0], pose=Pose(np.eye(3), np.ones(3)))]),
    }
    assert len(keys) == 6
    assert map_key(digest, MapSettings(threads=2)) == map_key(scan_digest(replace(scene, format="other")), MapSettings())


@pytest.mark.parametrize("options", [{"views": 0}, {"side_px": 50}, {"seed": -1}, {"threads": -1}])
def test_settings_outside_their_range_are_refused(options):
    with pytest.raises(RefineError, match=next(iter(options))):
        MapSettings(**options)
