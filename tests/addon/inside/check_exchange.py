"""Cameras in and out, the view as a start, the background undistorted, and what a saved file brings back."""

import json
import struct

import numpy as np
import pytest
from samples import counts, write_photo


@pytest.fixture
def scene(bpy, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Y_DOWN")
    splat = bpy.context.scene.gssmc.splat
    splat.location, splat.scale = (1, 2, 3), (2.0,) * 3
    bpy.context.view_layer.update()
    return bpy.context.scene


@pytest.fixture
def cameras(extension, tmp_path):
    """Two engine cameras of photos that are there, one lens each."""
    engine = extension("core.geometry.camera")
    made = []
    for i in range(2):
        rotation = extension("core.geometry.lie").so3_exp(np.array([0.1, 0.2 * i, -0.3]))
        lens = engine.Intrinsics(60, 90, 80.0 + i, 80.0 + i, 31.0, 44.0, (0.05, -0.01, 0.001, 0.002, 0))
        made.append(engine.Camera(lens, engine.Pose(rotation, np.array([0.5, 0.25 * i, 2.0])), f"{'ab'[i]}.png"))
        write_photo(tmp_path / made[-1].file)
    return made


def same(extension, got, wanted):
    distance, degrees = extension("core.geometry.camera").pose_error(got.pose, wanted.pose)
    assert (distance < 1e-5, degrees < 1e-3) == (True, True)
    np.testing.assert_allclose(got.intrinsics.matrix, wanted.intrinsics.matrix, rtol=1e-5)
    np.testing.assert_allclose(got.intrinsics.dist, wanted.intrinsics.dist, atol=1e-6)
    assert got.file == wanted.file


def read_to_end(extension, path, photos):
    steps = extension("gssmc_addon.camera.import_job").read_incoming(path, photos)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value.cameras


@pytest.mark.parametrize("kind", ["JSON", "NERFSTUDIO", "COLMAP"])
def test_cameras_go_in_and_come_out(bpy, extension, scene, cameras, tmp_path, kind):
    """In by the engine's writers, out by the operator, read by the engine's readers; and once more in."""
    files = extension("core.cameras.files")
    files.write_cameras(tmp_path / "in.json", cameras)
    assert bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "in.json")) == {"FINISHED"}
    assert (scene.render.resolution_x, scene.render.resolution_y) == (1920, 1080)
    assert scene.camera.name == "a"
    assert scene.camera.data.background_images[0].image.name == "a.png"
    out = tmp_path / ("model" if kind == "COLMAP" else "transforms.json")
    assert bpy.ops.gssmc.export_cameras(filepath=str(out), format=kind) == {"FINISHED"}
    for item, wanted in zip(read_to_end(extension, out, tmp_path), cameras, strict=True):
        same(extension, item.camera, wanted)
    assert bpy.ops.gssmc.import_cameras(filepath=str(out), photos=str(tmp_path)) == {"FINISHED"}


def test_cameras_of_nerfstudio_follow_its_splat_and_go_back(bpy, extension, scene, cameras, tmp_path):
    """p_splat = scale * (R p + t): a camera comes to where its centre goes, and is exported to where it was."""
    turn, shift, scale = extension("core.geometry.lie").so3_exp(np.array([0.3, -1.0, 0.5])), np.array([1.0, 2.0, -3.0]), 0.4
    world = tmp_path / "dataparser_transforms.json"
    world.write_text(json.dumps({"transform": np.column_stack([turn, shift]).tolist(), "scale": scale}))
    extension("core.cameras.nerfstudio").write_transforms(tmp_path / "transforms.json", cameras)
    bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "transforms.json"), world=str(world))
    inside = extension("gssmc_addon.camera.bridge").read_camera(scene, scene.camera, scene.gssmc.splat)
    np.testing.assert_allclose(inside.pose.centre, scale * (turn @ cameras[0].pose.centre + shift), atol=1e-4)
    np.testing.assert_allclose(inside.pose.R, cameras[0].pose.R @ turn.T, atol=1e-5)
    out = tmp_path / "back.json"
    assert bpy.ops.gssmc.export_cameras(filepath=str(out), format="NERFSTUDIO", world=str(world)) == {"FINISHED"}
    for item, wanted in zip(read_to_end(extension, out, tmp_path), cameras, strict=True):
        same(extension, item.camera, wanted)
    world.write_text("{}")
    with pytest.raises(RuntimeError, match='lacks "transform" or "scale"'):
        bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "transforms.json"), world=str(world))


def test_cameras_of_the_training_stand_in_a_splat_with_other_axes(bpy, extension, cameras, splat_file, tmp_path):
    """Of an .spz, made of a .ply by half a turn about x: the cameras stand, and come out, as those of the .ply."""
    splats, files = extension("core.splats"), extension("core.cameras.files")
    extension("core.splats.spz.write").write_spz(tmp_path / "a.spz", splats.read_splats(splat_file))
    bpy.ops.gssmc.import_splats(filepath=str(tmp_path / "a.spz"))
    scene, read = bpy.context.scene, extension("gssmc_addon.camera.bridge").read_camera
    files.write_cameras(tmp_path / "in.json", cameras)
    turn = np.diag([1, -1, -1])
    for axes, sign in (("FILE", np.eye(3)), ("TRAINING", turn)):
        for obj in [obj for obj in scene.objects if obj.type == "CAMERA"]:
            bpy.data.objects.remove(obj)
        bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "in.json"), axes=axes)
        inside = read(scene, scene.camera, scene.gssmc.splat)
        np.testing.assert_allclose(inside.pose.centre, sign @ cameras[0].pose.centre, atol=1e-5)
    assert bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"), axes="TRAINING") == {"FINISHED"}
    for item, wanted in zip(files.read_cameras(tmp_path / "out.json"), cameras, strict=True):
        same(extension, item, wanted)


def test_an_exported_json_tells_verdicts_and_guesses(bpy, extension, scene, tmp_path):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW")
    extension("gssmc_addon.registration.camera_props").keep_verdict(scene.camera.data, "check", ("Look.",), 2, 1.0)
    bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"))
    (record,) = json.loads((tmp_path / "out.json").read_text())["frames"]
    assert (record["verdict"], record["reasons"], record["focal_guessed"]) == ("check", ["Look."], True)
    assert (record["width"], record["height"]) == (60, 90)


@pytest.fixture(scope="module")
def odd_photos(tmp_path_factory):
    """Of a photo that EXIF turns Blender holds a turned copy, of a very large one a smaller copy."""
    folder = tmp_path_factory.mktemp("odd")
    write_photo(folder / "turned.jpg", 60, 90, orientation=6)
    write_photo(folder / "large.jpg", 5200, 6800)
    write_photo(folder / "both.jpg", 6800, 5200, orientation=8)
    return folder


@pytest.mark.parametrize("kind", ["JSON", "NERFSTUDIO", "COLMAP"])
def test_an_exported_photo_is_its_own_file_at_its_own_size(bpy, extension, scene, odd_photos, tmp_path, kind):
    for name in ("turned", "large", "both"):
        bpy.ops.gssmc.add_photo(filepath=str(odd_photos / f"{name}.jpg"), camera="NEW")
    out = tmp_path / ("model" if kind == "COLMAP" else "out.json")
    assert bpy.ops.gssmc.export_cameras(filepath=str(out), format=kind) == {"FINISHED"}
    found = {item.camera.file: item for item in read_to_end(extension, out, odd_photos)}
    sizes = {name: (item.camera.intrinsics.width, item.camera.intrinsics.height) for name, item in found.items()}
    assert sizes == {"turned.jpg": (90, 60), "large.jpg": (5200, 6800), "both.jpg": (5200, 6800)}
    assert all(item.file for item in found.values()), "the files are there"
    bridge = extension("gssmc_addon.camera.bridge")
    inside = bridge.read_camera(scene, bpy.data.objects["both"], scene.gssmc.splat).at_size(2600, 3400)
    assert found["both.jpg"].camera.intrinsics.fx == pytest.approx(2 * inside.intrinsics.fx, rel=1e-6)


def test_a_large_photo_gives_the_render_its_own_resolution(bpy, scene, tmp_path):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "both.jpg", 6800, 5200, orientation=8)), camera="NEW")
    bpy.ops.gssmc.match_resolution()
    assert (scene.render.resolution_x, scene.render.resolution_y) == (5200, 6800)


def judged(bpy, extension, tmp_path, **verdicts):
    """A photo, with a camera of the name, for each verdict."""
    for name, verdict in verdicts.items():
        bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / f"{name}.png")), camera="NEW")
        note = extension("gssmc_addon.registration.camera_props").keep_verdict
        note(bpy.context.scene.camera.data, verdict, ("Said.",), 2, 1.0)


@pytest.mark.parametrize("kind", ["JSON", "NERFSTUDIO", "COLMAP"])
def test_failed_cameras_are_no_cameras_for_other_programs(bpy, extension, scene, tmp_path, capfd, kind):
    judged(bpy, extension, tmp_path, good="trusted", lost="failed", new="none")
    out = tmp_path / ("model" if kind == "COLMAP" else "out.json")
    bpy.ops.gssmc.export_cameras(filepath=str(out), format=kind)
    names = {item.camera.file for item in read_to_end(extension, out, tmp_path)}
    said = capfd.readouterr().out
    if kind == "JSON":
        assert names == {"good.png", "lost.png", "new.png"}
        verdicts = [record.get("verdict") for record in json.loads(out.read_text())["frames"]]
        assert sorted(map(str, verdicts)) == ["None", "failed", "trusted"]
        assert "left out" not in said
    else:
        assert names == {"good.png", "new.png"}
        assert "2 cameras were written" in said
        assert "1 that failed to be solved were left out: lost." in said


def test_nothing_is_written_where_every_camera_failed(bpy, extension, scene, tmp_path):
    judged(bpy, extension, tmp_path, a="failed", b="failed")
    for kind in ("COLMAP", "NERFSTUDIO"):
        with pytest.raises(RuntimeError, match="Every camera failed"):
            bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"), format=kind)
    assert not (tmp_path / "out.json").exists()
    assert not (tmp_path / "out").exists()


def test_a_solved_lens_is_exported_as_no_calibration(bpy, scene, tmp_path):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW")
    told = []
    for state in ("GUESSED", "SOLVED", "CALIBRATED"):
        scene.camera.data.gssmc.lens_state = state
        bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"))
        (record,) = json.loads((tmp_path / "out.json").read_text())["frames"]
        told.append((record["lens_state"], record.get("focal_guessed", False)))
    assert told == [("guessed", True), ("solved", True), ("calibrated", False)]


def test_poses_alone_take_their_lens_from_the_photo(bpy, scene, tmp_path):
    write_photo(tmp_path / "a.jpg", focal_35mm=28)
    pose = {"file": "a.jpg", "R": np.eye(3).tolist(), "t": [0, 0, 2.0]}
    (tmp_path / "p.json").write_text(json.dumps({"frames": [pose, pose | {"file": "none.jpg"}]}))
    bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "p.json"))
    assert [o.name for o in scene.objects if o.type == "CAMERA"] == ["a"]
    assert scene.camera.data.gssmc.lens_state == "GUESSED"


@pytest.mark.parametrize("chosen", ["images.bin", "cameras.bin", "points3D.bin"])
def test_a_binary_colmap_model_comes_in_by_any_of_its_files(bpy, scene, tmp_path, chosen):
    (tmp_path / "images").mkdir()
    write_photo(tmp_path / "images" / "a.png")
    pinhole = struct.pack("<QIiQQ4d", 1, 1, 1, 60, 90, 80, 81, 31, 44)
    (tmp_path / "cameras.bin").write_bytes(pinhole)
    image = struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0.5, 0.25, 2, 1) + b"a.png\0" + struct.pack("<Q", 0)
    (tmp_path / "images.bin").write_bytes(image)
    (tmp_path / "points3D.bin").write_bytes(struct.pack("<Q", 0))
    assert bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / chosen)) == {"FINISHED"}
    assert (scene.camera.name, scene.camera.data.gssmc.photo.name) == ("a", "a.png")
    centre = scene.gssmc.splat.matrix_world.inverted() @ scene.camera.matrix_world.translation
    np.testing.assert_allclose(centre, (-0.5, -0.25, -2), atol=1e-5)


def test_cameras_of_wide_lenses_show_the_middle_of_their_view(bpy, scene, tmp_path, capfd):
    write_photo(tmp_path / "a.png", 600, 400)
    lens = {"camera_model": "OPENCV_FISHEYE", "width": 600, "height": 400, "fx": 220, "fy": 220, "cx": 300, "cy": 200}
    around = {"camera_model": "EQUIRECTANGULAR", "width": 200, "height": 100}
    pose = {"R": np.eye(3).tolist(), "t": [0.5, 0.25, 2.0]}
    frames = [{**lens, **pose, "file": "a.png"}, {**around, **pose, "file": "a.png"}]
    (tmp_path / "p.json").write_text(json.dumps({"frames": frames}))
    bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "p.json"), set_resolution=True)
    (camera,) = [o for o in scene.objects if o.type == "CAMERA"]
    assert camera.data.gssmc.photo is None
    width = scene.render.resolution_x
    assert width == pytest.approx(2 * 220 * np.tan(np.radians(50)), abs=2)
    assert camera.data.lens / camera.data.sensor_width * width == pytest.approx(220, rel=1e-3)
    centre = scene.gssmc.splat.matrix_world.inverted() @ camera.matrix_world.translation
    np.testing.assert_allclose(centre, (-0.5, -0.25, -2), atol=1e-5)
    told = capfd.readouterr().out
    assert "1 camera of a wide lens shows the middle of its view, without the photo; Add Photo cuts that." in told


def test_photos_are_not_decoded_but_for_those_that_must_be_turned(bpy, scene, tmp_path):
    """Decoding takes a tenth of a second per photo, and its pixels stay in memory."""
    write_photo(tmp_path / "a.jpg", 60, 90)
    write_photo(tmp_path / "b.jpg", 60, 90, orientation=3)
    pose = {"R": np.eye(3).tolist(), "t": [0, 0, 2.0]}
    (tmp_path / "p.json").write_text(json.dumps({"frames": [pose | {"file": name} for name in ("a.jpg", "b.jpg")]}))
    bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "p.json"))
    a, b = (next(o for o in scene.objects if o.name == name).data.gssmc.photo for name in "ab")
    assert not a.has_data
    bottom = np.array(b.pixels[:]).reshape(90, 60, 4)[10, 30, :3]
    np.testing.assert_allclose(bottom, (1, 0, 0), atol=0.02)  # stored red over blue


@pytest.fixture
def importing(extension, scene, cameras, tmp_path, monkeypatch):
    """An import that has made one of two cameras, driven by hand as the timer of the window does it."""
    module = extension("gssmc_addon.camera.import_job")
    monkeypatch.setattr(module, "SLICE_S", -1.0)  # one camera a tick
    extension("core.cameras.files").write_cameras(tmp_path / "in.json", cameras)
    job = module.CameraImport(scene, tmp_path / "in.json", None, False)
    job.start()
    while job.made == 0:
        assert job.tick() is None
        job.join(0.1)
    return job


def test_a_stopped_import_leaves_nothing(bpy, scene, importing):
    objects = [o.name for o in scene.objects]
    importing.cancel()
    assert (len(bpy.data.cameras), len(bpy.data.images), len(bpy.data.collections)) == (0, 0, 0)
    assert [o.name for o in scene.objects] == objects


def test_an_import_goes_on_after_its_scene_is_edited_and_ends_with_its_splat(bpy, scene, importing, extension):
    bpy.data.objects.new("other", None)
    assert importing.tick() is importing
    assert importing.made == 2
    bpy.data.objects.remove(scene.gssmc.splat)
    with pytest.raises(extension("core.errors").CameraError, match="removed while cameras were imported"):
        importing.tick()


@pytest.mark.parametrize("content", ["{", '{"frames": []}', '[{"R": 1, "t": 2}]'])
def test_a_bad_camera_file_changes_nothing(bpy, scene, tmp_path, content):
    (tmp_path / "bad.json").write_text(content)
    before = counts(bpy)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "bad.json"))
    assert "Traceback" not in str(error.value)
    assert counts(bpy) == before


def test_exporting_nothing_or_one_photo_twice_is_refused(bpy, scene, tmp_path):
    with pytest.raises(RuntimeError, match="no camera to export"):
        bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"))
    for _ in range(2):
        bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW")
    with pytest.raises(RuntimeError, match=r"Two cameras have the photo .a\.png."):
        bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"))
    assert not (tmp_path / "out.json").exists()


def test_the_view_becomes_the_start(bpy, scene, extension):
    view = extension("gssmc_addon.photo.camera").find_view(bpy.context)
    if view is None:
        pytest.skip("this Blender has no viewport in background mode")
    view = view.region
    view.view_perspective = "PERSP"
    assert bpy.ops.gssmc.camera_from_view() == {"FINISHED"}
    bpy.context.view_layer.update()
    np.testing.assert_allclose(np.array(scene.camera.matrix_world), np.linalg.inv(np.array(view.view_matrix)), atol=1e-5)
    scene.camera.constraints.new("LIMIT_LOCATION")
    view.view_perspective = "PERSP"
    with pytest.raises(RuntimeError, match="constraint"):
        bpy.ops.gssmc.camera_from_view()


def test_the_background_can_be_undistorted(bpy, scene, tmp_path):
    photo = write_photo(tmp_path / "a.png")
    bpy.ops.gssmc.add_photo(filepath=str(photo), camera="NEW")
    data = scene.camera.data
    with pytest.raises(RuntimeError, match="no lens distortion"):
        bpy.ops.gssmc.undistort_photo()
    data.gssmc.k1 = -0.2
    images = len(bpy.data.images)
    for _ in range(2):
        assert bpy.ops.gssmc.undistort_photo() == {"FINISHED"}
        assert [b.image for b in data.background_images] == [data.gssmc.undistorted]
        assert len(bpy.data.images) == images + 1
    assert data.gssmc.photo.name == "a.png"
    assert tuple(data.gssmc.undistorted.size) == (60, 90)
    bottom = np.array(data.gssmc.undistorted.pixels[:]).reshape(90, 60, 4)[10, 30]
    np.testing.assert_allclose(bottom[:3], (0, 0, 1), atol=0.05)


def test_matching_the_resolution_keeps_the_camera(bpy, scene, extension, tmp_path):
    bridge = extension("gssmc_addon.camera.bridge")
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.jpg", focal_35mm=28)), camera="NEW")
    before = bridge.photo_intrinsics(scene, scene.camera.data, 60, 90)
    assert bpy.ops.gssmc.match_resolution() == {"FINISHED"}
    assert (scene.render.resolution_x, scene.render.resolution_y) == (60, 90)
    after = bridge.photo_intrinsics(scene, scene.camera.data, 60, 90)
    np.testing.assert_allclose(after.matrix, before.matrix, rtol=1e-5)


def test_a_saved_file_brings_all_of_it_back(bpy, scene, tmp_path):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW")
    scene.camera.data.gssmc.k1 = 0.125
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    scene = bpy.context.scene
    kept = scene.camera.data.gssmc
    assert (kept.k1, kept.lens_state, kept.photo.name, kept.frame_x) == (0.125, "GUESSED", "a.png", 1920)
    assert len(scene.gssmc.splat.data.points) == 200


def test_an_export_overwrites_neither_scan_nor_photo(bpy, scene, splat_file, tmp_path):
    """A script is asked by nobody whether it means that."""
    photo = write_photo(tmp_path / "a.png")
    bpy.ops.gssmc.add_photo(filepath=str(photo), camera="NEW")
    for path in (splat_file, photo):
        before = path.read_bytes()
        for export in (bpy.ops.gssmc.export_cameras, bpy.ops.gssmc.export_splats):
            with pytest.raises(RuntimeError, match="would overwrite"):
                export(filepath=str(path))
        assert path.read_bytes() == before


def test_a_scan_in_map_coordinates_stands_at_its_own_origin_and_cameras_keep_theirs(bpy, extension, tmp_path):
    """Blender's floats would round such places to half a metre."""
    far = (412345.0, 5654321.0, 287.0)
    ply, scenes = extension("core.splats.ply.reader"), extension("core.splats.scene")
    rng = np.random.default_rng(0)
    arrays = [rng.normal(size=(30, 3)), np.full((30, 3), 0.1), np.tile([1.0, 0, 0, 0], (30, 1)), np.full(30, 0.5)]
    splats = scenes.GaussianScene(*(a.astype(np.float32) for a in arrays), np.zeros((30, 1, 3), np.float32), origin=far)
    ply.write_ply(tmp_path / "far.ply", splats)
    bpy.ops.gssmc.import_splats(filepath=str(tmp_path / "far.ply"), orientation="Z_UP")
    scene = bpy.context.scene
    engine, files = extension("core.geometry.camera"), extension("core.cameras.files")
    lens = engine.Intrinsics(60, 90, 80.0, 80.0, 30.0, 45.0)
    wanted = engine.Camera(lens, engine.Pose.from_centre(np.eye(3), np.add(far, (0.125, 0.25, -3.5))), "a.png")
    write_photo(tmp_path / "a.png")
    files.write_cameras(tmp_path / "in.json", [wanted])
    bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "in.json"))
    assert max(abs(x) for x in scene.camera.matrix_world.translation) < 10
    bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"))
    (got,) = files.read_cameras(tmp_path / "out.json")
    np.testing.assert_allclose(got.pose.centre, wanted.pose.centre, rtol=0, atol=1e-5)
    bpy.ops.gssmc.export_splats(filepath=str(tmp_path / "again.ply"), coordinates="OBJECT")
    again = extension("core.splats").read_splats(tmp_path / "again.ply")
    places = [s.means.astype(np.float64) + s.origin for s in (again, splats)]
    np.testing.assert_allclose(*places, rtol=0, atol=1e-5)
