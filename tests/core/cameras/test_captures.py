"""Cameras of capture apps, of XMP files and of fSpy, each the camera of dataset_files, with numbers worked out by hand."""

import json
import struct
import zipfile

import numpy as np
import pytest
from dataset_files import CENTRE, OPENGL, R, put, same

from core import cameras as datasets
from core.errors import CameraError, DatasetError
from core.geometry.camera import Intrinsics
from core.geometry.lie import so3_exp
from core.photos.places import PhotoFinder

GUESS = Intrinsics(640, 480, 1, 1, 320, 240)
# The turn of the camera-to-world matrix OPENGL: 120 degrees about (1, -1, -1) / sqrt 3, as a quaternion x y z w.
OPENGL_XYZW = (0.5, -0.5, -0.5, 0.5)


def numbers(values):
    return " ".join(str(float(value)) for value in np.ravel(values))


def xmp(path, body="", **values):
    said = {"Version": "3", "Coordinates": "absolute", "DistortionModel": "brown3t2", "FocalLength35mm": "28.125", "Skew": "0"}
    said |= {"AspectRatio": "1", "PrincipalPointU": "0.01", "PrincipalPointV": "-0.02", "Rotation": numbers(R)}
    said |= {"DistortionCoeficients": "0.1 -0.05 0.01 0 0.001 0.002"} | values
    attributes = " ".join(f'xcr:{name}="{value}"' for name, value in said.items() if value != "-")
    body = body or f"<xcr:Position>{numbers(CENTRE)}</xcr:Position>"
    return put(
        path,
        f"""<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
        <rdf:Description xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" {attributes}>
        {body}</rdf:Description></rdf:RDF></x:xmpmeta>""",
    )


def polycam(root, kind="corrected_", names=("1000", "1001"), **values):
    record = {f"t_{row}{column}": OPENGL[row][column] for row in range(3) for column in range(4)}
    record |= {"fx": 500, "fy": 501, "cx": 321, "cy": 239, "width": 640, "height": 480, "blur_score": 30} | values
    for name in names:
        put(root / f"keyframes/{kind}cameras/{name}.json", json.dumps(record))
        put(root / f"keyframes/{kind}images/{name}.jpg", b"")
    return root


def metadata(**more):
    pose = [*OPENGL_XYZW, *CENTRE.tolist()]
    data = {"w": 640, "h": 480, "K": [500, 0, 0, 0, 501, 0, 321, 239, 1], "fps": 60, "poses": [pose, pose]} | more
    return json.dumps(data)


def record3d(path, text=None):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", metadata() if text is None else text)
        archive.writestr("rgbd/0.jpg", b"")
    return path


def fspy(path, size=(640, 480), version=1, **more):
    width, height = size
    camera = {"principalPoint": {"x": 0.1, "y": -0.05}, "horizontalFieldOfView": 2 * np.arctan(width / 2 / 500)}
    camera |= {"cameraTransform": {"rows": OPENGL}, "imageWidth": width, "imageHeight": height} | more
    state = json.dumps({"cameraParameters": camera if camera["imageWidth"] else None}).encode()
    return put(path, b"fspy" + struct.pack("<III", version, len(state), 4) + state + b"\xff\xd8\xff\xd9")


FILES = {
    "realitycapture-xmp": (
        lambda p: xmp(p / "a.xmp"),
        "a",
        Intrinsics(640, 480, 500, 500, 326.4, 227.2, (0.1, -0.05, 0.002, 0.001, 0.01)),
    ),
    "polycam": (
        lambda p: polycam(p / "scan", names=["1000"]),
        "keyframes/corrected_images/1000.jpg",
        Intrinsics(640, 480, 500, 501, 321, 239),
    ),
    "record3d": (
        lambda p: record3d(p / "scan.r3d", metadata(poses=[[*OPENGL_XYZW, *CENTRE.tolist()]])),
        "rgbd/0.jpg",
        Intrinsics(640, 480, 500, 501, 321, 239),
    ),
    "fspy": (lambda p: fspy(p / "house.fspy"), "house", Intrinsics(640, 480, 500, 500, 352, 256)),
}


@pytest.mark.parametrize("layout", FILES)
def test_the_camera_is_where_it_was_put_and_has_its_lens(tmp_path, layout):
    make, name, lens = FILES[layout]
    path = make(tmp_path)
    assert datasets.detect(path) == layout
    (start,) = datasets.starts(path).placed
    same(start.pose, atol=1e-9)
    assert start.file == name and start.focal_guessed == (layout == "fspy")
    assert start.pixel_order == ("stored" if layout in ("polycam", "record3d") else "upright")
    got = start.camera(GUESS).intrinsics
    for key in ("width", "height", "fx", "fy", "cx", "cy", "dist"):
        assert getattr(got, key) == pytest.approx(getattr(lens, key), abs=1e-9), key


def test_the_quaternion_turns_as_the_matrix_does():
    turn = so3_exp(2 * np.pi / 3 * np.array([1, -1, -1]) / np.sqrt(3))
    np.testing.assert_allclose(turn, np.array(OPENGL)[:3, :3], atol=1e-12)


def test_every_form_of_an_xmp_is_read(tmp_path):
    place = f"<xcr:Position>{numbers(CENTRE)}</xcr:Position>"
    elements = f"{place}<xcr:Rotation>{numbers(R)}</xcr:Rotation><xcr:DistortionCoeficients>0.1</xcr:DistortionCoeficients>"
    xmp(tmp_path / "elements.xmp", elements, Rotation="-", DistortionCoeficients="-")
    xmp(tmp_path / "attributes.XMP", " ", Position=numbers(CENTRE), DistortionModel="division", DistortionCoeficients="-0.2")
    xmp(tmp_path / "prior.xmp", " ", Rotation="-")
    xmp(tmp_path / "rig.xmp", Coordinates="relative")
    put(tmp_path / "lightroom.xmp", '<x:xmpmeta xmlns:x="adobe:ns:meta/"/>')
    put(tmp_path / "elements.jpg", b"")
    found = datasets.starts(tmp_path)
    assert {start.file for start in found.placed} == {"elements", "attributes"}
    for start in found.placed:
        same(start.pose, atol=1e-9)
    lens = next(start for start in found.placed if start.file == "attributes").camera(GUESS).intrinsics
    bent = lens.project([[0.3, 0.2, 1.0]])[0]
    # d of x = d / (1 - 0.2 |d|^2), at the ray (0.3, 0.2)
    r = np.hypot(0.3, 0.2)
    d = (np.sqrt(1 + 4 * 0.2 * r * r) - 1) / (2 * 0.2 * r)
    np.testing.assert_allclose(bent, np.array([0.3, 0.2]) * d / r * 500 + (326.4, 227.2), atol=0.3)
    assert any("rig.xmp' places its camera on a rig" in note for note in found.notes)
    assert any("Without a pose, hence left out: 1 of 3 cameras" in note for note in found.notes)
    assert PhotoFinder(tmp_path).find("elements") == tmp_path / "elements.jpg"


def test_a_captures_photos_are_found_from_each_of_its_folders(tmp_path):
    polycam(polycam(tmp_path, kind="", cx=1), names=("1000", "1001"))
    for path in (tmp_path, tmp_path / "keyframes", tmp_path / "keyframes/corrected_cameras"):
        found = datasets.starts(path).placed
        assert [start.intrinsics.cx for start in found] == [321, 321]
        photos = [PhotoFinder(path).find(start.file) for start in found]
        wanted = [tmp_path / f"keyframes/corrected_images/{name}.jpg" for name in ("1000", "1001")]
        assert [photo.resolve() for photo in photos] == wanted
    (one,) = datasets.starts(tmp_path / "keyframes/cameras/1001.json").placed
    assert one.intrinsics.cx == 1
    photo = PhotoFinder(tmp_path / "keyframes/cameras/1001.json").find(one.file)
    assert photo.resolve() == tmp_path / "keyframes/images/1001.jpg"


def test_a_recording_is_read_from_its_folder_with_the_lens_of_each_frame(tmp_path):
    coefficients = [[400, 401, 300, 200], [410, 411, 301, 201]]
    put(tmp_path / "metadata.json", metadata(perFrameIntrinsicCoeffs=coefficients))
    put(tmp_path / "rgb/1.jpg", b"")
    found = datasets.starts(tmp_path).placed
    assert [(start.file, start.intrinsics.fy, start.intrinsics.cx) for start in found] == [
        ("rgb/0.jpg", 401, 300),
        ("rgb/1.jpg", 411, 301),
    ]
    assert PhotoFinder(tmp_path).find("rgb/1.jpg") == tmp_path / "rgb/1.jpg"


def test_fspys_centre_and_angle_hold_for_a_tall_picture(tmp_path):
    found = datasets.starts(fspy(tmp_path / "tall.fspy", (480, 640)))
    k = found.placed[0].intrinsics
    assert (k.fx, k.cx, k.cy) == pytest.approx((500, 240 + 32, 320 + 16))
    assert found.notes[0].startswith("1 camera of 'tall.fspy': its place is in fSpy's own axes")


def test_one_bad_record_does_not_end_the_rest(tmp_path):
    polycam(tmp_path / "scan", names=["1", "2"])
    put(tmp_path / "scan/keyframes/corrected_cameras/3.json", '{"t_00": "x", "t_23": 1}')
    found = datasets.starts(tmp_path / "scan")
    assert len(found.placed) == 2 and "'3.json' has no matrix t_00 to t_23" in found.notes[0]
    pose = [*OPENGL_XYZW, *CENTRE.tolist()]
    record3d(tmp_path / "a.r3d", metadata(poses=[pose, [float("-inf")] * 7, pose]).replace("-Infinity", "-1e999"))
    found = datasets.starts(tmp_path / "a.r3d")
    assert [start.file for start in found.placed] == ["rgbd/0.jpg", "rgbd/2.jpg"]
    assert "Frame 1 of 'a.r3d' has no quaternion and place" in found.notes[0]


BAD = {
    "xmp, no xml": (lambda p: put(p / "a.xmp", "<x:xmpmeta xcr:"), "no valid XML; export the metadata"),
    "xmp, no rotation": (lambda p: xmp(p / "a.xmp", Rotation="1 2 3"), "has no rotation and place of a camera"),
    "xmp, no turn": (lambda p: xmp(p / "a.xmp", Rotation=numbers(2 * R)), "is not a rotation"),
    "xmp, entities": (lambda p: put(p / "a.xmp", '<!DOCTYPE a [<!ENTITY x "y">]><x:xmpmeta xcr:a="1"/>'), "no XMP of"),
    "record3d, no poses": (lambda p: record3d(p / "a.r3d", '{"poses": 3, "K": 1}'), "has no list of poses"),
    "record3d, no json": (lambda p: record3d(p / "a.r3d", "{"), "is a damaged recording"),
    "polycam, no object": (lambda p: put(p / "a.json", '{"t_00": null, "t_23": 0}'), "has no matrix t_00 to t_23"),
    "fspy, cut": (lambda p: put(p / "a.fspy", b"fspy\1\0\0\0"), "is a damaged fSpy project"),
    "fspy, no camera": (lambda p: fspy(p / "a.fspy", imageWidth=0), "has no camera yet"),
    "fspy, version": (lambda p: fspy(p / "a.fspy", version=9), "of version 9; version 1 can be read"),
    "fspy, no angle": (lambda p: fspy(p / "a.fspy", horizontalFieldOfView=0), "cannot be used; save the project"),
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
    file = path if path.is_file() else next(path.rglob("*.json"))
    good, rng = file.read_bytes(), np.random.default_rng(5)
    for _ in range(60):
        data = bytearray(good)
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.choice(np.frombuffer(b'0-9.e,{}[]"<> \n\xff\0', np.uint8))
        file.write_bytes(bytes(data[: rng.integers(1, len(data) + 1)] if rng.random() < 0.3 else data))
        try:
            for start in datasets.starts(path).placed:
                start.camera(GUESS)
        except (DatasetError, CameraError) as error:
            assert str(error).endswith(".")
