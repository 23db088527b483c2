"""Writing .sog: another program's reading of our file, what is lost, and scenes at the edge."""

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ply_files import ply_bytes, raw_table

from core.cli.main import main
from core.errors import SplatFormatError
from core.splats import GaussianScene, read_splats
from core.splats.sog.codebook import LARGEST_PALETTE, codebook, palette
from core.splats.sog.write import write_sog

# Our .sog of raw_table(24, 2, seed=5), turned into a .ply by splat-transform 2.7.1.
READ_BY_OTHERS = Path(__file__).parents[2] / "data" / "our_sog_by_splat_transform.ply"
NAMES = ("means", "scales", "opacities", "sh")


@pytest.fixture
def source(tmp_path):
    (tmp_path / "a.ply").write_bytes(ply_bytes(raw_table(24, 2, seed=5)))
    return read_splats(tmp_path / "a.ply")


def matched(scene, source):
    """The scene in the order of the source."""
    order = np.linalg.norm(source.means[:, None] - scene.means, axis=2).argmin(axis=1)
    assert sorted(order) == list(range(len(source)))
    return {name: getattr(scene, name)[order] for name in (*NAMES, "rotations")}


def test_another_program_reads_our_file_as_we_do(source, tmp_path):
    write_sog(tmp_path / "a.sog", source)
    scene, theirs = read_splats(tmp_path / "a.sog"), read_splats(READ_BY_OTHERS)
    for name in NAMES:
        np.testing.assert_allclose(getattr(scene, name), getattr(theirs, name), rtol=1e-5, atol=2e-6, err_msg=name)
    assert np.abs((scene.rotations * theirs.rotations).sum(axis=1)).min() > 1 - 1e-6


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_what_is_written_is_read_within_what_is_said(tmp_path, degree):
    (tmp_path / "a.ply").write_bytes(ply_bytes(raw_table(200, degree, seed=3)))
    source = replace(read_splats(tmp_path / "a.ply"), antialiased=degree == 1)
    said = write_sog(tmp_path / "a.sog", source)
    scene = read_splats(tmp_path / "a.sog")
    assert (scene.sh_degree, scene.antialiased, scene.format) == (degree, degree == 1, "sog version 2")
    back = matched(scene, source)
    place = np.abs(back["means"] - source.means).max()
    assert f"positions to {place:.2g} units" in said and place < 1e-3
    # 600 scales and 600 colours share 256 values each, which are far from each other only at the sparse ends.
    for got, wanted in ((np.log(back["scales"]), np.log(source.scales)), (back["sh"][:, 0], source.sh[:, 0])):
        assert np.sqrt(np.mean((got - wanted) ** 2)) < 0.02 and np.abs(got - wanted).max() < 0.3
    np.testing.assert_allclose(back["opacities"], source.opacities, atol=0.51 / 255)
    assert np.abs((back["rotations"] * source.rotations).sum(axis=1)).min() > 1 - 1e-4
    assert degree == 0 or np.sqrt(np.mean((back["sh"][:, 1:] - source.sh[:, 1:]) ** 2)) < 0.02
    names = zipfile.ZipFile(tmp_path / "a.sog").namelist()
    assert ("shN_labels.webp" in names) == (degree > 0)
    assert "lost" not in json.loads(zipfile.ZipFile(tmp_path / "a.sog").read("meta.json"))


def test_the_same_scene_gives_the_same_file(source, tmp_path):
    for name in ("a.sog", "b.sog"):
        write_sog(tmp_path / name, source)
    assert (tmp_path / "a.sog").read_bytes() == (tmp_path / "b.sog").read_bytes()


def test_flat_and_opaque_and_single_gaussians_stay(tmp_path):
    one = GaussianScene(*(np.float32(v) for v in ([[1, 2, 3]], [[0, 1, 2]], [[1, 0, 0, 0]], [1], [[[0.1, 0.2, 0.3]]])))
    write_sog(tmp_path / "a.sog", one)
    scene = read_splats(tmp_path / "a.sog")
    np.testing.assert_allclose(scene.means, one.means, atol=1e-5)
    np.testing.assert_allclose(scene.scales, one.scales, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(scene.sh, one.sh, atol=1e-6)
    assert scene.opacities.tolist() == [1]


def test_a_scan_in_map_coordinates_is_refused(source, tmp_path):
    with pytest.raises(SplatFormatError, match=r"too far from its origin for \.sog"):
        write_sog(tmp_path / "a.sog", replace(source, origin=(5e5, 0, 0)))
    assert not (tmp_path / "a.sog").exists()


def test_convert_writes_it_and_says_what_is_lost(tmp_path, capsys):
    (tmp_path / "a.ply").write_bytes(ply_bytes(raw_table(24, 1)))
    assert main(["convert", str(tmp_path / "a.ply"), str(tmp_path / "b.sog")]) == 0
    assert "The .sog keeps positions to" in capsys.readouterr().err
    assert len(read_splats(tmp_path / "b.sog")) == 24


def test_a_codebook_has_the_nearest_of_its_numbers_for_each():
    values = np.random.default_rng(0).standard_normal((4000, 3)).astype(np.float32)
    book, found = codebook(values)
    assert (len(book), found.dtype, found.shape) == (256, np.uint8, (4000, 3))
    np.testing.assert_array_equal(np.abs(book[found] - values), np.abs(values[..., None] - book).min(axis=-1))
    # The root mean square error of an optimal codebook for a normal distribution (Panter and Dite, 1951).
    assert np.sqrt(np.mean((book[found] - values) ** 2)) < 1.1 * np.sqrt(np.sqrt(3) * np.pi / 2) / 256


def test_a_palette_of_many_vectors_is_no_larger_than_its_numbers_and_near_all():
    rng = np.random.default_rng(0)
    kinds = rng.standard_normal((500, 9)).astype(np.float32)
    vectors = kinds[rng.integers(0, 500, 70_000)] + rng.standard_normal((70_000, 9)).astype(np.float32) * np.float32(0.01)
    entries, labels = palette(vectors)
    assert len(entries) <= LARGEST_PALETTE and len(labels) == len(vectors)
    assert np.sqrt(np.mean((entries[labels] - vectors) ** 2)) < 0.01
