"""A place for composites: a plate of spots, its camera with a bent lens, and a box and a floor that CG stands behind and on.

Everything is exact: the camera and the proxy are made, not solved, and what a pixel shows follows from OpenCV's lens model.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from samples import write_ply

WIDTH, HEIGHT = 240, 180
FX, FY, CX, CY = 189.4, 188.8, 121.5, 88.7
DIST = np.array([-0.11, 0.045, 0.0008, -0.0006, 0.0])
BOX = (np.array([-0.9, -0.3, 2.6]), np.array([0.1, 0.9, 3.2]))  # x right, y down, z away from the camera
FLOOR = 0.9
BALL, RADIUS = np.array([0.15, 0.35, 3.6]), 0.45


@dataclass(frozen=True)
class Place:
    """`plate` (H, W, 3) 8 bits, RGB; the camera stands at the origin of the splat's coordinates and looks along z."""

    scene: object
    proxy: object
    plate: np.ndarray


def matrix():
    """K for OpenCV's pixels."""
    return np.array([[FX, 0, CX - 0.5], [0, FY, CY - 0.5], [0, 0, 1.0]])


def rays():
    """Directions (H * W, 3) that the pixels see, by OpenCV."""
    grid = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1).reshape(-1, 1, 2).astype(np.float64)
    seen = cv2.undistortPoints(grid, matrix(), DIST).reshape(-1, 2)
    return np.column_stack([seen, np.ones(len(seen))])


def pixels(points):
    """Where points (N, 3) in front of the camera are seen (N, 2), in OpenCV's pixels."""
    return cv2.projectPoints(np.asarray(points, np.float64), np.zeros(3), np.zeros(3), matrix(), DIST)[0].reshape(-1, 2)


def ball_masks():
    """(H, W) where the ball is seen when nothing hides it, and where it is seen behind the box and above the floor."""
    d = rays()
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    along = d @ BALL
    under = along**2 - (BALL @ BALL - RADIUS**2)
    ball = np.where(under > 0, along - np.sqrt(np.maximum(under, 0)), np.inf)
    with np.errstate(divide="ignore"):
        near, far = BOX[0] / d, BOX[1] / d
        floor = np.where(d[:, 1] > 0, FLOOR / d[:, 1], np.inf)
    enter, leave = np.minimum(near, far).max(axis=1), np.maximum(near, far).min(axis=1)
    box = np.where((enter < leave) & (leave > 0), enter, np.inf)
    whole = np.isfinite(ball).reshape(HEIGHT, WIDTH)
    return whole, ((ball < box) & (ball < floor)).reshape(HEIGHT, WIDTH) & whole


def solved(bpy, extension, scene, size=None):
    """Keeps the scene camera as solved where it stands, with the lens it has; `size` of its photo where Blender tells none."""
    bpy.context.view_layer.update()
    bridge, record = extension("gssmc_addon.camera.bridge"), extension("gssmc_addon.camera.record")
    camera, splat = scene.camera, scene.gssmc.splat
    size = size or camera.data.gssmc.photo.size[:]
    found = bridge.read_camera(scene, camera, splat).at_size(*size)
    bridge.write_camera(scene, camera, splat, found)
    known = record.SolvedCamera(found, "trusted", ("Made.",), 1, 0.0, "CALIBRATED", 3.0)
    extension("gssmc_addon.camera.solution").keep(scene, camera, splat, known)


def make_place(bpy, extension, folder, splat_file):
    """The place, with its plate in `folder`."""
    spots = np.random.default_rng(3).integers(0, 256, (HEIGHT // 6, WIDTH // 6, 3)).astype(np.uint8)
    plate = cv2.resize(spots, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(folder / "plate.png"), plate[..., ::-1])
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Y_DOWN")
    bpy.ops.gssmc.add_photo(filepath=str(folder / "plate.png"), camera="NEW")
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    geometry = extension("core.geometry.camera")
    camera = geometry.Camera(geometry.Intrinsics(WIDTH, HEIGHT, FX, FY, CX, CY, tuple(DIST)), geometry.Pose())
    extension("gssmc_addon.camera.bridge").write_camera(scene, scene.camera, scene.gssmc.splat, camera)
    solved(bpy, extension, scene)
    floor = (np.array([-6, FLOOR, 0.5]), np.array([6, FLOOR + 0.1, 9]))
    proxy = add_mesh(bpy, scene, "proxy", *_boxes([BOX, floor]))
    proxy.gssmc.proxy_of, proxy.gssmc.proxy_use = scene.gssmc.splat, "SHADOW_CATCHER"
    return Place(scene, proxy, plate)


def add_mesh(bpy, scene, name, vertices, faces):
    """A mesh object in the splat's coordinates."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    obj = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(obj)
    obj.parent = scene.gssmc.splat
    return obj


def add_ball(bpy, scene, centre, radius, material, rings=32):
    """A ball in the splat's coordinates, of twice as many parts around as `rings`."""
    parts = 2 * rings
    points = [
        (radius * math.sin(a) * math.cos(b), radius * math.cos(a), radius * math.sin(a) * math.sin(b))
        for a in np.linspace(0, math.pi, rings + 1)
        for b in np.linspace(0, 2 * math.pi, parts, endpoint=False)
    ]
    faces = [
        (r * parts + p, r * parts + (p + 1) % parts, (r + 1) * parts + (p + 1) % parts, (r + 1) * parts + p)
        for r in range(rings)
        for p in range(parts)
    ]
    obj = add_mesh(bpy, scene, "ball", points, faces)
    obj.location = centre
    obj.data.materials.append(material)
    return obj


def material(bpy, shader, color):
    """A material of one shader: "Emission" or "BsdfDiffuse"."""
    made = bpy.data.materials.new(shader)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    out, light = nodes.new("ShaderNodeOutputMaterial"), nodes.new(f"ShaderNode{shader}")
    light.inputs["Color"].default_value = (*color, 1)
    made.node_tree.links.new(light.outputs[0], out.inputs["Surface"])
    return made


def add_light(bpy, scene):
    """A lamp above the ball, in the splat's coordinates."""
    lamp = bpy.data.lights.new("lamp", "AREA")
    lamp.energy, lamp.size = 80, 0.4
    obj = bpy.data.objects.new("lamp", lamp)
    scene.collection.objects.link(obj)
    obj.parent, obj.location, obj.rotation_euler = scene.gssmc.splat, (0.4, -2.5, 3.4), (math.pi / 2, 0, 0)


def render(bpy, scene, path, samples=8):
    """F12, as (H, W, 3) of 8 bits, RGB."""
    if scene.render.engine == "CYCLES":
        scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.render.filepath, scene.render.image_settings.file_format = str(path), "PNG"
    bpy.ops.render.render(write_still=True)
    return cv2.imread(str(path))[..., ::-1].astype(int)


def _boxes(boxes):
    vertices, faces = [], []
    for low, high in boxes:
        k = len(vertices)
        vertices += [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        faces += [tuple(k + i for i in side) for side in sides]
    return vertices, faces


PLAIN = {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}


def dump(block):
    """Every plain value of a data-block or a part of one, and the name of each data-block that it points at."""
    out = {}
    for prop in block.bl_rna.properties:
        name = prop.identifier
        if prop.type in PLAIN and not prop.is_readonly:
            value = getattr(block, name)
            out[name] = tuple(value) if hasattr(value, "__len__") and not isinstance(value, str | set) else value
        elif prop.type == "POINTER" and name != "rna_type":
            other = getattr(block, name)
            out[name] = getattr(other, "name", other is not None)
    return out


def everything(bpy, scene):
    """All that a composite might touch: settings, objects, cameras with their keys, compositor, and what data-blocks exist."""
    out = {"scene": dump(scene), "render": dump(scene.render), "view": dump(scene.view_settings)}
    for obj in bpy.data.objects:
        out[f"object {obj.name}"] = dump(obj)
        out[f"own {obj.name}"] = dump(obj.gssmc)
    for data in bpy.data.cameras:
        out[f"camera {data.name}"] = (dump(data), dump(data.gssmc), [dump(slot) for slot in data.background_images])
    for action in bpy.data.actions:
        bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
        out[f"action {action.name}"] = [dump(p) for bag in bags for c in bag.fcurves for p in c.keyframe_points]
    trees = list(bpy.data.node_groups) + ([scene.node_tree] if bpy.app.version < (5, 0) and scene.node_tree else [])
    for tree in trees:
        links = sorted((k.from_node.name, k.from_socket.name, k.to_node.name, k.to_socket.name) for k in tree.links)
        active = tree.nodes.active
        out[f"tree {tree.name}"] = (active and active.name, links, sorted((n.name, *map(str, n.location)) for n in tree.nodes))
    if hasattr(scene, "compositor_effects"):
        out["effects"] = [dump(effect) for effect in scene.compositor_effects]
    kinds = ("objects", "meshes", "cameras", "node_groups", "collections", "scenes", "movieclips")
    out["count"] = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    out["images"] = sorted(image.name for image in bpy.data.images if image.type not in ("RENDER_RESULT", "COMPOSITING"))
    return out


def own_compositor(bpy, scene):
    """A compositor of the user's: the render, brighter. Its tree."""
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
        tree, out = scene.node_tree, scene.node_tree.nodes["Composite"].inputs[0]
    else:
        tree = bpy.data.node_groups.new("mine", "CompositorNodeTree")
        tree.interface.new_socket(name="Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        out = tree.nodes.new("NodeGroupOutput").inputs[0]
        if hasattr(scene, "compositor_effects"):
            scene.compositor_effects.new(name="mine").node_group = tree
        else:
            scene.compositing_node_group = tree
    layers, gain = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeExposure")
    gain.inputs["Exposure"].default_value = 1.0
    tree.links.new(layers.outputs["Image"], gain.inputs["Image"])
    tree.links.new(gain.outputs["Image"], out)
    return tree


def write_wall(path, depth=3.0):
    """A splat that is a grey wall left of the camera's middle, `depth` in front of it; its edge is at x = 0."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-3, 0, 0.1) + 0.05, np.arange(-2.5, 2.5, 0.1)))
    count = len(x)
    columns = dict(zip("xyz", (x, y, np.full(count, depth)), strict=True))
    columns |= {f"f_dc_{k}": np.full(count, (0.5 - 0.5) / 0.28209479) for k in range(3)}
    columns |= {"opacity": np.full(count, 8.0), "rot_0": np.ones(count)}
    columns |= {f"scale_{k}": np.full(count, math.log(0.08)) for k in range(2)} | {"scale_2": np.full(count, math.log(0.004))}
    columns |= {f"rot_{k}": np.zeros(count) for k in (1, 2, 3)}
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2"]
    names += ["rot_0", "rot_1", "rot_2", "rot_3"]
    return write_ply(path, {name: columns[name].astype(np.float32) for name in names})
