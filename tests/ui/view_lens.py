"""Cameras made at the current view show what the view showed, in the real window: against RegionView3D's own matrices.

See full_job.py for how it is run. Beside this file: photo.jpg, tall.jpg.
"""

# ruff: noqa: F821 - the driver provides view3d and shot

import os
from itertools import product

import bpy
import numpy as np
from mathutils import Quaternion, Vector

HERE = os.path.dirname(__file__)
LIMIT_PX = 0.01
POINTS = [Vector(p) for p in product((-0.6, 0.3), (-0.5, 0.4), (-0.3, 0.7))]


def in_view(operator, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(**kwargs)


def turn(lens, degrees):
    _, _, _, space, _ = view3d()
    space.lens = lens
    view = space.region_3d
    view.view_perspective = "PERSP"
    view.view_location, view.view_distance = (0.1, -0.2, 0.3), 6.0
    view.view_rotation = Quaternion((0.8, 0.3, 0.5), np.radians(degrees))
    view.update()


def seen(matrix, size):
    """Where POINTS lie in pixels of a picture, from its middle; `matrix`: world to clip space."""
    clip = [matrix @ p.to_4d() for p in POINTS]
    return np.array([(c.x / c.w * size[0] / 2, c.y / c.w * size[1] / 2) for c in clip])


def through_camera(size):
    """As Blender itself renders a picture of `size`, fitted into the render's frame."""
    scene = bpy.context.scene
    camera, render = scene.camera, scene.render
    frame = np.array([render.resolution_x, render.resolution_y], float)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = camera.calc_matrix_camera(depsgraph, x=int(frame[0]), y=int(frame[1]))
    return seen(projection @ camera.matrix_world.inverted(), frame) / (frame / size).min()


def check(tag, size, made):
    _, _, region, space, _ = view3d()
    there = np.array([region.width, region.height], float)
    wanted = seen(space.region_3d.perspective_matrix.copy(), there) / (there / size).min()
    made()
    bpy.context.view_layer.update()
    off = np.abs(through_camera(size) - wanted).max()
    print(f"{tag}: lens {bpy.context.scene.camera.data.lens:.2f} mm, largest difference {off:.5f} px", flush=True)
    assert off < LIMIT_PX, (tag, off)


def steps():
    view3d()[3].show_region_ui = False
    yield 1.0
    render = bpy.context.scene.render
    for lens, degrees, (width, height) in ((50.0, 70, (1920, 1080)), (24.0, 40, (700, 1000))):
        render.resolution_x, render.resolution_y = width, height
        for name, size in (("photo.jpg", (640, 480)), ("tall.jpg", (300, 500))):
            for fill in (False, True):
                turn(lens, degrees)
                yield 0.5
                options = {"filepath": f"{HERE}/{name}", "camera": "NEW", "set_resolution": fill}
                check(f"{name} {lens} {fill}", np.array(size), lambda o=options: in_view(bpy.ops.gssmc.add_photo, **o))
        turn(lens, degrees)
        yield 0.5
        frame = np.array([render.resolution_x, render.resolution_y])
        check(f"frame {lens}", frame, lambda: in_view(bpy.ops.gssmc.camera_from_view, new=True))
    yield 1.0
