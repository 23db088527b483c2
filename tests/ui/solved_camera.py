"""A solved camera in the real window: dragged by mistake, put back by the button; other photos keep their fit meanwhile.

Not part of pytest; see full_job.py for how it is run. Beside this file: scene.ply, wide.png, tall.png, and
starts.json with the start cameras of both photos.
"""

# ruff: noqa: F821 - the driver provides view3d, sidebar, move, click, press and shot

import os
import sys
import time

import bpy

HERE = os.path.dirname(__file__)
MODULE = "bl_ext.user_default.gssmc.gssmc_addon"
QUICK = {"long_side_px": 320, "final": "none", "candidates": 4, "iterations": 3}


def in_view(operator, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(**kwargs)


def verdicts():
    scene, solution = bpy.context.scene, sys.modules[f"{MODULE}.camera.solution"]
    return [solution.verdict(scene, entry.camera) for entry in scene.gssmc.photos]


def wait_until(condition, what, limit=10.0):
    start = time.time()
    while not condition() and time.time() - start < limit:
        yield 0.1
    assert condition(), what


def drag(button="MIDDLEMOUSE", by=(80, 30)):
    """In the middle of the viewport."""
    window, _, region, _, _ = view3d()
    x, y = region.x + region.width // 3, region.y + region.height // 2
    move(x, y)
    yield 0.3
    window.event_simulate(type=button, value="PRESS", x=x, y=y)
    for part in range(1, 5):
        yield 0.2
        move(x + by[0] * part // 4, y + by[1] * part // 4)
    yield 0.2
    window.event_simulate(type=button, value="RELEASE", x=x + by[0], y=y + by[1])


def press_button(command):
    """Clicks the panel's button that calls `command`, which Ctrl-C over a button puts on the clipboard."""
    _, _, _, _, panel = view3d()
    x, manager = panel.x + int(0.45 * panel.width), bpy.context.window_manager
    for y in range(panel.y + panel.height - 40, panel.y, -8):
        manager.clipboard = ""
        move(x, y)
        yield 0.2
        press("C", x, y, ctrl=True)
        yield 0.1
        if manager.clipboard.startswith(f"bpy.ops.{command}("):
            click(x, y)
            return
    raise AssertionError(f"the panel shows no button of {command}")


def steps():
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    in_view(bpy.ops.gssmc.import_splats, filepath=HERE + "/scene.ply")
    for name in ("wide.png", "tall.png"):
        in_view(bpy.ops.gssmc.add_photo, filepath=f"{HERE}/{name}", camera="NEW", camera_file=HERE + "/starts.json")
    space = view3d()[3]
    space.show_region_ui = True
    yield 2.0
    sidebar("GS-SMC")
    space.lock_camera = True  # as the artist who brought the camera there has it
    in_view(bpy.ops.gssmc.refine_all, **QUICK)
    assert verdicts() == ["TRUSTED"] * 2, verdicts()
    assert not space.lock_camera, "the next turn of the view would take the camera along"
    yield 3.0
    shot("extra-1-solved.png")
    space.lock_camera = True
    yield from drag()
    yield from wait_until(lambda: verdicts() == ["TRUSTED", "CHANGED"], "a moved camera is still trusted")
    yield 3.0
    shot("extra-2-moved.png")
    yield from press_button("gssmc.back_to_solution")
    yield from wait_until(lambda: verdicts() == ["TRUSTED"] * 2, "the button did not put the camera back")
    assert not space.lock_camera
    in_view(bpy.ops.gssmc.match_resolution)
    scene = bpy.context.scene
    assert (scene.render.resolution_x, scene.render.resolution_y) == (480, 640)
    scene.gssmc.photo_index = 0
    yield from wait_until(lambda: scene.camera.name == "wide", "the other photo is not looked through")
    yield 3.0
    shot("extra-3-the-other-photo.png")
    assert verdicts() == ["TRUSTED"] * 2
    print("a solved camera: moved, put back, and the other kept its fit", flush=True)
