"""Photos in the containers that OpenCV reads in its own ways: TIFF, which it turns itself, WebP, and alpha in all of them."""

import cv2
import numpy as np
import pytest
from photo_files import RATIONAL, SHORT, encoded, exif, picture, tiff

from core.errors import PhotoError
from core.photos.photo import read_photo

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
