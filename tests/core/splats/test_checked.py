"""`GaussianScene.checked`: what a renderer may rely on holds for every scene, whoever made its numbers."""

import gzip
import zlib

import numpy as np
import pytest
from ply_files import ply_bytes, raw_table
from splat_files import spz_bytes, spz_rows

from core.errors import SplatFormatError
from core.splats import read_splats
from core.splats.scene import CHECKED_ROWS, GaussianScene
from core.splats.spz import payload as spz_payload


def arrays(count, coefficients=4, seed=0):
    rng = np.random.default_rng(seed)
    rotations = rng.normal(size=(count, 4))
    parts = (
        rng.normal(size=(count, 3)),
        rng.uniform(0.01, 1, (count, 3)),
        rotations / np.linalg.norm(rotations, axis=1, keepdims=True),
        rng.uniform(0, 1, count),
        rng.normal(size=(count, coefficients, 3)),
    )
    return [p.astype(np.float32) for p in parts]


def test_a_sound_scene_stays_as_it_is_bit_by_bit():
    given = arrays(3 * CHECKED_ROWS + 5)
    wanted = [a.copy() for a in given]
    scene = GaussianScene(*given, format="here", orientation="Y_UP").checked()
    got = (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh)
    for a, b, c in zip(got, wanted, given, strict=True):
        np.testing.assert_array_equal(a, b)
        assert np.shares_memory(a, c) and a.dtype == np.float32 and a.flags.c_contiguous
    assert (scene.dropped, scene.normalised, scene.format, scene.orientation) == (0, 0, "here", "Y_UP")


BAD = {
    "mean": (0, lambda row: row.__setitem__(1, np.nan)),
    "scale": (1, lambda row: row.__setitem__(0, np.inf)),
    "negative scale": (1, lambda row: row.__setitem__(2, -0.1)),
    "zero quaternion": (2, lambda row: row.__setitem__(slice(None), 0)),
    "quaternion": (2, lambda row: row.__setitem__(3, np.nan)),
    "sh": (4, lambda row: row.__setitem__((3, 2), -np.inf)),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_left_out_and_counted(case):
    given = arrays(2 * CHECKED_ROWS + 9)
    wanted = [a.copy() for a in given]
    bad = [0, 7, CHECKED_ROWS, 2 * CHECKED_ROWS + 8]
    index, spoil = BAD[case]
    for row in bad:
        spoil(given[index][row])
    scene = GaussianScene(*given).checked()
    assert (scene.dropped, scene.normalised, len(scene)) == (4, 0, len(wanted[0]) - 4)
    for got, want in zip((scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh), wanted, strict=True):
        np.testing.assert_array_equal(got, np.delete(want, bad, axis=0))


def test_an_opacity_that_is_no_number_is_left_out():
    given = arrays(5)
    given[3][2] = np.nan
    assert GaussianScene(*given).checked().dropped == 1


def test_quaternions_of_any_length_and_opacities_out_of_range_are_put_right_and_counted():
    given = arrays(9)
    wanted = given[2].copy()
    given[2][2] *= 3
    given[2][5] *= -0.5
    given[3][:3] = -0.25, 1.5, 0.5
    scene = GaussianScene(*given).checked()
    np.testing.assert_allclose(np.linalg.norm(scene.rotations, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(scene.rotations[2], wanted[2], atol=1e-6)
    np.testing.assert_allclose(scene.rotations[5], -wanted[5], atol=1e-6)
    np.testing.assert_array_equal(scene.opacities[:3], [0, 1, 0.5])
    assert (scene.dropped, scene.normalised) == (0, 4)


def test_nothing_left_is_refused():
    given = arrays(3)
    given[0][:] = np.nan
    with pytest.raises(SplatFormatError, match=r"Every Gaussian of the file .3. holds"):
        GaussianScene(*given).checked()


def test_arrays_that_cannot_be_written_are_copied():
    given = arrays(4)
    given[2][1] *= 2
    for a in given:
        a.flags.writeable = False
    assert GaussianScene(*given).checked().normalised == 1
    assert np.linalg.norm(given[2][1]) == pytest.approx(2, rel=1e-5)


@pytest.mark.parametrize("suffix", [".ply", ".spz"])
def test_every_reader_ends_in_it(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"scene{suffix}"
    path.write_bytes(ply_bytes(raw_table(4)) if suffix == ".ply" else spz_bytes(spz_rows(40, 1), 3, 1))
    seen = []
    whole = GaussianScene.checked
    monkeypatch.setattr(GaussianScene, "checked", lambda self: seen.append(1) or whole(self))
    read_splats(path)
    assert seen == [1]


def test_an_spz_file_is_unpacked_once(tmp_path, monkeypatch):
    path = tmp_path / "scene.spz"
    path.write_bytes(spz_bytes(spz_rows(4000, 1), 3, 1))
    whole = len(gzip.decompress(path.read_bytes()))
    unpacked = []

    class Counting(gzip.GzipFile):
        def read(self, size=-1):  # readinto goes through it as well
            data = super().read(size)
            unpacked.append(len(data))
            return data

    monkeypatch.setattr(spz_payload.gzip, "GzipFile", Counting)
    assert len(read_splats(path)) == 4000
    assert sum(unpacked) == whole


def test_an_spz_file_whose_checksum_is_wrong_is_still_refused(tmp_path):
    data = spz_bytes(spz_rows(4000, 1), 3, 1)
    path = tmp_path / "scene.spz"
    path.write_bytes(data[:-8] + zlib.crc32(b"other").to_bytes(4, "little") + data[-4:])
    with pytest.raises(SplatFormatError, match="damaged"):
        read_splats(path)
