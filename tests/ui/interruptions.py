"""What may happen in the real window while a refinement runs: undo, deletion, another file, the extension switched off.

See full_job.py for how it is run and what lies beside it.
"""

# ruff: noqa: F821 - the driver provides view3d, sidebar, press, shot and tick

import os
import sys
import time

import addon_utils
import bpy

HERE = os.path.dirname(__file__)
MODULE = "bl_ext.user_default.gssmc"
JOB_LIMIT_S = 150


def jobs():
    return sys.modules[MODULE + ".gssmc_addon.jobs.slot"]


def in_view(operator, *args, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def set_up():
    """Splat and photo, with one undo step after each as the user interface makes them."""
    in_view(bpy.ops.gssmc.import_splats, filepath=HERE + "/scene.ply", show_colours=False)
    bpy.context.scene.gssmc.splat.gssmc.show_as = "BOX"  # without a graphics card, drawing splats delays everything
    bpy.ops.ed.undo_push(message="import")
    in_view(bpy.ops.gssmc.add_photo, filepath=HERE + "/photo.jpg", camera="NEW", camera_file=HERE + "/cameras.json")
    bpy.ops.ed.undo_push(message="photo")


def start():
    in_view(bpy.ops.gssmc.refine, "INVOKE_DEFAULT")
    assert jobs().active()


def message():
    return bpy.context.window_manager.gssmc.message


def matrix():
    return [x for row in bpy.context.scene.camera.matrix_world for x in row]


def wait_for_end(limit):
    begun = time.time()
    while jobs().active() and time.time() - begun < limit:
        yield 0.1
    assert not jobs().active(), "the job did not end"
    yield 0.5


def wait_until(condition, what, limit=10.0):
    begun = time.time()
    while not condition() and time.time() - begun < limit:
        yield 0.1
    assert condition(), what


def undo_of_something_else():
    """The job goes on, and its result still arrives as one undo step."""
    bpy.context.scene.camera.location.x += 0.05
    bpy.ops.ed.undo_push(message="nudge")
    start()
    yield 1.5
    press("Z", ctrl=True)
    yield 0.5
    assert jobs().active(), message()
    moved_back = matrix()
    yield from wait_for_end(JOB_LIMIT_S)
    print("after undo during the job:", bpy.context.scene.camera.data.gssmc.verdict, message(), flush=True)
    refined = matrix()
    assert refined != moved_back
    press("Z", ctrl=True)
    yield from wait_until(lambda: matrix() == moved_back, "one Ctrl-Z must take back the refinement alone")


def undo_of_the_photo():
    start()
    yield 1.0
    press("Z", ctrl=True)
    yield from wait_for_end(3)
    print("after undo of the photo:", message(), flush=True)
    assert "removed" in message()
    press("ESC")  # closes the popup with the message
    yield 0.5
    press("Z", ctrl=True, shift=True)
    yield from wait_until(lambda: bpy.context.scene.camera.name == "photo", "redo must bring the photo's camera back")


def splat_deleted():
    start()
    yield 1.0
    for other in bpy.context.selected_objects:
        other.select_set(False)
    bpy.context.scene.gssmc.splat.select_set(True)
    before = matrix()
    in_view(bpy.ops.object.delete)
    bpy.ops.ed.undo_push(message="delete")
    yield from wait_for_end(3)
    print("after deleting the splat:", message(), flush=True)
    assert "splat" in message()
    assert matrix() == before
    shot("extra-i1-deleted.png")
    press("ESC")
    yield 0.5
    press("Z", ctrl=True)
    yield 1.0


def cancel_button():
    start()
    yield 1.0
    begun = time.time()
    in_view(bpy.ops.gssmc.cancel)
    yield from wait_for_end(3)
    print(f"Cancel took {time.time() - begun - 0.5:.2f} s", flush=True)


def extension_off_and_on():
    start()
    yield 1.0
    addon_utils.disable(MODULE)
    yield 1.0
    assert addon_utils.enable(MODULE) is not None
    yield 1.0
    assert jobs().active() is None
    shot("extra-i2-enabled-again.png")
    start()
    yield from wait_for_end(JOB_LIMIT_S)
    print("after switching off and on:", bpy.context.scene.camera.data.gssmc.verdict, flush=True)


def saved_and_opened_again():
    start()
    yield 1.0
    bpy.ops.wm.save_as_mainfile(filepath=HERE + "/saved.blend")
    assert jobs().active(), "saving must not stop the job"
    bpy.app.timers.register(tick, first_interval=2.0, persistent=True)  # opening a file ends the driver's own timer
    bpy.ops.wm.open_mainfile(filepath=HERE + "/saved.blend")
    yield 2.0
    assert jobs().active() is None
    assert bpy.context.scene.gssmc.splat is not None
    start()
    yield from wait_for_end(JOB_LIMIT_S)
    print("after opening the file again:", bpy.context.scene.camera.data.gssmc.verdict, flush=True)


def steps():
    view3d()[3].show_region_ui = True
    yield 1.0
    sidebar("GS-SMC")
    yield 1.0
    set_up()
    for case in (
        undo_of_something_else,
        undo_of_the_photo,
        splat_deleted,
        cancel_button,
        extension_off_and_on,
        saved_and_opened_again,
    ):
        yield from case()
