"""The same photo under other spellings is found; a name that could be two photos is refused."""

import pytest

from core.cameras.names import match_names, name_key
from core.errors import DatasetError


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
