"""Cameras in the sample room, photos taken with them, and the files of the demo."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from ..cameras.files import camera_to_dict
from ..geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ..geometry.lie import so3_exp
from ..photos.photo import Photo
from ..pictures.through_lens import render_through_lens
from ..render import Renderer, RenderSettings
from ..render.view import ViewRenderer
from ..splats.ply.reader import write_ply
from .room import make_scene

LENS = Intrinsics(640, 480, 505.0, 503.5, 324.0, 236.5, (-0.11, 0.045, 0.0008, -0.0006, 0.0))
DEPTH = 3.2  # about the median depth of the sample views, scene units
SUPERSAMPLE = 2
GAIN = np.array([0.9, 0.84, 0.78])  # warmer and darker than the scan
GAMMA = 1.12
BLUR_PX = 0.6
NOISE = 0.012
START_RATIO, START_DEG = 0.12, 8.0  # how far off the demo starts


@dataclass(frozen=True)
class SampleFiles:
    """What `write_sample` wrote: splat, photo, the wrong start, and the true camera."""

    scene: Path
    photo: Path
    start: Path
    truth: Path


def sample_cameras(count: int = 6) -> list[Camera]:
    """`count` cameras that look into the room from different places, all with the lens of the sample."""
    out = []
    for k in range(count):
        turn = 2 * np.pi * k / count
        centre = np.array([0.55 * np.sin(turn), -0.12 + 0.16 * np.cos(2 * turn), 0.1 + 0.35 * np.cos(turn)])
        out.append(Camera(LENS, look_at(centre, np.array([0.15 * np.cos(turn), 0.22, 3.4])), f"sample_{k}.jpg"))
    return out


def look_at(centre: FloatArray, target: FloatArray) -> Pose:
    """The pose of a level camera at `centre` that looks at `target`."""
    z = target - centre
    z = z / np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return Pose.from_centre(np.stack([x, np.cross(z, x), z]), centre)


def make_photo(renderer: ViewRenderer, camera: Camera, seed: int = 0) -> Photo:
    """A photo of the scene as a real camera would take it: light averaged over each pixel, the lens bends it, exposure and
    white balance are its own, slightly blurred, noisy, 8 bits.
    """
    color = np.clip(render_through_lens(renderer, camera, SUPERSAMPLE), 0, 1)
    exposed = (GAIN * color**GAMMA).astype(np.float32)
    blurred = cv2.GaussianBlur(exposed, (0, 0), BLUR_PX)
    grain = np.random.default_rng(seed).normal(0, NOISE, blurred.shape)
    return Photo(np.clip((blurred + grain) * 255 + 0.5, 0, 255).astype(np.uint8), camera.file)


def perturb_camera(camera: Camera, translation: float, rotation_deg: float, seed: int = 0) -> Camera:
    """`camera` moved by `translation` (scene units) and turned by `rotation_deg`, both exactly, in random directions."""
    rng = np.random.default_rng(seed)
    way, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    R = so3_exp(np.radians(rotation_deg) * axis) @ camera.pose.R
    return replace(camera, pose=Pose.from_centre(R, camera.pose.centre + translation * way))


def write_sample(folder: Path, seed: int = 0) -> SampleFiles:
    """Writes room.ply, photo.jpg, start.json and truth.json into `folder`, which is made if need be."""
    folder.mkdir(parents=True, exist_ok=True)
    files = SampleFiles(folder / "room.ply", folder / "photo.jpg", folder / "start.json", folder / "truth.json")
    scene = make_scene(seed)
    write_ply(files.scene, scene)
    truth = replace(sample_cameras()[1], file=files.photo.name)
    photo = make_photo(Renderer(scene, RenderSettings()), truth, seed)
    cv2.imwrite(str(files.photo), photo.pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
    start = perturb_camera(truth, START_RATIO * DEPTH, START_DEG, seed + 2)
    for path, camera in ((files.start, start), (files.truth, truth)):
        path.write_text(json.dumps(camera_to_dict(camera), indent=1) + "\n")
    return files
