"""A start of the other pixels than it says, of a photo that EXIF turns by 180 degrees: sizes cannot tell."""

from dataclasses import replace

import pytest
from boxroom import DEPTH, LENS, TRUTH, BoxRoom, start_off

from core.batch.refine_one import refine_photo
from core.geometry.camera import Camera, pose_error
from core.geometry.turned_photo import stored_camera
from core.photos.fit import other_reading
from core.photos.photo import Photo
from core.pose.settings import RefineSettings

pytestmark = pytest.mark.loop
# A centre that is not the picture's shows in the result which pixels the lens was taken for.
SMALL = LENS.with_long_side(320)
OFF_CENTRE = replace(SMALL, cx=SMALL.cx + 8, cy=SMALL.cy - 6)
FEW = RefineSettings(iterations=2, final="none")


@pytest.fixture(scope="module")
def room():
    return BoxRoom()


@pytest.fixture(scope="module")
def photo(room):
    return replace(room.photo(OFF_CENTRE, TRUTH), orientation=3)


def start(order):
    """A camera of the upright photo near the truth, or of its stored pixels."""
    upright = Camera(OFF_CENTRE, start_off(0.03, 2.0), "p.jpg")
    return upright if order == "upright" else stored_camera(upright, 3)


def test_a_start_that_says_the_wrong_one_comes_home_all_the_same(room, photo):
    order = "stored"
    wrong = replace(start(order), pixel_order="upright")
    report = refine_photo(room, photo, wrong, FEW)
    assert report.verdict == "trusted", report.reasons
    assert pose_error(report.camera.pose, TRUTH)[0] < 0.001 * DEPTH
    assert (report.camera.intrinsics.cx, report.camera.intrinsics.cy) == (OFF_CENTRE.cx, OFF_CENTRE.cy)
    assert report.reasons[-1].startswith("The photo is turned by its EXIF data") and f'"{order}"' in report.reasons[-1]


def test_a_start_that_says_the_right_one_is_refined_once(room, photo):
    steps = []
    report = refine_photo(room, photo, start("stored"), FEW, lambda p: steps.append(p.fraction))
    assert report.verdict == "trusted" and pose_error(report.camera.pose, TRUTH)[0] < 0.001 * DEPTH
    assert not any("EXIF" in reason for reason in report.reasons) and steps == sorted(steps)


def test_only_where_no_size_tells_is_there_another_reading(photo):
    assert other_reading(photo, start("upright")).intrinsics.cx == pytest.approx(SMALL.width - OFF_CENTRE.cx)
    assert other_reading(photo, start("stored")).intrinsics == start("stored").intrinsics
    assert other_reading(replace(photo, orientation=1), start("upright")) is None
    assert other_reading(replace(photo, orientation=4), start("upright")) is None
    tall = Photo(photo.pixels.swapaxes(0, 1), orientation=6)
    assert other_reading(tall, start("upright")) is None
