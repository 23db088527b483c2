"""The built-in sample at a small size: a room, photos taken in it, their true cameras and starts a little off."""

import json
from dataclasses import replace

import cv2

from core.cameras.files import camera_to_dict
from core.render import Renderer, RenderSettings
from core.splats.ply.reader import write_ply
from core.synthetic import make_photo, make_scene, perturb_camera, sample_cameras

WIDTH, HEIGHT = 320, 240
QUICK = {"long_side_px": 320, "final": "none", "candidates": 4, "iterations": 3}  # settings that keep the tests short


class Room:
    """`scene` (.ply), `renderer`, and what `take` was asked for, in `folder`."""

    def __init__(self, folder):
        self.folder, self.scene = folder, folder / "room.ply"
        gaussians = make_scene(0)
        write_ply(self.scene, gaussians)
        self.renderer = Renderer(gaussians, RenderSettings())

    def take(self, name, camera, seed=0):
        """Writes a photo of `camera`; its true camera at the photo's size and name."""
        truth = replace(camera, intrinsics=camera.intrinsics.resized(WIDTH, HEIGHT), file=name)
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(path), make_photo(self.renderer, truth, seed).pixels[:, :, ::-1])
        return truth

    def starts(self, name, truths, translation=0.08, degrees=2.0):
        """A camera file of starts that are off."""
        off = [perturb_camera(truth, translation, degrees, seed) for seed, truth in enumerate(truths)]
        path = self.folder / name
        path.write_text(json.dumps({"frames": [camera_to_dict(camera) for camera in off]}))
        return path


def photos(folder, count=3):
    """A room with `count` photos and their starts: (room, truths, camera file)."""
    room = Room(folder)
    truths = [room.take(f"photos/p{k}.png", camera, k) for k, camera in enumerate(sample_cameras()[:count])]
    truths = [replace(truth, file=f"p{k}.png") for k, truth in enumerate(truths)]
    return room, truths, room.starts("starts.json", truths)
