"""How wide a plate's pixels are, by the header of its OpenEXR files, and the lens that is guessed for it."""

import struct

import numpy as np
import pytest

from core.photos.containers.exr_header import pixel_aspect
from core.photos.lens_guess import guess_lens
from core.photos.linear import photo_from_linear


def header(*attributes):
    """The beginning of a file as OpenEXR's description of its layout has it."""
    parts = [name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value for name, kind, value in attributes]
    return b"\x76\x2f\x31\x01\x02\0\0\0" + b"".join(parts) + b"\0" + bytes(20)


BOX = (b"dataWindow", b"box2i", struct.pack("<4i", 0, 0, 1919, 1079))
TEXT = (b"comments", b"string", b"pixelAspectRatio\0float\0\4\0\0\0\0\0\0\x41")


def ratio(value):
    return (b"pixelAspectRatio", b"float", struct.pack("<f", value))


@pytest.mark.parametrize(
    ("data", "wanted"),
    [
        (header(BOX, TEXT, ratio(2.0)), 2.0),
        (header(ratio(0.9), BOX), pytest.approx(0.9)),
        (header(BOX, TEXT), 1.0),
        (header(BOX, ratio(float("nan"))), 1.0),
        (header(BOX, ratio(1000.0)), 1.0),
        (header(BOX, ratio(2.0))[:60], 1.0),
        (b"\x76\x2f\x31\x01", 1.0),
        (b"no picture", 1.0),
        (b"", 1.0),
    ],
)
def test_the_shape_of_a_pixel_is_what_the_header_says(data, wanted):
    assert pixel_aspect(data) == wanted


def test_a_squeezed_plates_lens_is_guessed_as_it_is_shown():
    light = np.full((540, 960, 4), 0.5, np.float32)
    squeezed = guess_lens(photo_from_linear(light, "a.exr", 2.0)).intrinsics
    plain = guess_lens(photo_from_linear(np.full((540, 1920, 4), 0.5, np.float32), "b.exr")).intrinsics
    assert squeezed.fy == pytest.approx(plain.fy) and squeezed.fx == pytest.approx(plain.fx / 2)
    assert squeezed.cx == pytest.approx(plain.cx / 2)
