"""Masks: found by name, checked for size, joined with what the photo itself lacks, and honoured by refine and batch."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from cli_place import FAST, Place

from core.cli.main import main
from core.errors import PhotoError
from core.features.extractors.sift import RootSift
from core.photos.mask import find_mask, masked
from core.photos.photo import Photo, read_photo
from core.pose.search.observe import Frontend, extract_photo_features
from core.synthetic import sample_cameras


def mask_file(path, height=40, width=60, black=slice(0, 30)):
    picture = np.full((height, width), 255, np.uint8)
    picture[:, black] = 0
    assert cv2.imwrite(str(path), picture)
    return path


def photo(height=40, width=60):
    return Photo(np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8), "a.jpg")


@pytest.mark.parametrize("name", ["a.jpg.png", "a.jpg", "a.png", "a.tif"])
def test_a_folder_holds_masks_by_the_photos_name(tmp_path, name):
    mask_file(tmp_path / "b.png")
    found = mask_file(tmp_path / name) if name != "a.tif" else mask_file(tmp_path / "a.tif")
    assert find_mask(tmp_path, tmp_path / "elsewhere" / "a.jpg") == found
    assert find_mask(tmp_path, tmp_path / "c.jpg") is None


def test_a_mask_is_found_in_other_spellings(tmp_path):
    for spelt, name in (("A.JPG.PNG", "a.jpg"), ("cafe\u0301.PNG", "caf\u00e9.cr3")):
        found = mask_file(tmp_path / "m.png").rename(tmp_path / spelt)
        assert find_mask(tmp_path, tmp_path / "elsewhere" / name) == found


def test_a_photo_is_not_its_own_mask(tmp_path):
    picture = mask_file(tmp_path / "a.jpg")
    assert find_mask(tmp_path, picture) is None
    mask = mask_file(tmp_path / "a.png")
    assert find_mask(tmp_path, picture) == mask


def test_a_file_is_the_mask_and_nothing_is_refused(tmp_path):
    file = mask_file(tmp_path / "any.png")
    assert find_mask(file, tmp_path / "a.jpg") == file
    with pytest.raises(PhotoError, match="no mask or folder of masks"):
        find_mask(tmp_path / "gone", tmp_path / "a.jpg")


def test_black_is_left_out_and_transparent_pixels_stay_out(tmp_path):
    got = masked(photo(), mask_file(tmp_path / "m.png"))
    assert not got.mask[:, :30].any()
    assert got.mask[:, 30:].all()
    assert "leaves out 50 %" in got.notes[-1]
    transparent = np.ones((40, 60), bool)
    transparent[:10] = False
    both = masked(replace(photo(), mask=transparent), mask_file(tmp_path / "m.png"))
    assert both.mask.sum() == 30 * 30


def test_size_and_emptiness_are_refused(tmp_path):
    with pytest.raises(PhotoError, match="has 61 x 40 pixels but its photo 60 x 40"):
        masked(photo(), mask_file(tmp_path / "m.png", width=61))
    with pytest.raises(PhotoError, match="leaves nothing"):
        masked(photo(), mask_file(tmp_path / "m.png", black=slice(None)))
    (tmp_path / "no.png").write_text("no picture")
    with pytest.raises(PhotoError, match="cannot be decoded"):
        masked(photo(), tmp_path / "no.png")


def test_the_mask_of_a_reduced_photo_has_the_photos_own_size(tmp_path):
    got = masked(replace(photo(), full_size=(120, 80)), mask_file(tmp_path / "m.png", 80, 120, slice(0, 60)))
    assert got.mask.shape == (40, 60)
    assert not got.mask[:, :30].any()
    assert got.mask[:, 30:].all()


def test_no_feature_comes_from_what_is_masked(tmp_path):
    camera = sample_cameras(1)[0].intrinsics.resized(320, 240)
    noise = cv2.resize(np.random.default_rng(3).integers(0, 256, (60, 80, 3)).astype(np.uint8), (320, 240))
    plain = Photo(noise, "a.png")
    frontend = Frontend(extractor=RootSift())
    before = extract_photo_features(plain, camera, 320, frontend).features.keypoints
    after = extract_photo_features(masked(plain, mask_file(tmp_path / "m.png", 240, 320, slice(0, 160))), camera, 320, frontend)
    assert (before[:, 0] < 159).sum() > 50
    assert (after.features.keypoints[:, 0] < 159).sum() == 0
    assert len(after.features.keypoints) > 50


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("place"), photos=2)


def test_refine_takes_a_mask(place, tmp_path, capsys):
    camera = place.json(tmp_path / "c.json", place.starts[:1])
    arguments = ["refine", str(place.scene), str(place.folder / "photo_0.png"), "--camera", camera, *FAST]
    height, width = read_photo(place.folder / "photo_0.png").pixels.shape[:2]
    mask_file(tmp_path / "photo_0.png", height, width, slice(0, width // 3))
    assert main([*arguments, "--mask", str(tmp_path)]) in (0, 3)
    assert "leaves out 33 %" in capsys.readouterr().err
    assert main([*arguments, "--mask", str(place.folder / "photo_1.png.no")]) == 2
    assert "no mask or folder of masks" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main([*arguments, "--mask", str(tmp_path / "empty")]) == 2
    assert "has no mask for 'photo_0.png'" in capsys.readouterr().err


def test_batch_takes_a_folder_of_masks_and_an_answer_belongs_to_its_mask(place, tmp_path, capsys):
    queries = place.json(place.folder / "q.json", place.starts)
    out = tmp_path / "results.json"
    height, width = read_photo(place.folder / "photo_0.png").pixels.shape[:2]
    masks = tmp_path / "masks"
    masks.mkdir()
    mask_file(masks / "photo_0.png", height, width, slice(None))  # leaves nothing, which only a mask that is read can do
    arguments = ["batch", str(place.scene), queries, "--out", str(out), "--workers", "1", *FAST]
    main([*arguments, "--mask", str(masks)])
    assert "1 of 2 photos has a mask" in capsys.readouterr().err
    first, second = json.loads(out.read_text())["frames"]
    assert first["verdict"] == "failed"
    assert "leaves nothing of the photo" in first["reasons"][0]
    assert "leaves nothing" not in " ".join(second["reasons"])
    main(arguments)
    assert "1 of 2 photos was finished before" in capsys.readouterr().err
    assert "leaves nothing" not in " ".join(json.loads(out.read_text())["frames"][0]["reasons"])
