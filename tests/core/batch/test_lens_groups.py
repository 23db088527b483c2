"""Which photos share a lens: by what their files say of camera and lens, by their size, or none."""

import struct

import pytest
from photo_files import ASCII, RATIONAL, SHORT, encoded, exif, picture

from core.batch.keys import BatchQuery
from core.batch.lens_groups import lens_groups
from core.geometry.camera import Camera, Intrinsics, Pose
from core.photos.taken_with import taken_with

MODEL, ORIENTATION, FOCAL, FOCAL_35MM, LENS = 0x0110, 0x0112, 0x920A, 0xA405, 0xA434


def block(model="Phone 3", focal=57, lens="", orientation=1, equivalent=0):
    sub = {FOCAL: (RATIONAL, (focal, 10))} if focal else {}
    sub |= {FOCAL_35MM: (SHORT, equivalent)} if equivalent else {}
    sub |= {LENS: (ASCII, lens)} if lens else {}
    return exif({ORIENTATION: (SHORT, orientation)} | ({MODEL: (ASCII, model)} if model else {}), sub)


class Batch:
    """Photos in a folder with their queries and records."""

    def __init__(self, folder):
        self.folder, self.queries, self.records = folder, [], {}

    def add(self, data, size=(64, 48), **more):
        index = len(self.queries)
        path = self.folder / f"{index}.jpg"
        path.write_bytes(data)
        self.queries.append(BatchQuery(Camera(Intrinsics(*size, 50, 50, 32, 24), Pose(), path.name), path))
        record = {"verdict": "trusted", "lens_evidence": {}, "width": size[0], "height": size[1]}
        self.records[index] = record | more

    def groups(self, sharing):
        return [(group.name, group.members) for group in lens_groups(sharing, self.queries, self.records)]


@pytest.fixture
def batch(tmp_path):
    return Batch(tmp_path)


def photo(**said):
    return encoded(".jpg", picture(), block(**said))


def test_a_photo_tells_its_camera_lens_and_size(batch):
    batch.add(photo(lens="Lens 5.7 mm f/1.8", orientation=6, equivalent=26), (48, 64))
    found = taken_with(batch.queries[0].photo)
    assert (found.model, found.lens, found.focal_mm, found.focal_35mm) == ("Phone 3", "Lens 5.7 mm f/1.8", 5.7, 26)
    assert (found.width, found.height, found.orientation) == (48, 64, 6)
    assert str(found) == "Phone 3 at 5.7 mm"


def test_photos_of_one_camera_are_a_group_and_every_difference_makes_another(batch):
    same = {"lens": "wide"}
    batch.add(photo(**same))
    for other in ({"lens": "tele"}, {"focal": 70}, {"model": "Phone 4"}, {"orientation": 3}, {"equivalent": 30}):
        batch.add(photo(**{**same, **other}))
    batch.add(encoded(".jpg", picture(96, 128), block(**same)), (128, 96))
    batch.add(photo(**same))
    groups = [members for _, members in batch.groups("auto")]
    assert groups == [(0, 7), (1,), (2,), (3,), (4,), (5,), (6,)]


def test_photos_that_tell_no_camera_are_in_no_group(batch):
    batch.add(photo(model=""))
    batch.add(photo(focal=0))
    batch.add(encoded(".jpg", picture()))
    batch.add(b"no photo")
    batch.add(photo()[:20])
    batch.queries.append(BatchQuery(batch.queries[0].camera, batch.folder / "missing.jpg"))
    batch.records[5] = batch.records[0]
    assert batch.groups("auto") == []
    assert batch.groups("one") == [("64 x 48 pixels", (0, 1, 2, 3, 4, 5))]


def test_those_that_solved_no_lens_take_no_part(batch):
    for more in ({}, {"lens_evidence": None}, {"verdict": "failed"}, {"verdict": "check"}):
        batch.add(photo(), **more)
    for sharing in ("auto", "one"):
        assert [members for _, members in batch.groups(sharing)] == [(0, 3)]
    assert batch.groups("off") == []


def test_each_size_is_a_group_of_its_own(batch):
    for size in ((64, 48), (48, 64), (64, 48)):
        batch.add(photo(), size)
    assert batch.groups("one") == [("64 x 48 pixels", (0, 2)), ("48 x 64 pixels", (1,))]


def test_a_damaged_name_is_read_as_far_as_it_goes(batch):
    spoilt = bytearray(block(lens="x" * 30))
    at = spoilt.index(struct.pack("<HH", LENS, ASCII)) + 8
    spoilt[at : at + 4] = struct.pack("<I", 1 << 30)
    batch.add(encoded(".jpg", picture(), bytes(spoilt)))
    assert taken_with(batch.queries[0].photo).lens == ""
