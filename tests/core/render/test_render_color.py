"""Colour polynomials against spherical harmonics as the slow twin has them."""

from __future__ import annotations

import numpy as np
import pytest

from core.render.color import color_polynomials, colors
from core.render.reference import sh_basis


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("wanted", [300, 20], ids=["most of a chunk", "few of a chunk"])
def test_colours_are_those_of_the_harmonics(degree: int, wanted: int) -> None:
    rng = np.random.default_rng(degree)
    sh = rng.normal(size=(300, (degree + 1) ** 2, 3)).astype(np.float32)
    means, centre = rng.normal(size=(3, 300)).astype(np.float32) * 50, np.array([1, 2, 3], np.float32)
    index = np.sort(rng.permutation(300)[:wanted])
    got = colors(color_polynomials(sh), means, centre, index)
    for i, rgb in zip(index, got.T, strict=True):
        d = means[:, i].astype(float) - centre
        want = np.maximum(0, sh_basis(d / np.linalg.norm(d), degree) @ sh[i].astype(float) + 0.5)
        np.testing.assert_allclose(rgb, want, atol=5e-6)
