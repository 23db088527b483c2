"""The files that a trial is about: a small room, another scan of the same size, photos with starts, a plate, and a map."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import cv2

from core.cameras.files import camera_to_dict
from core.locate import MapCache, MapPlace, MapSettings
from core.render import Renderer, RenderSettings
from core.splats import read_splats
from core.splats.ply.reader import write_ply
from core.synthetic import make_photo, make_scene, perturb_camera, sample_cameras
from core.synthetic.plate import HandHeld
from core.synthetic.sample import DEPTH, LENS

GAUSSIANS = 20_500  # the least for which views are drawn in processes of their own
SIZE = (240, 180)
PHOTOS, FRAMES, VIEWS = 6, 4, 3
SHOT = HandHeld(count=FRAMES, lens=LENS.resized(*SIZE))
SCAN, OTHER, MAP = "room.ply", "other.ply", "room.ply.gssmc-map"
STARTS, LENSES, FEW = "starts.json", "lenses.json", "few.json"
START_FRAME = 1002
PICTURES = "photos"  # a folder for those who take whole folders


@dataclass(frozen=True)
class Samples:
    """The files, in one folder that no trial changes: each works on a copy."""

    folder: Path

    def copied(self, to: Path) -> None:
        """All files but those of the other scan, with their times."""
        shutil.copytree(self.folder, to, ignore=shutil.ignore_patterns(OTHER))

    @property
    def other(self) -> Path:
        """A scan of as many bytes as the one of the trials, and other Gaussians."""
        return self.folder / OTHER


def make_samples(folder: Path) -> Samples:
    folder.mkdir(parents=True)
    for seed, name in enumerate((SCAN, OTHER)):
        write_ply(folder / name, make_scene(seed, GAUSSIANS))
    scene = read_splats(folder / SCAN)
    renderer = Renderer(scene, RenderSettings(threads=1))
    starts = []
    for number, camera in enumerate(sample_cameras(PHOTOS)):
        name = f"photo_{number}.png"
        truth = replace(camera, intrinsics=camera.intrinsics.resized(*SIZE), file=name)
        cv2.imwrite(str(folder / name), make_photo(renderer, truth, number).pixels[..., ::-1])
        starts.append(camera_to_dict(perturb_camera(truth, 0.1, 2.0, number)))
    (folder / PICTURES).mkdir()
    for number in range(2):
        shutil.copy2(folder / f"photo_{number}.png", folder / PICTURES)
    lenses = [{name: value for name, value in start.items() if name not in ("R", "t")} for start in starts]
    for file, records in ((STARTS, starts), (LENSES, lenses[:4]), (FEW, starts[:3])):
        (folder / file).write_text(json.dumps({"frames": records}))
    for frame in SHOT.frames:
        cv2.imwrite(str(folder / f"plate.{frame:04d}.png"), SHOT.photo(renderer, frame).pixels[..., ::-1])
    near = perturb_camera(SHOT.camera(START_FRAME), 0.03 * DEPTH, 2.0)
    (folder / "start.json").write_text(json.dumps(camera_to_dict(near)))
    for _ in MapCache(scene, MapPlace(folder / SCAN), MapSettings(VIEWS)).steps():
        pass
    assert (folder / MAP).exists()
    return Samples(folder)
