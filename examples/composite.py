"""The finished picture of the built-in sample, without a window: a ball stands in the photographed room, half behind the chest.

blender -b --python-exit-code 1 --python examples/composite.py -- OUT_FOLDER
python examples/composite.py OUT_FOLDER            with Blender as a Python module (bpy)

Scan and photo are made in OUT_FOLDER where they are not there yet; the picture is OUT_FOLDER/composite.png, the scene
OUT_FOLDER/composite.blend. The extension must be installed.
"""

import argparse
import math
import sys
from pathlib import Path

import addon_utils
import bpy

EXTENSION = "bl_ext.user_default.gssmc"
# In the scan's coordinates: x right, y down, z into the room, metres.
FLOOR, BALL, RADIUS = 1.3, (0.45, 1.02, 3.5), 0.28
QUICK = {"faces": 20_000, "long_side_px": 400}
LAMP = (0.2, -1.1, 2.6)


def main() -> None:
    options = parse_arguments()
    if addon_utils.enable(EXTENSION) is None:
        raise SystemExit("The GS-SMC extension is not installed; install its zip first (README).")
    sample = make_sample(options.out.resolve())
    print(make_picture(sample, options.out.resolve(), options.samples, options.quick))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="composite.py", description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--samples", type=int, default=64, help="of Cycles, for each pixel (64)")
    parser.add_argument("--quick", action="store_true", help="the known camera and a coarse proxy, to try it out")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])


def make_sample(folder: Path) -> Path:
    """The folder with room.ply and photo.jpg in it."""
    if not (folder / "room.ply").exists():
        from bl_ext.user_default.gssmc.core.synthetic import write_sample

        write_sample(folder)
    return folder


def make_picture(sample: Path, out: Path, samples: int, quick: bool = False) -> str:
    """From scan and photo to composite.png: what an artist does with five buttons. Returns the camera's verdict."""
    scene = bpy.context.scene
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.gssmc.import_splats(filepath=str(sample / "room.ply"))
    start = sample / ("truth.json" if quick else "start.json")
    bpy.ops.gssmc.add_photo(filepath=str(sample / "photo.jpg"), camera="NEW", camera_file=str(start))
    if not quick:
        bpy.ops.gssmc.refine()  # Without a start: find_camera()
    bpy.ops.gssmc.make_proxy(**(QUICK if quick else {}))
    add_ball(scene)
    add_light(scene)
    scene.render.engine, scene.cycles.samples = "CYCLES", samples
    bpy.ops.gssmc.set_up_composite()
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(out / "composite.png")
    bpy.ops.render.render(write_still=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(out / "composite.blend"))
    return scene.camera.data.gssmc.verdict


def add_ball(scene: bpy.types.Scene) -> None:
    """A glossy ball on the floor. A child of the splat has the scan's coordinates, wherever the splat stands."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=RADIUS)
    ball = bpy.context.object
    ball.parent, ball.location = scene.gssmc.splat, BALL
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("ball")
    if material.node_tree is None:  # before Blender 5.0
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.04, 0.2, 0.8, 1)
    shader.inputs["Roughness"].default_value = 0.35
    ball.data.materials.append(material)


def add_light(scene: bpy.types.Scene) -> None:
    """A lamp below the ceiling, and some light from everywhere."""
    lamp = bpy.data.lights.new("lamp", "AREA")
    lamp.energy, lamp.size = 60, 0.5
    obj = bpy.data.objects.new("lamp", lamp)
    scene.collection.objects.link(obj)
    obj.parent, obj.location, obj.rotation_euler = scene.gssmc.splat, LAMP, (math.pi / 2, 0, 0)
    scene.world = scene.world or bpy.data.worlds.new("world")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (0.9, 0.95, 1, 1), 0.12


if __name__ == "__main__":
    main()
