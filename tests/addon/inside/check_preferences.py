"""Preferences that reach the work: threads, memory limit, preset, log file; and Report a Problem."""

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
    bpy.ops.gssmc.refine()
    assert "failed after" in (tmp_path / "log.txt").read_text()
    own.log_file = str(tmp_path / "none" / "log.txt")
    assert logging.getLogger(MODULE).handlers == []


def test_a_problem_is_reported_with_versions_and_the_last_record(bpy, scene, extension):
    problem = extension("gssmc_addon.support.problem")
    bpy.ops.gssmc.refine()
    text = problem.text(bpy.context)
    for words in ("GS-SMC 0.", f"Blender {bpy.app.version_string}", "Python 3.", "numpy ", "cv2 5", '"verdict": "failed"'):
        assert words in text
    assert "a.png" not in text
    assert bpy.ops.gssmc.report_problem() == {"FINISHED"}
