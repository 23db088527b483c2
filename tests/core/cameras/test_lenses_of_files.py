"""Lenses of camera files: other programs' models, what files leave out, and records that cannot be used."""

import json

import numpy as np
import pytest
from dataset_files import LINE, OPENGL, binary_cameras, binary_images, put

from core import cameras as datasets
from core.cameras.colmap import MODELS, PINHOLE
from core.cameras.colmap_binary import MODEL_IDS
from core.errors import CameraError, DatasetError
from core.geometry.camera import Intrinsics, Pose
from core.geometry.foreign_lens import MODELS as FORMULAS
from core.geometry.foreign_lens import lens_of
from core.geometry.turned_photo import upright_lens
from core.geometry.wide_lens import WideLens

# Where pycolmap 4.2.1 puts points x/z, y/z on a picture of 1280 x 720 pixels, by its camera models' parameters.
POINTS = (
    (0.16435402478574512, -0.27625594348335564),
    (-0.5508317712765664, -0.580166837365765),
    (0.3759242870403269, 0.495306692733266),
)
GOLDEN = {
    "FULL_OPENCV": (
        (900, 905, 640, 350, 0.06, -0.08, 0.001, -0.0015, 0.02, 0.01, -0.02, 0.003),
        ((788.296148, 99.208018), (137.247787, -180.974281), (981.597909, 803.62119)),
    ),
    "OPENCV_FISHEYE": (
        (900, 905, 640, 350, 0.03, -0.01, 0.004, -0.002),
        ((783.520535, 107.422005), (216.907338, -98.100555), (945.239115, 754.408306)),
    ),
    "SIMPLE_RADIAL_FISHEYE": (
        (900, 640, 350, 0.03),
        ((783.533434, 108.740535), (216.162551, -96.409313), (945.498676, 752.515996)),
    ),
    "RADIAL_FISHEYE": (
        (900, 640, 350, 0.03, -0.01),
        ((783.520042, 108.763044), (217.029243, -95.496464), (945.208782, 752.134041)),
    ),
    "FOV": ((900, 905, 640, 350, 0.6), ((790.557633, 95.527923), (165.331701, -152.724692), (973.034698, 791.234401))),
    "THIN_PRISM_FISHEYE": (
        (900, 905, 640, 350, 0.03, -0.01, 0.001, -0.002, 0.004, -0.002, 0.0005, -0.0007),
        ((783.222405, 107.731448), (215.924889, -98.366508), (944.682385, 754.308244)),
    ),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        (900, 905, 640, 350, 0.03, -0.01, 0.004, -0.002, 0.001, -0.0005, 0.001, -0.002, 0.0005, -0.0007, 0.0003, 0.0004),
        ((783.84555, 106.938318), (216.953267, -99.211979), (945.263752, 753.512395)),
    ),
    "SIMPLE_DIVISION": ((900, 640, 350, -0.1), ((786.420979, 103.886979), (172.470482, -142.428244), (966.173629, 779.756701))),
    "DIVISION": ((900, 905, 640, 350, -0.1), ((786.420979, 102.519684), (172.470482, -145.163956), (966.173629, 782.144238))),
    "SIMPLE_FISHEYE": ((900, 640, 350), ((783.118112, 109.438631), (221.873491, -90.394231), (942.688467, 748.813348))),
    "FISHEYE": ((900, 905, 640, 350), ((783.118112, 108.102179), (221.873491, -92.840866), (942.688467, 751.028978))),
    "EUCM": ((900, 905, 640, 350, 0.6, 1.1), ((783.168122, 108.017652), (221.019676, -93.745148), (943.078188, 751.545315))),
}

SIZE = (1280, 720)


def named(model):
    """The pinhole of a golden model, and its other parameters by name."""
    values = dict(zip(MODELS[model], GOLDEN[model][0], strict=True))
    fx = values.get("fx", values.get("f"))
    pinhole = Intrinsics(*SIZE, fx, values.get("fy", fx), values["cx"], values["cy"])
    return pinhole, {name: value for name, value in values.items() if name not in PINHOLE}


@pytest.mark.parametrize("model", GOLDEN)
def test_every_model_bends_as_colmap_does(model):
    k, values = named(model)
    got = FORMULAS[model](np.array(POINTS), values) * (k.fx, k.fy) + (k.cx, k.cy)
    np.testing.assert_allclose(got, GOLDEN[model][1], atol=2e-6)


@pytest.mark.parametrize("model", GOLDEN)
def test_the_five_coefficients_say_it_within_what_is_told(model):
    """At random places within the picture, the lens that is used is as near as the bound, and what is told, say."""
    k, values = named(model)
    lens = lens_of(model, k, values)
    rays = np.random.default_rng(0).uniform(-0.9, 0.9, (4000, 2))
    true = FORMULAS[model](rays, values) * (k.fx, k.fy) + (k.cx, k.cy)
    inside = (true > 0).all(axis=1) & (true < SIZE).all(axis=1)
    if lens.intrinsics is None:
        assert model in {"THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE"}
        assert "pixels off with k1 k2 p1 p2 k3: its photo is matched through" in lens.problem
        ahead = lens.wide.project(np.column_stack([rays, np.ones(len(rays))]))
        np.testing.assert_allclose(ahead[inside], true[inside], atol=1e-9)
        return
    off = np.abs(lens.intrinsics.project(np.column_stack([rays, np.ones(len(rays))]))[inside] - true[inside]).max()
    assert off < 5e-4 * 1280
    assert off < 0.05 or "pixels off at the picture's edge" in lens.problem
    back = lens.intrinsics.normalise(lens.intrinsics.project(np.column_stack([rays[inside], np.ones(inside.sum())])))
    np.testing.assert_allclose(back, rays[inside], atol=1e-9)


def test_what_is_no_lens_is_named():
    k = Intrinsics(*SIZE, 300, 300, 640, 360)
    assert "sees more than 120 degrees" in lens_of("FISHEYE", k, {}).problem
    assert "is not known" in lens_of("MEI", k, {}).problem
    assert "not finite" in lens_of("FOV", k, {"omega": float("nan")}).problem
    panorama = lens_of("SPHERICAL", Intrinsics(1280, 640, 1, 1, 0, 0), {})
    assert panorama.wide.is_panorama and "no picture through a lens" in panorama.problem
    assert "twice as wide as high" in lens_of("EQUIRECTANGULAR", k, {}).problem
    assert not lens_of("ORTHOPHOTO", k, {}).is_picture


def test_every_model_of_colmap_has_its_parameters():
    assert {name: count for name, count in MODEL_IDS.values() if name != "EQUIRECTANGULAR"} == {
        name: len(names) for name, names in MODELS.items()
    }


def test_binary_models_of_today_are_read(tmp_path):
    cameras = [(1, 12, *SIZE, 900, 640, 350, -0.1), (2, 16, *SIZE, 900, 905, 640, 350, 0.6, 1.1), (3, 17, 1280, 640, 1280, 640)]
    put(tmp_path / "sparse/0/cameras.bin", binary_cameras(cameras))
    put(tmp_path / "sparse/0/images.bin", binary_images(["a.png", "b.png", "c.png"]))
    found = datasets.starts(tmp_path)
    assert [start.file for start in found.placed] == ["a.png", "b.png", "c.png"]
    assert found.placed[0].intrinsics.dist[0] == pytest.approx(-0.1, abs=0.01)
    assert found.placed[2].intrinsics is None and found.placed[2].wide == WideLens.panorama(1280, 640)


# ---- transforms.json

BASE = {"w": 640, "h": 480, "fl_x": 500, "fl_y": 501, "cx": 321, "cy": 239.5, "k1": 0.1}
FRAME = {"file_path": "images/a.png", "transform_matrix": OPENGL}


def transforms(tmp_path, **more):
    values = {key: value for key, value in {**BASE, **more}.items() if value != "-"}
    return datasets.starts(put(tmp_path / "transforms.json", json.dumps({**values, "frames": [FRAME]})))


@pytest.mark.parametrize(
    ("more", "wanted"),
    [
        ({"k3": None, "cx": None}, Intrinsics(640, 480, 500, 501, 320, 239.5, (0.1, 0, 0, 0, 0))),
        ({"cx": "-", "cy": "-", "k1": "-"}, Intrinsics(640, 480, 500, 501, 320, 240)),
        ({"fl_x": "-"}, Intrinsics(640, 480, 501, 501, 321, 239.5, (0.1, 0, 0, 0, 0))),
        (
            {"fl_x": "-", "fl_y": "-", "camera_angle_x": np.pi / 2},
            Intrinsics(640, 480, 320, 320, 321, 239.5, (0.1, 0, 0, 0, 0)),
        ),
        ({"camera_model": "SIMPLE_PINHOLE"}, Intrinsics(640, 480, 500, 501, 321, 239.5, (0.1, 0, 0, 0, 0))),
    ],
)
def test_a_lens_is_completed_from_what_is_there(tmp_path, more, wanted):
    found = transforms(tmp_path, **more)
    got = found.placed[0].intrinsics
    np.testing.assert_allclose(
        [got.fx, got.fy, got.cx, got.cy, *got.dist], [wanted.fx, wanted.fy, wanted.cx, wanted.cy, *wanted.dist]
    )
    assert not found.notes and not found.placed[0].focal_guessed


def test_without_a_size_the_photo_gives_it(tmp_path):
    angle = {"fl_x": "-", "fl_y": "-", "cx": "-", "cy": "-", "k1": "-", "w": "-", "h": "-", "camera_angle_x": np.pi / 2}
    (start,) = transforms(tmp_path, **angle).placed
    assert start.intrinsics is None and not start.tells_no_lens
    guess = Intrinsics(800, 600, 1, 1, 400, 300)
    camera = start.camera(guess)
    k = camera.intrinsics
    assert (k.width, k.height, k.fx, k.fy, k.cx, k.cy) == pytest.approx((800, 600, 400, 400, 400, 300))
    assert not camera.focal_guessed
    turned = start.camera(upright_lens(guess, 6), 6)
    assert (turned.intrinsics.width, turned.intrinsics.height, turned.pixel_order) == (800, 600, "stored")


def test_a_fisheye_is_no_pinhole(tmp_path):
    found = transforms(tmp_path, camera_model="OPENCV_FISHEYE", fl_x=900, fl_y=900, k1=0.02, p1=0.5)
    assert found.placed[0].intrinsics.dist[0] == pytest.approx(-0.31, abs=0.02)  # atan(r) = r (1 - r^2 / 3 + ...), and k1
    wide = transforms(tmp_path, camera_model="OPENCV_FISHEYE", fl_x=200, fl_y=200)
    assert wide.placed[0].intrinsics is None
    assert wide.placed[0].wide == WideLens("OPENCV_FISHEYE", 640, 480, 200, 200, 321, 239.5, (("k1", 0.1),))
    assert wide.notes[0].startswith(
        "1 camera of 'transforms.json': the lens OPENCV_FISHEYE sees more than 120 degrees: its photo"
    )
    assert transforms(tmp_path, camera_model="EQUIRECTANGULAR", w=800, h=400).placed[0].wide == WideLens.panorama(800, 400)
    with pytest.raises(DatasetError, match="twice as wide as high"):
        transforms(tmp_path, camera_model="EQUIRECTANGULAR")
    (long,) = transforms(tmp_path, k4=0.01).placed
    true = Pose().transform([[0.3, 0.2, 1.0]])
    r2 = 0.13
    assert long.intrinsics.project(true)[0, 0] == pytest.approx(321 + 500 * 0.3 * (1 + 0.1 * r2 + 0.01 * r2**4), abs=0.05)


def test_one_bad_record_does_not_end_the_rest(tmp_path):
    lost = {"file_path": "b.png", "transform_matrix": [[float("-inf")] * 4] * 4}
    file = put(tmp_path / "transforms.json", json.dumps({**BASE, "frames": [FRAME, lost, {**FRAME, "file_path": "c.png"}]}))
    found = datasets.starts(file)
    assert [start.file for start in found.placed] == ["images/a.png", "c.png"]
    assert found.notes[0].startswith("1 camera of 'transforms.json' cannot be used and left out: Camera 2 of")
    put(tmp_path / "m/images.txt", f"1 {LINE} 1 a.png\n\n2 0 0 0 0 1 2 3 1 b.png\n\n3 {LINE} 1 c.png\n\n")
    found = datasets.starts(tmp_path / "m")
    assert [start.file for start in found.placed] == ["a.png", "c.png"] and "Line 3" in found.notes[0]
    with pytest.raises((DatasetError, CameraError), match="Line 3"):
        datasets.read(tmp_path / "m")


def test_images_without_their_empty_lines_all_count(tmp_path):
    lines = [f"{i} {LINE} 1 my photo {i}.png" for i in range(1, 5)]
    put(tmp_path / "images.txt", "\n".join(lines) + "\n")
    assert datasets.read(tmp_path).names == [f"my photo {i}.png" for i in range(1, 5)]
    put(tmp_path / "images.txt", lines[0] + "\n1.5 2.5 -1 3 4 17 5 6 -1 8 9 2\n" + "\n".join(lines[1:3]) + "\n")
    assert datasets.read(tmp_path).names == [f"my photo {i}.png" for i in range(1, 4)]
