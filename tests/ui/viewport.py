"""The splat in the real viewport: import by the dialog, beside a cube, hidden, undone, reopened, the extension switched off.

See full_job.py for how it is run. Beside it: scene.ply, photo.jpg, cameras.json. Look at the screenshots.
"""

# ruff: noqa: F821 - the driver provides view3d, sidebar, press, shot and tick

import math
import os
import sys
import time

import addon_utils
import bpy
from mathutils import Quaternion

HERE = os.path.dirname(__file__)
MODULE = "bl_ext.user_default.gssmc"


def stage():
    return sys.modules[MODULE + ".gssmc_addon.viewport.handlers"]._handler.stage


def splat():
    return bpy.context.scene.gssmc.splat


def in_view(operator, *args, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def redraw():
    view3d()[1].tag_redraw()


def until(condition, what, limit=60.0):
    start = time.time()
    while not condition():
        assert time.time() - start < limit, what
        yield 0.1


def live():
    return [view for view in stage()._views.values() if view.live]


def complete():
    """Every Gaussian has been drawn in the view as it is."""
    found = [(uid, view) for (_, uid), view in stage()._views.items() if view.live]
    return bool(found) and all(is_complete(uid, view) for uid, view in found)


def is_complete(uid, view):
    textures, version = stage().clouds.get(uid)
    if textures is None or view.version != version or not (view.rested and view.count == view.limit and view.canvas.shows):
        return False
    ((stamp, count, _, _), _), shrink = view.canvas._shown_key
    return (stamp, count, shrink) == ((version, view.stamp), view.limit, 1)


def imported_by_the_dialog():
    cube = bpy.data.objects["Cube"]
    cube.scale, cube.location = (0.3, 0.3, 0.3), (0.2, 2.2, -0.3)
    bpy.ops.ed.undo_push(message="cube")
    in_view(bpy.ops.gssmc.import_splats, "INVOKE_DEFAULT", filepath=HERE + "/scene.ply")
    yield 1.0
    shot("extra-v1-dialog.png")
    press("RET")
    yield from until(splat, "the import must end")
    yield from until(complete, "the splat must be drawn")
    shot("extra-v2-imported.png")
    view = view3d()[3].region_3d
    view.view_location, view.view_distance = (0, 1.7, 0), 2.5
    view.view_rotation = Quaternion((1, 0, 0), math.radians(80))
    redraw()
    yield 1.0
    yield from until(complete, "the splat must be drawn from here")
    shot("extra-v3-inside.png")


def hidden_and_isolated():
    splat().hide_set(True)
    redraw()
    yield from until(lambda: not live(), "a hidden splat is not drawn")
    splat().hide_set(False)
    redraw()
    yield from until(live, "and drawn again")
    cube = bpy.data.objects["Cube"]
    splat().select_set(False)
    cube.select_set(True)
    in_view(bpy.ops.view3d.localview, frame_selected=False)
    redraw()
    yield from until(lambda: not live(), "local view of the cube leaves the splat out")
    in_view(bpy.ops.view3d.localview, frame_selected=False)
    yield from until(live, "and brings it back")
    cube.select_set(False)


def undone_and_redone():
    press("Z", ctrl=True)
    yield from until(lambda: not splat(), "one Ctrl-Z takes the import back")
    yield 1.0
    assert not live()
    press("Z", ctrl=True, shift=True)
    yield from until(splat, "redo brings it back")
    yield from until(complete, "and it is drawn")


def moved():
    splat().location.x += 0.5
    redraw()
    yield 0.5
    yield from until(complete, "a moved splat is drawn where it is")
    shot("extra-v4-moved.png")
    splat().location.x -= 0.5


def off_and_on():
    name = splat().name
    addon_utils.disable(MODULE)
    yield 1.0
    assert bpy.data.objects[name].display_type == "TEXTURED", "without the extension: points"
    assert addon_utils.enable(MODULE) is not None
    yield from until(lambda: splat().display_type == "BOUNDS", "switched on again")
    yield from until(complete, "and drawn again")


def saved_and_opened_again():
    bpy.ops.wm.save_as_mainfile(filepath=HERE + "/saved.blend")
    bpy.app.timers.register(tick, first_interval=2.0, persistent=True)  # opening a file ends the driver's own timer
    bpy.ops.wm.open_mainfile(filepath=HERE + "/saved.blend")
    yield 2.0
    yield from until(complete, "the splat of an opened file must be drawn")
    shot("extra-v5-opened.png")


def with_the_photo():
    in_view(bpy.ops.gssmc.add_photo, filepath=HERE + "/photo.jpg", camera="NEW", camera_file=HERE + "/cameras.json")
    yield 1.0
    yield from until(complete, "the splat must be drawn through the camera")
    shot("extra-v6-photo.png")


def steps():
    view3d()[3].show_region_ui = True
    yield 1.0
    sidebar("GS-SMC")
    yield 1.0
    for part in (
        imported_by_the_dialog,
        hidden_and_isolated,
        undone_and_redone,
        moved,
        off_and_on,
        saved_and_opened_again,
        with_the_photo,
    ):
        yield from part()
        print("ok", part.__name__, flush=True)
