"""Photos in the containers that OpenCV reads in its own ways: TIFF, which it turns itself, WebP, and alpha in all of them."""

import cv2
import numpy as np
import pytest
from photo_files import RATIONAL, SHORT, encoded, exif, picture, tiff

import core.photos.photo as photo_module
from core.errors import PhotoError
from core.photos.exif import read_exif
from core.photos.photo import photo_facts, read_photo

CODEC_ERROR = {".jpg": 12, ".png": 0, ".webp": 12}  # largest error of the codec inside a block
UPRIGHT = {  # EXIF's own definition: where the stored first row and first column belong
    1: lambda a: a,
    2: np.fliplr,
    3: lambda a: np.rot90(a, 2),
    4: np.flipud,
    5: lambda a: a.swapaxes(0, 1),
    6: lambda a: np.rot90(a, -1),
    7: lambda a: np.rot90(a, 2).swapaxes(0, 1),
    8: lambda a: np.rot90(a, 1),
}


@pytest.fixture
def put(tmp_path):
    def write(data, name):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


def same(pixels, want, tolerance):
    """Equal away from the edges between blocks, where codecs ring."""
    assert pixels.shape == want.shape
    assert pixels.dtype == np.uint8
    height, width = want.shape[:2]
    for y in (0.2, 0.8):
        for x in (0.2, 0.8):
            at = int(y * height), int(x * width)
            np.testing.assert_allclose(pixels[at].astype(int), want[at].astype(int), atol=tolerance)


@pytest.mark.parametrize("suffix", CODEC_ERROR)
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_applied_exactly_once(put, suffix, orientation):
    stored = picture()
    photo = read_photo(put(encoded(suffix, stored, exif({0x0112: (SHORT, orientation)})), "photo" + suffix))
    same(photo.pixels, UPRIGHT[orientation](stored), CODEC_ERROR[suffix])
    assert photo.pixels.flags.c_contiguous
    assert any("EXIF" in note for note in photo.notes) == (orientation != 1)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_tiff_orientation_is_applied_exactly_once(put, kind, orientation):
    stored = picture()
    scale = 257 if kind == np.uint16 else 1
    photo = read_photo(put(tiff(stored.astype(kind) * kind(scale), orientation), "photo.tiff"))
    np.testing.assert_array_equal(photo.pixels, UPRIGHT[orientation](stored))


@pytest.mark.parametrize("order", ["<", ">"])
def test_focal_length_as_the_camera_states_it(put, order):
    block = exif({0x0112: (SHORT, 1)}, {0xA405: (SHORT, 28), 0x920A: (RATIONAL, (425, 100))}, order)
    for suffix in CODEC_ERROR:
        assert read_photo(put(encoded(suffix, picture(), block), "photo" + suffix)).focal_35mm == 28


@pytest.mark.parametrize("kind", ["png", "webp", "tiff", "png16"])
def test_alpha_becomes_a_mask(put, kind):
    image = picture()
    alpha = np.full((48, 64, 1), 255, np.uint8)
    alpha[:, :10] = 0
    rgba = np.concatenate([image, alpha], axis=2)
    if kind == "tiff":
        data = tiff(rgba, alpha=True)
    elif kind == "webp":
        data = cv2.imencode(".webp", rgba[..., [2, 1, 0, 3]], [cv2.IMWRITE_WEBP_QUALITY, 101])[1].tobytes()
    else:
        deep = rgba.astype(np.uint16) * np.uint16(257) if kind == "png16" else rgba
        data = cv2.imencode(".png", np.ascontiguousarray(deep[..., [2, 1, 0, 3]]))[1].tobytes()
    photo = read_photo(put(data, f"alpha.{kind[:4].replace('png1', 'png')}"))
    np.testing.assert_array_equal(photo.mask, alpha[..., 0] > 0)
    np.testing.assert_array_equal(photo.pixels[:, 10:], image[:, 10:])
    assert any("alpha" in note for note in photo.notes)


def test_a_size_that_no_memory_holds_is_refused(put):
    png = encoded(".png", picture())
    with pytest.raises(PhotoError, match="at most 400 megapixels can be read"):
        read_photo(put(png[:16] + (1 << 30).to_bytes(4, "big") * 2 + png[24:], "huge.png"))


# ---- what phones and editors put around a JPEG's picture

MP4 = b"\0\0\0\x18ftypmp42\0\0\0\0" + b"\xff\xda\0\x0c" + bytes(range(256)) * 40  # a film holds every pair of bytes


def jpeg_with(block=b"", fill=b""):
    """A JPEG of noise, so that its scan holds stuffed bytes; `fill` stands before its EXIF segment."""
    image = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)
    data = encoded(".jpg", image, block)
    assert b"\xff\x00" in data
    return data[:2] + fill + data[2:], image


@pytest.mark.parametrize("tail", [MP4, b"\xff\xd8\xff\xda", b"\xff\xda" * 9, bytes(1000)])
def test_data_behind_the_end_of_a_jpeg_is_no_fault(put, tail):
    data, _ = jpeg_with(exif({0x0112: (SHORT, 6)}))
    plain = read_photo(put(data, "plain.jpg"))
    photo = read_photo(put(data + tail, "motion.jpg"))
    np.testing.assert_array_equal(photo.pixels, plain.pixels)
    assert photo_facts(put(data + tail, "motion.jpg")).width == 48


@pytest.mark.parametrize("share", [0.3, 0.7, 0.999])
def test_a_jpeg_without_the_end_of_its_picture_is_cut_off(put, share):
    """Also where an end mark stands in what a thumbnail or an earlier segment holds."""
    data, _ = jpeg_with()
    body = b"\xff\xd8\xff\xd9"
    data = data[:2] + b"\xff\xe2" + (len(body) + 2).to_bytes(2, "big") + body + data[2:]
    cut = data[: int(share * len(data))]
    with pytest.raises(PhotoError, match="is cut off"):
        read_photo(put(cut, "cut.jpg"))


def test_restart_marks_and_several_scans_are_walked(put):
    image = np.random.default_rng(2).integers(0, 256, (64, 64, 3), np.uint8)
    options = [cv2.IMWRITE_JPEG_RST_INTERVAL, 2, cv2.IMWRITE_JPEG_PROGRESSIVE, 1]
    data = cv2.imencode(".jpg", image, options)[1].tobytes()
    assert data.count(b"\xff\xda") > 1 and b"\xff\xd0" in data
    assert read_photo(put(data + MP4, "a.jpg")).width == 64
    with pytest.raises(PhotoError, match="is cut off"):
        read_photo(put(data[: data.rindex(b"\xff\xda") + 20], "b.jpg"))


def test_fill_bytes_before_a_marker_cost_neither_exif_nor_size(put):
    """T.81, B.1.1.2: any marker may be preceded by any number of fill bytes 0xFF."""
    data, _ = jpeg_with(exif({0x0112: (SHORT, 6)}, {0xA405: (SHORT, 28)}), fill=b"\xff\xff\xff")
    photo, facts = read_photo(put(data, "a.jpg")), photo_facts(put(data, "a.jpg"))
    assert photo.focal_35mm == facts.focal_35mm == 28
    assert (photo.width, photo.height) == (facts.width, facts.height) == (48, 64)
    assert not photo.stored_upright and not facts.stored_upright


@pytest.mark.parametrize("cut", [1, 5, 11, 12])
def test_exif_that_is_cut_off_keeps_what_came_before(put, cut):
    """The last entry is lost, and what lies behind it; not the orientation in front of it."""
    block = exif({0x0112: (SHORT, 6), 0xA405: (SHORT, 28)})
    photo = read_photo(put(encoded(".jpg", picture(), block[: len(block) - 4 - cut]), "a.jpg"))
    assert not photo.stored_upright and photo.pixels.shape == (64, 48, 3)


def test_exif_whose_sub_directory_is_cut_off_keeps_the_rest(put):
    block = exif({0x0112: (SHORT, 6)}, {0x920A: (RATIONAL, (425, 100)), 0xA405: (SHORT, 28)})
    whole = read_photo(put(encoded(".png", picture(), block), "a.png"))
    assert whole.focal_35mm == 28
    directory = len(block) - 8 - 4 - 24  # its count stands before this, its two entries after it
    photo = read_photo(put(encoded(".png", picture(), block[: directory + 20]), "b.png"))
    assert not photo.stored_upright


def test_a_photos_exif_is_read_once(put, monkeypatch):
    calls = []
    monkeypatch.setattr(photo_module, "read_exif", lambda data: calls.append(1) or read_exif(data))
    path = put(encoded(".jpg", picture(), exif({0x0112: (SHORT, 6)})), "a.jpg")
    read_photo(path)
    assert len(calls) == 1
    photo_facts(put(cv2.imencode(".bmp", picture())[1].tobytes(), "a.bmp"))  # whose header tells no size
    assert len(calls) == 2
