"""Damaged photo files end in a picture or in one sentence of ours, and OpenCV writes nothing to the terminal."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from core.cli.main import main
from core.errors import PhotoError
from core.photos.photo import read_photo

from ..support.photo_files import encoded, picture

SUFFIXES = (".jpg", ".png", ".tif", ".webp", ".avif", ".bmp", ".jp2", ".ppm")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_decoders_write_nothing_to_the_terminal(tmp_path, capfd, suffix):
    ok, coded = cv2.imencode(suffix, np.random.default_rng(0).integers(0, 255, (60, 80, 3), np.uint8))
    assert ok
    good, rng, file = coded.tobytes(), np.random.default_rng(1), tmp_path / f"x{suffix}"
    for number in range(25):
        data = bytearray(good[: rng.integers(10, len(good))] if number % 3 == 0 else good)
        for at in rng.integers(0, len(data) if number % 2 else min(len(data), 200), 3 + number % 5):
            data[at] = rng.integers(0, 256)
        file.write_bytes(bytes(data))
        try:
            assert read_photo(file).pixels.ndim == 3
        except PhotoError as error:
            assert str(error).endswith(".")
    written = capfd.readouterr()
    # What libjpeg itself says of a picture that it could decode all the same has no switch.
    lines = [line for line in written.err.splitlines() if not line.startswith("Corrupt JPEG data")]
    assert not lines and not written.out


def test_a_movie_that_is_none_says_so_once(tmp_path):
    """In a process of its own, because FFmpeg takes its level when it opens the first movie."""
    file = tmp_path / "plate.mp4"
    file.write_bytes(b"\0\0\0\x20ftypisom" + b"x" * 3000)
    code = "import sys; from core.photos.plate import open_plate; open_plate(sys.argv[1])"
    done = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=False)
    assert done.stderr.strip().splitlines()[-1].startswith("core.errors.PhotoError: 'plate.mp4' is neither a movie")
    assert "moov" not in done.stderr


def test_a_png_that_is_cut_off_or_damaged_says_so(tmp_path):
    good, file = encoded(".png", picture()), tmp_path / "a.png"
    file.write_bytes(good[:-30])
    with pytest.raises(PhotoError, match="is cut off: the PNG has no end; copy it again"):
        read_photo(file)
    at = good.index(b"IDAT") + 20
    file.write_bytes(good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :])
    with pytest.raises(PhotoError, match="is damaged: a check sum is wrong; copy it again"):
        read_photo(file)
    text = good[:33] + b"\0\0\0\3tEXta\0b\0\0\0\0" + good[33:]
    file.write_bytes(text)
    assert read_photo(file).pixels.shape == picture().shape, "a wrong sum elsewhere does no harm"


@pytest.mark.parametrize("suffix", [".tif", ".png", ".webp", ".avif"])
def test_refine_says_one_sentence_of_a_damaged_photo(tmp_path, capfd, suffix):
    ok, coded = cv2.imencode(suffix, np.random.default_rng(0).integers(0, 255, (60, 80, 3), np.uint8))
    assert ok
    data = bytearray(coded.tobytes())
    data[len(data) // 2 :] = b"\xa5" * len(data[len(data) // 2 :])
    file = tmp_path / f"x{suffix}"
    file.write_bytes(bytes(data))
    try:
        read_photo(file)
    except PhotoError as error:
        assert main(["refine", str(tmp_path / "scan.ply"), str(file)]) == 2
        written = capfd.readouterr()
        assert written.out == "" and written.err.strip() == str(error)
        return
    pytest.skip("this decoder reads it all the same")
