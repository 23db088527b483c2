"""Moving plates: keys where the camera truly was, none where the frame is bad, one refusal per thing that is missing."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import rooms

from core.geometry.camera import Pose, pose_error
from core.geometry.lie import so3_exp
from core.synthetic import sample_cameras

FIRST, COUNT, STEP = 12, 9, 2  # files 12 to 20 show at frames 1 to 9
BAD_FRAME = 5
HERE = {"first_frame": 1, "set_range": False}  # at the scene's frame 1, whatever the files' numbers


def moving(index):
    """The camera of the plate's frame `index` = 0, 1 ..., a little bow to the right."""
    base = sample_cameras()[0]
    turn = so3_exp([0, -0.01 * index, 0.002 * index]) @ base.pose.R
    return replace(base, pose=Pose.from_centre(turn, base.pose.centre + np.array([0.03 * index, 0.004 * index**2 / COUNT, 0])))


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A room, the true cameras of its plate, and a copy of the plate in which one frame shows noise."""
    room = rooms.Room(tmp_path_factory.mktemp("room"))
    truths = [room.take(f"plate/shot.{FIRST + k:04d}.png", moving(k), k) for k in range(COUNT)]
    (room.folder / "broken").mkdir()
    for k in range(COUNT):
        name = f"shot.{FIRST + k:04d}.png"
        data = (room.folder / "plate" / name).read_bytes()
        if k == BAD_FRAME - 1:
            noise = np.random.default_rng(0).integers(0, 256, (rooms.HEIGHT, rooms.WIDTH, 3), np.uint8)
            data = cv2.imencode(".png", noise)[1].tobytes()
        (room.folder / "broken" / name).write_bytes(data)
    _with_frames(room.folder, "jumping", {3: COUNT}, "plate")
    _with_frames(room.folder, "half", dict.fromkeys((5, 9), BAD_FRAME), "broken")
    first = replace(truths[0], file=f"shot.{FIRST:04d}.png")
    return room, truths, room.starts("start.json", [first], 0.04, 1.0)


def _with_frames(folder, name, replaced, others):
    """A copy of the plate in which frames show what others show: `replaced` maps frames to those of the plate `others`."""
    (folder / name).mkdir()
    for k in range(COUNT):
        source = ("plate", k + 1) if k + 1 not in replaced else (others, replaced[k + 1])
        data = (folder / source[0] / f"shot.{FIRST + source[1] - 1:04d}.png").read_bytes()
        (folder / name / f"shot.{FIRST + k:04d}.png").write_bytes(data)


def set_up(bpy, plate, folder="plate"):
    room, _, start = plate
    bpy.ops.gssmc.import_splats(filepath=str(room.scene))
    file = room.folder / folder / f"shot.{FIRST:04d}.png"
    assert bpy.ops.gssmc.add_plate(filepath=str(file), camera="NEW", camera_file=str(start), **HERE) == {"FINISHED"}
    return bpy.context.scene


def keyed(camera, path):
    strips = [s for layer in camera.animation_data.action.layers for s in layer.strips]
    curves = [c for s in strips for c in s.channelbag(camera.animation_data.action_slot).fcurves if c.data_path == path]
    return [{int(p.co.x) for p in curve.keyframe_points} for curve in curves]


def errors(bpy, extension, scene, truths, frames):
    read, out = extension("gssmc_addon.camera.bridge").read_camera, []
    for frame in frames:
        scene.frame_set(frame)
        pose = read(scene, scene.camera, scene.gssmc.splat).at_size(rooms.WIDTH, rooms.HEIGHT).pose
        out.append(pose_error(pose, truths[frame - 1].pose))
    return np.array(out)


def test_the_camera_follows_the_plate(bpy, plate, extension):
    scene = set_up(bpy, plate)
    camera, truths = scene.camera, plate[1]
    camera.rotation_mode = "QUATERNION"  # the other tests have Euler angles
    lens = camera.data.lens
    result = bpy.ops.gssmc.refine_sequence(step=8, smooth_frames=2.0, **rooms.QUICK)
    assert result == {"FINISHED"}
    assert scene.frame_current == 1
    keys = set(range(1, COUNT + 1))
    assert all(frames == keys for frames in keyed(camera, "location"))
    assert all(frames == keys for frames in keyed(camera, "rotation_quaternion"))
    assert camera.data.animation_data is None
    assert camera.data.lens == pytest.approx(lens)
    off = errors(bpy, extension, scene, truths, range(1, COUNT + 1))  # those between the keys too
    assert off[:, 0].max() < 0.02
    assert off[:, 1].max() < 0.3
    assert camera.data.gssmc.bad_frames == ""
    assert changes(bpy, extension, scene, range(1, COUNT + 1)) == [""] * COUNT
    assert camera.data.gssmc.verdict in ("TRUSTED", "CHECK")


def changes(bpy, extension, scene, frames):
    """What is no longer as it was solved, at each of the frames."""
    found = []
    for frame in frames:
        scene.frame_set(frame)
        found.append(extension("gssmc_addon.camera.solution").change(scene, scene.camera))
    return found


@pytest.mark.parametrize("zoom", [False, True])
def test_a_plate_is_solved_frame_by_frame_and_its_keys_come_back(bpy, plate, extension, zoom):
    scene, truths = set_up(bpy, plate), plate[1]
    camera, splat, solution = scene.camera, scene.gssmc.splat, extension("gssmc_addon.camera.solution")
    record, engine = extension("gssmc_addon.camera.record"), extension("core.geometry.camera")
    path = {}
    for frame in (1, 4, 9):
        k, pose = truths[frame - 1].intrinsics, truths[frame - 1].pose
        focal = k.fx * (1 + 0.1 * frame * zoom)
        lens = engine.Intrinsics(k.width, k.height, focal, focal, k.cx, k.cy, k.dist)
        path[frame] = engine.Camera(lens, engine.Pose(pose.R, pose.t))
    keys = extension("gssmc_addon.camera.keys")
    keys.write(scene, camera, splat, path, keys.KeyOptions(zoom))
    solution.keep(
        scene, camera, splat, record.SolvedCamera(path[1], "trusted", ("It sits.",), 3, 1.0, "SOLVED", 3.0, path=path)
    )
    frames = (1, 3, 4, 9)
    assert changes(bpy, extension, scene, frames) == [""] * 4
    scene.render.resolution_x, scene.render.resolution_y = 500, 900
    bpy.context.view_layer.update()
    assert changes(bpy, extension, scene, frames) == [""] * 4
    scene.frame_set(12)
    assert solution.title(scene, camera) == "Solved from frame 1 to 9"
    scene.frame_set(4)
    camera.location.x += 0.1
    camera.keyframe_insert("location", frame=4)
    assert changes(bpy, extension, scene, frames) == ["", "", "MOVED", ""]
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert changes(bpy, extension, scene, frames) == [""] * 4
    assert all(found == {1, 4, 9} for found in keyed(camera, "location"))


@pytest.mark.main_only
@pytest.mark.asked
def test_a_bad_frame_is_flagged_and_the_gap_filled(bpy, plate, extension):
    scene = set_up(bpy, plate, "broken")
    bpy.ops.gssmc.refine_sequence(start=1, end=9, step=STEP, every_frame=True, smooth_frames=0, **rooms.QUICK)
    data = scene.camera.data
    assert data.gssmc.bad_frames == str(BAD_FRAME)
    assert data.gssmc.verdict == "CHECK"
    assert "4 of 5 frames" in data.gssmc.reasons
    assert all(frames == set(range(1, 10)) for frames in keyed(scene.camera, "location"))
    off = errors(bpy, extension, scene, plate[1], range(1, COUNT + 1))
    assert off[:, 0].max() < 0.025
    again = bpy.ops.gssmc.refine_sequence(
        start=1, end=9, step=4, every_frame=False, key_lens=True, **rooms.QUICK
    )  # over its own keys
    assert again == {"FINISHED"}
    assert all(frames == {1, 9} for frames in keyed(scene.camera, "location"))
    assert all(frames == {1, 9} for frames in keyed(data, "lens"))


@pytest.mark.main_only
def test_a_guessed_lens_is_solved_first_and_held(bpy, plate):
    scene = set_up(bpy, plate)
    data = scene.camera.data
    true = data.lens
    data.lens, data.gssmc.lens_state = 1.15 * true, "GUESSED"
    assert bpy.ops.gssmc.refine_sequence(step=8, smooth_frames=0, **{**rooms.QUICK, "final": "auto"}) == {"FINISHED"}
    assert data.lens == pytest.approx(true, rel=0.005)
    assert data.gssmc.lens_state == "SOLVED"
    assert data.animation_data is None


@pytest.mark.main_only
def test_a_frame_between_that_jumps_is_seen(bpy, plate):
    scene = set_up(bpy, plate, "jumping")
    assert bpy.ops.gssmc.refine_sequence(step=8, smooth_frames=0, **rooms.QUICK) == {"FINISHED"}
    data = scene.camera.data.gssmc
    assert (data.verdict, data.weak_frames.split()[0]) == ("CHECK", "3")
    assert "Frame 3: Its corners lie" in data.reasons


@pytest.mark.main_only
def test_a_plate_with_fewer_than_half_of_its_frames_changes_nothing(bpy, plate):
    scene = set_up(bpy, plate, "half")
    before = scene.camera.matrix_world.copy()
    with pytest.raises(RuntimeError, match="Only 1 of 3 frames of the plate could be refined; nothing was changed"):
        bpy.ops.gssmc.refine_sequence(step=4, **{**rooms.QUICK, "iterations": 1})
    assert scene.camera.animation_data is None
    assert scene.camera.matrix_world == before


USERS_KEYS = (0, 2, 4, 6, 8, 10)  # 18 of the location: what someone animated before


def animate(camera):
    """Keys of the user's on the camera's location; then a pose that is not keyed."""
    place = camera.location.copy()
    for frame in USERS_KEYS:
        camera.location = place.x + frame / 1000, place.y, place.z
        camera.keyframe_insert("location", frame=frame)
    camera.location.z += 0.01
    camera.rotation_euler.x += 4 * np.pi  # whole turns, which a matrix would not keep


def state(camera):
    """All of the camera's curves, and where it stands."""
    from_curves = [
        (curve.data_path, curve.array_index, [tuple(p.co) for p in curve.keyframe_points])
        for block in (camera, camera.data)
        if block.animation_data and block.animation_data.action
        for layer in block.animation_data.action.layers
        for strip in layer.strips
        for curve in strip.channelbag(block.animation_data.action_slot).fcurves
    ]
    return from_curves, tuple(camera.location), tuple(camera.rotation_euler), tuple(camera.scale), camera.data.lens


def curve_of(block, path):
    bag = block.animation_data.action.layers[0].strips[0].channelbag(block.animation_data.action_slot)
    return next(curve for curve in bag.fcurves if curve.data_path == path)


def parent_uneven_at(bpy, scene, camera, frame):
    """A parent that is scaled unevenly, and turned, from `frame` on."""
    parent = bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    parent.rotation_euler = (0.3, 0.4, 0.5)
    for at, scale in ((frame - 1, (1, 1, 1)), (frame, (1, 2, 1))):
        parent.scale = scale
        parent.keyframe_insert("scale", frame=at)
    place = camera.location.copy(), camera.rotation_euler.copy()
    scene.frame_set(scene.frame_current)
    camera.location, camera.rotation_euler = place  # as it was moved, without keys
    camera.parent, camera.matrix_parent_inverse = parent, parent.matrix_world.inverted()


def splat_uneven(bpy, scene, camera):
    for at, scale in ((8, (1, 2, 1)), (7, (1, 1, 1))):
        scene.gssmc.splat.scale = scale
        scene.gssmc.splat.keyframe_insert("scale", frame=at)


def held_later(bpy, scene, camera):
    constraint = camera.constraints.new("TRACK_TO")
    constraint.target = scene.gssmc.splat
    for at, influence in ((8, 1.0), (7, 0.0)):
        constraint.influence = influence
        constraint.keyframe_insert("influence", frame=at)


def driven(bpy, scene, camera):
    camera.driver_add("delta_location", 0).driver.expression = "0.01 * frame"


def set_on_curve(**values):
    def hinder(bpy, scene, camera):
        for name, value in values.items():
            setattr(curve_of(camera, "location"), name, value)

    return hinder


HINDRANCES = {  # and a word of the refusal
    "parent": (lambda bpy, scene, camera: parent_uneven_at(bpy, scene, camera, 8), "scaled unevenly"),
    "splat": (splat_uneven, "scale"),
    "constraint": (held_later, "Track To"),
    "driver": (driven, "is driven"),
    "locked": (set_on_curve(lock=True), "is locked"),
    "group": (lambda bpy, scene, camera: setattr(curve_of(camera, "location").group, "lock", True), "is locked"),
    "muted": (set_on_curve(mute=True), "is muted"),
    "noise": (lambda bpy, scene, camera: curve_of(camera, "location").modifiers.new("NOISE"), "modifier"),
}


@pytest.mark.parametrize("what", HINDRANCES)
def test_a_plate_that_cannot_be_written_costs_no_key(bpy, plate, extension, what):
    """Most of these forbid the write at one of its last frames only, and some of Blender's refusals are silent."""
    scene, truths = set_up(bpy, plate), plate[1]
    camera = scene.camera
    hinder, word = HINDRANCES[what]
    scene.frame_set(3)
    animate(camera)
    hinder(bpy, scene, camera)
    scene.view_layers[0].update()
    before, frame, background = state(camera), scene.frame_current, camera.data.background_images[0].image.display_aspect[:]
    cameras = {k + 1: truth for k, truth in enumerate(truths)}
    with pytest.raises(extension("core.errors").CameraError, match=word):
        keys = extension("gssmc_addon.camera.keys")
        keys.write(scene, camera, scene.gssmc.splat, cameras, keys.KeyOptions(lens=True))
    assert state(camera) == before
    assert scene.frame_current == frame
    assert camera.data.background_images[0].image.display_aspect[:] == background


@pytest.mark.main_only
def test_a_refused_plate_leaves_the_users_keys(bpy, plate):
    """The whole operator: what it found cannot be written, for the parent is scaled unevenly at the last frame."""
    scene = set_up(bpy, plate)
    camera = scene.camera
    animate(camera)
    parent_uneven_at(bpy, scene, camera, 3)
    bpy.context.view_layer.update()
    before = state(camera)
    with pytest.raises(RuntimeError, match="scaled unevenly") as error:
        bpy.ops.gssmc.refine_sequence(start=1, end=3, step=2, **{**rooms.QUICK, "iterations": 1})
    assert "Traceback" not in str(error.value)
    assert state(camera) == before


@pytest.mark.main_only
def test_frames_to_check_say_why(bpy, plate):
    """With two views besides the start's no answer is trusted: every frame is to be checked, and the same is said of all."""
    scene = set_up(bpy, plate)
    bpy.ops.gssmc.refine_sequence(start=1, end=9, step=4, smooth_frames=0, **{**rooms.QUICK, "candidates": 2, "iterations": 1})
    note = scene.camera.data.gssmc
    assert note.verdict == "CHECK"
    summary, *reasons = note.reasons.splitlines()
    assert summary == "3 of 3 frames of the plate were refined. Look at these before you rely on them: 1, 5, 9."
    assert len(reasons) == 1
    assert reasons[0].startswith("Frames 1, 5, 9")
    assert "rendered views" in reasons[0]


def test_sentences_that_differ_in_figures_share_a_line(extension):
    by_sentence = extension("gssmc_addon.plate.words").by_sentence
    frames = {7: "Only 12 % fit.", 3: "Only 9.5 % fit.", 5: "Too dark.", 9: "Too dark."}
    assert by_sentence(frames) == ["Frames 3, 7, with the figures of 3: Only 9.5 % fit.", "Frames 5, 9: Too dark."]
    assert by_sentence({4: "Too dark."}) == ["Frame 4: Too dark."]


@pytest.mark.main_only
@pytest.mark.asked
def test_one_frame_is_told_of_in_the_singular(bpy, plate, extension, capfd):
    scene = set_up(bpy, plate)
    bpy.ops.gssmc.refine_sequence(start=1, end=1, **rooms.QUICK)
    out = capfd.readouterr().out
    assert "1 key was set." in out
    assert "1 frame of the plate was refined." in out
    title = extension("gssmc_addon.registration.camera_props").verdict_title(scene.camera.data.gssmc)
    assert "1 frame," in title, "what a plate counts are frames"
    bpy.ops.gssmc.refine_sequence(start=1, end=3, step=1, **rooms.QUICK)
    assert "3 keys were set." in capfd.readouterr().out
    assert "3 frames," in extension("gssmc_addon.registration.camera_props").verdict_title(scene.camera.data.gssmc)
    bpy.ops.gssmc.refine(**rooms.QUICK)
    assert "iteration" in extension("gssmc_addon.registration.camera_props").verdict_title(scene.camera.data.gssmc)


@pytest.fixture(scope="module")
def whip(tmp_path_factory):
    """Three frames of a camera at 0, 80 and 40 degrees: the second shows too little of the first to be found from it."""
    room, base = rooms.Room(tmp_path_factory.mktemp("whip")), sample_cameras()[0]
    turned = [so3_exp([0, -np.radians(degrees), 0]) @ base.pose.R for degrees in (0, 80, 40)]
    cameras = [replace(base, pose=Pose.from_centre(turn, base.pose.centre)) for turn in turned]
    truths = [room.take(f"plate/shot.{FIRST + k:04d}.png", camera, k) for k, camera in enumerate(cameras)]
    return room, truths, room.starts("start.json", [replace(truths[0], file=f"shot.{FIRST:04d}.png")], 0.04, 1.0)


@pytest.mark.main_only
@pytest.mark.asked
def test_a_failed_frame_is_tried_again_from_the_solved_frame_beside_it(bpy, whip, extension):
    scene = set_up(bpy, whip)
    assert bpy.ops.gssmc.refine_sequence(start=1, end=3, step=1, smooth_frames=0, **rooms.QUICK) == {"FINISHED"}
    assert scene.camera.data.gssmc.bad_frames == ""
    off = errors(bpy, extension, scene, whip[1], (1, 2, 3))
    assert off[:, 0].max() < 0.02
    assert off[:, 1].max() < 0.3


@pytest.mark.main_only
def test_nothing_is_keyed_when_no_frame_is_good(bpy, plate):
    scene = set_up(bpy, plate, "broken")
    before = [x for row in scene.camera.matrix_world for x in row]
    with pytest.raises(RuntimeError, match="No frame of the plate") as error:
        bpy.ops.gssmc.refine_sequence(start=BAD_FRAME, end=BAD_FRAME, find_start=False, **rooms.QUICK)
    assert "Traceback" not in str(error.value)
    assert scene.camera.animation_data is None
    assert [x for row in scene.camera.matrix_world for x in row] == before


def test_refusals_are_sentences_and_change_nothing(bpy, plate, tmp_path):
    scene = set_up(bpy, plate)
    camera = scene.camera

    def refused(words, **options):
        with pytest.raises(RuntimeError, match=words) as error:
            bpy.ops.gssmc.refine_sequence(**options)
        assert "Traceback" not in str(error.value)
        assert camera.animation_data is None

    refused("before its start", start=5, end=2)
    camera.constraints.new("TRACK_TO").target = scene.gssmc.splat
    refused("Track To")
    camera.constraints.clear()
    camera.data.driver_add("lens")
    refused("is driven", key_lens=True)
    camera.data.animation_data_clear()
    camera.data.gssmc.photo.filepath = str(tmp_path / "gone.0001.png")
    refused("gone.0001.png")
    camera.data.gssmc.photo = None
    camera.data.background_images.clear()
    refused("no image sequence or movie")
    scene.gssmc.splat = None
    scene.camera = None
    refused("No splat")
    with pytest.raises(RuntimeError, match="neither"):
        (tmp_path / "words.txt").write_text("no plate")
        bpy.ops.gssmc.add_plate(filepath=str(tmp_path / "words.txt"))


def test_a_movie_clip_behind_the_camera_counts_as_blender_counts(bpy, plate, extension, tmp_path):
    scene = set_up(bpy, plate)
    moving_photo = extension("gssmc_addon.plate.source").moving_photo
    assert moving_photo(scene.camera).scene_range == (1, COUNT)
    user = scene.camera.data.background_images[0].image_user
    user.frame_start, user.frame_duration = 101, 4
    assert moving_photo(scene.camera).scene_range == (101, 104)
    assert moving_photo(scene.camera).frame_at(102).number == FIRST + 1
    clip = bpy.data.movieclips.load(str(plate[0].folder / "plate" / f"shot.{FIRST:04d}.png"))
    clip.frame_start, clip.frame_offset = 11, 2
    data = scene.camera.data
    data.gssmc.photo = None
    data.background_images.clear()
    slot = data.background_images.new()
    slot.source, slot.clip = "MOVIE_CLIP", clip
    found = moving_photo(scene.camera)
    assert found.frame_at(11).number == FIRST + 2
    assert found.scene_range == (9, 9 + COUNT - 1)


@pytest.fixture
def exr_plate(bpy, plate):
    """Three frames of the plate as a renderer writes them: linear light, half float."""
    room, truths, _ = plate
    folder = room.folder / "exr"
    folder.mkdir(exist_ok=True)
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "16"
    for number in range(FIRST, FIRST + 3):
        image = bpy.data.images.load(str(room.folder / "plate" / f"shot.{number:04d}.png"))
        image.save_render(str(folder / f"shot.{number:04d}.exr"))
        bpy.data.images.remove(image)
    first = replace(truths[0], file=f"shot.{FIRST:04d}.exr")
    return room.scene, folder, room.starts("start_exr.json", [first], 0.04, 1.0)


@pytest.mark.main_only
def test_a_plate_of_open_exr_files_is_refined(bpy, plate, exr_plate, extension):
    """Blender decodes them one at a time, and keeps none."""
    splat, folder, start = exr_plate
    assert (folder / f"shot.{FIRST:04d}.exr").read_bytes()[:4] == b"\x76\x2f\x31\x01"
    bpy.ops.gssmc.import_splats(filepath=str(splat))
    file = str(folder / f"shot.{FIRST:04d}.exr")
    assert bpy.ops.gssmc.add_plate(filepath=file, camera="NEW", camera_file=str(start), **HERE) == {"FINISHED"}
    scene, images = bpy.context.scene, len(bpy.data.images)
    assert bpy.ops.gssmc.refine_sequence(step=1, smooth_frames=0, **rooms.QUICK) == {"FINISHED"}
    assert len(bpy.data.images) == images
    assert scene.camera.data.gssmc.bad_frames == ""
    assert all(frames == {1, 2, 3} for frames in keyed(scene.camera, "location"))
    off = errors(bpy, extension, scene, plate[1], (1, 2, 3))
    assert off[:, 0].max() < 0.02
    assert off[:, 1].max() < 0.3


@pytest.mark.main_only
def test_a_bad_open_exr_frame_fails_alone(bpy, exr_plate):
    splat, folder, start = exr_plate
    whole = (folder / f"shot.{FIRST + 2:04d}.exr").read_bytes()
    (folder / f"shot.{FIRST + 2:04d}.exr").write_bytes(whole[:200])
    bpy.ops.gssmc.import_splats(filepath=str(splat))
    file = str(folder / f"shot.{FIRST:04d}.exr")
    bpy.ops.gssmc.add_plate(filepath=file, camera="NEW", camera_file=str(start), **HERE)
    assert bpy.ops.gssmc.refine_sequence(step=1, every_frame=False, **rooms.QUICK) == {"FINISHED"}
    data = bpy.context.scene.camera.data.gssmc
    assert data.bad_frames == "3"
    assert "no plain picture that Blender can read" in data.reasons


@pytest.mark.main_only
def test_one_frame_of_a_plate_can_be_previewed_and_refined(bpy, plate, extension):
    scene = set_up(bpy, plate)
    assert bpy.ops.gssmc.refine(**rooms.QUICK) == {"FINISHED"}
    assert errors(bpy, extension, scene, plate[1], [1])[0, 0] < 0.02
    assert bpy.ops.gssmc.preview(style="DIAGONAL") == {"FINISHED"}


def write_movie(path, frames):
    movie = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 24, (rooms.WIDTH, rooms.HEIGHT))
    for _ in range(frames):
        movie.write(np.zeros((rooms.HEIGHT, rooms.WIDTH, 3), np.uint8))
    movie.release()
    return path


def keyed_by_hand(scene, truths, extension):
    """Keys of the true cameras at frames 1, 4 and 9; beside them a move that nobody keyed."""
    camera = scene.camera
    for frame in (1, 4, 9):
        scene.frame_set(frame)
        extension("gssmc_addon.camera.bridge").write_camera(scene, camera, scene.gssmc.splat, truths[frame - 1])
        for path in ("location", "rotation_euler"):
            camera.keyframe_insert(path, frame=frame)
    scene.frame_set(2)
    camera.location.x += 0.25
    return tuple(camera.location)


@pytest.mark.parametrize("kind", ["JSON", "NERFSTUDIO", "COLMAP"])
def test_a_plate_is_exported_with_the_file_of_each_keyed_frame(bpy, plate, extension, tmp_path, kind):
    scene, truths = set_up(bpy, plate), plate[1]
    at = keyed_by_hand(scene, truths, extension)
    out = tmp_path / ("model" if kind == "COLMAP" else "out.json")
    assert bpy.ops.gssmc.export_cameras(filepath=str(out), format=kind) == {"FINISHED"}
    found = {start.file: start for start in extension("core.cameras").starts(out).placed}
    assert sorted(found) == [f"shot.{FIRST + frame - 1:04d}.png" for frame in (1, 4, 9)]
    for frame in (1, 4, 9):
        start = found[f"shot.{FIRST + frame - 1:04d}.png"]
        distance, degrees = pose_error(start.pose, truths[frame - 1].pose)
        assert (distance < 1e-4, degrees < 1e-3) == (True, True)
        assert (start.intrinsics.width, start.intrinsics.height) == (rooms.WIDTH, rooms.HEIGHT)
    assert scene.frame_current == 2
    assert tuple(scene.camera.location) == pytest.approx(at), "nothing that was not keyed is lost"


def test_a_plate_without_keys_is_exported_as_the_frame_that_shows(bpy, plate, extension, tmp_path):
    scene = set_up(bpy, plate)
    scene.frame_set(3)
    for name in ("photo_x", "photo_y"):
        scene.camera.data.gssmc.property_unset(name)  # as an older version left it
    assert bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json")) == {"FINISHED"}
    (start,) = extension("core.cameras").starts(tmp_path / "out.json").placed
    assert (start.file, start.intrinsics.width) == (f"shot.{FIRST + 2:04d}.png", rooms.WIDTH)


def test_frames_of_a_movie_are_no_files(bpy, plate, extension, tmp_path):
    bpy.ops.gssmc.import_splats(filepath=str(plate[0].scene))
    movie = write_movie(tmp_path / "shot.avi", 9)
    assert bpy.ops.gssmc.add_plate(filepath=str(movie), camera="NEW") == {"FINISHED"}
    scene = bpy.context.scene
    keyed_by_hand(scene, plate[1], extension)
    for kind in ("COLMAP", "NERFSTUDIO"):
        with pytest.raises(RuntimeError, match="shows a movie"):
            bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"), format=kind)
    assert not (tmp_path / "out.json").exists()
    assert bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json")) == {"FINISHED"}
    records = json.loads((tmp_path / "out.json").read_text())["frames"]
    assert [(record["file"], record["frame"]) for record in records] == [("shot.avi", 1), ("shot.avi", 4), ("shot.avi", 9)]


def test_a_frame_that_was_refined_alone_is_solved_at_that_frame(bpy, plate, extension):
    scene, solution = set_up(bpy, plate), extension("gssmc_addon.camera.solution")
    scene.frame_set(2)
    bpy.ops.gssmc.refine(**rooms.QUICK)
    bpy.context.view_layer.update()
    assert solution.change(scene, scene.camera) == ""
    before = tuple(scene.camera.location)
    scene.frame_set(5)
    assert solution.title(scene, scene.camera) == "Solved at frame 2"
    scene.camera.location.x += 1
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert (scene.frame_current, tuple(scene.camera.location)) == (2, pytest.approx(before))
    assert solution.change(scene, scene.camera) == ""


def test_a_new_plate_brings_its_name_its_frames_and_its_rate(bpy, plate):
    """Files begin at 12; the movie shows 24000/1001 frames a second."""
    room, _, start = plate
    bpy.ops.gssmc.import_splats(filepath=str(room.scene))
    scene = bpy.context.scene
    file = room.folder / "plate" / f"shot.{FIRST:04d}.png"
    assert bpy.ops.gssmc.add_plate(filepath=str(file), camera="NEW", camera_file=str(start)) == {"FINISHED"}
    shown = scene.camera.data.background_images[0].image_user.frame_start
    assert (scene.camera.name, shown, scene.frame_current) == ("shot", FIRST, FIRST)
    assert (scene.frame_start, scene.frame_end) == (FIRST, FIRST + COUNT - 1)
    movie = room.folder / "clip.avi"
    writer = cv2.VideoWriter(str(movie), cv2.VideoWriter.fourcc(*"MJPG"), 24000 / 1001, (rooms.WIDTH, rooms.HEIGHT))
    for k in range(5):
        writer.write(cv2.imread(str(room.folder / "plate" / f"shot.{FIRST + k:04d}.png")))
    writer.release()
    assert bpy.ops.gssmc.add_plate(filepath=str(movie), camera="NEW") == {"FINISHED"}
    assert (scene.camera.name, scene.frame_start, scene.frame_end, scene.frame_current) == ("clip", 1, 5, 1)
    assert (scene.render.fps, scene.render.fps_base) == (24, pytest.approx(1.001))
