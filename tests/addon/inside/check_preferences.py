"""Preferences that reach the work: threads, memory limit, preset, log file; and Report a Problem."""

import json
import logging

import numpy as np
import pytest

MODULE = "bl_ext.user_default.gssmc"


@pytest.fixture
def own(bpy):
    own = bpy.context.preferences.addons[MODULE].preferences
    yield own
    own.threads, own.memory_limit_gb, own.default_preset, own.log_file = 0, 0.0, "NONE", ""


def test_threads_of_the_preferences_count_where_the_scene_says_0(bpy, own, extension):
    settings_from, scene = extension("gssmc_addon.registration.settings").settings_from, bpy.context.scene
    own.threads = 3
    assert settings_from(scene.gssmc).threads == 3
    scene.gssmc.threads = 1
    assert settings_from(scene.gssmc).threads == 1


def test_a_refinement_beyond_the_memory_limit_is_refused(bpy, own, scene):
    own.memory_limit_gb = 0.1
    before = np.array(scene.camera.matrix_world)
    with pytest.raises(RuntimeError, match=r"about 0\.\d GB of memory, and 0\.1 GB are allowed"):
        bpy.ops.gssmc.refine()
    assert (np.array(scene.camera.matrix_world) == before).all()
    assert scene.camera.data.gssmc.verdict == "NONE"


def test_a_search_beyond_the_memory_limit_is_refused(bpy, own, scene, extension):
    """A limit that a refinement keeps, and a search with the map of the scan does not."""
    memory, objects = extension("core.render.memory"), extension("gssmc_addon.splat.object")
    splat = next(obj for obj in scene.objects if objects.is_splat(obj))
    threads = extension("gssmc_addon.registration.preferences").threads(bpy.context, scene.gssmc.threads)
    least = memory.refine_bytes(len(splat.data.points), objects.sh_coefficients(splat), 10**5, threads)
    own.memory_limit_gb = (least + 1e6) / 1e9
    with pytest.raises(RuntimeError, match="The search would take about"):
        bpy.ops.gssmc.find_camera()


def test_an_import_beyond_the_memory_limit_is_refused(bpy, own, splat_file):
    own.memory_limit_gb = 0.1
    with pytest.raises(RuntimeError, match="The import would take about"):
        bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    assert not bpy.data.pointclouds


def test_the_default_preset_fills_untouched_settings(bpy, own, splat_file):
    own.default_preset = "7scenes"
    settings = bpy.context.scene.gssmc
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    assert (settings.iterations, settings.perturb_translation_units) == (6, pytest.approx(0.04))
    bpy.ops.wm.read_homefile(use_empty=True)
    settings = bpy.context.scene.gssmc
    settings.iterations = 2
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    assert (settings.iterations, settings.perturb_translation_units) == (2, 0)


def test_the_log_file_gets_the_engines_words(bpy, own, scene, tmp_path):
    own.log_file = str(tmp_path / "log.txt")
    bpy.ops.gssmc.refine(locate=False)
    assert "failed after" in (tmp_path / "log.txt").read_text()
    own.log_file = str(tmp_path / "none" / "log.txt")
    assert logging.getLogger(MODULE).handlers == []


def test_a_problem_is_reported_with_versions_and_the_last_record(bpy, scene, extension):
    problem = extension("gssmc_addon.support.problem")
    bpy.ops.gssmc.refine(locate=False)
    text = problem.text(bpy.context)
    for words in ("GS-SMC 0.", f"Blender {bpy.app.version_string}", "Python 3.", "numpy ", "cv2 5", '"verdict": "failed"'):
        assert words in text
    for words in (
        "Views from the card: AUTO, not tested",
        "Graphics: none, in background mode",
        "Splat: 200 Gaussians, 4 SH coefficients",
        " GB of memory",
    ):
        assert words in text
    assert "Views from the card: AUTO, not tested" in text
    assert "Last job: Refine Camera: 1 failed" in text
    assert "a.png" not in text
    assert bpy.ops.gssmc.report_problem() == {"FINISHED"}


def keys(value):
    """Every name in a record, however deep."""
    if isinstance(value, dict):
        return set(value).union(*map(keys, value.values()))
    return set().union(*map(keys, value)) if isinstance(value, list) else set()


def test_a_problems_record_holds_no_pose_and_no_name(bpy, listed, extension):
    problem = extension("gssmc_addon.support.problem")
    bpy.ops.gssmc.refine(long_side_px=320, final="none", candidates=4, iterations=2)
    text = problem.text(bpy.context)
    record = json.loads(text.split("Its last record: ")[1])
    assert record["iterations"], "there are figures"
    assert {"inliers", "verdict", "seconds"} <= keys(record)
    assert keys(record).isdisjoint({"R", "t", "start", "file", "k1", "fx", "cx"})
    assert bpy.context.scene.camera.name not in text
    assert "p0" not in text


SENTENCES = [
    "'/home/ann/Secret Job/scan 2.ply' cannot be read; check the path.",
    '"Secret" was refined (check) in 3.0 s: 12 of 40 matches agree.',
    "There is no folder at 'C:\\Users\\ann\\Secret\\photos'; choose the folder of the photos.",
    "No such file: /mnt/Secret/my photos/a.jpg",
    "'https://studio.example/Secret/net.onnx' cannot be reached (timed out); check the address.",
    "The photo '//Secret/o'neil.jpg' isn't there.",
    "[Errno 2] No such file or directory: '/home/ann/Secret'",
    "\\\\server\\Secret\\scan.ply is cut off.",
]


@pytest.mark.parametrize("sentence", SENTENCES)
def test_a_problem_quotes_no_path_and_no_name(bpy, extension, sentence):
    bpy.context.window_manager.gssmc.tell(sentence)
    text = extension("gssmc_addon.support.problem").text(bpy.context)
    for word in ("Secret", "/ann", "ann\\", "photos/", "neil", "studio"):
        assert word not in text
    assert "Last message: " in text and "..." in text


def test_a_problem_keeps_the_sentence_around_the_names(extension):
    without = extension("gssmc_addon.support.problem").without_names
    assert without("\"a\" was refined (check) in 3.0 s: it's the splat's edge.") == (
        "\"...\" was refined (check) in 3.0 s: it's the splat's edge."
    )


def test_a_problem_tells_of_the_last_job_and_not_of_one_before(bpy, listed, extension):
    problem = extension("gssmc_addon.support.problem")
    bpy.ops.gssmc.refine(long_side_px=320, final="none", candidates=4, iterations=2)
    assert "Last job: Refine Camera: 1 " in problem.text(bpy.context)
    problem.begin("Refine Plate", reports := {})
    assert "Last job: Refine Plate: no result" in problem.text(bpy.context)
    assert "record" not in problem.text(bpy.context)
    core = extension("core.pose.report")
    camera = extension("core.geometry.camera").Camera
    lens = extension("core.geometry.camera").Intrinsics(4, 4, 2.0, 2.0, 2.0, 2.0)
    start = camera(lens, extension("core.geometry.camera").Pose(np.eye(3), np.zeros(3)))
    reports.update({k: core.RefineReport(start, start, word, (), (), 1.0) for k, word in enumerate(["check", "trusted"])})
    assert "Last job: Refine Plate: 1 trusted, 1 check" in problem.text(bpy.context)


def test_whatever_can_be_typed_is_accepted(bpy, extension):
    """The panel's limits are the engine's own."""
    module, settings = extension("gssmc_addon.registration.settings"), bpy.context.scene.gssmc
    numbers = [name for name in module.settings_annotations() if settings.bl_rna.properties[name].type in ("INT", "FLOAT")]
    assert len(numbers) == 9
    for name in numbers:
        for typed in (-(2**31), 0, 2**31 - 1):
            setattr(settings, name, typed)
            assert module.settings_from(settings) is not None, name
        settings.property_unset(name)


def test_a_tooltip_says_what_the_option_is_and_nothing_of_the_code(bpy, extension):
    options, rna = extension("gssmc_addon.registration.settings").OPTIONS, bpy.context.scene.gssmc.bl_rna.properties
    for name in extension("gssmc_addon.registration.settings").settings_annotations():
        text = rna[name].description
        assert text.lower() == options[name].help.lower()
        assert text[0].isupper()
        assert "Error" not in text
        if rna[name].type == "ENUM":
            assert all(item.description for item in rna[name].enum_items)
