"""CG in the sample's photo: is the plate untouched, the CG cut off and bent as it has to be, and is there a shadow.

    .venv/bin/python benchmarks/composite.py [--engines CYCLES EEVEE] [--proxies exact made] [--samples 32]

The built-in sample at 640 x 480 with its true camera, so that errors are those of the composite alone. A ball stands half
behind the chest. "exact": the proxy is the room's own boxes, floor and wall; "made": it is what Make Proxy makes of the splat.

plate: largest difference of F12 without CG from the photo, of 255. wrong: pixels of the ball, of those that it would cover if
nothing hid it, that show although they are hidden or the other way round: by the room's own shapes, and by what the photo
shows, in which a pixel is hidden where the Gaussians of the things before the ball cover more than half of it. shadow: pixels
beside the ball that get darker by more than 8 of 255. lens: how far 63 small dots all over the picture are from where the lens
model has them, the largest distance in pixels. Run it with the Python of another Blender (.venv45, .venv53) for that one.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / part) for part in ("", "scripts", "tests/core/support", "tests/addon/inside")]

import shots
from blender_demo import enable_extension

from core.cameras.files import read_cameras
from core.pictures.through_lens import render_through_lens
from core.render import Renderer, RenderSettings
from core.splats import GaussianScene
from core.synthetic import make_scene, write_sample
from core.synthetic.room import BALLS, BOXES, HULL

BALL, RADIUS = np.array([0.45, 1.02, 3.5]), 0.28
DOT_PX, DOT_DEPTH = 3.5, 2.0
DARKER = 8
THICK = 0.02  # scene units: Gaussians so near to a thing are its own
COLUMNS = ("engine", "proxy", "plate", "wrong %, shapes", "wrong %, photo", "shadow px", "lens px", "s a picture")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=["CYCLES", "EEVEE"])
    parser.add_argument("--proxies", nargs="+", default=["exact", "made"], choices=["exact", "made"])
    parser.add_argument("--samples", type=int, default=32)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        enable_extension(Path(folder))
        sample = write_sample(Path(folder) / "sample")
        pairs = [(engine, proxy) for engine in options.engines for proxy in options.proxies]
        rows = [Trial(sample, Path(folder), engine, options.samples).run(proxy) for engine, proxy in pairs]
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))  # below what Blender prints
    for row in rows:
        print("| " + " | ".join(row) + " |")
    return 0


class Trial:
    """One scene: the sample with its true camera, kept as solved."""

    def __init__(self, sample: Any, folder: Path, engine: str, samples: int) -> None:
        import bpy

        self.bpy, self.folder = bpy, folder
        bpy.ops.wm.read_homefile(use_empty=True)
        bpy.ops.gssmc.import_splats(filepath=str(sample.scene))
        bpy.ops.gssmc.add_photo(filepath=str(sample.photo), camera="NEW", camera_file=str(sample.truth))
        self.scene, self.photo = bpy.context.scene, cv2.imread(str(sample.photo))[..., ::-1].astype(int)
        self.truth, self.splat = read_cameras(sample.truth)[0], self.scene.gssmc.splat
        self.lens = self.truth.intrinsics
        keep_as_solved(self.scene, self.lens.width, self.lens.height)
        if engine == "EEVEE":
            self.scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"
            self.scene.eevee.taa_render_samples = samples
        else:
            self.scene.render.engine = engine
            self.scene.cycles.samples, self.scene.cycles.use_denoising = samples, False
        self.engine = engine

    def run(self, proxy: str) -> list[str]:
        if proxy == "made":
            self.bpy.ops.gssmc.make_proxy()
        else:
            self.add_exact_proxy()
        self.add_lamp()
        self.bpy.ops.gssmc.set_up_composite()
        plate = int(np.abs(self.render() - self.photo).max())
        ball = self.add_ball(BALL, RADIUS, shots.material(self.bpy, "BsdfDiffuse", (0.8, 0.3, 0.1)))
        began = time.perf_counter()
        lit = self.render()
        seconds = time.perf_counter() - began
        whole, visible = self.masks()
        near = cv2.dilate(whole.astype(np.uint8), np.ones((5, 5))).astype(bool)
        shadow = int((((self.photo - lit).min(axis=2) > DARKER) & ~near).sum())
        shown = self.coverage([ball]) > 0.5
        wrong = [100 * (shown != truth)[near].sum() / whole.sum() for truth in (visible, whole & ~self.hidden_in_photo())]
        self.bpy.data.objects.remove(ball)
        return [
            self.engine,
            proxy,
            f"{plate}",
            *(f"{w:.2f}" for w in wrong),
            f"{shadow}",
            f"{self.lens_error():.3f}",
            f"{seconds:.1f}",
        ]

    def coverage(self, balls: list[Any]) -> np.ndarray:
        """How much of each pixel (H, W) the balls cover: they are rendered bright and black, and what differs are the balls."""
        pictures = []
        for value in (1.0, 0.0):
            material = shots.material(self.bpy, "Emission", (value,) * 3)
            for ball in balls:
                ball.data.materials[0] = material
            pictures.append(to_light(self.render()).mean(axis=2))
        return (pictures[0] - pictures[1]) / max(1e-6, float((pictures[0] - pictures[1]).max()))

    def lens_error(self) -> float:
        """The largest distance, in pixels, of a dot from where the lens model has it."""
        x, y = np.linspace(8, self.lens.width - 8, 9), np.linspace(8, self.lens.height - 8, 7)
        targets = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        rays = np.column_stack([self.lens.normalise(targets), np.ones(len(targets))]) * DOT_DEPTH
        for obj in [o for o in self.scene.objects if o.type == "MESH"]:
            obj.hide_render = True
        radius = DOT_PX / self.lens.focal * DOT_DEPTH
        places = (rays - self.truth.pose.t) @ self.truth.pose.R
        light = self.coverage(
            [self.add_ball(place, radius, shots.material(self.bpy, "Emission", (1, 1, 1))) for place in places]
        )
        yy, xx = np.mgrid[: self.lens.height, : self.lens.width] + 0.5
        worst = 0.0
        for u, v in targets:
            weights = light * (np.hypot(xx - u, yy - v) < 3 * DOT_PX)
            found = (weights * xx).sum() / weights.sum(), (weights * yy).sum() / weights.sum()
            worst = max(worst, float(np.hypot(found[0] - u, found[1] - v)))
        return worst

    def masks(self) -> tuple[np.ndarray, np.ndarray]:
        """(H, W) what the ball would cover if nothing hid it, and what of it the room's own shapes leave to see."""
        k, pose = self.lens, self.truth.pose
        x, y = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        rays = np.column_stack([k.normalise(np.stack([x.ravel(), y.ravel()], axis=1)), np.ones(x.size)]) @ pose.R
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        ball = hit_ball(pose.centre, rays, BALL, RADIUS)
        room = np.minimum.reduce([hit_ball(pose.centre, rays, np.array(c), r) for c, r in BALLS])
        for low, high in BOXES.values():
            room = np.minimum(room, hit_box(pose.centre, rays, np.array(low), np.array(high)))
        shape = (k.height, k.width)
        return np.isfinite(ball).reshape(shape), (ball < room).reshape(shape)

    def hidden_in_photo(self) -> np.ndarray:
        """(H, W) where the photo, which was drawn from the splat, shows something that stands before the ball."""
        scene = make_scene(0)
        means = scene.means
        inside = [np.linalg.norm(means - np.array(c), axis=1) < r + THICK for c, r in BALLS]
        inside += [
            ((means > np.array(low) - THICK) & (means < np.array(high) + THICK)).all(axis=1) for low, high in BOXES.values()
        ]
        before = self.truth.pose.transform(means)[:, 2] < self.truth.pose.transform(BALL[None])[0, 2]
        kept = np.any(inside, axis=0) & before & (means[:, 1] < HULL[1][1] - THICK)
        white = np.zeros_like(scene.sh[kept])
        white[:, 0] = 0.5 / 0.28209479
        things = GaussianScene(means[kept], scene.scales[kept], scene.rotations[kept], scene.opacities[kept], white)
        return render_through_lens(Renderer(things, RenderSettings()), self.truth, 2).mean(axis=2) > 0.5

    def render(self) -> np.ndarray:
        """F12 (H, W, 3) of 8 bits."""
        render = self.scene.render
        render.image_settings.file_format, render.filepath = "PNG", str(self.folder / "f12.png")
        self.bpy.ops.render.render(write_still=True)
        return cv2.imread(render.filepath)[..., ::-1].astype(int)

    def add_mesh(self, name: str, vertices: list[Any], faces: list[Any]) -> Any:
        mesh = self.bpy.data.meshes.new(name)
        mesh.from_pydata(vertices, [], faces)
        return self.place(self.bpy.data.objects.new(name, mesh))

    def place(self, obj: Any) -> Any:
        """Into the scene, in the splat's coordinates."""
        self.scene.collection.objects.link(obj)
        obj.parent = self.splat
        return obj

    def add_exact_proxy(self) -> None:
        low, high = HULL
        thin = 0.05
        floor = ((low[0], high[1], low[2]), (high[0], high[1] + thin, high[2]))
        wall = ((low[0], low[1], high[2]), (high[0], high[1], high[2] + thin))
        vertices, faces = [], []
        for a, b in [*BOXES.values(), floor, wall]:
            k = len(vertices)
            vertices += [(x, y, z) for x in (a[0], b[0]) for y in (a[1], b[1]) for z in (a[2], b[2])]
            sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
            faces += [tuple(k + i for i in side) for side in sides]
        proxy = self.add_mesh("exact", vertices, faces)
        proxy.gssmc.proxy_of, proxy.gssmc.proxy_use = self.splat, "SHADOW_CATCHER"

    def add_ball(self, centre: np.ndarray, radius: float, material: Any) -> Any:
        rows, columns = 24, 48
        up, around = np.linspace(0, np.pi, rows + 1)[:, None], np.linspace(0, 2 * np.pi, columns, endpoint=False)
        points = np.stack(np.broadcast_arrays(np.sin(up) * np.cos(around), np.cos(up), np.sin(up) * np.sin(around)), axis=-1)
        index = np.arange((rows + 1) * columns).reshape(rows + 1, columns)
        right = np.roll(index, -1, axis=1)
        faces = np.stack([index[:-1], right[:-1], right[1:], index[1:]], axis=-1).reshape(-1, 4)
        ball = self.add_mesh("ball", (radius * points.reshape(-1, 3)).tolist(), faces.tolist())
        ball.location = centre
        ball.data.materials.append(material)
        return ball

    def add_lamp(self) -> None:
        lamp = self.bpy.data.lights.new("lamp", "AREA")
        lamp.energy, lamp.size = 60, 0.6
        obj = self.place(self.bpy.data.objects.new("lamp", lamp))
        obj.location, obj.rotation_euler = (0.2, -1.1, 2.6), (np.pi / 2, 0, 0)


def keep_as_solved(scene: Any, width: int, height: int) -> None:
    """The scene camera, where it stands, becomes a solved one."""
    import bpy
    from bl_ext.user_default.gssmc.gssmc_addon.camera import bridge, record, solution

    bpy.context.view_layer.update()
    found = bridge.read_camera(scene, scene.camera, scene.gssmc.splat).at_size(width, height)
    known = record.SolvedCamera(found, "trusted", ("The true camera.",), 1, 0.0, "CALIBRATED", 3.2)
    solution.keep(scene, scene.camera, scene.gssmc.splat, known)


def to_light(values: np.ndarray) -> np.ndarray:
    """sRGB of 0..255 to linear light."""
    share = values / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def hit_ball(eye: np.ndarray, rays: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """Distance (N,) along unit rays (N, 3), infinite where they miss."""
    away = eye - centre
    along = rays @ away
    under = along**2 - (away @ away - radius**2)
    return np.where(under > 0, -along - np.sqrt(np.maximum(under, 0)), np.inf)


def hit_box(eye: np.ndarray, rays: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """As `hit_ball`."""
    with np.errstate(divide="ignore"):
        a, b = (low - eye) / rays, (high - eye) / rays
    enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    return np.where((enter < leave) & (leave > 0), enter, np.inf)


if __name__ == "__main__":
    sys.exit(main())
