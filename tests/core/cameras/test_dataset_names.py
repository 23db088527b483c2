"""The same photo under other spellings is found; a name that could be two photos is refused."""

import pytest

from core.cameras.files import StartCamera
from core.cameras.names import match_names, name_key, record_of_photo
from core.errors import CameraError, DatasetError
from core.geometry.camera import Pose


def match(wanted, given):
    return match_names(wanted, given, "truth.txt", "estimate.txt")


SPELLINGS = [
    "seq-03/frame-000844.color.png",
    "seq-03/frame-000844.png",
    "seq-03/frame-000844.color",
    "seq-03/frame-000844",
    "seq-03-frame-000844",
    "seq-03-frame-000844.color.png",
    "seq-03_frame-000844.color.png",
    "seq-03\\frame-000844.pose.txt",
    "./seq-03/frame-000844.JPG",
]


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_spellings_of_one_frame(spelling):
    others = ["seq-04/frame-000844.color.png", "seq-03/frame-000845.color.png"]
    for truth in SPELLINGS:
        assert match([others[0], truth], [others[1], spelling]) == [None, 1]


def test_leading_folders_may_be_missing_on_either_side():
    assert match(["chess/seq-03/frame-1.png"], ["seq-03-frame-1"]) == [0]
    assert match(["1.jpg", "2.jpg"], ["/home/me/images/2.JPG", "/home/me/images/1.jpg"]) == [1, 0]


def test_part_of_a_word_is_no_leading_folder():
    assert match(["img-1.png"], ["1.png"]) == [None]
    assert match(["b/1.png"], ["a/1.png"]) == [None]
    assert match(["frame10.png"], ["frame1.png"]) == [None]


def test_equal_names_win_over_similar_ones():
    names = ["a/1.png", "a-1.png", "a/1.jpg", "1.png"]
    assert match(names, names[::-1]) == [3, 2, 1, 0]


@pytest.mark.parametrize(
    ("wanted", "given", "words"),
    [
        (["a/1"], ["a/1.png", "a/1.jpg"], "'a/1' of 'truth.txt' could be 'a/1.jpg' or 'a/1.png' of 'estimate.txt'"),
        (["a/1.png", "a-1.jpg"], ["a/1"], "'a/1' of 'estimate.txt' could be 'a/1.png' or 'a-1.jpg' of 'truth.txt'"),
        (["s1/f.png", "s2/f.png"], ["f.png"], "'f.png' of 'estimate.txt' could be 's1/f.png' or 's2/f.png'"),
        (["f.png"], ["s1/f.png", "s2/f.png"], "'f.png' of 'truth.txt' could be 's1/f.png' or 's2/f.png'"),
    ],
)
def test_ambiguous_names_are_refused(wanted, given, words):
    with pytest.raises(DatasetError, match="spell the names alike") as caught:
        match(wanted, given)
    assert words in str(caught.value)


def test_keys():
    assert name_key("seq-03/frame-000844.color.png") == "seq 03 frame 000844"
    assert name_key("1.5.png") == "1 5"
    assert name_key("???") == "???"  # nothing to go by but itself
    assert name_key("Cafe\u0301.png") == name_key("caf\u00e9.jpg")


def record(file):
    return StartCamera(Pose(), file)


def test_a_photo_takes_the_only_record_or_the_only_one_that_names_it():
    assert record_of_photo([record("")], "photos/a.jpg", "c.json").file == ""
    both = [record("b.jpg"), record("left\\a.jpg")]
    assert record_of_photo(both, "photos/a.jpg", "c.json").file == "left\\a.jpg"
    spelt = [record("b.jpg"), record("A.JPEG")]
    assert record_of_photo(spelt, "photos/a.jpg", "c.json").file == "A.JPEG"
    exact = [record("a.png"), record("a.jpg")]
    assert record_of_photo(exact, "a.jpg", "c.json").file == "a.jpg", "the same name goes before another suffix"


def test_case_and_accents_go_before_other_spellings_and_folders_tell_equal_names_apart():
    composed, apart = "caf\u00e9/IMG_1.jpg", "cafe\u0301/IMG_1.JPG"
    others = [record("x/IMG-1.jpg"), record("tea/IMG_1.JPG")]
    assert record_of_photo([*others, record(apart)], f"C:\\scan\\{composed}", "c.json").file == apart
    assert record_of_photo([*others, record("IMG_1.CR3")], "/scan/tea/img_1.jpg", "c.json").file == "tea/IMG_1.JPG"
    raw = [record("a.jpg"), record("IMG_2.CR3")]
    assert record_of_photo(raw, "IMG_2.jpg", "c.json").file == "IMG_2.CR3"
    assert match(["IMG_2.avif"], ["D:\\scan\\IMG_2.DNG"]) == [0]


def test_a_record_that_others_of_its_file_left_alone_is_no_photos_only_one():
    with pytest.raises(CameraError, match=r"holds 1 camera, 0 of them for 'a.jpg'"):
        record_of_photo([record("b.jpg")], "a.jpg", "c.json", alone=False)


@pytest.mark.parametrize("files", [("left/a.jpg", "right/a.jpg"), ("a.png", "a.tif"), ("b.jpg", "c.jpg"), ("", "")])
def test_a_photo_named_by_none_or_by_several_is_refused(files):
    with pytest.raises(CameraError, match=r"'c.json' holds 2 cameras, [02] of them for 'a.jpg'"):
        record_of_photo([record(file) for file in files], "a.jpg", "c.json")
