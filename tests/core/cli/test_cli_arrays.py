"""What `render --npz` writes is the renderer's own output, to the last bit, whatever lens the camera file names."""

from dataclasses import replace

import numpy as np
import pytest
from cli_place import Place

from core.cli.main import main
from core.render import Renderer, RenderSettings
from core.splats import read_splats

NEAR = 0.05


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("place"), photos=1)


@pytest.mark.parametrize("dist", [(), (0.3, -0.1, 0.01, 0.0, 0.0)])
def test_arrays_equal_the_renderers_pinhole_view(place, tmp_path, dist):
    lens = replace(place.truths[0].intrinsics.resized(96, 72), dist=dist)
    file = place.json(tmp_path / "cam.json", [replace(place.truths[0], intrinsics=lens, file="a/view.one.jpg")])
    assert main(["render", str(place.scene), file, str(tmp_path), "--npz", "--threads", "1", "--near", str(NEAR)]) == 0
    view = Renderer(read_splats(place.scene), RenderSettings(near=NEAR, threads=1)).render(lens, place.truths[0].pose)
    with np.load(tmp_path / "view.one.npz") as arrays:
        assert sorted(arrays) == ["alpha", "color", "depth"]
        for name in arrays:
            assert arrays[name].dtype == np.float32
            np.testing.assert_array_equal(arrays[name], getattr(view, name))
    assert view.alpha.mean() > 0.5
