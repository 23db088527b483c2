"""Records of photos that share their lens: their cameras, deviations, verdicts and words, and the way back to their own."""

import json

import numpy as np
import pytest
from solved_photos import LENS, OTHER, record_of, solved_photo

from core.cameras.files import camera_from_dict
from core.geometry.camera import pose_error
from core.pose.shared_records import own_record, share_records

MM = 540.0 / np.hypot(640, 480) * np.hypot(36, 24)


@pytest.fixture(scope="module")
def photos():
    return [solved_photo(seed, LENS) for seed in range(6)]


@pytest.fixture(scope="module")
def own(photos):
    return [record_of(photo) for photo in photos]


@pytest.fixture(scope="module")
def shared(own):
    return share_records(own, "Camera X at 5 mm")


def errors(photos, records):
    return np.array([pose_error(camera_from_dict(r).pose, p[0])[0] for p, r in zip(photos, records, strict=True)])


def test_records_hold_one_lens_and_better_cameras_with_their_smaller_deviations(photos, own, shared):
    records = [shared.records[i] for i in range(6)]
    lenses = {tuple(r[name] for name in ("fx", "fy", "cx", "cy")) + tuple(r["dist"]) for r in records}
    assert len(lenses) == 1 and shared.count == 6
    assert abs(records[0]["fx"] / LENS.fx - 1) < 0.003
    assert np.linalg.norm(errors(photos, records)) < 0.8 * np.linalg.norm(errors(photos, own))
    for record, before in zip(records, own, strict=True):
        q, was = record["quality"], before["quality"]
        assert q["pose"] == {"R": record["R"], "t": record["t"]} and q["of"] == "refined"
        assert q["focal_std_pct"] == pytest.approx(100 * record["lens"]["focal"]["std"] / record["lens"]["focal"]["value"])
        assert q["focal_std_pct"] < was["focal_std_pct"] and q["agreement"] == was["agreement"]
        assert {number["state"] for number in record["lens"].values()} == {"shared"}
        assert record["lens_evidence"] == before["lens_evidence"]


def test_the_words_tell_with_how_many_photos_and_how_sure(own, shared):
    for record in shared.records.values():
        said = [reason for reason in record["reasons"] if "focal" in reason.lower()]
        assert len(said) == 1 and said[0].startswith("Its lens is shared with 5 other photos: focal length ")
        value, std = (float(part.split()[0]) for part in said[0].split("focal length ")[1].split("mm +- "))
        assert value == pytest.approx(MM, abs=4 * std) and std < 0.1
    two = share_records(own[:2], "X")
    assert "shared with 1 other photo:" in two.records[0]["reasons"][-1]


def test_a_doubt_of_the_lens_ends_with_it_and_every_other_one_stays(photos):
    records = [
        record_of(photos[0], focal_std_pct=5.0, translation_std_pct=2.0),
        record_of(photos[1], views_used=2),
        record_of(photos[2], also=("The refinement from the given start failed.",)),
        {**record_of(photos[3]), "verdict": "check"},
    ]
    assert [r["verdict"] for r in records] == ["check", "check", "trusted", "check"]
    after = share_records(records, "X").records
    assert [after[i]["verdict"] for i in range(4)] == ["trusted", "check", "trusted", "check"]
    assert "known only" in " ".join(records[0]["reasons"]) and "known only" not in " ".join(after[0]["reasons"])
    assert "Only 2 of the rendered views" in after[1]["reasons"][0]
    assert "The refinement from the given start failed." in after[2]["reasons"]


def test_a_doubt_beside_the_evidence_outlives_the_lens(photos):
    """That the photo fits another place as well comes before the reasons of the evidence, or in their place."""
    rival, note = "It fits two places.", "A second run came to another camera."
    uncertain = record_of(photos[0], focal_std_pct=5.0)
    uncertain = {**uncertain, "reasons": [rival, *uncertain["reasons"]], "details": [*uncertain["details"], note]}
    alone = record_of(photos[1])
    alone = {**alone, "verdict": "check", "reasons": [rival, alone["reasons"][-1]]}
    after = share_records([uncertain, alone, record_of(photos[2])], "X").records
    for record in (after[0], after[1]):
        assert (record["verdict"], record["reasons"][0]) == ("check", rival)
        assert len(record["reasons"]) == 2 and "shared with 2 other photos" in record["reasons"][1]
    assert note in after[0]["details"] and len(after[0]["details"]) == len(uncertain["details"])
    assert after[2]["verdict"] == "trusted"


def test_a_photo_that_its_shared_lens_moves_far_is_to_be_checked(photos):
    """In a scene a hundred times nearer the same move is a hundred times as many per cent of the depth."""
    near = [record_of(photo, median_depth=0.04, translation_std_pct=0.1) for photo in photos]
    after = share_records(near, "X").records[0]
    assert near[0]["verdict"] == "trusted" and after["verdict"] == "check"
    assert "from where the photo alone put it" in after["reasons"][0]


def test_a_photo_of_another_lens_keeps_its_record_and_says_so(own):
    stranger = record_of(solved_photo(50, OTHER))
    shared = share_records([*own[:3], stranger, *own[3:]], "Camera X at 5 mm")
    assert shared.count == 6
    assert own_record(shared.records[3]) == stranger
    assert shared.records[3]["reasons"][-1] == (
        "Its lens is not that of the other photos of Camera X at 5 mm, so it keeps its own."
    )
    assert {**shared.records[3], "reasons": 0, "own": 0} == {**stranger, "reasons": 0, "own": 0}


def test_own_records_come_back_to_the_last_digit_and_share_the_same_again(own, shared):
    stored = [json.loads(json.dumps(shared.records[i])) for i in range(6)]
    back = [own_record(record) for record in stored]
    assert back == own and [list(r) for r in back] == [list(r) for r in own]
    again = share_records(back, "Camera X at 5 mm")
    assert [again.records[i] for i in range(6)] == [shared.records[i] for i in range(6)]
    assert own_record(own[0]) == own[0]


def test_photos_that_can_tell_nothing_take_no_part(own):
    spoilt = [
        {**own[0], "verdict": "failed"},
        {**own[1], "lens_evidence": None},
        {**own[2], "quality": None},
        {**own[3], "quality": {**own[3]["quality"], "pose": {"R": "x"}}},
        {"file": "a.jpg", "verdict": "trusted"},
        {**own[0], "details": None},
    ]
    shared = share_records([*spoilt, *own[4:]], "X")
    assert set(shared.records) == {6, 7} and shared.count == 2
    assert share_records([*spoilt, own[5]], "X") is None
