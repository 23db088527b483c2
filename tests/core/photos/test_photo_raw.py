"""Raw photos and JPEG XL: by the packages that decode them where these are installed, and named where they are not."""

import importlib.util
import io
import struct
import sys
import types

import numpy as np
import pytest

from core.errors import PhotoError
from core.photos.photo import photo_facts, read_photo

from ..support.photo_files import LONG, SHORT, TiffFile, picture

BYTE, ASCII, RATIONAL, SIGNED = 1, 2, 5, 10
HAS_RAWPY = importlib.util.find_spec("rawpy") is not None
SCENE = np.array([0.2, 0.4, 0.1])  # linear red, green, blue of a grey card's upper half, as the sensor has them
NEUTRAL = np.array([0.5, 1.0, 0.25])  # what the sensor has of white; so that half is (0.4, 0.4, 0.4) in truth


def dng(size=(64, 48), orientation=1):
    """A DNG of a sensor with red, green, green, blue filters: its upper half a grey card, its lower half black."""
    width, height = size
    colours = np.zeros((height, width), np.uint16)
    for y, x, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        colours[y : height // 2 : 2, x::2] = round(SCENE[channel] * 65535)
    file = TiffFile()
    at = file.put(colours.tobytes())
    matrix = file.put(struct.pack("<18i", *(n for v in np.eye(3).ravel() for n in (round(v * 1e4), 10000))))
    neutral = file.put(struct.pack("<6I", *(n for v in NEUTRAL for n in (round(v * 1e4), 10000))))
    model = file.put(b"Test\0\0")
    tags = {256: width, 257: height, 259: 1, 262: 32803, 273: at, 277: 1, 278: height, 279: colours.nbytes}
    entries = {tag: (LONG, (value,)) for tag, value in tags.items()}
    entries |= {258: (SHORT, (16,)), 274: (SHORT, (orientation,)), 33421: (SHORT, (2, 2)), 50717: (LONG, (65535,))}
    first = file.directory({**entries, **{tag: (LONG, (0,)) for tag in (254, 33422, 50706, 50708, 50721, 50728, 50778, 271)}})
    data = bytearray(file.data)
    own = {
        33422: (BYTE, 4, bytes((0, 1, 1, 2))),
        50706: (BYTE, 4, bytes((1, 4, 0, 0))),
        50778: (SHORT, 1, bytes((21, 0, 0, 0))),
    }
    own |= {50708: (ASCII, 5, struct.pack("<I", model)), 271: (ASCII, 5, struct.pack("<I", model))}
    own |= {50721: (SIGNED, 9, struct.pack("<I", matrix)), 50728: (RATIONAL, 3, struct.pack("<I", neutral))}
    (count,) = struct.unpack("<H", data[first : first + 2])
    for entry in range(first + 2, first + 2 + 12 * count, 12):
        (tag,) = struct.unpack("<H", data[entry : entry + 2])
        if tag in own:
            kind, length, value = own[tag]
            data[entry + 2 : entry + 12] = struct.pack("<HI", kind, length) + value
    return bytes(data)


@pytest.fixture
def put(tmp_path):
    def write(data, name="a.dng"):
        (tmp_path / name).write_bytes(data)
        return tmp_path / name

    return write


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\0\0\0\x18ftypcrx " + bytes(64), "a Canon raw photo"),
        (b"FUJIFILMCCD-RAW" + bytes(64), "a Fujifilm raw photo"),
        (dng(), "a raw photo of 64 x 48 pixels that holds no picture beside the sensor's values"),
    ],
)
def test_a_raw_photo_names_the_package_that_reads_it(put, data, words, monkeypatch):
    monkeypatch.setitem(sys.modules, "rawpy", None)
    with pytest.raises(PhotoError, match=f"'a.dng' is {words}.*, which needs the Python package rawpy; install it") as caught:
        read_photo(put(data))
    assert str(caught.value).endswith("or develop the photo to JPEG or TIFF.")


@pytest.mark.parametrize(("orientation", "lit"), [(1, "top"), (3, "bottom"), (6, "right"), (8, "left")])
def test_a_raw_photo_is_developed_with_its_white_balance_and_turned(put, orientation, lit):
    pytest.importorskip("rawpy")
    file = put(dng(orientation=orientation))
    photo, facts = read_photo(file), photo_facts(file)
    size = (64, 48) if orientation < 5 else (48, 64)
    assert (photo.width, photo.height, photo.orientation) == (*size, orientation) and photo.pixels.shape[:2] == size[::-1]
    assert (facts.width, facts.height, facts.orientation) == (*size, orientation)
    halves = {"top": photo.pixels[4:20], "bottom": photo.pixels[28:44], "left": photo.pixels[:, 4:20]}
    halves["right"] = photo.pixels[:, 28:44]
    lit_half = halves.pop(lit).reshape(-1, 3).astype(float)
    assert np.ptp(lit_half.mean(axis=0)) < 8, "grey after white balance"
    assert lit_half.mean() > 60 and "camera's white balance" in photo.notes[0]
    opposite = {"top": "bottom", "bottom": "top", "left": "right", "right": "left"}[lit]
    assert halves[opposite].mean() < 5


def test_a_large_raw_photo_is_read_at_half_its_size(put):
    pytest.importorskip("rawpy")
    photo = read_photo(put(dng(size=(4096, 2304))))
    assert photo.pixels.shape == (1152, 2048, 3) and (photo.width, photo.height) == (4096, 2304)


def test_a_damaged_raw_photo_ends_in_one_sentence(put):
    pytest.importorskip("rawpy")
    for data in (b"\0\0\0\x18ftypcrx " + bytes(64), dng()[:900]):
        with pytest.raises(PhotoError) as caught:
            read_photo(put(data))
        assert str(caught.value).endswith(".")


@pytest.mark.skipif(HAS_RAWPY, reason="rawpy is installed, and the tests above ask it")
def test_what_rawpy_is_asked_for(put, monkeypatch):
    """With a stand-in for the package: half size only of many pixels, the camera's white balance, turned here and not there."""
    asked = []

    class Opened:
        sizes = types.SimpleNamespace(flip=6, iwidth=64, iheight=48)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

        def postprocess(self, **options):
            asked.append(options)
            return picture()

    fake = types.SimpleNamespace(imread=lambda stream: Opened(), LibRawError=type("LibRawError", (Exception,), {}))
    monkeypatch.setitem(sys.modules, "rawpy", fake)
    photo = read_photo(put(b"FUJIFILMCCD-RAW" + bytes(64), "a.raf"))
    np.testing.assert_array_equal(photo.pixels, np.rot90(picture(), -1))
    assert photo.orientation == 6 and len(asked) == 1
    assert asked[0] == {"use_camera_wb": True, "half_size": False, "output_bps": 8, "user_flip": 0}


@pytest.mark.parametrize("start", [b"\xff\x0a", b"\0\0\0\x0cJXL \r\n\x87\n"])
def test_a_jpeg_xl_picture_names_the_package_that_reads_it(put, start, monkeypatch):
    monkeypatch.setitem(sys.modules, "pillow_jxl", None)
    with pytest.raises(PhotoError, match=r"'a.jxl' is a JPEG XL picture, which needs the Python package pillow-jxl-plugin"):
        read_photo(put(start + bytes(64), "a.jxl"))


def test_a_jpeg_xl_picture_is_read(put):
    pytest.importorskip("pillow_jxl")
    images = pytest.importorskip("PIL.Image")
    stream = io.BytesIO()
    images.fromarray(picture()).save(stream, "JXL", lossless=True)
    photo = read_photo(put(stream.getvalue(), "a.jxl"))
    np.testing.assert_array_equal(photo.pixels, picture())
    with pytest.raises(PhotoError, match="cannot be decoded"):
        read_photo(put(stream.getvalue()[:60], "a.jxl"))
