"""Files of photogrammetry programs, each with the camera of dataset_files, whose place and axes are worked out by hand."""

import json

import numpy as np
import pytest
from dataset_files import CAMERA_TO_WORLD, CENTRE, OPENGL, QUATERNION, R, T, put, same

from core import cameras as datasets
from core.cameras import nerfstudio
from core.errors import CameraError, DatasetError
from core.geometry.camera import Camera, Intrinsics
from core.geometry.conventions import FLIP_YZ
from core.geometry.lie import so3_exp

GUESS = Intrinsics(640, 480, 1, 1, 320, 240)


def numbers(values):
    return " ".join(str(float(v)) for v in np.ravel(values))


def metashape(tmp_path, sensor="frame", camera=CAMERA_TO_WORLD, **values):
    values = {"f": 500, "cx": 1.5, "cy": -2.5, "k1": 0.1, "k2": -0.05, "k3": 0.01, "p1": 0.002, "p2": -0.001} | values
    terms = "".join(f"<{name}>{value}</{name}>" for name, value in values.items())
    return put(
        tmp_path / "cameras.xml",
        f"""<?xml version="1.0" encoding="UTF-8"?>
        <document version="2.0.0"><chunk label="Chunk 1"><sensors><sensor id="0" type="{sensor}">
        <resolution width="640" height="480"/>
        <calibration type="{sensor}" class="initial"><f>1</f></calibration>
        <calibration type="{sensor}" class="adjusted">{terms}</calibration></sensor></sensors>
        <cameras><camera id="0" sensor_id="0" label="a.jpg"><transform>{" ".join(camera.split())}</transform></camera>
        <camera id="1" sensor_id="0" label="b.jpg"/></cameras></chunk></document>""",
    )


def realitycapture(tmp_path, row="a.jpg,1,2,3,90,90,0,28.125,0.01,-0.02,0.1,-0.05,0.01,0,0.001,0.002"):
    return put(tmp_path / "cameras.csv", f"#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n{row}\n")


def bundler(tmp_path):
    lines = ["# Bundle file v0.3", "2 1", "500 0.1 -0.05", *(numbers(row) for row in FLIP_YZ @ R), numbers(FLIP_YZ @ T)]
    lines += ["0 0 0", "0 0 0", "0 0 0", "0 0 0", "0 0 0", "1 2 3", "255 0 0", "1 0 5 1.5 2.5"]
    put(tmp_path / "list.txt", "images/a.jpg 0 500\nimages/b.jpg\n")
    return put(tmp_path / "bundle.out", "\n".join(lines) + "\n")


def nvm(tmp_path, r=-0.1):
    line = f"images/my photo.jpg\t500 {numbers(QUATERNION)} {numbers(CENTRE)} {r} 0"
    return put(tmp_path / "model.nvm", f"NVM_V3 \n\n1\n{line}\n\n0\n")


def meshroom(tmp_path, **more):
    lens = {
        "intrinsicId": "7",
        "width": "640",
        "height": "480",
        "sensorWidth": "36",
        "focalLength": "28.125",
        "pixelRatio": "1",
    }
    lens |= {"type": "radial3", "principalPoint": ["1.5", "-2.5"], "distortionParams": ["0.1", "-0.05", "0.01"]} | more
    pose = {"rotation": [str(v) for v in R.T.ravel()], "center": [str(v) for v in CENTRE]}
    views = [{"viewId": "1", "poseId": "5", "intrinsicId": "7", "path": "C:\\x\\a.jpg"}, {"viewId": "2", "path": "/x/b.jpg"}]
    data = {"version": ["1", "2", "6"], "views": views, "intrinsics": [lens]}
    return put(tmp_path / "cameras.sfm", json.dumps({**data, "poses": [{"poseId": "5", "pose": {"transform": pose}}]}))


def opensfm(tmp_path, **lens):
    lens = {"projection_type": "brown", "width": 640, "height": 480, "focal_x": 0.78125, "focal_y": 0.8, "c_x": 0.01, **lens}
    lens |= {"c_y": -0.02, "k1": 0.1, "k2": -0.05, "k3": 0.01, "p1": 0.001, "p2": 0.002}
    turn = (2 * np.pi / 3 * np.array([1, -1, 1]) / np.sqrt(3)).tolist()
    shot = {"rotation": turn, "translation": T.tolist(), "camera": "v2"}
    return put(
        tmp_path / "reconstruction.json",
        json.dumps([{"cameras": {"v2": lens}, "shots": {"a.jpg": shot}}, {"shots": {"b": shot}}]),
    )


def ns_export(tmp_path):
    return put(tmp_path / "train.json", json.dumps([{"file_path": "images/a.jpg", "transform": OPENGL[:3]}]))


FILES = {
    "metashape": (metashape, "a.jpg", Intrinsics(640, 480, 500, 500, 321.5, 237.5, (0.1, -0.05, -0.001, 0.002, 0.01))),
    "realitycapture": (realitycapture, "a.jpg", Intrinsics(640, 480, 500, 500, 326.4, 227.2, (0.1, -0.05, 0.002, 0.001, 0.01))),
    "bundler": (bundler, "images/a.jpg", Intrinsics(640, 480, 500, 500, 320, 240, (0.1, -0.05, 0, 0, 0))),
    "nvm": (nvm, "images/my photo.jpg", None),
    "meshroom": (meshroom, "a.jpg", Intrinsics(640, 480, 500, 500, 321.5, 237.5, (0.1, -0.05, 0, 0, 0.01))),
    "opensfm": (opensfm, "a.jpg", Intrinsics(640, 480, 500, 512, 326.4, 227.2, (0.1, -0.05, 0.001, 0.002, 0.01))),
    "ns-export": (ns_export, "images/a.jpg", None),
}


@pytest.mark.parametrize("layout", FILES)
def test_the_camera_is_where_it_was_put_and_has_its_lens(tmp_path, layout):
    make, name, lens = FILES[layout]
    path = make(tmp_path)
    assert datasets.detect(path) == layout
    found = datasets.starts(path)
    (start,) = found.placed
    same(start.pose, atol=1e-9)
    assert start.file == name
    unplaced = layout in ("metashape", "meshroom", "bundler", "opensfm")
    assert found.notes == ((f"Without a pose, hence left out: 1 of 2 cameras in '{path.name}'.",) if unplaced else ())
    assert start.pixel_order == ("upright" if layout == "realitycapture" else "stored")
    if lens is not None:
        got = start.camera(GUESS).intrinsics
        for key in ("width", "height", "fx", "fy", "cx", "cy", "dist"):
            assert getattr(got, key) == pytest.approx(getattr(lens, key), abs=1e-9), key


def test_realityscans_table_of_today_reads_as_the_older_one(tmp_path):
    old = realitycapture(tmp_path).read_text()
    header = "#name,x,y,alt,yaw,pitch,roll,f_35mm,px_norm,py_norm,k1,k2,k3,k4,t1,t2"
    new = put(tmp_path / "today.csv", header + "\n" + old.split("\n")[1] + "\n")
    cameras = [datasets.starts(path).placed[0].camera(GUESS) for path in (tmp_path / "cameras.csv", new)]
    assert datasets.detect(new) == "realitycapture" and cameras[0] == cameras[1]


def test_visualsfms_distortion_goes_the_other_way_round(tmp_path):
    lens = datasets.starts(nvm(tmp_path)).placed[0].camera(GUESS).intrinsics
    bent = np.array([[0.3, -0.2], [0.5, 0.35]])
    ideal = bent * (1 - 0.1 * (bent**2).sum(axis=1))[:, None]
    got = lens.project(np.column_stack([ideal, np.ones(2)]))
    np.testing.assert_allclose(got, bent * 500 + (320, 240), atol=0.05)


def test_lenses_of_other_kinds_are_used_or_named(tmp_path):
    fisheye = datasets.starts(metashape(tmp_path, "fisheye", f=900, k1=0, k2=0, k3=0, p1=0, p2=0)).placed[0].intrinsics
    ray = np.array([[0.2, 0.1, 1.0]])
    at = np.arctan(np.hypot(0.2, 0.1)) / np.hypot(0.2, 0.1) * np.array([0.2, 0.1]) * 900 + (321.5, 237.5)
    np.testing.assert_allclose(fisheye.project(ray)[0], at, atol=0.05)
    with pytest.raises(DatasetError, match="The panorama has 640 x 480 pixels, but all around it is twice as wide as high"):
        datasets.starts(metashape(tmp_path, "spherical"))
    old = datasets.starts(meshroom(tmp_path, pxFocalLength=500, principalPoint=["321.5", "237.5"])).placed[0].intrinsics
    assert (old.fx, old.cx, old.cy) == (500, 321.5, 237.5)
    without = datasets.starts(meshroom(tmp_path, sensorWidth="0"))
    assert without.placed[0].tells_no_lens and "the lens is left out" in without.notes[0]


BAD = {
    "alembic": (lambda p: put(p / "f.abc", b"Ogawa\xff\0"), "is an Alembic file, which is not read; import it in Blender"),
    "metashape, project": (
        lambda p: put(p / "a.psx", '<document version="1.2.0" path="{projectname}.files/project.zip"/>'),
        "is a Metashape project, which is not read; export its cameras as XML",
    ),
    "realitycapture, project": (
        lambda p: put(p / "a.rcproj", b"\1\2\3"),
        "is a RealityCapture project, which is not read; export internal and external parameters as CSV, or XMP files",
    ),
    "zephyr, project": (lambda p: put(p / "a.ZEP", b"PK\3\4"), "is a 3DF Zephyr project, which is not read; export"),
    "blocksexchange": (
        lambda p: put(p / "a.xml", "<?xml version='1.0'?>\n<BlocksExchange><Block/></BlocksExchange>"),
        "is a BlocksExchange file, which is not read; export the cameras as Metashape's XML, Bundler or COLMAP",
    ),
    "another xml": (
        lambda p: put(p / "a.kml", "<?xml version='1.0'?><kml/>"),
        "of a kind that is not known, which is not read",
    ),
    "a scan": (
        lambda p: put(p / "a.ply", b"ply\nformat ascii 1.0\n"),
        "is a scan or a mesh, which is not read; give a file of",
    ),
    "a photo": (lambda p: put(p / "a.JPG", b"\xff\xd8\xff"), "is a picture, which is not read; give a file of cameras"),
    "an archive": (lambda p: put(p / "a.zip", b"PK\3\4"), "is an archive, which is not read; unpack it"),
    "colmap, cameras": (
        lambda p: put(p / "cameras.txt", "# Camera list with one line of data per camera:\n1 PINHOLE 64 48 60 60 32 24\n"),
        "is one file of a COLMAP model, which is not read; give the model's folder",
    ),
    "colmap, points": (
        lambda p: put(p / "points3D.bin", b"\0\1"),
        "is one file of a COLMAP model, which is not read; give the",
    ),
    "a table": (lambda p: put(p / "a.csv", "name;x;y\n"), "is in no layout of cameras that is known; a pose list has lines of"),
    "metashape, no matrix": (lambda p: metashape(p, camera="1 2 3"), "The camera 'a.jpg' .* transform that is not 16 numbers"),
    "metashape, no xml": (lambda p: put(p / "a.xml", "<document><chunk>"), "no valid XML"),
    "metashape, entities": (
        lambda p: put(p / "a.xml", '<!DOCTYPE a [<!ENTITY x "y">]><document><chunk/></document>'),
        "no export",
    ),
    "csv, no angles": (lambda p: realitycapture(p, "a.jpg,1,2,3,x,0,0"), "Line 2 of 'cameras.csv' has no place and angles"),
    "bundler, cut": (lambda p: put(p / "b.out", "# Bundle file v0.3\n2 1\n500 0 0\n"), "ends before the cameras"),
    "bundler, no list": (
        lambda p: put(p / "b.out", "# Bundle file v0.3\n1 0\n5 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n"),
        "list.txt",
    ),
    "nvm, cut": (lambda p: put(p / "m.nvm", "NVM_V3\n\n3\na.jpg 1\n"), "ends before the cameras"),
    "nvm, few numbers": (lambda p: put(p / "m.nvm", "NVM_V3\n\n1\na.jpg 1 2\n"), "is no camera"),
    "meshroom, no views": (lambda p: put(p / "c.sfm", '{"views": 3, "viewId": 1}'), "no file of cameras of Meshroom"),
    "opensfm, nothing": (lambda p: put(p / "r.json", '[{"cameras": 3, "projection_type": 1}]'), "no reconstruction"),
    "ns-export, no matrix": (
        lambda p: put(p / "t.json", '[{"file_path": "a", "transform": [[1]]}]'),
        'no "file_path" and "transform"',
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_ends_in_one_sentence(tmp_path, case):
    make, words = BAD[case]
    with pytest.raises((DatasetError, CameraError), match=words) as caught:
        datasets.starts(make(tmp_path))
    assert str(caught.value).endswith(".") and "\n" not in str(caught.value)


@pytest.mark.parametrize("layout", FILES)
def test_damaged_files_end_in_cameras_or_in_one_sentence(tmp_path, layout):
    path = FILES[layout][0](tmp_path)
    good, rng = path.read_bytes(), np.random.default_rng(5)
    for _ in range(60):
        data = bytearray(good)
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.choice(np.frombuffer(b'0-9.e,{}[]"<> \n\xff\0', np.uint8))
        path.write_bytes(bytes(data[: rng.integers(1, len(data) + 1)] if rng.random() < 0.3 else data))
        try:
            for start in datasets.starts(path).placed:
                start.camera(GUESS)
        except (DatasetError, CameraError) as error:
            assert str(error).endswith(".")


def test_nerfstudio_reads_the_same_numbers(tmp_path):
    """RealityCapture's angles and Metashape's matrix, against transforms.json as nerfstudio's own code converts them."""
    turn = so3_exp(np.array([0, 0, -np.pi / 2])) @ so3_exp(np.array([np.pi / 2, 0, 0]))
    np.testing.assert_allclose(turn, np.array(OPENGL)[:3, :3], atol=1e-12)
    file = tmp_path / "transforms.json"
    nerfstudio.write_transforms(file, [Camera(GUESS, datasets.starts(realitycapture(tmp_path)).placed[0].pose, "a.jpg")])
    np.testing.assert_allclose(json.loads(file.read_text())["frames"][0]["transform_matrix"], OPENGL, atol=1e-9)
