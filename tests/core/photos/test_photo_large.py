"""Very large photos, photos of linear light, and focal lengths by the sensor's size."""

import math
import struct

import cv2
import numpy as np
import pytest
from photo_files import RATIONAL, SHORT, encoded, exif, picture, tiff

from core.errors import PhotoError
from core.geometry.camera import Intrinsics
from core.photos import sensors
from core.photos import size as photo_size
from core.photos.containers.light import srgb
from core.photos.containers.openexr import write_exr
from core.photos.linear import photo_from_linear
from core.photos.photo import check_size, photo_facts, read_photo
from core.photos.size import picture_size, reduction


@pytest.fixture
def put(tmp_path):
    def write(data, name):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


@pytest.fixture
def small_limit(monkeypatch):
    """Photos of more than 1000 pixels are large."""
    monkeypatch.setattr(photo_size, "MAX_PIXELS", 1000)


CONTAINERS = {
    ".jpg": lambda p, o: encoded(".jpg", p, exif({0x0112: (SHORT, o)})),
    ".png": lambda p, o: encoded(".png", p, exif({0x0112: (SHORT, o)})),
}
CONTAINERS[".tif"] = tiff


@pytest.mark.parametrize("suffix", CONTAINERS)
@pytest.mark.parametrize("orientation", [1, 6, 3])
def test_a_large_photo_is_reduced_and_keeps_its_own_size(put, small_limit, suffix, orientation):
    stored = picture(48, 64)  # 3072 pixels: every 2 x 2 become one
    photo = read_photo(put(CONTAINERS[suffix](stored, orientation), "a" + suffix))
    upright = {1: stored, 6: np.rot90(stored, -1), 3: np.rot90(stored, 2)}[orientation]
    height, width = upright.shape[:2]
    assert (photo.width, photo.height, photo.full_size) == (width, height, (width, height))
    assert photo.pixels.shape == (height // 2, width // 2, 3)
    assert np.abs(photo.pixels.astype(int) - upright[::2, ::2]).mean() < 4  # blocks of one colour
    assert f"has {width} x {height} pixels; every 2 x 2" in " ".join(photo.notes)
    camera = Intrinsics(width, height, 100, 100, width / 2, height / 2)
    assert check_size(photo, camera) == camera


def test_a_large_photo_of_16_bits_with_alpha(put, small_limit):
    deep = np.full((40, 60, 4), 65535, np.uint16)
    deep[..., :3] = (100 * 257, 50 * 257, 200 * 257)
    deep[:, :30, 3] = 0
    ok, data = cv2.imencode(".png", deep)
    assert ok
    photo = read_photo(put(data.tobytes(), "a.png"))
    assert photo.pixels.shape == (20, 30, 3)
    np.testing.assert_array_equal(photo.pixels[10, 20], [200, 50, 100])
    assert not photo.mask[:, :15].any()
    assert photo.mask[:, 15:].all()


def test_an_ordinary_photo_is_left_alone(put):
    photo = read_photo(put(encoded(".png", picture()), "a.png"))
    assert photo.full_size is None
    np.testing.assert_array_equal(photo.pixels, picture())


@pytest.mark.parametrize(("size", "factor"), [((6000, 5592), 1), ((6000, 5593), 2), ((12000, 9000), 2), ((20000, 20000), 4)])
def test_reduction(size, factor):
    assert reduction(size) == factor
    assert size[0] * size[1] / factor**2 <= 32 << 20


def test_a_picture_of_absurd_size_is_refused_before_it_is_decoded(put):
    png = encoded(".png", picture())
    path = put(png[:16] + struct.pack(">II", 30_000, 20_000) + png[24:], "a.png")
    with pytest.raises(PhotoError, match="30000 x 20000 pixels; at most 400 megapixels"):
        read_photo(path)


@pytest.mark.parametrize("size", [(1_000_000, 1), (101, 1), (3, 303)])
def test_a_strip_is_refused_before_it_is_decoded_and_where_its_header_says_nothing(put, size):
    png = encoded(".png", picture())
    path = put(png[:16] + struct.pack(">II", *size) + png[24:], "a.png")
    with pytest.raises(PhotoError, match=f"{size[0]} x {size[1]} pixels; the long side may be at most 100 times"):
        read_photo(path)
    path = put(cv2.imencode(".bmp", np.zeros((size[1], size[0], 3), np.uint8))[1].tobytes(), "a.bmp")
    with pytest.raises(PhotoError, match="the long side may be at most 100 times"):
        read_photo(path)
    assert read_photo(put(cv2.imencode(".bmp", np.zeros((1, 100, 3), np.uint8))[1].tobytes(), "b.bmp")).width == 100


def test_sizes_in_headers():
    for suffix in (".jpg", ".png"):
        assert picture_size(encoded(suffix, picture(48, 64))) == (64, 48)
        assert picture_size(encoded(suffix, picture(48, 64), exif({0x0112: (SHORT, 6)}))) == (64, 48)
    assert picture_size(encoded(".webp", picture(48, 64), exif({0x0112: (SHORT, 6)}))) == (64, 48)
    assert picture_size(tiff(picture(48, 64))) == (64, 48)
    assert picture_size(b"\xff\xd8\xff") is None
    assert picture_size(b"hello") is None


def model_exif(model, focal):
    """An EXIF block with a camera's name and a real focal length: one directory, one more, then the texts."""
    text = model.encode() + b"\0"
    at = 8 + 2 + 24 + 4 + 2 + 12 + 4
    main = struct.pack("<HHHIIHHIII", 2, 0x0110, 2, len(text), at + 8, 0x8769, 4, 1, 38, 0)
    sub = struct.pack("<HHHIII", 1, 0x920A, RATIONAL, 1, at, 0)
    return b"II*\0" + struct.pack("<I", 8) + main + sub + struct.pack("<II", round(focal * 10), 10) + text


def test_the_focal_length_follows_from_the_sensor_of_a_known_camera(put):
    photo = read_photo(put(encoded(".jpg", picture(48, 72), model_exif("NIKON D7200", 35.0)), "a.jpg"))
    focal_px = photo.focal_35mm * math.hypot(72, 48) / math.hypot(36, 24)  # CIPA's definition
    assert focal_px == pytest.approx(35 / 23.5 * 72, rel=1e-6)
    assert "focal length of 35 mm" in " ".join(photo.notes)


def test_an_upright_photo_of_a_known_camera_too(put):
    assert sensors.focal_35mm_of("nikon  d7200", 35, 48, 72) == sensors.focal_35mm_of("NIKON D7200", 35, 72, 48)


def test_an_unknown_camera_tells_no_focal_length(put):
    assert read_photo(put(encoded(".jpg", picture(), model_exif("Unknown 1", 35.0)), "a.jpg")).focal_35mm is None


def test_the_stated_equivalent_goes_before_the_table(put):
    block = exif(sub={0xA405: (SHORT, 28), 0x920A: (RATIONAL, (43, 10))})
    assert read_photo(put(encoded(".jpg", picture(), block), "a.jpg")).focal_35mm == 28


def test_the_table_is_sane():
    assert len(sensors.WIDTH_MM) == sum(len(m) for m in sensors.MODELS_BY_WIDTH_MM.values()) > 60  # no model twice
    assert all(4 < width <= 36 for width in sensors.MODELS_BY_WIDTH_MM)


def test_a_damaged_exr_is_one_sentence(put):
    with pytest.raises(PhotoError, match=r"'a\.exr' is no whole OpenEXR file"):
        read_photo(put(b"\x76\x2f\x31\x01" + bytes(100), "a.exr"))


LIGHT = np.linspace(0, 4, 1200, dtype=np.float32).reshape(20, 60)


@pytest.mark.parametrize("prefix", ["", "beauty."])
def test_the_light_of_an_exr_file_is_that_of_the_same_pixels(tmp_path, prefix):
    planes = {"R": LIGHT, "G": LIGHT[::-1], "B": LIGHT[:, ::-1]}
    write_exr(tmp_path / "a.exr", {prefix + name: plane for name, plane in planes.items()} | {"depth.Z": LIGHT})
    photo = read_photo(tmp_path / "a.exr")
    wanted = photo_from_linear(np.stack([*planes.values(), np.ones_like(LIGHT)], axis=2))
    np.testing.assert_array_equal(photo.pixels, wanted.pixels)
    assert photo.mask is None and photo.file.endswith("a.exr")
    facts = photo_facts(tmp_path / "a.exr")
    assert (facts.width, facts.height, facts.focal_35mm) == (60, 20, None)


def test_an_exr_file_of_one_grey_channel_is_grey_and_one_without_colour_says_so(tmp_path):
    write_exr(tmp_path / "y.exr", {"Y": LIGHT, "A": (LIGHT > 1).astype(np.float32)})
    photo = read_photo(tmp_path / "y.exr")
    assert (photo.pixels == photo.pixels[..., :1]).all()
    np.testing.assert_array_equal(photo.mask, LIGHT > 1)
    write_exr(tmp_path / "z.exr", {"Z": LIGHT})
    with pytest.raises(PhotoError, match=r"'z\.exr' has the channels Z; a picture has R, G and B, or Y"):
        read_photo(tmp_path / "z.exr")


def test_linear_light_is_exposed_and_encoded():
    light = np.full((20, 50, 4), 1, np.float32)
    light[..., :3] = np.linspace(0, 8, 1000, dtype=np.float32).reshape(20, 50, 1)
    photo = photo_from_linear(light, "a.exr")
    assert photo.mask is None
    white = np.quantile(light[..., 0], 0.99)
    for row, column in ((0, 0), (3, 7), (12, 30), (19, 49)):
        x = min(1.0, light[row, column, 0] / white)
        want = 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055
        np.testing.assert_allclose(photo.pixels[row, column], 255 * want, atol=0.51)


def test_linear_light_that_cannot_be_seen(small_limit):
    light = np.ones((40, 60, 4), np.float32)
    light[:, :20, 3] = 0
    light[:, 20:30, 1] = np.nan
    photo = photo_from_linear(light)
    assert photo.full_size == (60, 40)
    assert photo.pixels.shape == (20, 30, 3)
    assert not photo.mask[:, :15].any()
    assert photo.mask[:, 15:].all()
    with pytest.raises(PhotoError, match="black or transparent"):
        photo_from_linear(np.zeros((4, 4, 4), np.float32))


def test_the_srgb_curve_is_continuous():
    x = np.float32([0.0031307, 0.0031309])
    assert np.diff(srgb(x))[0] < 1e-4
    assert srgb(np.float32([1]))[0] == pytest.approx(1)
