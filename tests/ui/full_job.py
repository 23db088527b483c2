"""The main job in the real window, by hand as a user does it; screenshots to look at.

It runs inside a windowed Blender (run.sh, window.py) under driver.py, which gives view3d(), sidebar(), press(), shot() and
waits for the seconds that steps() yields. Beside this file: scene.ply, photo.jpg, cameras.json (the photo's start camera).
"""

# ruff: noqa: F821 - the driver provides view3d, sidebar, move, click, press and shot

import os
import sys
import time

import bpy

HERE = os.path.dirname(__file__)
JOB_LIMIT_S = 150
SHADER_COMPILE_S = 40


def jobs():
    return sys.modules["bl_ext.user_default.gssmc.gssmc_addon.jobs.slot"]


def in_view(operator, *args, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def camera_state():
    camera = bpy.context.scene.camera
    data = camera.data
    return [x for row in camera.matrix_world for x in row] + [data.lens, data.shift_x, data.shift_y]


def wait_for_job():
    start = time.time()
    while jobs().active() and time.time() - start < JOB_LIMIT_S:
        yield 0.2
    assert not jobs().active(), "the refinement did not end"


def wait_until(condition, what, limit=10.0):
    start = time.time()
    while not condition() and time.time() - start < limit:
        yield 0.1
    assert condition(), what


def until_free(limit=30.0):
    """Blender's own redraws follow each other for seconds after a change: samples of its anti-aliasing."""
    start = calm = time.time()
    while time.time() - calm < 1.0 and time.time() - start < limit:
        before = time.time()
        yield 0.02
        if time.time() - before > 0.1:
            calm = time.time()


def find_button(command):
    """Window pixels of the panel's button that calls `command`, which Ctrl-C over a button puts on the clipboard."""
    _, _, _, _, sidebar_region = view3d()
    x, manager = sidebar_region.x + int(0.45 * sidebar_region.width), bpy.context.window_manager
    manager.clipboard = ""
    for y in range(sidebar_region.y + sidebar_region.height - 40, sidebar_region.y, -10):
        move(x, y)
        yield 0.2
        press("C", x, y, ctrl=True)
        yield 0.1
        if manager.clipboard.startswith(f"bpy.ops.{command}("):
            return x, y
    raise AssertionError(f"the panel shows no button of {command}")


def set_up():
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    shot("extra-1-empty.png")
    in_view(bpy.ops.gssmc.import_splats, filepath=HERE + "/scene.ply", show_colours=False)
    bpy.ops.ed.undo_push(message="import")
    yield 2.0
    shot("extra-2-imported.png")
    in_view(bpy.ops.gssmc.add_photo, filepath=HERE + "/photo.jpg", camera="NEW", camera_file=HERE + "/cameras.json")
    bpy.ops.ed.undo_push(message="photo")
    yield 2.0
    shot("extra-3-photo.png")


def escape():
    """Measured with the splat drawn as a box: without a graphics card one redraw of all points outlasts the limit."""
    before = camera_state()
    bpy.context.scene.gssmc.splat.gssmc.show_as = "BOX"
    yield from until_free()
    in_view(bpy.ops.gssmc.refine, "INVOKE_DEFAULT")
    yield 1.0
    assert jobs().active()
    shot("extra-4-running.png")
    pressed = time.time()
    press("ESC")
    while jobs().active() and time.time() - pressed < 10:
        yield 0.05
    print(f"Esc took {time.time() - pressed:.2f} s", flush=True)
    assert time.time() - pressed < 1.0
    assert camera_state() == before
    bpy.context.scene.gssmc.splat.gssmc.show_as = "SPLATS"
    yield 2.0
    shot("extra-5-cancelled.png")


def refine_and_undo():
    """By the mouse, on the panel's own button."""
    before = camera_state()
    button = yield from find_button("gssmc.refine")
    click(*button)
    yield from wait_until(jobs().active, "a click on Refine Camera must start the job")
    yield 2.0
    shot("extra-6a-running.png")
    yield from wait_for_job()
    yield 1.5
    shot("extra-6-refined.png")
    after = camera_state()
    assert after != before
    press("Z", ctrl=True)
    yield from wait_until(lambda: camera_state() == before, "one Ctrl-Z must take the camera back")
    yield 1.0
    shot("extra-7-undone.png")
    press("Z", ctrl=True, shift=True)
    yield from wait_until(lambda: camera_state() == after, "redo must bring the result back")


def colours():
    view3d()[3].shading.type = "MATERIAL"
    for slot in bpy.context.scene.camera.data.background_images:
        slot.alpha = 0.0
    for _ in range(SHADER_COMPILE_S):  # software GL compiles EEVEE's shaders for long
        yield 1.0
    shot("extra-8-colours.png")


def steps():
    view3d()[3].show_region_ui = True
    yield 1.0
    sidebar("GS-SMC")
    yield 1.0
    for part in (set_up, escape, refine_and_undo, colours):
        yield from part()
