"""The preview shows in the viewport by itself, goes when it is switched off, and follows the style, as the window shows it.

See full_job.py for how it is run. Beside this file: scene.ply, photo.jpg, cameras.json.
"""

# ruff: noqa: F821 - the driver provides view3d, sidebar and shot

import os
import sys
import time

import bpy
import cv2
import numpy as np

HERE = os.path.dirname(__file__)


def in_view(operator, *args, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def job():
    return sys.modules["bl_ext.user_default.gssmc.gssmc_addon.jobs.slot"].active()


def viewport(name):
    """The viewport's pixels as the X server has them."""
    shot(name)
    _, _, region, _, _ = view3d()
    picture = cv2.imread(os.path.join(HERE, name)).astype(float)
    top = picture.shape[0] - region.y - region.height
    return picture[top + 100 : top + region.height - 100, region.x + 200 : region.x + region.width - 400]


def steps():
    _, _, _, space, _ = view3d()
    space.show_region_ui = True
    yield 1.0
    sidebar("GS-SMC")
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    in_view(bpy.ops.gssmc.import_splats, filepath=HERE + "/scene.ply", show_colours=False)
    bpy.context.scene.gssmc.splat.gssmc.show_as = "BOX"
    in_view(bpy.ops.gssmc.add_photo, filepath=HERE + "/photo.jpg", camera="NEW", camera_file=HERE + "/cameras.json")
    yield 2.0
    before = viewport("extra-p1-photo.png")
    own = bpy.context.window_manager.gssmc.preview
    own.style = "DIFFERENCE"  # what Blender's default layout shows without a switch to be found first
    in_view(bpy.ops.gssmc.preview, "INVOKE_DEFAULT")
    begun = time.time()
    while job() and time.time() - begun < 60:
        yield 0.2
    yield 2.0
    behind = viewport("extra-p2-behind.png")
    assert np.abs(behind - before).mean() > 5, "the preview must stand behind the camera"
    own.background = False
    yield 2.0
    after = viewport("extra-p3-switched-off.png")
    assert np.abs(after - before).mean() < 0.5, "switching it off must bring the photo back"
    own.background = True
    yield 2.0
    assert np.abs(viewport("extra-p4-on-again.png") - behind).mean() < 0.5
    in_view(bpy.ops.gssmc.preview, background=False)
    yield 2.0
    assert np.abs(viewport("extra-p5-operator.png") - before).mean() < 0.5
    own.style = "FLICKER"
    assert own.flicker, "the style that is chosen is the one that shows"
    yield 2.0
    own.style = "MATCHES"
    yield 1.0
    begun = time.time()
    while job() and time.time() - begun < 60:
        yield 0.2
    assert "matches sit" in bpy.context.window_manager.gssmc.message, "chosen and made, without another press"
    yield 1.0
    assert np.abs(viewport("extra-p6-matches.png") - before).mean() < 0.5, "no double picture stands in the viewport"
