"""Track Plate: every frame keyed where the camera truly was, what is lost filled and said, nothing changed on refusal."""

import cv2
import numpy as np
import pytest
import rooms
from check_sequence import BAD_FRAME, COUNT, FIRST, errors, keyed, plate, set_up  # noqa: F401  # `plate` is a fixture

FRAMES = range(1, COUNT + 1)


def track(bpy, **options):
    return bpy.ops.gssmc.track_plate(**{**rooms.QUICK, **options})


def tracked(bpy, plate):  # noqa: F811
    """The plate's scene with its track, which is made once and then opened from a file."""
    file = plate[0].folder / "tracked.blend"
    if file.exists():
        bpy.ops.wm.open_mainfile(filepath=str(file))
        return bpy.context.scene
    scene = set_up(bpy, plate)
    assert track(bpy) == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=True)
    return scene


def kinds(camera):
    """The types of the keys of the camera's place, by frame."""
    strips = [s for layer in camera.animation_data.action.layers for s in layer.strips]
    curves = [c for s in strips for c in s.channelbag(camera.animation_data.action_slot).fcurves if c.data_path == "location"]
    return {int(p.co.x): p.type for p in curves[0].keyframe_points}


def test_every_frame_is_keyed_where_the_camera_was(bpy, plate, extension):  # noqa: F811
    scene = tracked(bpy, plate)
    assert all(frames == set(FRAMES) for frames in keyed(scene.camera, "location"))
    assert set(kinds(scene.camera).values()) == {"KEYFRAME"}
    off = errors(bpy, extension, scene, plate[1], FRAMES)
    assert (np.sqrt((off**2).mean(0)) < (0.004, 0.08)).all() and (off.max(0) < (0.01, 0.15)).all()
    data = scene.camera.data
    assert (data.gssmc.verdict, data.gssmc.bad_frames, data.gssmc.frames_done) == ("TRUSTED", "", COUNT)
    assert data.lens == pytest.approx(data.sensor_width * plate[1][0].intrinsics.fx / rooms.WIDTH, rel=1e-5)
    assert extension("gssmc_addon.camera.solution").change(scene, scene.camera) == ""


def test_a_lost_frame_is_filled_and_said_and_the_errors_are_a_curve(bpy, plate, extension):  # noqa: F811
    scene = set_up(bpy, plate, "broken")
    assert track(bpy) == {"FINISHED"}
    found = kinds(scene.camera)
    assert [frame for frame, kind in found.items() if kind == "GENERATED"] == [BAD_FRAME]
    data = scene.camera.data.gssmc
    assert (data.verdict, data.bad_frames) == ("CHECK", str(BAD_FRAME))
    assert f"Frame {BAD_FRAME}: " in data.reasons
    for step in (1, -1, 1):
        assert bpy.ops.gssmc.weak_frame(step=step) == {"FINISHED"}
        assert scene.frame_current == BAD_FRAME
    assert errors(bpy, extension, scene, plate[1], FRAMES)[:, 0].max() < 0.03
    curve = extension("gssmc_addon.plate.track.errors").read(scene.camera.data)
    assert set(curve) == set(FRAMES) - {BAD_FRAME}
    assert 0 < min(curve.values()) <= max(curve.values()) < 1
    scene.frame_set(3)
    assert data.frame_error_px == pytest.approx(curve[3])
    picture = extension("gssmc_addon.plate.track.errors").drawn({**curve, 8: 4.0})
    assert (picture == (230, 90, 60)).all(-1).sum() > 20, "an error that is not good is red"


def test_what_cannot_be_tracked_is_refused_and_nothing_keyed(bpy, plate):  # noqa: F811
    scene = set_up(bpy, plate)
    scene.frame_set(7)
    with pytest.raises(RuntimeError, match="begins at the frame that is shown, 7; go to one from 1 to 4"):
        track(bpy, start=1, end=4)
    assert scene.camera.animation_data is None


def test_the_plate_without_its_distortion_goes_behind_the_camera(bpy, plate, extension, tmp_path):  # noqa: F811
    scene = set_up(bpy, plate)
    data, source = scene.camera.data, extension("gssmc_addon.plate.source")
    shown = source.moving_photo(scene.camera)
    photo = shown.frame_at(4).read()
    lens = extension("gssmc_addon.camera.bridge").photo_intrinsics(scene, data, photo.width, photo.height)
    assert bpy.ops.gssmc.undistort_plate(folder=str(tmp_path / "flat")) == {"FINISHED"}
    files = sorted((tmp_path / "flat").iterdir())
    assert [file.name for file in files] == [f"flat.{FIRST + k:04d}.png" for k in range(COUNT)]
    wanted = extension("core.photos.undistort").undistorted(photo, lens).pixels
    assert (cv2.imread(str(files[3]))[..., ::-1] == wanted).all()
    slot = next(slot for slot in data.background_images if slot.show_background_image)
    assert (slot.image, slot.image_user.frame_start) == (data.gssmc.undistorted, 1)
    assert source.moving_photo(scene.camera) == shown, "the plate stays what is tracked"
    with pytest.raises(RuntimeError, match="is there already"):
        bpy.ops.gssmc.undistort_plate(folder=str(tmp_path / "flat"))


def places(camera):
    """Where the keys of the camera's location stand, by frame."""
    strips = [s for layer in camera.animation_data.action.layers for s in layer.strips]
    curves = [c for s in strips for c in s.channelbag(camera.animation_data.action_slot).fcurves if c.data_path == "location"]
    return {int(points[0].co.x): [p.co.y for p in points] for points in zip(*(c.keyframe_points for c in curves), strict=True)}


@pytest.mark.main_only
def test_a_range_is_tracked_anew_and_the_rest_stays(bpy, plate, extension):  # noqa: F811
    scene = tracked(bpy, plate)
    camera, before = scene.camera, places(scene.camera)
    for frame in (4, 5, 6):
        scene.frame_set(frame)
        camera.location.x += 0.02
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(5)
    assert track(bpy, start=4, end=6) == {"FINISHED"}
    after = places(camera)
    assert {f: after[f] for f in FRAMES if not 4 <= f <= 6} == {f: before[f] for f in FRAMES if not 4 <= f <= 6}
    assert errors(bpy, extension, scene, plate[1], (4, 5, 6))[:, 0].max() < 0.01
    data = camera.data.gssmc
    assert (data.verdict, data.frames_done, data.weak_frames) == ("TRUSTED", COUNT, "")
    for frame in FRAMES:
        scene.frame_set(frame)
        assert extension("gssmc_addon.camera.solution").change(scene, camera) == ""


@pytest.mark.main_only
def test_a_pinned_frame_is_held_exactly(bpy, plate, extension):  # noqa: F811
    scene = tracked(bpy, plate)
    camera = scene.camera
    scene.frame_set(5)
    camera.location.x += 0.02
    assert bpy.ops.gssmc.pin_frame() == {"FINISHED"}
    assert kinds(camera)[5] == "EXTREME"
    pinned = places(camera)[5]
    scene.frame_set(1)
    assert track(bpy) == {"FINISHED"}
    assert kinds(camera)[5] == "EXTREME"
    assert places(camera)[5] == pytest.approx(pinned, abs=1e-5)
    assert errors(bpy, extension, scene, plate[1], (1, 3, 7, 9))[:, 0].max() < 0.01
    assert "5" in camera.data.gssmc.weak_frames.split(), "a camera that is off is told, also where the user set it"
    scene.frame_set(5)
    assert bpy.ops.gssmc.pin_frame() == {"FINISHED"}
    assert (camera.data.gssmc.pinned_frames, kinds(camera)[5]) == ("", "KEYFRAME")


def test_the_camera_goes_to_other_programs(bpy, plate, extension, tmp_path):  # noqa: F811
    """Nuke's .chan as its place and field of view say, and Alembic, which Blender itself writes and reads."""
    scene = tracked(bpy, plate)
    file = tmp_path / "shot.chan"
    assert bpy.ops.gssmc.export_cameras(filepath=str(file), format="CHAN") == {"FINISHED"}
    rows = np.loadtxt(file)
    assert rows[:, 0].tolist() == list(FRAMES)
    truths = plate[1]
    np.testing.assert_allclose(rows[:, 1:4], [truth.pose.centre for truth in truths], atol=0.02)
    assert np.radians(rows[0, 7]) == pytest.approx(2 * np.arctan(rooms.HEIGHT / (2 * truths[0].intrinsics.fy)), rel=1e-3)
    camera = scene.camera
    camera.select_set(True)
    abc = tmp_path / "shot.abc"
    bpy.ops.wm.alembic_export(filepath=str(abc), start=1, end=3, selected=True)
    wanted = []
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        wanted.append(np.array(camera.matrix_world))
    known = set(bpy.data.objects)
    bpy.ops.wm.alembic_import(filepath=str(abc), as_background_job=False)
    came = next(o for o in bpy.data.objects if o not in known and o.type == "CAMERA")
    for frame, matrix in zip((1, 2, 3), wanted, strict=True):
        scene.frame_set(frame)
        np.testing.assert_allclose(np.array(came.matrix_world), matrix, atol=1e-4)


def bend(data, path, factor):
    for curve in data.animation_data.action.layers[0].strips[0].channelbag(data.animation_data.action_slot).fcurves:
        for point in curve.keyframe_points if curve.data_path == path else ():
            point.co.y *= factor


@pytest.mark.main_only
def test_a_range_is_not_tied_to_what_has_moved_since(bpy, plate, extension):  # noqa: F811
    """Refused with a sentence, and the keys stay; Back to Solution brings the whole track back with its lens."""
    scene = set_up(bpy, plate, "broken")
    camera, data = scene.camera, scene.camera.data
    scene.frame_set(7)
    lens, user = data.lens, data.background_images[0].image_user
    for frame in (1, 9):  # the user's own, which would hold another lens than the solved one
        data.lens = lens * (1 + 0.03 * (frame - 7))
        data.keyframe_insert("lens", frame=frame)
    data.lens = lens
    assert track(bpy) == {"FINISHED"}
    scene.frame_set(8)
    assert bpy.ops.gssmc.pin_frame() == {"FINISHED"}
    before, types = places(camera), kinds(camera)
    for frame in FRAMES:
        scene.frame_set(frame)
        assert data.lens == pytest.approx(lens, rel=1e-3)
    scene.frame_set(6)
    for start, end in ((0, 7), (5, 10)):
        with pytest.raises(RuntimeError, match=f"covers the frames 1 to 9 of the scene, not {start} to {end}"):
            track(bpy, start=start, end=end)
    with pytest.raises(RuntimeError, match="ends at frame 6, before its start 7"):
        track(bpy, start=7, end=6)
    user.frame_start += 2
    with pytest.raises(RuntimeError, match="Another frame of the plate shows at frame 6 than"):
        track(bpy, start=6, end=7)
    user.frame_start -= 2
    bend(data, "lens", 1.2)
    scene.frame_set(6)
    with pytest.raises(RuntimeError, match="The lens changed since the plate was tracked"):
        track(bpy, start=6, end=7)
    bend(data, "lens", 1 / 1.2)
    scene.frame_set(8)
    camera.location.x += 0.1
    camera.keyframe_insert("location", frame=8)
    scene.frame_set(6)
    camera.location.x += 0.01
    stood = tuple(camera.location)
    with pytest.raises(RuntimeError, match="At frame 8, beside the range, the camera moved"):
        track(bpy, start=6, end=7)
    assert tuple(camera.location) == stood, "what has no key is kept, too"
    assert {f: p for f, p in places(camera).items() if f != 8} == {f: p for f, p in before.items() if f != 8}
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert (kinds(camera), data.gssmc.frames_done) == (types, COUNT)
    scene.frame_set(6)
    assert bpy.ops.gssmc.refine(**rooms.QUICK) == {"FINISHED"}, "one frame by itself, which leaves the track of the others"
    assert track(bpy, start=6, end=7) == {"FINISHED"}
    assert (data.gssmc.verdict, data.gssmc.frames_done, data.gssmc.weak_frames) == ("CHECK", COUNT, str(BAD_FRAME))
    for frame in FRAMES:
        scene.frame_set(frame)
        assert extension("gssmc_addon.camera.solution").change(scene, camera) == ""
