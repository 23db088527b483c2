"""Many photos: a folder becomes cameras, the queue refines them, what fails stays where it was and says why."""

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import rooms
from panels_drawn import Layout, drawn
from samples import counts, write_photo

from core.geometry.camera import pose_error


def matrices(scene):
    return {o.name: [x for row in o.matrix_world for x in row] for o in scene.objects if o.type == "CAMERA"}


def test_a_folder_becomes_cameras_and_they_come_home(bpy, listed, place, extension):
    _, truths, _ = place
    own = listed.gssmc
    assert [entry.camera.name for entry in own.photos] == ["p0", "p1", "p2"]
    assert listed.camera == own.photos[0].camera
    assert (listed.render.resolution_x, listed.render.resolution_y) == (1920, 1080)  # the artist's own, never asked for
    assert all(max(entry.camera.data.gssmc.photo.preview.image_size) == 64 for entry in own.photos)
    assert bpy.ops.gssmc.refine_all(**rooms.QUICK) == {"FINISHED"}
    read = extension("gssmc_addon.camera.bridge").read_camera
    for entry, truth in zip(own.photos, truths, strict=True):
        assert entry.camera.data.gssmc.verdict in ("TRUSTED", "CHECK"), entry.camera.data.gssmc.reasons
        assert entry.error == ""
        pose = read(listed, entry.camera, own.splat).at_size(rooms.WIDTH, rooms.HEIGHT).pose
        distance, degrees = pose_error(pose, truth.pose)
        assert distance < 0.02
        assert degrees < 0.3
    assert "3 of 3 photos" in bpy.context.window_manager.gssmc.message


def test_one_bad_photo_fails_alone(bpy, listed, place):
    """Its file is gone when its turn comes; the others are refined all the same."""
    own = listed.gssmc
    own.photos[1].camera.data.gssmc.photo.filepath = "/nowhere/gone.png"
    own.photos[2].ticked = False
    before = matrices(listed)
    assert bpy.ops.gssmc.refine_all(which="TICKED", **rooms.QUICK) == {"FINISHED"}
    bpy.context.view_layer.update()
    after = matrices(listed)
    assert [name for name in before if before[name] != after[name]] == ["p0"]
    assert "gone.png" in own.photos[1].error
    assert "1 could not be refined" in bpy.context.window_manager.gssmc.message
    assert own.photos[2].error == ""
    assert "Traceback" not in own.photos[1].error


def test_a_held_camera_says_so_and_none_refined_is_cancelled(bpy, listed):
    for entry in listed.gssmc.photos:
        entry.camera.constraints.new("TRACK_TO").target = listed.gssmc.splat
    bpy.context.view_layer.update()
    before = matrices(listed)
    assert bpy.ops.gssmc.refine_all(**rooms.QUICK) == {"CANCELLED"}
    assert all("Track To" in entry.error for entry in listed.gssmc.photos)
    assert matrices(listed) == before


@pytest.mark.main_only
def test_the_renderer_is_made_once(bpy, listed, extension, monkeypatch):
    made = []
    module = extension("gssmc_addon.splat.renderer")
    original = module.ProcessRenderer
    monkeypatch.setattr(module, "ProcessRenderer", lambda *args, **how: made.append(args) or original(*args, **how))
    listed.gssmc.photos[2].ticked = False
    bpy.ops.gssmc.refine_all(which="TICKED", **{**rooms.QUICK, "iterations": 1, "candidates": 1})
    assert len(made) == 1


def test_unreadable_photos_are_listed_with_the_reason(bpy, tmp_path):
    write_photo(tmp_path / "good.jpg")
    (tmp_path / "cut.jpg").write_bytes((tmp_path / "good.jpg").read_bytes()[:300])
    assert bpy.ops.gssmc.add_photo_folder(directory=str(tmp_path)) == {"FINISHED"}
    entries = {entry.file or entry.camera.name: entry for entry in bpy.context.scene.gssmc.photos}
    assert set(entries) == {"good", "cut.jpg"}
    assert entries["cut.jpg"].error
    assert entries["cut.jpg"].camera is None
    with pytest.raises(RuntimeError, match="on the list already"):
        bpy.ops.gssmc.add_photos(directory=str(tmp_path), files=[{"name": "good.jpg"}])


def test_what_a_folder_holds_beside_photos_is_named(bpy, tmp_path, capfd):
    for name in ("a.jpg", "b.png"):
        write_photo(tmp_path / name)
    for name in ("notes.txt", "clip.mov", "c.psd", ".hidden", "A.CR3", "b.dng"):
        (tmp_path / name).write_bytes(b"x")
    assert bpy.ops.gssmc.add_photo_folder(directory=str(tmp_path)) == {"FINISHED"}
    assert "3 other files are no photos that can be read, and left out: c.psd, clip.mov, notes.txt." in (
        said := capfd.readouterr().out
    )
    assert "2 raw photos were left out, because they are there as pictures too." in said
    write_photo(tmp_path / "d.jpg")
    assert bpy.ops.gssmc.add_photo_folder(directory=str(tmp_path)) == {"FINISHED"}
    said = capfd.readouterr().out
    assert "1 photo added" in said and "2 are on the list already." in said


@pytest.mark.parametrize("words", ["no folder", "no photos", "cut"])
def test_bad_input_changes_nothing(bpy, tmp_path, words):
    folder = tmp_path / "no such folder" if words == "no folder" else tmp_path
    if words == "cut":
        write_photo(tmp_path / "cut.jpg")
        (tmp_path / "cut.jpg").write_bytes((tmp_path / "cut.jpg").read_bytes()[:300])
    before = counts(bpy)
    with pytest.raises(RuntimeError, match=words) as error:
        bpy.ops.gssmc.add_photo_folder(directory=str(folder))
    assert "Traceback" not in str(error.value)
    assert counts(bpy) == before
    assert len(bpy.context.scene.gssmc.photos) == 0


def test_without_photos_or_without_a_splat(bpy, listed):
    listed.gssmc.splat = None
    with pytest.raises(RuntimeError, match="No splat"):
        bpy.ops.gssmc.refine_all()
    listed.gssmc.photos.clear()
    with pytest.raises(RuntimeError, match="no photos on the list"):
        bpy.ops.gssmc.refine_all()
    assert not bpy.ops.gssmc.review.poll()
    assert not bpy.ops.gssmc.remove_photo.poll()


def test_review_goes_round_and_skips(bpy, listed):
    own = listed.gssmc
    seen = []
    for _ in range(4):
        assert bpy.ops.gssmc.review(step=1) == {"FINISHED"}
        seen.append(listed.camera.name)
    assert seen == ["p1", "p2", "p0", "p1"]
    own.photos[2].camera.data.gssmc.verdict = "TRUSTED"
    assert bpy.ops.gssmc.review(step=1, skip_trusted=True) == {"FINISHED"}
    assert listed.camera.name == "p0"
    bpy.data.objects.remove(own.photos[1].camera)
    assert bpy.ops.gssmc.review(step=1) == {"FINISHED"}
    assert listed.camera.name == "p2"


def test_a_photo_is_removed_with_its_camera_or_without(bpy, listed):
    own, before = listed.gssmc, counts(bpy)
    assert bpy.ops.gssmc.remove_photo() == {"FINISHED"}
    assert counts(bpy) == {
        **before,
        "objects": before["objects"] - 1,
        "cameras": before["cameras"] - 1,
        "images": before["images"] - 1,
    }
    assert bpy.ops.gssmc.remove_photo(camera=False) == {"FINISHED"}
    assert len(own.photos) == 1
    assert "p1" in listed.objects


def test_add_photo_puts_its_camera_on_the_list(bpy, tmp_path):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW")
    own, first = bpy.context.scene.gssmc, bpy.context.scene.camera
    assert [entry.camera for entry in own.photos] == [first]
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "b.png")), camera="NEW")
    assert [entry.camera for entry in own.photos] == [first, bpy.context.scene.camera]
    assert own.photo_index == 1, "the photo that is looked at is the one that Remove Photo would take"


def rows(bpy, extension):
    """What each line of the list says, and what the box below it says of the picked one."""
    panel, own = extension("gssmc_addon.photo.panel"), bpy.context.scene.gssmc
    said = []
    for entry in own.photos:
        layout = Layout()
        panel.GSSMC_UL_photos.draw_item(None, bpy.context, layout, own, entry, 0, own, "photo_index", 0)
        said.append([*filter(None, layout.said)])
    below, seen = Layout(), SimpleNamespace(scene=bpy.context.scene, region=SimpleNamespace(width=2000))
    seen.preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1))
    panel._draw_said(below, seen)
    return said, " ".join(below.said).strip()


def test_what_is_wrong_stands_below_the_list_in_full(bpy, listed, extension):
    own = listed.gssmc
    assert rows(bpy, extension) == ([["ticked", "name"]] * 3, "")
    own.photos[0].error = "A sentence that no line of the list has room for."
    assert rows(bpy, extension) == ([["ticked", "name"]] * 3, own.photos[0].error)
    own.photo_collection.objects.unlink(own.photos[1].camera)  # deleted by the user: the list keeps it
    own.photo_index = 1
    said, below = rows(bpy, extension)
    assert said[1] == ["ticked", "p1"]
    assert "was deleted" in below
    bpy.data.objects.remove(own.photos[1].camera)
    assert rows(bpy, extension)[0][1] == ["ticked", "Camera deleted"]


def test_progress_names_the_photo_as_it_is(bpy, listed, extension):
    settings = extension("core.pose.settings").RefineSettings(**rooms.QUICK)
    job, slot = extension("gssmc_addon.photo.queue").queue(listed, "ALL", settings), extension("gssmc_addon.jobs.slot")
    job.index = 1
    job.begin_item(1)
    slot.begin(bpy.context, job)
    try:
        said = drawn(bpy, extension)
    finally:
        job.cancel()
        slot.end(job)
    assert [text for text in said if text in ("p1", "Photo 2 of 3", "gssmc.cancel")] == ["p1", "gssmc.cancel", "Photo 2 of 3"]


class Buttons(Layout):
    """`pressed`: what the buttons of Refine All would do, in order, and whether they can be pressed."""

    def __init__(self):
        super().__init__()
        self.buttons, self.enabled = [], True

    def operator(self, name, text="", **_):
        button = SimpleNamespace(text=text, enabled=self.enabled)
        if name == "gssmc.refine_all":
            self.buttons.append(button)
        return button


def test_the_first_button_takes_the_photos_that_are_not_trusted(bpy, listed, extension):
    def first():
        layout = Buttons()
        seen = SimpleNamespace(
            scene=listed, region=SimpleNamespace(width=300), preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1))
        )
        extension("gssmc_addon.photo.panel").GSSMC_PT_photos.draw(SimpleNamespace(layout=layout), seen)
        return layout.buttons[0]

    assert (first().which, first().text) == ("OPEN", "Refine Open (3)")
    listed.gssmc.photos[0].camera.data.gssmc.verdict = "TRUSTED"
    assert first().text == "Refine Open (2)"
    before = matrices(listed)
    assert bpy.ops.gssmc.refine_all(which=first().which, **rooms.QUICK) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert [name for name, now in matrices(listed).items() if now != before[name]] == ["p1", "p2"]
    for entry in listed.gssmc.photos:
        entry.camera.data.gssmc.verdict = "TRUSTED"
    assert not first().enabled


def turn_away(camera):
    """The camera looks to the other side: no start that a refinement could come home from."""
    from mathutils import Matrix  # there once bpy is

    camera.matrix_world = camera.matrix_world @ Matrix.Rotation(np.pi, 4, "Y")


def error(extension, scene, camera, truth):
    read = extension("gssmc_addon.camera.bridge").read_camera
    return pose_error(read(scene, camera, scene.gssmc.splat).at_size(rooms.WIDTH, rooms.HEIGHT).pose, truth.pose)


@pytest.mark.main_only
def test_a_failed_photo_is_found_from_a_solved_ones_camera(bpy, listed, place, extension):
    own = listed.gssmc
    turn_away(own.photos[0].camera)
    bpy.context.view_layer.update()
    start = error(extension, listed, own.photos[0].camera, place[1][0])
    assert bpy.ops.gssmc.refine_all(again=False, which="TICKED", **rooms.QUICK) == {"FINISHED"}
    assert own.photos[0].camera.data.gssmc.verdict == "FAILED"
    assert error(extension, listed, own.photos[0].camera, place[1][0]) == pytest.approx(start)
    assert bpy.ops.gssmc.refine_all(which="OPEN", **rooms.QUICK) == {"FINISHED"}  # the other two are trusted already
    assert own.photos[0].camera.data.gssmc.verdict == "TRUSTED"
    distance, degrees = error(extension, listed, own.photos[0].camera, place[1][0])
    assert distance < 0.02
    assert degrees < 0.3
    assert own.photos[0].note in ('Found from the camera of "p1".', 'Found from the camera of "p2".')
    assert own.photos[0].note in rows(bpy, extension)[1]
    assert "1 photo was found" in bpy.context.window_manager.gssmc.message


@pytest.mark.main_only
def test_a_photo_of_another_place_is_tried_a_few_times_and_says_so(bpy, listed, extension):
    own = listed.gssmc
    noise = np.random.default_rng(0).integers(0, 256, (rooms.HEIGHT, rooms.WIDTH, 3), np.uint8)
    photo = bpy.path.abspath(own.photos[0].camera.data.gssmc.photo.filepath)
    other = str(Path(photo).parents[1] / "noise.png")
    cv2.imwrite(other, noise)
    own.photos[0].camera.data.gssmc.photo.filepath = other
    before = matrices(listed)["p0"]
    own.map_views = 4
    settings = extension("core.pose.settings").RefineSettings(**{**rooms.QUICK, "iterations": 1})
    job = extension("gssmc_addon.photo.queue").queue(listed, "ALL", settings)
    seen = watched(job)
    assert job.verdicts == {"trusted": 2, "failed": 1}
    assert matrices(listed)["p0"] == before
    assert own.photos[0].note == "Tried again from the cameras of 2 solved photos and in the whole scan."
    assert {detail.split(":")[0] for _, detail in seen if "Again" in detail} == {"Again, 1 of 1"}
    starts = {detail.split(": ")[1].split(".")[0] for _, detail in seen if "Again" in detail}
    assert starts == {'from "p1"', 'from "p2"', "in the whole scan"}
    second = [fraction for fraction, detail in seen if "Again" in detail]
    assert second == sorted(second)
    assert 0 <= second[0] < 0.5 < second[-1] <= 1


def watched(job):
    """Runs the job as the window's timer does; (fraction, detail) after every tick."""
    job.start()
    seen = []
    while job.tick() is None:
        seen.append((job.fraction, job.detail))
        job.join(0.1)
    job.close()
    return seen


@pytest.mark.main_only
def test_the_second_pass_can_be_stopped(bpy, listed, extension):
    own = listed.gssmc
    turn_away(own.photos[2].camera)
    bpy.context.view_layer.update()
    before = matrices(listed)["p2"]
    job = extension("gssmc_addon.photo.queue").queue(
        listed, "ALL", extension("core.pose.settings").RefineSettings(**rooms.QUICK)
    )
    job.start()
    while "Again" not in job.detail:
        assert job.tick() is None
        job.join(0.1)
    job.cancel()
    assert job.join(30)
    job.close()
    bpy.context.view_layer.update()
    assert "3 of 3 photos: 2 trusted, 1 failed" in job.summary()
    assert matrices(listed)["p2"] == before


def test_starts_are_near_first_and_then_from_all_around(extension):
    neighbours, camera = extension("gssmc_addon.photo.neighbours"), extension("core.geometry.camera")

    def at(x):
        return camera.Pose.from_centre(np.eye(3), np.array([x, 0.0, 0.0]))

    solved = [neighbours.Neighbour(str(x), at(x)) for x in range(10)]
    assert [n.name for n in neighbours.choose(at(3.2), solved)] == ["3", "4", "9", "0"]
    assert [n.name for n in neighbours.choose(at(3.2), solved[:1])] == ["0"]
    assert neighbours.choose(at(3.2), []) == []


@pytest.mark.main_only
def test_a_stopped_queue_keeps_what_is_done(bpy, listed, extension):
    """Driven by hand as the window's timer does it."""
    settings = extension("core.pose.settings").RefineSettings(**rooms.QUICK)
    job = extension("gssmc_addon.photo.queue").queue(listed, "ALL", settings)
    job.start()
    while job.index < 1:  # the splat is copied, the first photo refined
        job.tick()
        job.join(0.1)
    before = matrices(listed)
    job.cancel()
    assert job.join(30)
    bpy.context.view_layer.update()
    assert job.refined == 1
    assert "1 of 3 photos" in job.summary()
    assert {name for name, now in matrices(listed).items() if now != before[name]} <= {"p0"}


@pytest.mark.main_only
def test_photos_do_not_pile_up_in_memory(bpy, listed):
    """Pixels are let go once a photo has its camera; what stays is a thumbnail."""
    images = [entry.camera.data.gssmc.photo for entry in listed.gssmc.photos[1:]]
    assert [image.has_data for image in images] == [False, False]
    for image in images:
        assert max(image.preview.image_size) <= 64
        assert np.ptp(np.array(image.preview.image_pixels_float)) > 0.2


@pytest.mark.main_only
def test_a_queue_ends_with_its_splat(bpy, listed, extension):
    settings = extension("core.pose.settings").RefineSettings(**rooms.QUICK)
    job = extension("gssmc_addon.photo.queue").queue(listed, "ALL", settings)
    job.start()
    bpy.data.objects.remove(listed.gssmc.splat)
    with pytest.raises(extension("core.errors").RefineError, match="removed"):
        job.tick()
    assert job.cancelled
    assert job.join(30)
