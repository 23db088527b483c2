"""Same Lens: photos of one camera get one lens, their cameras move along, and what was changed since is left out."""

from types import SimpleNamespace

import pytest
from panels_drawn import Layout
from photo_files import ASCII, RATIONAL, encoded, exif, picture
from solved_photos import LENS, record_of, solved_photo

CAMERA_X = exif({0x0110: (ASCII, "Camera X")}, {0x920A: (RATIONAL, (57, 10))})


@pytest.fixture(scope="module")
def records():
    return [record_of(solved_photo(seed, LENS), focal_std_pct=5.0) for seed in range(3)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three photos of one camera, and one that tells none."""
    folder = tmp_path_factory.mktemp("photos")
    for k, block in enumerate([CAMERA_X] * 3 + [b""]):
        (folder / f"p{k}.jpg").write_bytes(encoded(".jpg", picture(480, 640), block))
    return folder


@pytest.fixture
def solve(bpy, extension):
    """Writes the end of a refinement as the job does."""
    reports, js = extension("core.pose.report"), extension("core.pose.report_json")
    jobs, files = extension("gssmc_addon.refine.job"), extension("core.cameras.files")

    def write(camera, record):
        scene = bpy.context.scene
        found = files.camera_from_dict({**record, "lens": None})
        quality, lens = js.quality_from_dict(record["quality"]), js.lens_from_dict(record["lens"])
        known, said = js.evidence_from_dict(record["lens_evidence"]), (record["verdict"], tuple(record["reasons"]))
        start = extension("gssmc_addon.camera.bridge").read_camera(scene, camera, scene.gssmc.splat).at_size(640, 480)
        report = reports.RefineReport(found, start, *said, (), 1.0, quality, "joint", lens, known)
        photo = extension("gssmc_addon.photo.image").camera_photo(camera)
        jobs.apply_report(jobs.Targets.of(scene, scene.gssmc.splat, camera, photo), report)
        bpy.context.view_layer.update()

    return write


@pytest.fixture
def listed(bpy, extension, splat_file, folder, records, solve):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Z_UP")
    assert bpy.ops.gssmc.add_photo_folder(directory=str(folder)) == {"FINISHED"}
    scene = bpy.context.scene
    for entry, record in zip(scene.gssmc.photos, [*records, records[0]], strict=True):
        solve(entry.camera, record)
    return SimpleNamespace(scene=scene, cameras=[entry.camera for entry in scene.gssmc.photos], entries=scene.gssmc.photos)


def solved(extension, camera):
    return extension("gssmc_addon.camera.record").read(camera.data)


def lenses(extension, cameras):
    return [solved(extension, camera).camera.intrinsics.fx for camera in cameras]


def place(camera):
    return [x for row in camera.matrix_world for x in row]


def test_photos_of_one_camera_get_one_lens_and_stay_solved(bpy, extension, listed, records):
    solution, before = extension("gssmc_addon.camera.solution"), [place(camera) for camera in listed.cameras]
    assert {camera.data.gssmc.verdict for camera in listed.cameras} == {"CHECK"}, "their focal lengths are uncertain"
    assert bpy.ops.gssmc.same_lens() == {"FINISHED"}
    bpy.context.view_layer.update()
    found = lenses(extension, listed.cameras)
    assert found[0] == found[1] == found[2] and abs(found[0] / LENS.fx - 1) < 0.01
    assert found[3] == records[0]["fx"] and place(listed.cameras[3]) == before[3], "its photo tells no camera"
    assert all(place(camera) != was for camera, was in zip(listed.cameras[:3], before[:3], strict=True))
    assert all(solution.change(listed.scene, camera) == "" for camera in listed.cameras)
    read = extension("gssmc_addon.camera.bridge").read_camera
    for camera in listed.cameras[:3]:
        assert camera.data.gssmc.verdict == "TRUSTED", camera.data.gssmc.reasons
        assert "Its lens is shared with 2 other photos" in camera.data.gssmc.reasons
        shown = read(listed.scene, camera, listed.scene.gssmc.splat).at_size(640, 480).intrinsics
        assert shown.fx == pytest.approx(found[0], rel=1e-5) and camera.data.gssmc.lens_state == "SOLVED"
    message = bpy.context.window_manager.gssmc.message
    assert message.startswith("One lens for 3 of the photos (Camera X at 5.7 mm): focal length ")
    assert bpy.ops.gssmc.same_lens() == {"CANCELLED"}, "nothing is left to be done"


def test_a_camera_that_was_changed_takes_no_part_and_stays(bpy, extension, listed):
    moved = listed.cameras[1]
    moved.location.x += 1.0
    bpy.context.view_layer.update()
    before, said = place(moved), moved.data.gssmc.solution
    assert bpy.ops.gssmc.same_lens() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert (place(moved), moved.data.gssmc.solution) == (before, said)
    assert "shared with 1 other photo:" in listed.cameras[0].data.gssmc.reasons


@pytest.mark.parametrize("what", ["photo", "failed", "splat"])
def test_an_answer_that_no_longer_holds_tells_nothing(bpy, extension, listed, tmp_path, what):
    if what == "photo":
        for camera in listed.cameras:
            camera.data.gssmc.photo = listed.cameras[3].data.gssmc.photo.copy()
    elif what == "failed":
        for camera in listed.cameras:
            extension("gssmc_addon.registration.camera_props").keep_verdict(camera.data, "failed", ["No."], 1, 1.0)
    else:
        listed.scene.gssmc.splat.location.x += 1.0
    bpy.context.view_layer.update()
    before = [camera.data.gssmc.solution for camera in listed.cameras]
    with pytest.raises(RuntimeError, match="No two photos of one camera"):
        bpy.ops.gssmc.same_lens()
    assert [camera.data.gssmc.solution for camera in listed.cameras] == before


def test_groups_by_name_and_back_to_each_photos_own(bpy, extension, listed, records):
    listed.entries[3].lens_group = listed.entries[0].lens_group = "mine"
    assert bpy.ops.gssmc.same_lens() == {"FINISHED"}
    assert "shared with 1 other photo:" in listed.cameras[3].data.gssmc.reasons
    for k, entry in enumerate(listed.entries):
        entry.lens_group = f"group {k}"
    assert bpy.ops.gssmc.same_lens() == {"FINISHED"}
    assert "each photo has its own" in bpy.context.window_manager.gssmc.message
    for camera, record in zip(listed.cameras, [*records, records[0]], strict=True):
        assert solved(extension, camera).camera.pose.t.tolist() == record["t"]
        assert lenses(extension, [camera]) == [record["fx"]]
        assert camera.data.gssmc.reasons.splitlines() == record["reasons"] and camera.data.gssmc.verdict == "CHECK"


def test_it_survives_saving_and_is_one_undo_step(bpy, extension, listed, tmp_path):
    listed.scene = listed.entries = listed.cameras = None  # nothing may hold what another file takes out of memory
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    cameras = [entry.camera for entry in bpy.context.scene.gssmc.photos]
    before = lenses(extension, cameras)
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.gssmc.same_lens() == {"FINISHED"}
    assert len(set(lenses(extension, cameras[:3]))) == 1
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert lenses(extension, [entry.camera for entry in bpy.context.scene.gssmc.photos]) == before


def test_what_cannot_be_read_takes_no_part(bpy, extension, listed):
    record, spoilt = extension("gssmc_addon.camera.record"), ["{", "[1]", "{}", '{"verdict": "trusted", "lens_evidence": {}}']
    data = listed.cameras[0].data
    solution = record.loads(data.gssmc.solution)
    for own in spoilt:
        data.gssmc.solution = record.dumps(extension("gssmc_addon.photo.same_lens").replace(solution, own=own))
        bpy.ops.gssmc.same_lens()
        assert "shared with 1 other photo:" in listed.cameras[1].data.gssmc.reasons
    assert "shared" not in data.gssmc.reasons


def test_a_held_camera_keeps_its_own_and_says_why(bpy, extension, listed, records):
    listed.cameras[0].constraints.new("LIMIT_LOCATION")
    assert bpy.ops.gssmc.same_lens() == {"FINISHED"}
    assert lenses(extension, listed.cameras)[0] == records[0]["fx"]
    assert "keeps its lens: The constraint" in bpy.context.window_manager.gssmc.message


@pytest.mark.main_only
def test_the_end_of_refine_all_shares_the_lens(bpy, extension, listed, monkeypatch):
    """The photos show no splat, so the refinements fail; what was solved before stands."""
    queue = extension("gssmc_addon.photo.queue").RefineQueue
    monkeypatch.setattr(queue, "run", lambda self: self)
    monkeypatch.setattr(queue, "refined", 1)
    bpy.ops.gssmc.refine_all(same_lens=False)
    assert "One lens" not in bpy.context.window_manager.gssmc.message
    bpy.ops.gssmc.refine_all()
    assert "One lens for 3 of the photos" in bpy.context.window_manager.gssmc.message


def test_the_button_and_the_groups_name_stand_below_the_list(bpy, extension, listed):
    layout = Layout()
    extension("gssmc_addon.photo.panel")._draw_lens(layout, bpy.context)
    assert layout.said == ["gssmc.same_lens", "lens_group"] and bpy.ops.gssmc.same_lens.poll()
