"""SOG scenes: another program's own file against its own reading, version 1 by hand, folders, and damaged ones."""

import json
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.batch.keys import scan_file_digest
from core.errors import SplatFormatError
from core.splats import check_splat_file, inspect_splats, read_splats

# 24 Gaussians with SH of degree 1, written by splat-transform 2.7.1, and the .ply into which that turned its own .sog again.
THEIRS = Path(__file__).parents[2] / "data" / "by_splat_transform.sog"
READ_BY_THEM = THEIRS.with_suffix(".ply")


@pytest.fixture
def folder(tmp_path):
    """Their scene as files beside each other."""
    with zipfile.ZipFile(THEIRS) as archive:
        archive.extractall(tmp_path / "scene")
    return tmp_path / "scene"


def same(scene, truth):
    for name in ("means", "scales", "opacities", "sh"):
        np.testing.assert_allclose(getattr(scene, name), getattr(truth, name), rtol=1e-5, atol=2e-6, err_msg=name)
    assert np.abs((scene.rotations * truth.rotations).sum(axis=1)).min() > 1 - 1e-6


def test_a_file_of_splat_transform_is_read_as_that_reads_it():
    scene, truth, info = read_splats(THEIRS), read_splats(READ_BY_THEM), inspect_splats(THEIRS)
    same(scene, truth)
    assert (info.format, info.count, info.sh_degree, info.orientation) == ("sog version 2", 24, 1, "Y_DOWN")
    assert (scene.format, scene.orientation, scene.antialiased, scene.dropped) == ("sog version 2", "Y_DOWN", False, 0)


def test_a_folder_and_its_meta_json_are_the_same_scene(folder):
    truth = read_splats(READ_BY_THEM)
    same(read_splats(folder), truth)
    same(read_splats(folder / "meta.json"), truth)
    assert check_splat_file(folder).name == "sog"
    before = scan_file_digest(folder)
    assert before == scan_file_digest(folder / "meta.json")
    (folder / "sh0.webp").write_bytes((folder / "sh0.webp").read_bytes() + b"\0")
    assert scan_file_digest(folder / "meta.json") != before


def test_an_archive_with_a_folder_inside(folder, tmp_path):
    with zipfile.ZipFile(tmp_path / "a.sog", "w") as archive:
        for file in folder.iterdir():
            archive.write(file, f"scan/{file.name}")
    same(read_splats(tmp_path / "a.sog"), read_splats(READ_BY_THEM))


def test_an_antialiased_scene_says_so(folder):
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps({**meta, "antialias": True}))
    assert read_splats(folder).antialiased


def webp(path, values):
    """A lossless picture of (H, W, 4) bytes, red green blue alpha."""
    order = values[..., [2, 1, 0, 3]].astype(np.uint8)
    path.write_bytes(cv2.imencode(".webp", np.ascontiguousarray(order), [cv2.IMWRITE_WEBP_QUALITY, 101])[1].tobytes())


def test_version_1_by_hand(tmp_path):
    """Two Gaussians in pictures of 2 x 1, whose values are worked out from the ranges."""

    def row(*pixels):
        return np.array([pixels])

    webp(tmp_path / "l.webp", row((0, 255, 128, 255), (255, 255, 255, 255)))
    webp(tmp_path / "u.webp", row((0, 255, 0, 255), (255, 255, 255, 255)))
    webp(tmp_path / "s.webp", row((0, 51, 255, 255), (255, 0, 0, 255)))
    webp(tmp_path / "q.webp", row((128, 128, 128, 252), (255, 128, 128, 255)))
    webp(tmp_path / "c.webp", row((0, 255, 51, 255), (51, 51, 51, 51)))
    span = {"mins": [-1, -2, 0, -4], "maxs": [1, 3, 5, 6]}
    meta = {
        "means": {"shape": [2, 3], "mins": [-1, -2, 0], "maxs": [1, 2, 5], "files": ["l.webp", "u.webp"]},
        "scales": {"mins": [-3, -3, -3], "maxs": [2, 2, 2], "files": ["s.webp"]},
        "quats": {"files": ["q.webp"]},
        "sh0": {**span, "files": ["c.webp"]},
    }
    (tmp_path / "meta.json").write_text(json.dumps(meta))
    scene = read_splats(tmp_path / "meta.json")
    assert (len(scene), scene.sh_degree, scene.format) == (2, 0, "sog version 1")
    third = np.expm1(5 * 128 / 65535)
    np.testing.assert_allclose(
        scene.means, [[-np.expm1(1), np.expm1(2), third], [np.expm1(1), np.expm1(2), np.expm1(5)]], rtol=1e-6
    )
    np.testing.assert_allclose(np.log(scene.scales), [[-3, -2, 2], [2, -3, -3]], atol=1e-6)
    np.testing.assert_allclose(scene.sh[:, 0], [[-1, 3, 1], [-0.6, -1, 1]], atol=1e-6)
    np.testing.assert_allclose(scene.opacities, 1 / (1 + np.exp([-6.0, 2.0])), rtol=1e-5)
    small = (128 / 255 * 2 - 1) / np.sqrt(2)
    np.testing.assert_allclose(scene.rotations[0], [np.sqrt(1 - 3 * small**2), small, small, small], atol=1e-6)
    wide = 1 / np.sqrt(2)
    np.testing.assert_allclose(scene.rotations[1], [wide, small, small, np.sqrt(1 - wide**2 - 2 * small**2)], atol=1e-6)


BAD = {
    "a picture is missing": (lambda f: (f / "quats.webp").unlink(), "lacks its file 'quats.webp'"),
    "a picture is none": (
        lambda f: (f / "quats.webp").write_bytes(b"no picture"),
        "'quats.webp' .* is damaged",
    ),
    "no json": (lambda f: (f / "meta.json").write_text('{"means" "quats"'), "no valid JSON"),
    "version 3": (lambda f: change(f, version=3), "of version 3; versions 1 and 2 can be read"),
    "too many": (lambda f: change(f, count=10**6), "is damaged, or has another size"),
    "no count": (lambda f: change(f, count="many"), "tells no number of Gaussians"),
    "no scales": (lambda f: change(f, scales=None), "lacks a usable 'scales'"),
    "half a codebook": (lambda f: change(f, scales={"codebook": [1.0, 2.0], "files": ["scales.webp"]}), "'scales.codebook'"),
    "a way out": (lambda f: change(f, quats={"files": ["../secret.webp"]}), "names its pictures wrongly"),
    "another degree": (lambda f: change(f, shN={**meta_of(f)["shN"], "bands": 3}), "another width than its degree"),
}


def meta_of(folder):
    return json.loads((folder / "meta.json").read_text())


def change(folder, **values):
    (folder / "meta.json").write_text(json.dumps(meta_of(folder) | values))


@pytest.mark.parametrize("case", BAD)
def test_a_bad_scene_ends_in_one_sentence(folder, case):
    hurt, words = BAD[case]
    hurt(folder)
    with pytest.raises(SplatFormatError, match=words) as caught:
        read_splats(folder)
    assert str(caught.value).endswith(".") and "\n" not in str(caught.value)


def test_of_a_cut_picture_only_our_own_sentence_is_said(folder, capfd):
    (folder / "quats.webp").write_bytes((folder / "quats.webp").read_bytes()[:30])
    with pytest.raises(SplatFormatError, match="is damaged"):
        read_splats(folder)
    assert capfd.readouterr() == ("", "")


def test_other_archives_are_named(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("notes.txt", "hello")
    with pytest.raises(SplatFormatError, match=r"holds no 'meta.json', so it is no SOG scene"):
        read_splats(tmp_path / "a.zip")


def test_damaged_archives_end_in_a_scene_or_one_sentence(tmp_path):
    good, rng = THEIRS.read_bytes(), np.random.default_rng(4)
    outcomes = set()
    for _ in range(150):
        data = bytearray(good)
        for at in rng.integers(0, len(data), 4):
            data[at] = rng.integers(256)
        (tmp_path / "a.sog").write_bytes(
            bytes(data[: rng.integers(len(data) // 2, len(data) + 1)] if rng.random() < 0.2 else data)
        )
        try:
            read_splats(tmp_path / "a.sog")
            outcomes.add("scene")
        except SplatFormatError as error:
            assert str(error).endswith(".")
            outcomes.add("error")
    assert "error" in outcomes
