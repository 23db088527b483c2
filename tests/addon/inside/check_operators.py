"""Every operator is driven in every Blender that the tests install the zip into; here those that no other check calls."""

import ast
from pathlib import Path

HERE = Path(__file__).parent


def called():
    """Names of the operators that the checks call (asking their poll is no call), except in a check that 4.5 is spared."""
    tree = [n for path in HERE.glob("check_*.py") if path.stem != "check_docs" for n in ast.walk(ast.parse(path.read_text()))]
    functions = [n.func for n in tree if isinstance(n, ast.Call) and isinstance(n.func, ast.Attribute)]
    return {f.attr for f in functions if ast.unparse(f.value) == "bpy.ops.gssmc"}


def test_every_registered_operator_is_driven(bpy):
    registered = {name for name in dir(bpy.ops.gssmc) if not name.startswith("_")}
    assert len(registered) >= 19
    assert registered - called() == set()


def test_cancel_stops_the_running_job(bpy, extension, scene):
    jobs = extension("gssmc_addon.jobs")
    settings = extension("core.pose.settings").RefineSettings()
    job = jobs.gather(scene, scene.gssmc.splat, scene.camera, scene.camera.data.gssmc.photo, settings)
    assert not bpy.ops.gssmc.cancel.poll()
    jobs.begin(bpy.context, job)  # as the button does; the timer that would drive it is the window's
    try:
        assert not bpy.ops.gssmc.refine.poll()
        assert bpy.ops.gssmc.cancel() == {"FINISHED"}
        assert job.cancelled
        assert job.join(60)
    finally:
        jobs.end(job)
    assert bpy.ops.gssmc.refine.poll()
