"""Find Camera: photos without a start come home, the map is kept and used again, Esc keeps what was made of it."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import rooms
from by_hand import Context, event, operator

from core.geometry.camera import pose_error
from core.locate import MapCache, MapPlace, MapSettings
from core.splats import read_splats

VIEWS = 10  # of the tests' maps; the room is small
MODULE = "bl_ext.user_default.gssmc"


@pytest.fixture(autouse=True)
def own_preferences(bpy, extension):
    """No map from the test before, and none that stays."""
    yield
    bpy.context.preferences.addons[MODULE].preferences.map_place = "CACHE"
    for path in maps(extension):
        path.unlink()


def maps(extension):
    return sorted(extension("core.support.cache_folder").user_cache_folder().glob("*.gssmc-map"))


def away(scene):
    """All cameras stand in one place far outside of the room and look away from it, where there is nothing to be found by."""
    for camera in (obj for obj in scene.objects if obj.type == "CAMERA"):
        send_away(scene, camera)


def send_away(scene, camera):
    from mathutils import Matrix  # there once bpy is

    camera.matrix_world = scene.gssmc.splat.matrix_world @ Matrix.Translation((0.0, 0.0, -40.0))


def error(extension, scene, camera, truth):
    import bpy

    bpy.context.view_layer.update()
    read = extension("gssmc_addon.camera.bridge").read_camera
    return pose_error(read(scene, camera, scene.gssmc.splat).at_size(rooms.WIDTH, rooms.HEIGHT).pose, truth.pose)


def is_home(extension, scene, camera, truth):
    distance, degrees = error(extension, scene, camera, truth)
    return distance < 0.02 and degrees < 0.3


@pytest.fixture
def lost(bpy, listed):
    """The room's three photos, their cameras far outside of it."""
    listed.gssmc.map_views = VIEWS
    away(listed)
    bpy.context.view_layer.update()
    return listed


@pytest.fixture(scope="module")
def whole_map():
    """The room's complete map, once a test has asked for it."""
    return {}


@pytest.fixture
def mapped(lost, extension, whole_map):
    """As `lost`, with the room's map there already."""
    cache = cache_of(extension, lost)
    if not whole_map:
        whole_map["map"] = list(cache.steps())[-1].map
    cache.keep(whole_map["map"])
    return lost


def test_a_photo_without_a_start_comes_home_and_the_map_is_used_again(bpy, lost, place, extension, monkeypatch):
    camera, message = lost.camera, lambda: bpy.context.window_manager.gssmc.message
    start = camera.matrix_world.copy()
    assert bpy.ops.gssmc.find_camera(**rooms.QUICK) == {"FINISHED"}
    assert camera.data.gssmc.verdict == "TRUSTED", camera.data.gssmc.reasons
    assert is_home(extension, lost, camera, place[1][0])
    assert message() == "Found in the map of the scan."
    assert extension("gssmc_addon.camera.solution").verdict(lost, camera) == "TRUSTED"
    assert maps(extension) == [by_command_line(place[0].scene)]
    monkeypatch.setattr(extension("gssmc_addon.find.finder"), "build_map", only_known(extension))
    solution = extension("gssmc_addon.camera.record").loads(camera.data.gssmc.solution)
    camera.matrix_world = start
    bpy.context.view_layer.update()
    assert bpy.ops.gssmc.find_camera(**rooms.QUICK) == {"FINISHED"}
    again = extension("gssmc_addon.camera.record").loads(camera.data.gssmc.solution)
    assert pose_error(again.camera.pose, solution.camera.pose)[0] < 1e-3
    assert len(maps(extension)) == 1


@pytest.mark.main_only
def test_refine_camera_searches_the_scan_where_it_fails_from_its_start_and_says_so(bpy, mapped, place, extension):
    camera = mapped.camera
    assert bpy.ops.gssmc.refine(locate=False, **rooms.QUICK) == {"CANCELLED"}
    assert camera.data.gssmc.verdict == "FAILED"
    assert bpy.ops.gssmc.refine(**rooms.QUICK) == {"FINISHED"}
    assert camera.data.gssmc.verdict == "TRUSTED", camera.data.gssmc.reasons
    assert is_home(extension, mapped, camera, place[1][0])
    assert "Found without the start" in camera.data.gssmc.reasons


def by_command_line(scan):
    """The file in which the command line looks for the map of a scan's file."""
    return MapCache(read_splats(scan), MapPlace(scan, beside=False), MapSettings()).files[0]


def only_known(extension):
    """The map's maker, for known cameras alone."""
    build = extension("core.locate").build_map

    def built(scene, settings=None, known=(), key=""):
        assert known, "the map is made once more"
        return build(scene, settings, known, key)

    return built


@pytest.mark.main_only
def test_a_camera_that_was_placed_roughly_needs_no_map_and_says_so(bpy, listed, place, extension, monkeypatch):
    monkeypatch.setattr(extension("gssmc_addon.find.finder"), "build_map", only_known(extension))
    assert bpy.ops.gssmc.find_camera(**rooms.QUICK) == {"FINISHED"}
    assert is_home(extension, listed, listed.camera, place[1][0])
    assert bpy.context.window_manager.gssmc.message == "Found from where the camera stood."
    assert maps(extension) == []


@pytest.mark.main_only
def test_a_solved_camera_is_looked_from_before_the_map(bpy, listed, place, extension, monkeypatch):
    monkeypatch.setattr(extension("gssmc_addon.find.finder"), "build_map", only_known(extension))
    other = listed.gssmc.photos[1].camera
    assert bpy.ops.gssmc.refine(camera=other.name, **rooms.QUICK) == {"FINISHED"}
    assert other.data.gssmc.verdict == "TRUSTED"
    send_away(listed, listed.camera)
    bpy.context.view_layer.update()
    assert bpy.ops.gssmc.find_camera(**rooms.QUICK) == {"FINISHED"}
    assert is_home(extension, listed, listed.camera, place[1][0])
    assert bpy.context.window_manager.gssmc.message == "Found from the cameras of solved photos."


@pytest.mark.main_only
@pytest.mark.asked
def test_a_guessed_lens_is_found_too(bpy, mapped, place, extension):
    camera = mapped.camera
    lens = camera.data.lens
    camera.data.lens, camera.data.gssmc.lens_state = 1.25 * lens, "GUESSED"
    with_a_fit = rooms.QUICK | {"final": "joint"}  # which alone tells how sure the focal length is
    assert bpy.ops.gssmc.find_camera(**with_a_fit) == {"FINISHED"}
    assert camera.data.lens == pytest.approx(lens, rel=0.02)
    assert camera.data.gssmc.lens_state == "SOLVED"
    assert is_home(extension, mapped, camera, place[1][0])


def test_a_photo_of_another_place_is_not_found_and_moves_nothing(bpy, mapped, extension, tmp_path):
    cv2.imwrite(str(tmp_path / "noise.png"), np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8))
    camera, lens = mapped.camera, mapped.camera.data.lens
    camera.data.gssmc.photo.filepath = str(tmp_path / "noise.png")
    before = camera.matrix_world.copy()
    assert bpy.ops.gssmc.find_camera(**rooms.QUICK) == {"CANCELLED"}
    assert camera.data.gssmc.verdict == "FAILED"
    assert "No place in the scan matches the photo" in camera.data.gssmc.reasons
    assert (camera.matrix_world, camera.data.lens) == (before, lens)


def test_the_work_is_called_by_what_it_does(bpy, listed, extension):
    queues, settings = extension("gssmc_addon.photo.queue"), extension("core.pose.settings").RefineSettings()
    for find, words in ((True, "Finding the photos"), (False, "Refining the photos")):
        queue = queues.queue(bpy.context.scene, "ALL", settings, queues.QueueOptions(find))
        assert queue.status.startswith(words)
        queue.close()


def test_a_whole_map_has_no_time_to_go(bpy, extension):
    """While the last views are matched, nobody can say how long it takes."""
    progress, told = extension("core.locate").FindProgress, extension("gssmc_addon.find.job").Told
    told = told(SimpleNamespace(wanted_views=5, views_before=1))
    details = [told(progress("drawing views", 0.1 * views, views))[2] for views in range(1, 7)]
    assert details[1].startswith("Map of the scan: view 1 of 5")
    assert details[-1] == "The map of the scan is whole; the photo is looked for in all of it."


def test_what_is_missing_is_one_sentence(bpy, lost):
    lost.gssmc.splat = None
    with pytest.raises(RuntimeError, match="No splat is picked") as refusal:
        bpy.ops.gssmc.find_camera()
    assert "Traceback" not in str(refusal.value)


@pytest.mark.main_only
def test_esc_in_the_map_leaves_the_camera_and_keeps_the_views(bpy, lost, extension):
    context, before = Context(bpy), lost.camera.matrix_world.copy()
    lost.gssmc.map_views = 400
    find = operator(bpy, extension("operators.find_camera").GSSMC_OT_find_camera, splat="", camera="")
    lost.camera.data.gssmc.photo.filepath = blank(lost, extension)
    assert find.invoke(context, event()) == {"RUNNING_MODAL"}
    job = find._job
    seen = set()
    for _ in range(6000):
        job.join(0.02)
        assert find.modal(context, event()) == {"PASS_THROUGH"}
        seen.add(job.detail)
        if "view 2 of" in job.detail:
            break
    assert find.modal(context, event("ESC", "PRESS")) == {"CANCELLED"}
    assert "was not changed" in find.said[-1][1]
    assert lost.camera.matrix_world == before
    assert lost.camera.data.gssmc.verdict == "NONE"
    assert job.join(60)
    assert len(maps(extension)) == 1
    made = kept_map(extension, lost)
    assert 2 <= len(made) < 400
    assert not made.complete


def blank(scene, extension):
    """A photo that nothing in the scan matches."""
    from pathlib import Path

    import bpy

    photo = Path(bpy.path.abspath(scene.camera.data.gssmc.photo.filepath)).parents[1] / "other.png"
    cv2.imwrite(str(photo), np.random.default_rng(1).integers(0, 256, (240, 320, 3), np.uint8))
    return str(photo)


def kept_map(extension, scene):
    """The map that is kept of the scene's splat."""
    return cache_of(extension, scene).read()


def cache_of(extension, scene):
    core, place = extension("core.locate"), extension("gssmc_addon.find.place").place_of(scene.gssmc.splat)
    gaussians = extension("gssmc_addon.splat.copy").read_splat(scene.gssmc.splat)
    return core.MapCache(gaussians, place, core.MapSettings(views=scene.gssmc.map_views))


@pytest.mark.main_only
@pytest.mark.asked
def test_a_damaged_map_beside_the_scan_is_made_again_and_cleared(bpy, mapped, place, extension):
    bpy.context.preferences.addons[MODULE].preferences.map_place = "SCAN"
    (whole,) = maps(extension)
    beside = place[0].scene.with_name("room.ply.gssmc-map")
    beside.write_bytes(whole.read_bytes()[:1000])
    whole.unlink()
    assert len(kept_map(extension, mapped)) == 0
    assert bpy.ops.gssmc.find_camera(**rooms.QUICK) == {"FINISHED"}
    assert is_home(extension, mapped, mapped.camera, place[1][0])
    assert maps(extension) == []
    assert len(kept_map(extension, mapped)) > 0
    assert bpy.ops.gssmc.clear_maps() == {"FINISHED"}
    assert not beside.exists()
    assert place[0].scene.exists()
    assert bpy.ops.gssmc.clear_maps() == {"FINISHED"}, "nothing is left to clear"


def test_all_photos_are_found_and_help_each_other(bpy, mapped, place, extension):
    own = mapped.gssmc
    assert bpy.ops.gssmc.find_all(which="OPEN", **rooms.QUICK) == {"FINISHED"}
    for entry, truth in zip(own.photos, place[1], strict=True):
        assert entry.camera.data.gssmc.verdict == "TRUSTED", entry.camera.data.gssmc.reasons
        assert is_home(extension, mapped, entry.camera, truth)
    assert own.photos[0].note == "Found in the map of the scan."
    assert own.photos[2].note == "Found from the cameras of solved photos."
    assert "3 of 3 photos: 3 trusted" in bpy.context.window_manager.gssmc.message


@pytest.mark.main_only
@pytest.mark.asked
def test_refine_all_finds_what_fails_from_everywhere_else(bpy, mapped, place, extension):
    """All cameras stand where nothing is: no neighbour is solved, so only the map can help."""
    assert bpy.ops.gssmc.refine_all(**rooms.QUICK) == {"FINISHED"}
    for entry, truth in zip(mapped.gssmc.photos, place[1], strict=True):
        assert entry.camera.data.gssmc.verdict == "TRUSTED", entry.camera.data.gssmc.reasons
        assert is_home(extension, mapped, entry.camera, truth)
    assert "3 photos were found by trying again" in bpy.context.window_manager.gssmc.message


@pytest.mark.main_only
@pytest.mark.asked
def test_the_first_frame_of_a_plate_is_found(bpy, mapped, place, extension):
    room, truths, _ = place
    for number in (1, 2, 3):
        room.take(f"moving/shot.{number:04d}.png", replace(truths[0], file=""), number)
    file = str(room.folder / "moving" / "shot.0001.png")
    assert bpy.ops.gssmc.add_plate(filepath=file, camera="NEW", camera_file=str(starts_of(room, truths[0]))) == {"FINISHED"}
    scene = mapped
    away(scene)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="No frame of the plate"):
        bpy.ops.gssmc.refine_sequence(step=2, find_start=False, **rooms.QUICK)
    assert bpy.ops.gssmc.refine_sequence(step=2, **rooms.QUICK) == {"FINISHED"}
    assert is_home(extension, scene, scene.camera, truths[0])


def starts_of(room, truth):
    return room.starts("moving.json", [replace(truth, file="shot.0001.png")])
