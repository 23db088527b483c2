"""The scripts of this folder, each in a Blender window of its own (run.sh); they assert, and leave screenshots to look at."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
import window

from core.cameras.files import camera_to_dict
from core.geometry.camera import Pose
from core.render import Renderer, RenderSettings
from core.synthetic import make_photo, make_scene, perturb_camera, sample_cameras, write_sample

REPO = Path(__file__).parents[2]
NOT_SCRIPTS = {"driver", "window", "conftest", "test_windows"}
SCRIPTS = sorted(path for path in Path(__file__).parent.glob("*.py") if path.stem not in NOT_SCRIPTS)
SHOTS = os.environ.get("GSSMC_UI_SHOTS")
PLATE_FRAMES, PLATE_STEP = range(12, 21), 0.02  # frame numbers; how far the camera goes from frame to frame


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """The extension without wheels: the chroot's Python has what they would bring."""
    out = tmp_path_factory.mktemp("dist")
    build = [sys.executable, str(REPO / "tools" / "build_extension.py"), "--no-wheels", "--out", str(out)]
    subprocess.run(build, check=True, capture_output=True)
    return next(out.glob("*.zip"))


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """What may lie beside a script: the built-in sample under the names the scripts use, photos, and a moving plate."""
    folder = tmp_path_factory.mktemp("files")
    sample = write_sample(folder / "sample")
    shutil.copy(sample.scene, folder / "scene.ply")
    shutil.copy(sample.photo, folder / "photo.jpg")
    shutil.copy(sample.start, folder / "cameras.json")
    cv2.imwrite(str(folder / "tall.jpg"), cv2.rotate(cv2.imread(str(sample.photo)), cv2.ROTATE_90_CLOCKWISE))
    renderer = Renderer(make_scene(0), RenderSettings())
    write_photos(folder, renderer)
    write_plate(folder, renderer)
    return sorted(path for path in folder.iterdir() if path.name != "sample")


def write_photos(folder, renderer):
    """Four photos, a file that is none, and starts that are a little off."""
    (folder / "photos").mkdir()
    starts = []
    for index, camera in enumerate(sample_cameras()[:4]):
        truth = replace(camera, file=f"p{index}.png")
        write_picture(folder / "photos" / truth.file, renderer, truth, index)
        starts.append(camera_to_dict(perturb_camera(truth, 0.08, 2.0, index)))
    (folder / "photos" / "short.png").write_bytes((folder / "photos" / "p0.png").read_bytes()[:3000])
    (folder / "starts.json").write_text(json.dumps({"frames": starts}))


def write_plate(folder, renderer):
    """A camera that goes sideways, and a start for its first frame."""
    (folder / "plate").mkdir()
    first = sample_cameras()[1]
    for index, frame in enumerate(PLATE_FRAMES):
        centre = first.pose.centre + PLATE_STEP * index * first.pose.R[0]
        camera = replace(first, pose=Pose.from_centre(first.pose.R, centre))
        write_picture(folder / "plate" / f"shot.{frame:04d}.png", renderer, camera, index)
    start = perturb_camera(replace(first, file="shot.0012.png"), 0.08, 2.0, 5)
    (folder / "start.json").write_text(json.dumps(camera_to_dict(start)))


def write_picture(path, renderer, camera, seed):
    cv2.imwrite(str(path), make_photo(renderer, camera, seed).pixels[:, :, ::-1])


@pytest.mark.skipif(bool(window.missing()), reason=window.missing() or "a window can be had")
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_in_the_window(script, archive, files):
    if script.stem == "languages" and not (window.CHROOT / "usr" / "share" / "locale" / "languages").exists():
        pytest.skip("this Debian's Blender has no languages")
    print(window.run(script, archive, files, Path(SHOTS) if SHOTS else None))


def test_there_are_scripts_to_run():
    assert {"full_job", "viewport", "interruptions"} <= {path.stem for path in SCRIPTS}
