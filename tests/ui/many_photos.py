"""Many photos, the preview and a moving plate in the real window; screenshots to look at.

See full_job.py for how it is run. Beside this file: scene.ply, photos/ and starts.json, plate/ and
start.json. docs/photos.jpg is what it shows of the sample room (and a file cut short) after all_of_them, at 80 %, with the
settings' defaults, the splat drawn, the render of the photo's resolution and the timeline closed.
"""

# ruff: noqa: F821 - the driver provides view3d, sidebar, press and shot

import os
import sys
import time

import bpy

HERE = os.path.dirname(__file__)
PHOTO_LIMIT_S = 150  # for each photo, or frame of the plate
QUICK = {"long_side_px": 320, "final": "none", "candidates": 4, "iterations": 3}  # what is looked at is the window


def jobs():
    return sys.modules["bl_ext.user_default.gssmc.gssmc_addon.jobs.slot"]


def in_view(operator, *args, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def wait_for_job():
    """Waits; prints the longest time in which the window could not answer."""
    begun = last = time.time()
    gap, limit = 0.0, PHOTO_LIMIT_S * getattr(jobs().active(), "count", 1)
    while jobs().active() and time.time() - begun < limit:
        yield 0.02
        gap, last = max(gap, time.time() - last), time.time()
    assert not jobs().active(), "the job did not end"
    print(f"job took {time.time() - begun:.1f} s, longest pause of the window {1000 * gap:.0f} ms", flush=True)


def wait_until(condition, what, limit=15.0):
    begun = time.time()
    while not condition() and time.time() - begun < limit:
        yield 0.1
    assert condition(), what


def matrices():
    return {o.name: [x for row in o.matrix_world for x in row] for o in bpy.context.scene.objects if o.type == "CAMERA"}


def set_up():
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.data.objects.remove(bpy.data.objects["Camera"])
    in_view(bpy.ops.gssmc.import_splats, filepath=HERE + "/scene.ply", show_colours=False)
    own = bpy.context.scene.gssmc
    own.splat.gssmc.show_as = "BOX"  # without a graphics card, drawing splats delays everything
    for name, value in QUICK.items():
        setattr(own, name, value)
    in_view(bpy.ops.gssmc.add_photo_folder, directory=HERE + "/photos", camera_file=HERE + "/starts.json")
    bpy.ops.ed.undo_push(message="photos")
    yield 2.0
    shot("extra-m1-listed.png")


def escape_keeps_what_is_done():
    before = matrices()
    in_view(bpy.ops.gssmc.refine_all, "INVOKE_DEFAULT")
    yield 2.0
    shot("extra-m2-running.png")
    yield from wait_until(lambda: jobs().active().index >= 1, "the first photo must come to its end", PHOTO_LIMIT_S)
    pressed = time.time()
    press("ESC")
    while jobs().active() and time.time() - pressed < 10:
        yield 0.05
    print(f"Esc took {time.time() - pressed:.2f} s", flush=True)
    yield 1.0
    shot("extra-m3-stopped.png")
    moved = [name for name, now in matrices().items() if now != before[name]]
    assert len(moved) == 1, moved
    press("Z", ctrl=True)
    yield from wait_until(lambda: matrices() == before, "one Ctrl-Z must take back what was refined before Esc")


def all_of_them():
    before = matrices()
    in_view(bpy.ops.gssmc.refine_all, "INVOKE_DEFAULT")
    yield from wait_for_job()
    yield 1.0
    shot("extra-m4-refined.png")
    assert sum(now != before[name] for name, now in matrices().items()) >= 3
    in_view(bpy.ops.gssmc.review, step=-1)
    yield 1.0
    shot("extra-m5-review.png")


def preview():
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "DOPESHEET_EDITOR")
    area.type = "IMAGE_EDITOR"
    yield 0.5
    for index, style in enumerate(("DIAGONAL", "DIFFERENCE", "MATCHES", "FLICKER")):
        in_view(bpy.ops.gssmc.preview, "INVOKE_DEFAULT", style=style, background=style == "DIAGONAL")
        yield from wait_for_job()
        yield 1.0
        shot(f"extra-m6{index}-{style.lower()}.png")
    own, space, seen = bpy.context.window_manager.gssmc.preview, area.spaces.active, set()
    for _ in range(8):
        seen.add(space.image.name)
        yield 0.3
    assert len(seen) == 2, seen
    own.flicker = False
    yield 1.0
    now = space.image.name
    yield 1.5
    assert space.image.name == now, "the flicker must stop"


def keyed(camera):
    return camera.animation_data is not None and camera.animation_data.action is not None


def plate():
    in_view(bpy.ops.gssmc.add_plate, filepath=HERE + "/plate/shot.0012.png", camera="NEW", camera_file=HERE + "/start.json")
    bpy.ops.ed.undo_push(message="plate")
    before = matrices()
    in_view(bpy.ops.gssmc.refine_sequence, "INVOKE_DEFAULT", step=4)
    yield 1.0
    shot("extra-m7-dialog.png")
    press("RET")
    yield 1.0
    assert jobs().active(), "Return must start the job"
    yield from wait_for_job()
    yield 1.0
    shot("extra-m8-plate.png")
    assert keyed(bpy.context.scene.camera)
    press("Z", ctrl=True)
    yield from wait_until(lambda: not keyed(bpy.context.scene.camera), "one Ctrl-Z must take back all keys")
    yield from wait_until(lambda: matrices() == before, "one Ctrl-Z must take back the refinement")


def steps():
    view3d()[3].show_region_ui = True
    yield 1.0
    sidebar("GS-SMC")
    yield 1.0
    for part in (set_up, escape_keeps_what_is_done, all_of_them, preview, plate):
        yield from part()
        print("ok", part.__name__, flush=True)
