"""A photo before the scene lies over the splat where it is, and nowhere else, as the window shows it.

Not part of pytest; see full_job.py for how it is run. Beside this file: scene.ply, photo.jpg, cameras.json.
"""

# ruff: noqa: F821 - the driver provides view3d and shot

import os
import sys
import time

import bpy
import cv2
import numpy as np

HERE = os.path.dirname(__file__)
MODULE = "bl_ext.user_default.gssmc"


def in_view(operator, *args, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def drawn():
    """Until every Gaussian has been drawn in the view as it is."""
    stage = sys.modules[MODULE + ".gssmc_addon.viewport.handlers"]._handler.stage
    begun = time.time()
    view3d()[1].tag_redraw()
    yield 1.0
    while time.time() - begun < 60:
        live = [view for view in stage._views.values() if view.live]
        if live and all(view.rested and view.count == view.limit and not view.canvas.working for view in live):
            break
        yield 0.3
    yield 1.0


def light(name):
    """The viewport as the X server has it, in linear light."""
    shot(name)
    _, _, region, _, _ = view3d()
    picture = cv2.imread(os.path.join(HERE, name)).astype(float) / 255
    top = picture.shape[0] - region.y - region.height
    shown = picture[top + 100 : top + region.height - 20, region.x + 60 : region.x + region.width - 60]
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def plain(space):
    """Nothing but splat and photo, for what else Blender draws differs between the pictures."""
    space.show_region_ui = space.show_gizmo = False
    overlay = space.overlay
    overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = overlay.show_cursor = overlay.show_outline_selected = False


def steps():
    _, _, _, space, _ = view3d()
    plain(space)
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    in_view(bpy.ops.gssmc.import_splats, filepath=HERE + "/scene.ply")
    in_view(bpy.ops.gssmc.add_photo, filepath=HERE + "/photo.jpg", camera="NEW", camera_file=HERE + "/cameras.json")
    data = bpy.context.scene.camera.data
    slot = data.background_images[0]
    yield from drawn()
    pictures = {}
    for name, depth, alpha in (("behind", "BACK", 0.5), ("half", "FRONT", 0.5), ("whole", "FRONT", 1.0)):
        slot.display_depth, slot.alpha = depth, alpha
        data.update_tag()
        yield from drawn()
        pictures[name] = light(f"extra-b-{name}.png")
    splat, half, whole = pictures["behind"], pictures["half"], pictures["whole"]
    photo = np.abs(whole - splat).max(axis=2) > 0.02
    rows, columns = np.nonzero(photo)
    inside = (
        slice(int(np.percentile(rows, 10)), int(np.percentile(rows, 90))),
        slice(int(np.percentile(columns, 10)), int(np.percentile(columns, 90))),
    )
    beside = np.ones(photo.shape, bool)
    beside[rows.min() - 2 : rows.max() + 3, columns.min() - 2 : columns.max() + 3] = False
    assert np.abs(half - splat)[beside].mean() < 1e-3, "the splat is opaque beside the photo"
    assert np.abs(whole - splat)[beside].mean() < 1e-3
    assert np.abs(half - (splat + whole) / 2)[inside].mean() < 5e-3, "photo and splat by halves where the photo is"
