"""`pins`, and `refine --pins`: files in, files out."""

import json

import numpy as np
import pytest
from cli_place import FAST, Place

from core.cameras.files import camera_from_dict
from core.cli.main import main
from core.geometry.camera import pose_error
from core.render import Renderer, RenderSettings
from core.splats import read_splats

PIXELS = np.array([(30.0, 25), (205, 30), (190, 150), (40, 140), (120, 90), (150, 60)])


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("place"), photos=1)


@pytest.fixture(scope="module")
def pins(place):
    """Exact pins of the photo: the depth that is rendered at its true camera."""
    truth, scene = place.truths[0], read_splats(place.scene)
    pinhole = truth.intrinsics.pinhole()
    depth = Renderer(scene, RenderSettings(threads=1)).render(pinhole, truth.pose).depth
    z = np.array([depth[int(y), int(x)] for x, y in PIXELS], float)
    world = (
        np.column_stack([pinhole.normalise(np.floor(PIXELS) + 0.5), np.ones(6)]) * z[:, None] - truth.pose.t
    ) @ truth.pose.R
    photo = truth.intrinsics.project(truth.pose.transform(world))
    return [{"photo": p, "world": w} for p, w in zip(photo.tolist(), world.tolist(), strict=True)]


def written(path, pins):
    path.write_text(json.dumps({"pins": pins}))
    return path


def run(capsys, *argv):
    code = main([str(a) for a in argv])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_pins_place_the_photo_with_a_start_and_without(place, pins, tmp_path, capsys):
    photo, truth = place.folder / place.truths[0].file, place.truths[0]
    start = place.json(tmp_path / "start.json", place.starts)
    alone = {name: value for name, value in json.loads((tmp_path / "start.json").read_text()).items() if name not in ("R", "t")}
    (tmp_path / "lens.json").write_text(json.dumps(alone))
    file = written(tmp_path / "pins.json", pins)
    for camera in (start, tmp_path / "lens.json"):
        out = tmp_path / "out.json"
        code, said, _ = run(capsys, "pins", place.scene, photo, "--pins", file, "--camera", camera, "--out", out)
        record = json.loads(out.read_text())
        assert code == 0 and said.startswith("Placed by pins: 6 pins") and record["verdict"] == "pinned"
        distance, degrees = pose_error(camera_from_dict(record).pose, truth.pose)
        assert distance < 0.02 and degrees < 0.3
        assert max(pin["error_px"] for pin in record["pins"]) < 0.5 and record["translation_std_pct"] < 10
    again = run(capsys, "pins", place.scene, photo, "--pins", out, "--camera", start, "--out", tmp_path / "again.json")
    assert again[0] == 0, "a result serves as a file of pins"


def test_a_pin_may_be_told_by_where_the_start_camera_sees_it(place, pins, tmp_path, capsys):
    """The pixel at which the start sees a point, in place of the point itself."""
    start, photo = place.starts[0], place.folder / place.truths[0].file
    seen = start.intrinsics.pinhole().project(start.pose.transform([pin["world"] for pin in pins]))
    told = [{"photo": pin["photo"], "view": at} for pin, at in zip(pins, seen.tolist(), strict=True)]
    camera = place.json(tmp_path / "start.json", place.starts)
    file = written(tmp_path / "pins.json", told)
    code, out, _ = run(capsys, "pins", place.scene, photo, "--pins", file, "--camera", camera)
    assert code == 0
    assert pose_error(camera_from_dict(json.loads(out)).pose, place.truths[0].pose)[1] < 1.0
    code, _, err = run(capsys, "pins", place.scene, photo, "--pins", file)
    assert code == 2 and "no camera of that view" in err


def test_too_few_pins_and_files_that_hold_none_are_refused(place, pins, tmp_path, capsys):
    photo = place.folder / place.truths[0].file
    start = place.json(tmp_path / "start.json", place.starts)
    common = ("pins", place.scene, photo, "--pins")
    for some, camera, words in ((pins[:2], ("--camera", start), "at least 3"), (pins[:3], (), "at least 4 without a start")):
        code, _, err = run(capsys, *common, written(tmp_path / "few.json", some), *camera)
        assert code == 2 and words in err
    code, _, err = run(capsys, *common, written(tmp_path / "few.json", []), "--camera", start)
    assert code == 2 and "no list of pins" in err
    file = written(tmp_path / "pins.json", pins)
    code, _, err = run(capsys, *common, file, "--camera", start, "--out", file)
    assert code == 2 and "overwrite the pins" in err


def test_a_refinement_begins_where_the_pins_place_the_camera(place, pins, tmp_path, capsys):
    photo, truth = place.folder / place.truths[0].file, place.truths[0]
    far = place.json(tmp_path / "far.json", place.starts, t=[5.0, 5.0, 5.0])
    out, file = tmp_path / "out.json", written(tmp_path / "pins.json", pins)
    code, _, err = run(
        capsys, "refine", place.scene, photo, "--camera", far, "--pins", file, "--out", out, "--no-locate", *FAST
    )
    record = json.loads(out.read_text())
    assert code == 0 and "Placed by pins" in err and record["verdict"] in ("trusted", "check")
    assert pose_error(camera_from_dict(record).pose, truth.pose)[1] < 0.5
