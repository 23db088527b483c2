"""Photos as cameras and phones leave them: bits, grey, alpha, EXIF; and the sentence for what is no photo."""

import struct

import cv2
import numpy as np
import pytest

from core.errors import PhotoError
from core.geometry.camera import Intrinsics
from core.photos.photo import Photo, check_size, read_photo

SHORT, LONG, RATIONAL = 3, 4, 5
RGB = np.random.default_rng(0).integers(0, 256, (6, 9, 3)).astype(np.uint8)


def exif_block(order="<", orientation=None, focal_35mm=None, lens=None):
    """A TIFF-style EXIF block; `lens` is (focal mm, pixels per resolution unit, unit, width, height)."""
    main = [(0x0112, SHORT, orientation)] if orientation else []
    inner = [(0xA405, SHORT, focal_35mm)] if focal_35mm else []
    if lens:
        focal, density, unit, width, height = lens
        inner += [(0x920A, RATIONAL, focal), (0xA002, LONG, width), (0xA003, LONG, height)]
        inner += [(0xA20E, RATIONAL, density), (0xA210, SHORT, unit)]
    at = 8 + 2 + 12 * (len(main) + 1) + 4  # the inner directory follows the main one
    main.append((0x8769, LONG, at))
    return (
        (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8) + _dir(order, main, 8) + _dir(order, inner, at)
    )


def _dir(order, entries, at):
    tail_at, tail, out = at + 2 + 12 * len(entries) + 4, b"", struct.pack(order + "H", len(entries))
    for tag, kind, value in entries:
        out += struct.pack(order + "HHI", tag, kind, 1)
        if kind == SHORT:
            out += struct.pack(order + "HH", value, 0)
        elif kind == LONG:
            out += struct.pack(order + "I", value)
        else:
            out += struct.pack(order + "I", tail_at + len(tail))
            tail += struct.pack(order + "II", round(value * 1000), 1000)
    return out + bytes(4) + tail


def encoded(ext, pixels=RGB, exif=b""):
    """File bytes of RGB(A) or grey `pixels`, with `exif` put in by hand."""
    flip = {3: [2, 1, 0], 4: [2, 1, 0, 3]}.get(pixels.shape[-1]) if pixels.ndim == 3 else None
    ok, data = cv2.imencode(ext, pixels if flip is None else pixels[..., flip], [cv2.IMWRITE_JPEG_QUALITY, 100])
    assert ok
    data = data.tobytes()
    if exif and ext == ".jpg":
        block = b"Exif\0\0" + exif
        data = data[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block + data[2:]
    elif exif:
        chunk = b"eXIf" + exif
        data = data[:33] + struct.pack(">I", len(exif)) + chunk + struct.pack(">I", _crc(chunk)) + data[33:]
    return data


def _crc(data):
    import zlib

    return zlib.crc32(data)


@pytest.fixture
def put(tmp_path):
    def write(data, name="photo.png"):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


@pytest.mark.parametrize("ext", [".png", ".tif", ".bmp"])
def test_eight_bit_colour_comes_through_untouched(put, ext):
    path = put(encoded(ext), "photo" + ext)
    photo = read_photo(path)
    np.testing.assert_array_equal(photo.pixels, RGB)
    assert (photo.width, photo.height, photo.file) == (9, 6, str(path))
    assert (photo.mask, photo.focal_35mm, photo.notes) == (None, None, ())
    assert photo.pixels.flags.c_contiguous


def test_jpeg_is_rgb_too(put):
    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 0] = 200
    assert np.abs(read_photo(put(encoded(".jpg", red), "a.jpg")).pixels.astype(int) - (200, 0, 0)).max() <= 3


@pytest.mark.parametrize("ext", [".png", ".tif"])
def test_sixteen_bits_are_scaled_to_eight(put, ext):
    deep = RGB.astype(np.uint16) * 257
    photo = read_photo(put(encoded(ext, deep), "a" + ext))
    np.testing.assert_array_equal(photo.pixels, RGB)
    assert photo.notes == ("The photo has 16 bits per channel; it is used with 8.",)


def test_sixteen_bits_round_to_the_nearest(put):
    deep = np.array([[0, 128, 129, 65535 - 129, 65535 - 128, 65535]], np.uint16)
    np.testing.assert_array_equal(read_photo(put(encoded(".png", deep))).pixels[0, :, 0], [0, 0, 1, 254, 255, 255])


def test_grey_is_repeated(put):
    photo = read_photo(put(encoded(".png", RGB[..., 0].copy())))
    np.testing.assert_array_equal(photo.pixels, np.repeat(RGB[..., :1], 3, axis=2))
    assert photo.notes == ("The photo is grey.",)


def test_alpha_becomes_the_mask(put):
    alpha = np.full((6, 9, 1), 255, np.uint8)
    alpha[:2], alpha[2, 0] = 0, 1
    photo = read_photo(put(encoded(".png", np.concatenate([RGB, alpha], axis=2))))
    np.testing.assert_array_equal(photo.mask, alpha[..., 0] > 0)
    np.testing.assert_array_equal(photo.pixels[photo.mask], RGB[photo.mask])
    assert "transparent pixels are left out" in photo.notes[0]


def test_alpha_that_hides_nothing_is_dropped(put):
    photo = read_photo(put(encoded(".png", np.concatenate([RGB, np.full((6, 9, 1), 255, np.uint8)], axis=2))))
    assert photo.mask is None
    np.testing.assert_array_equal(photo.pixels, RGB)


# What the viewer sees of stored rows/columns, straight from the EXIF table: (top of the picture, left of the picture).
UPRIGHT = {
    1: RGB,
    2: np.fliplr(RGB),
    3: np.rot90(RGB, 2),
    4: np.flipud(RGB),
    5: np.transpose(RGB, (1, 0, 2)),
    6: np.rot90(RGB, -1),
    7: np.transpose(np.rot90(RGB, 2), (1, 0, 2)),
    8: np.rot90(RGB, 1),
}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_rotation_is_applied_once(put, orientation, order):
    photo = read_photo(put(encoded(".png", exif=exif_block(order, orientation))))
    np.testing.assert_array_equal(photo.pixels, UPRIGHT[orientation])
    assert len(photo.notes) == (orientation != 1)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_jpeg_turns_as_opencv_itself_turns_it(put, orientation):
    smooth = cv2.resize(RGB, (45, 30), interpolation=cv2.INTER_CUBIC)
    path = put(encoded(".jpg", smooth, exif_block("<", orientation)), "a.jpg")
    np.testing.assert_array_equal(read_photo(path).pixels, cv2.imread(str(path), cv2.IMREAD_COLOR)[..., ::-1])


def test_mask_turns_with_the_pixels(put):
    alpha = np.full((6, 9, 1), 255, np.uint8)
    alpha[0, 0] = 0
    photo = read_photo(put(encoded(".png", np.concatenate([RGB, alpha], axis=2), exif_block("<", 6))))
    assert photo.mask.shape == (9, 6)
    assert np.argwhere(~photo.mask).tolist() == [[0, 5]]  # a quarter turn clockwise takes the top left to the top right


@pytest.mark.parametrize(("ext", "order"), [(".jpg", "<"), (".jpg", ">"), (".png", "<")])
def test_focal_length_as_the_camera_states_it(put, ext, order):
    assert read_photo(put(encoded(ext, exif=exif_block(order, focal_35mm=28)), "a" + ext)).focal_35mm == 28.0


def test_focal_length_from_the_sensor(put):
    """A full-frame sensor, 36 x 24 mm over 6000 x 4000 pixels: its 50 mm lens is a 50 mm equivalent."""
    lens = (50.0, 6000 / 3.6, 3, 6000, 4000)  # pixels per centimetre
    assert read_photo(put(encoded(".png", exif=exif_block(lens=lens)))).focal_35mm == pytest.approx(50, rel=1e-4)


@pytest.mark.parametrize(
    ("size", "wanted"),
    [
        ((5184, 3456), 26.8),
        ((1280, 720), None),  # fewer pixels than any such sensor has
        ((540, 360), None),  # a sensor of 2 mm
        ((60_000, 40_000), None),  # one of 26 cm
    ],
)
def test_the_resolution_of_a_photo_that_was_resized_is_not_believed(put, size, wanted):
    """Canon's cameras tell pixels per inch of their sensor, and programs that resize leave that as it is."""
    block = exif_block(lens=(16.662, 5184 / (22.5 / 25.4), 2, *size))
    got = read_photo(put(encoded(".png", exif=block))).focal_35mm
    assert got == (None if wanted is None else pytest.approx(wanted, abs=0.2))


@pytest.mark.parametrize("cut", [3, 9, 15, 30])
def test_damaged_exif_does_not_cost_the_photo(put, cut):
    photo = read_photo(put(encoded(".png", exif=exif_block(orientation=6, focal_35mm=28)[:cut])))
    assert photo.focal_35mm is None
    assert sorted(photo.pixels.shape[:2]) == [6, 9]


GOOD_JPG = encoded(".jpg", cv2.resize(RGB, (200, 120)))
CASES = {
    "empty": (b"", "is empty (0 bytes)"),
    "text": (b"no picture at all", "cannot be decoded"),
    "cut jpeg": (GOOD_JPG[: len(GOOD_JPG) // 2], "cut off"),
    "jpeg header alone": (GOOD_JPG[:20], ""),
    "png header alone": (encoded(".png")[:40], "is cut off: the PNG has no end"),
    "float": (cv2.imencode(".tif", RGB.astype(np.float32))[1].tobytes(), "float32"),
    "transparent": (encoded(".png", np.dstack([RGB, np.zeros((6, 9), np.uint8)])), "fully transparent"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_no_photo_gets_one_sentence(put, case):
    data, words = CASES[case]
    refuse(put(data), words)


def refuse(path, words):
    with pytest.raises(PhotoError) as caught:
        read_photo(path)
    sentence = str(caught.value)
    assert words in sentence
    assert sentence.endswith(".")
    assert "\n" not in sentence


def test_missing_photo_and_folder(tmp_path):
    refuse(tmp_path / "nowhere.jpg", "There is no photo at")
    refuse(tmp_path, "is a folder")


def photo_of(width, height):
    return Photo(np.zeros((height, width, 3), np.uint8), "a.jpg")


LENS = Intrinsics(4000, 3000, 3200.0, 3200.0, 2000.0, 1500.0, (0.1, 0, 0, 0, 0))


def test_same_size_is_the_same_camera():
    assert check_size(photo_of(4000, 3000), LENS) is LENS


@pytest.mark.parametrize(("width", "height"), [(640, 480), (8000, 6000), (641, 480), (1000, 751)])
def test_same_shape_is_resized(width, height):
    fitted = check_size(photo_of(width, height), LENS)
    assert (fitted.width, fitted.height) == (width, height)
    assert fitted.fx == pytest.approx(3200 * width / 4000)
    assert fitted.cy == pytest.approx(1500 * height / 3000)
    assert fitted.dist == LENS.dist


@pytest.mark.parametrize(
    ("width", "height", "words"), [(3000, 4000, "turned by 90"), (640, 360, "another shape;"), (4000, 3004, "uncropped")]
)
def test_another_shape_is_refused(width, height, words):
    with pytest.raises(PhotoError, match=words) as caught:
        check_size(photo_of(width, height), LENS)
    assert f"{width} x {height}" in str(caught.value)
    assert "4000 x 3000" in str(caught.value)
