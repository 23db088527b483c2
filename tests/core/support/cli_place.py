"""A small place with photos, as files, and a way to make single photos hurt the process that reads them."""

import json
import textwrap
from dataclasses import replace

import cv2

from core.cameras.files import camera_to_dict
from core.render import Renderer, RenderSettings
from core.splats.ply.reader import write_ply
from core.synthetic import make_photo, make_scene, perturb_camera, sample_cameras

FAST = ["--long-side-px", "240", "--iterations", "2", "--candidates", "3"]
SIZE = (240, 180)


class Place:
    """Files in one folder: scene.ply, photo_0.png ..., and `starts`, a rough camera for each photo."""

    def __init__(self, folder, photos=3, gaussians=12_000):
        self.folder = folder
        self.scene = folder / "scene.ply"
        scene = make_scene(0, gaussians)
        write_ply(self.scene, scene)
        renderer = Renderer(scene, RenderSettings(threads=1))
        cameras = sample_cameras(photos)
        self.truths = [replace(c, intrinsics=c.intrinsics.resized(*SIZE), file=f"photo_{i}.png") for i, c in enumerate(cameras)]
        for i, truth in enumerate(self.truths):
            cv2.imwrite(str(folder / truth.file), make_photo(renderer, truth, i).pixels[..., ::-1])
        self.starts = [perturb_camera(truth, 0.1, 2.0, i) for i, truth in enumerate(self.truths)]

    def json(self, path, cameras, **more):
        """Writes camera JSON with the documented keys; `more` overrides keys of every camera."""
        dicts = [camera_to_dict(c) | more for c in cameras]
        path.write_text(json.dumps(dicts[0] if len(dicts) == 1 else {"frames": dicts}))
        return str(path)


def hurt_readers(folder, monkeypatch):
    """From now on a photo with 'killer' in its name ends the worker that reads it, one with 'slow' hangs it.

    Done by a sitecustomize that workers import from the search path they inherit; every worker leaves its id in `folder`.
    """
    folder.mkdir(exist_ok=True)
    (folder / "sitecustomize.py").write_text(
        textwrap.dedent(f"""
        import os, pathlib, sys, time
        if any("worker" in a for a in sys.orig_argv):
            import core.batch.refine_one as module
            pathlib.Path({str(folder)!r}, f"{{os.getpid()}}.pid").touch()
            read = module.read_photo
            def read_photo(path):
                if "killer" in str(path):
                    os.abort()
                while "slow" in str(path) and pathlib.Path({str(folder)!r}, "hang").exists():
                    time.sleep(0.05)
                return read(path)
            module.read_photo = read_photo
        """)
    )
    monkeypatch.syspath_prepend(str(folder))
