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
