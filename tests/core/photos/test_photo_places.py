"""Photos found by the names that camera files give them."""

import unicodedata

import pytest

from core.photos.places import PhotoFinder


@pytest.fixture
def project(tmp_path):
    for name in (
        "images/0003.jpg",
        "images/sub/0004.PNG",
        "images/0004.png",
        "images/café.jpg",
        "model/x.txt",
        "images/notes.txt",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / unicodedata.normalize("NFC", name)).write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("0003.jpg", "0003.jpg"),
        ("images/0003.jpg", "0003.jpg"),
        ("images\\0003.jpg", "0003.jpg"),
        ("C:\\scans\\fox\\0003.jpg", "0003.jpg"),
        ("/home/me/0003.JPG", "0003.jpg"),
        ("0003", "0003.jpg"),
        ("./images/0003", "0003.jpg"),
        ("0003.png", "0003.jpg"),
        ("sub/0004.png", "sub/0004.PNG"),
        ("other/0004.png", "0004.png"),
        (unicodedata.normalize("NFD", "café.jpg"), "café.jpg"),
        ("CAFÉ.JPG", "café.jpg"),
        ("0005.jpg", None),
        ("notes", None),
        ("", None),
    ],
)
@pytest.mark.parametrize("model", ["model/cameras.json", "model", "transforms.json"])
def test_a_photo_is_found_however_its_name_is_spelt(project, name, file, model):
    if model == "model" and file == "0003.jpg":
        assert PhotoFinder(project / model).find(name).samefile(project / "images" / file)
        return
    found = PhotoFinder(project / model).find(name)
    assert (None if found is None else found.resolve()) == (None if file is None else (project / "images" / file).resolve())


def test_a_folder_of_photos_that_was_given_is_the_only_place(project):
    assert PhotoFinder(project / "transforms.json", project / "model").find("0003.jpg") is None
    assert PhotoFinder(project / "transforms.json", project / "images" / "sub").find("a/0004.jpg").name == "0004.PNG"


def test_folders_are_found_however_they_are_spelt_and_a_unique_name_below_them(tmp_path):
    for name in ("images/Caf\u00e9/1.jpg", "images/1.jpg", "images/a/b/IMG_7.CR3", "images/a/8.jpg", "images/b/8.jpg"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    finder = PhotoFinder(tmp_path / "cameras.json")
    assert finder.find("cafe\u0301\\1.JPG") == tmp_path / "images/Caf\u00e9/1.jpg"
    assert finder.find("E:\\card\\img_7.jpg") == tmp_path / "images/a/b/IMG_7.CR3"
    assert finder.find("8.jpg") is None, "it could be either"
    assert finder.find("B/8.jpg") == tmp_path / "images/b/8.jpg"
