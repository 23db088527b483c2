"""Frames of numbered files and movies."""

import cv2
import numpy as np
import pytest

from core.errors import PhotoError
from core.photos.plate import Plate, open_plate


def write_frames(folder, numbers, pattern="shot_v2.{:04d}.png"):
    for number in numbers:
        cv2.imwrite(str(folder / pattern.format(number)), np.full((24, 32, 3), 10 * (number % 20), np.uint8))
    return folder / pattern.format(numbers[0])


def test_a_sequence_counts_by_its_last_number(tmp_path):
    file = write_frames(tmp_path, [98, 99, 100, 101, 103])
    plate, first, last = open_plate(file)
    assert (first, last, plate.is_movie) == (98, 101, False)
    assert plate.file(7).name == "shot_v2.0007.png"
    assert plate.read(101).pixels[0, 0, 0] == 10
    with pytest.raises(PhotoError, match="0102"):
        plate.read(102)


@pytest.mark.parametrize(("suffix", "code"), [(".avi", "MJPG"), (".mp4", "mp4v")])
def test_a_movie_gives_each_frame_by_its_number(tmp_path, suffix, code):
    path = tmp_path / f"plate{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 24, (64, 48))
    assert writer.isOpened()
    for number in range(1, 31):
        writer.write(np.full((48, 64, 3), (0, 0, 8 * number), np.uint8))
    writer.release()
    plate, first, last = open_plate(path)
    assert (plate.is_movie, first, last) == (True, 1, 30)
    for number in (30, 1, 17, 18, 2):
        red, _, blue = plate.read(number).pixels.mean(axis=(0, 1))
        assert abs(red - 8 * number) < 4
        assert blue < 8
    for number in (0, 31, -5):
        with pytest.raises(PhotoError, match="no frame"):
            plate.read(number)


def test_what_is_no_plate_is_refused_in_a_sentence(tmp_path):
    with pytest.raises(PhotoError, match="no file"):
        open_plate(tmp_path / "none.png")
    (tmp_path / "words.txt").write_text("no movie")
    with pytest.raises(PhotoError, match="neither"):
        open_plate(tmp_path / "words.txt")
    with pytest.raises(PhotoError, match="no number"):
        Plate(tmp_path / "photo.png", False).file(3)
    with pytest.raises(PhotoError, match="no movie"):
        Plate(tmp_path / "gone.mp4", True).read(1)
    (tmp_path / "broken.mp4").write_bytes(b"\0" * 200)
    with pytest.raises(PhotoError, match="cannot be opened"):
        Plate(tmp_path / "broken.mp4", True).read(1)
