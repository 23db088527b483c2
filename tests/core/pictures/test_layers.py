"""A render of the splat as layers for Blender's compositor, and the OpenEXR files that hold them."""

import numpy as np
import pytest

from core.photos.containers.openexr import read_exr, write_exr
from core.pictures.layers import COLOUR, DEPTH, NOTHING, layers_of, write_layers
from core.render.view import RenderedView

pytestmark = pytest.mark.unit


@pytest.mark.parametrize("height", [1, 16, 37])
def test_packed_files_come_back(tmp_path, height):
    """Smooth channels, which get smaller, and noise, which does not."""
    rng = np.random.default_rng(0)
    smooth = np.tile(np.linspace(0, 1, 21, dtype=np.float32), (height, 1))
    noise = rng.integers(0, 2**32, (height, 21), np.uint32).view(np.float32)
    channels = {"a.long.name.of.more.than.thirty.letters": smooth, "B": noise, "C": smooth}
    write_exr(tmp_path / "x.exr", channels, half=("C",), packed=True)
    got = read_exr(tmp_path / "x.exr")
    np.testing.assert_array_equal(got["B"].view(np.uint32), noise.view(np.uint32))
    np.testing.assert_array_equal(got["a.long.name.of.more.than.thirty.letters"], smooth)
    np.testing.assert_array_equal(got["C"], smooth.astype(np.float16))


def test_a_smooth_picture_gets_smaller(tmp_path):
    smooth = {"R": np.tile(np.linspace(0, 1, 400, dtype=np.float32), (300, 1))}
    write_exr(tmp_path / "plain.exr", smooth)
    write_exr(tmp_path / "packed.exr", smooth, packed=True)
    assert (tmp_path / "packed.exr").stat().st_size < 0.2 * (tmp_path / "plain.exr").stat().st_size


def test_colours_become_light_and_depths_the_scenes():
    """A pixel that is half covered by the sRGB colour 0.5 is half of the light 0.2140, as IEC 61966-2-1 has it."""
    alpha = np.array([[1.0, 0.5, 0.0]], np.float32)
    color = np.full((1, 3, 3), 0.5, np.float32) * alpha[..., None]
    view = RenderedView(color, np.full((1, 3), 2.0, np.float32), alpha, np.zeros((1, 3), np.float32))
    got = layers_of(view, 3.0)
    np.testing.assert_allclose(got[COLOUR[0]], [[0.21404, 0.10702, 0.0]], atol=1e-5)
    np.testing.assert_array_equal(got[COLOUR[3]], alpha)
    np.testing.assert_allclose(got[DEPTH], [[6.0, 6.0, NOTHING]])


def test_layers_are_written(tmp_path):
    zeros = np.zeros((4, 5), np.float32)
    write_layers(tmp_path / "a" / "b.exr", RenderedView(np.zeros((4, 5, 3), np.float32), zeros, zeros, zeros), 1.0)
    assert set(read_exr(tmp_path / "a" / "b.exr")) == {*COLOUR, DEPTH}
