"""Streamed SOG: another program's own folder, one level of it, and what of it is damaged."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from core.batch.keys import scan_file_digest
from core.cli.main import main
from core.errors import SplatFormatError
from core.splats import check_splat_file, inspect_splats, read_splats

# by_splat_transform.ply without SH as level 0, and those of it with x < 0 as level 1, written by splat-transform 2.7.1.
DATA = Path(__file__).parents[2] / "data"
THEIRS = DATA / "streamed_by_splat_transform"


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(THEIRS, tmp_path / "scan")
    return tmp_path / "scan"


def content(folder):
    return json.loads((folder / "lod-meta.json").read_text())


def put(folder, **values):
    (folder / "lod-meta.json").write_text(json.dumps(content(folder) | values))


def by_place(scene):
    return np.sort(scene.means[:, 0])


@pytest.mark.parametrize("level", [0, 1])
def test_a_level_is_the_scan_that_it_was_made_from(level):
    source, scene = read_splats(DATA / "by_splat_transform.ply"), read_splats(THEIRS, level=level)
    wanted = by_place(source) if level == 0 else by_place(source)[by_place(source) < 0]
    np.testing.assert_allclose(by_place(scene), wanted, atol=2e-3)
    assert scene.format == f"streamed sog, level {level} of 2"


def test_the_finest_level_is_read_and_the_folder_stands_for_its_file(folder):
    info = inspect_splats(folder / "lod-meta.json")
    assert (info.count, info.sh_degree, info.orientation) == (24, 0, "Y_DOWN")
    assert check_splat_file(folder).name == check_splat_file(folder / "lod-meta.json").name == "streamed sog"
    assert len(read_splats(folder)) == 24
    before = scan_file_digest(folder)
    (folder / "0_0" / "sh0.webp").write_bytes(b"other")
    assert scan_file_digest(folder / "lod-meta.json") != before


def test_leaves_name_runs_and_the_environment_is_added(folder):
    run = {"file": 0, "offset": 3, "count": 4}
    tree = {"children": [{"lods": {"0": {"file": 1, "offset": 0, "count": 2}}}, {"children": [{"lods": {"0": run}}]}]}
    fine, coarse = read_splats(folder), read_splats(folder, level=1)
    put(folder, tree=tree)
    np.testing.assert_array_equal(read_splats(folder).means, np.concatenate([coarse.means[:2], fine.means[3:7]]))
    put(folder, environment="1_0/meta.json", tree={"lods": {"0": run}})
    np.testing.assert_array_equal(read_splats(folder).means, np.concatenate([fine.means[3:7], coarse.means]))


def test_convert_makes_one_scan_of_a_level_and_says_which(folder, tmp_path, capsys):
    assert main(["convert", str(folder), str(tmp_path / "a.ply"), "--level", "1"]) == 0
    assert "Read was a streamed sog, level 1 of 2; level 0 is the finest" in capsys.readouterr().err
    assert len(read_splats(tmp_path / "a.ply")) == 15


BAD = {
    "no json": (lambda f: (f / "lod-meta.json").write_text('{"lodLevels": "filenames"'), "lod-meta.json .* is damaged"),
    "no tree": (lambda f: put(f, tree=None), "lod-meta.json .* is damaged"),
    "a way out": (lambda f: put(f, filenames=["../0_0/meta.json", "1_0/meta.json"]), "lod-meta.json .* is damaged"),
    "no such file": (lambda f: put(f, tree={"lods": {"0": {"file": 7, "offset": 0, "count": 1}}}), "is damaged"),
    "a file is missing": (lambda f: shutil.rmtree(f / "0_0"), "lacks its file 'meta.json'"),
    "too many": (lambda f: put(f, tree={"lods": {"0": {"file": 0, "offset": 20, "count": 10**8}}}), "asks for more Gaussians"),
    "none": (lambda f: put(f, tree={"lods": {"1": {"file": 1, "offset": 0, "count": 1}}}), "Level 0 .* holds no Gaussians"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_scene_ends_in_one_sentence(folder, case):
    hurt, words = BAD[case]
    hurt(folder)
    with pytest.raises(SplatFormatError, match=words) as caught:
        read_splats(folder)
    assert str(caught.value).endswith(".") and "\n" not in str(caught.value)


def test_a_level_that_is_not_there_is_named(folder):
    with pytest.raises(SplatFormatError, match="has 2 levels, 0 the finest; there is no level 2"):
        read_splats(folder, level=2)


def test_an_lcc_scan_is_named_with_what_to_do(tmp_path):
    (tmp_path / "scan.lcc").write_text('{"version": "5.0"}')
    with pytest.raises(SplatFormatError, match=r"is an LCC scan of XGRIDS.*turn it into \.ply with splat-transform"):
        read_splats(tmp_path / "scan.lcc")
