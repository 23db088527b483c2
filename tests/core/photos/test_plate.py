"""Frames of numbered files and movies."""

import base64
import zlib
from fractions import Fraction

import cv2
import numpy as np
import pytest

from core.errors import PhotoError
from core.photos.frame_rate import movie_frame_rate
from core.photos.plate import Plate, behind_gaps, open_plate


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


def test_a_movie_tells_its_speed_and_the_shape_of_its_pixels(tmp_path):
    """In the YUV4MPEG2 format, whose header is text."""
    grey, colour = bytes([90]) * (64 * 48), bytes([128]) * (64 * 48 // 2)
    (tmp_path / "a.y4m").write_bytes(b"YUV4MPEG2 W64 H48 F24000:1001 Ip A2:1 C420jpeg\n" + 3 * (b"FRAME\n" + grey + colour))
    plate, first, last = open_plate(tmp_path / "a.y4m")
    assert (first, last) == (1, 3)
    assert movie_frame_rate(plate.path) == Fraction(24000, 1001)
    assert plate.read(2).pixel_aspect == 2.0


def test_two_sequences_in_one_folder_are_two_plates(tmp_path):
    one, two = write_frames(tmp_path, [1001, 1002], "a_{:04d}.png"), write_frames(tmp_path, [1001, 1002, 1003], "b_{:04d}.png")
    assert open_plate(one)[1:] == (1001, 1002) and open_plate(two)[1:] == (1001, 1003)
    assert open_plate(two)[0].file(1002).name == "b_1002.png" and not behind_gaps(*open_plate(one))


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


# Five frames of 512 x 384 pixels in one colour each, coded as AV1 by Blender 5.2; zlib and base64.
AV1 = zlib.decompress(
    base64.b64decode(
        "eNpjYGBQSCupLMgszs9lYGBiANGJZQaGQNoot8DEkIGBgSOtKDUVKFeTm5JYwsUHFOFx//cvt6aDg4NDwShdhMGyCyg2gUGBQZRhSZ3W2cpSgdjp11a6yAlV"
        "Pa7yklbNQRZ27Ve5q6JnxDKp6CAO1Sii8i8XXI+VnydV3WCUrchUoMDAIPdEA+gWB6BtDCIMak2sFwKWMuksXPixYklNfbO9wxRp7KLiW7xED2zIX9tdELVl"
        "q4zAi9BHZvLsQZnHXmBVbZSjyVjgwMAQuIPzAchrIgwMok36JbnmqdwFNvU3t6VMUopQftvl6NRAmjB2UaMcI8aHDAwOiwuA9jAqMAA9KFqnsej/S3Nuq5Bm"
        "q0e2feUrrDQFhBYUkCaMXVSKcYVRrRGzEssBBpiFGQwM0rOOq7BxKa77UfS5qmSGuUp00b+Z/85F/Hb9kJ9xA6+kyB3nqnj2DW1XuY9N9RL8KW3WGn+n/gA+"
        "HUbA+GfgmAG3XoCBge1i++dnZ4ousF2szrNf6vmT5eL6hr0OFxv9rA+Un2VgYE7Ozc8vA6aynNyyjBQGFMD8AmjIFwZGBhBCAEZUVeh8Bwa8gAmIkkqKErOB"
        "7JiSbLCdzJimAe1lwG8PNnuZQMINYK5KakpJMZCWSc0pLkHogJoL1st4KzclMxHIUMhNQfc7MKUA02boETBHNyMlpwgmU5aZkoqsMgzIz/dIzEvJSQWpYWzN"
        "zcxLA+kuywUbiuxMlRSInExKUWoakjd4SotyFKAOdC0uScoBsncWlxSnIKlZCSo8cAQF0ONAb3sAGR64VGAAif//QS5JLDN0bmTkYUAvfoA84eT8nKK85JwK"
        "oGmMEBMFChKLC6DGg7AIMCqhoasOi3iJ4hJwyMOcwcrAwAJiiwA9hCwOwjJAsWQ0MVYorQGUq0JyMEi8EijlCU0x9UBsADE3OR/JDJBYb2lKCShmW3NTwTQI"
        "KCLHIjDmixILCnKQQyQiE5JUtFemJAItYlAGlsqJsLA0MjAy0zc01DcyVzA0tzI0sTIwA4qqrizJB9kti6zUJ7EszcxIzxCIDAwAO0pjtw=="
    )
)


def test_a_movie_that_opencv_opens_but_cannot_decode_is_named(tmp_path):
    file = tmp_path / "plate.mp4"
    file.write_bytes(AV1)
    plate, first, last = open_plate(file)
    assert (first, last) == (1, 5)
    if cv2.VideoCapture(str(file)).read()[0]:
        assert plate.read(1).pixels.shape == (384, 512, 3)
        return
    with pytest.raises(PhotoError, match=r"'plate.mp4' is coded as AV1, which cannot be decoded here; convert it to H.264"):
        plate.read(1)
    with pytest.raises(PhotoError, match="has no frame 6"):
        plate.read(6)
