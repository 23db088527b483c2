"""Files that hold more than one picture, planes of their own, or boxes: which pixels come out, and how they are turned."""

import base64
import importlib.util
import io
import sys
import zlib

import cv2
import numpy as np
import pytest

from core.errors import PhotoError
from core.photos.photo import photo_facts, read_photo

from ..support.photo_files import LONG, SHORT, TiffFile, encoded, exif, picture, tiff

# A 64 x 48 picture as pillow-heif 1.4 writes it, with an EXIF orientation of 6 and a 35 mm equivalent of 27 mm.
HEIC = base64.b64decode(
    "AAAAHGZ0eXBoZWljAAAAAG1pZjFoZWljbWlhZgAAAchtZXRhAAAAAAAAACFoZGxyAAAAAAAAAABwaWN0AAAAAAAAAAAAAAAAAAAAADRpbG9jAAAAAERA"
    "AAIAAQAAAAAB7AABAAAAAAAAALEAAgAAAAACnQABAAAAAAAAAG4AAAA4aWluZgAAAAAAAgAAABVpbmZlAgAAAAABAABodmMxAAAAABVpbmZlAgAAAQAC"
    "AABFeGlmAAAAAA5waXRtAAAAAAABAAABB2lwcnAAAADmaXBjbwAAAHZodmNDAQNwAAAAkAAAAAAAHvAA/P34+AAADwNgAAEAGEABDAH//wNwAAADAJAA"
    "AAMAAAMAHroCQGEAAQAqQgEBA3AAAAMAkAAAAwAAAwAeoCCBBZbq5Ka5uAhoMCAAAAMDIAAAAwAhYgABAAZEAcFzwIkAAAATY29scm5jbHgAAQANAAaA"
    "AAAAFGlzcGUAAAAAAAAAQAAAAEAAAAAoY2xhcAAAAEAAAAABAAAAMAAAAAEAAAAAAAAAAv////AAAAACAAAAEHBpeGkAAAAAAwgICAAAAAlpcm90AwAA"
    "ABlpcG1hAAAAAAAAAAEAAQaBAgMFhIYAAAAaaXJlZgAAAAAAAAAOY2RzYwACAAEAAQAAASdtZGF0AAAArSgBrwngITip//It3/8THZe5lyeVp79Y//0Q"
    "b70Nb/4im3R+jauyid0mV+Tqv+0PB5VgP/cZ/ZTTzrT49En5/lFInmrmosQHvwI9eVkmioAN9dslgRsk0/XKqHYYbeb12OWQwr9hRy15Lb/e//IgnMOI"
    "KmfKbcM8dqW5Nd2MFGIYr3ukTqqznR5YoR2AjGBmDOv6xI+XdnuDVWSQpmdKjaw/VpANmkzVzxrzpwmIAAAABkV4aWYAAE1NACoAAAAIAAMBEAACAAAA"
    "DAAAADIBEgADAAAAAQAGAACHaQAEAAAAAQAAAD4AAAAAQ2Fub24gRU9TIFIAAAKSCgAMAAAAAQAAAFykBQADAAAAAQAbAAAAAAAAQDsAAAAAAAA="
)


@pytest.fixture
def read(tmp_path):
    def reads(data, name="a.tif"):
        (tmp_path / name).write_bytes(data)
        photo, facts = read_photo(tmp_path / name), photo_facts(tmp_path / name)
        assert (facts.width, facts.height, facts.orientation) == (photo.width, photo.height, photo.orientation)
        return photo

    return reads


def test_the_largest_of_a_tiffs_pictures_is_the_photo(read):
    file = TiffFile()
    first = file.directory(file.strip(picture(12, 16), t254=1))
    second = file.directory(file.strip(picture(48, 64)))
    file.follow(first, second)
    np.testing.assert_array_equal(read(bytes(file.data)).pixels, picture(48, 64))


def test_a_picture_below_the_first_directory_is_found_and_turned_by_what_that_says(read):
    file = TiffFile()
    sub = file.directory(file.strip(picture(48, 64)))
    file.data[4:8] = bytes(4)
    file.directory({**file.strip(picture(12, 16), t254=1, t274=6), 330: (LONG, (sub,))})
    photo = read(bytes(file.data), "a.dng")
    assert photo.orientation == 6
    np.testing.assert_array_equal(photo.pixels, cv2.rotate(picture(48, 64), cv2.ROTATE_90_CLOCKWISE))


def test_a_jpeg_inside_a_raw_file_is_the_photo_where_it_has_its_size(read, monkeypatch):
    """As in Nikon's NEF: the sensor's values in one directory, a JPEG of the whole picture in another."""
    inner = encoded(".jpg", picture(48, 64))

    def raw(size):
        file = TiffFile()
        at = file.put(inner)
        preview = file.directory({254: (LONG, (1,)), 259: (SHORT, (6,)), 513: (LONG, (at,)), 514: (LONG, (len(inner),))})
        sensor = file.directory(file.strip(np.zeros((*size, 1), np.uint16), t262=32803))
        file.data[4:8] = bytes(4)
        file.directory({**file.strip(picture(12, 16), t254=1), 330: (LONG, (preview, sensor))})
        return bytes(file.data)

    photo = read(raw((50, 66)), "a.nef")
    assert np.abs(photo.pixels.astype(int) - picture(48, 64)).mean() < 3  # a JPEG with halved colours
    monkeypatch.setitem(sys.modules, "rawpy", None)
    with pytest.raises(PhotoError, match=r"raw photo of 640 x 480 pixels that holds only a small preview.*JPEG or TIFF"):
        read(raw((480, 640)), "a.nef")


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("deflate", [False, True])
def test_planes_of_their_own_become_the_picture(read, kind, deflate):
    image = picture().astype(kind) * (257 if kind == np.uint16 else 1)
    image[3, 5] = image[3, 5] // 3
    file, rows = TiffFile(), 20
    strips = [image[top : top + rows, :, c].tobytes() for c in range(3) for top in range(0, 48, rows)]
    strips = [zlib.compress(strip) for strip in strips] if deflate else strips
    tags = {256: 64, 257: 48, 259: 8 if deflate else 1, 262: 2, 277: 3, 278: rows, 284: 2}
    listed = {273: (LONG, tuple(file.put(strip) for strip in strips)), 279: (LONG, tuple(len(strip) for strip in strips))}
    file.directory({tag: (LONG, (v,)) for tag, v in tags.items()} | listed | {258: (SHORT, (8 * image.itemsize,) * 3)})
    np.testing.assert_array_equal(read(bytes(file.data)).pixels, image // 257 if kind == np.uint16 else image)


def test_directories_that_run_in_a_circle_end(read):
    file = TiffFile()
    first = file.directory(file.strip(picture()))
    file.follow(first, first)
    np.testing.assert_array_equal(read(bytes(file.data)).pixels, picture())


def test_a_tiff_is_turned_once(read):
    upright = read(tiff(picture(), orientation=8))
    np.testing.assert_array_equal(upright.pixels, cv2.rotate(picture(), cv2.ROTATE_90_COUNTERCLOCKWISE))


def test_damaged_tiffs_end_in_a_photo_or_one_sentence(tmp_path):
    file = TiffFile()
    first = file.directory(file.strip(picture(12, 16)))
    file.follow(first, file.directory({**file.strip(picture(24, 32), t284=2), 330: (LONG, (first, 9, 1 << 30))}))
    good, random = bytes(file.data), np.random.default_rng(3)
    for _ in range(300):
        data = bytearray(good)
        for at in random.integers(0, len(data), 3):
            data[at] = random.integers(256)
        for at in random.integers(first, first + 200, 2):
            data[at] = random.integers(256)
        (tmp_path / "a.tif").write_bytes(bytes(data[: random.integers(8, len(data) + 1)]))
        try:
            read_photo(tmp_path / "a.tif")
        except PhotoError as error:
            assert str(error).endswith(".")


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_an_avif_is_turned_as_its_boxes_say(read, orientation):
    """Pillow writes the boxes from an EXIF orientation; the truth is OpenCV's rotation of the picture."""
    image = pytest.importorskip("PIL.Image")
    block = exif({0x0112: (SHORT, orientation)}, {0xA405: (SHORT, 27)})
    stream = io.BytesIO()
    image.fromarray(picture()).save(stream, "AVIF", exif=block, quality=95, subsampling="4:4:4")
    photo = read(stream.getvalue(), "a.avif")
    turn = {3: cv2.ROTATE_180, 6: cv2.ROTATE_90_CLOCKWISE, 8: cv2.ROTATE_90_COUNTERCLOCKWISE}.get(orientation)
    wanted = picture() if turn is None else cv2.rotate(picture(), turn)
    assert np.abs(photo.pixels.astype(int) - wanted).mean() < 3
    assert (photo.orientation, photo.focal_35mm) == (orientation, 27)


@pytest.mark.skipif(importlib.util.find_spec("pi_heif") is not None, reason="pi-heif is installed")
def test_a_heic_photo_names_the_package_that_reads_it(tmp_path):
    (tmp_path / "a.heic").write_bytes(HEIC)
    with pytest.raises(PhotoError, match="HEIC photo, which needs the Python package pi-heif; install it"):
        read_photo(tmp_path / "a.heic")
    facts = photo_facts(tmp_path / "a.heic")
    assert (facts.width, facts.height, facts.orientation, facts.focal_35mm) == (48, 64, 6, 27)


def test_a_heic_photo_is_read_with_pi_heif(read):
    pytest.importorskip("pi_heif")
    photo = read(HEIC, "a.heic")
    wanted = cv2.rotate(picture(), cv2.ROTATE_90_CLOCKWISE)
    assert photo.orientation == 6 and np.abs(photo.pixels.astype(int) - wanted).mean() < 4


@pytest.mark.parametrize(
    ("start", "words"),
    [(b"8BPS", "Photoshop document"), (b"%PDF", "PDF document")],
)
def test_what_cannot_be_read_is_named(tmp_path, start, words):
    (tmp_path / "a.xyz").write_bytes(start + bytes(64))
    with pytest.raises(PhotoError, match=f"'a.xyz' is an? .*{words}.*save the photo as JPEG"):
        read_photo(tmp_path / "a.xyz")
