"""Places that repeat themselves: the right one of many windows is found, and no door is trusted that might be another."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry.camera import Pose, pose_error
from core.locate import MapSettings, PhotoLens, build_map, find_camera, locate
from core.locate.find import RIVALS
from core.pose.settings import RefineSettings
from core.render import Renderer, RenderSettings
from core.synthetic import buildings
from core.synthetic.sample import make_photo

QUICK = RefineSettings(threads=1, final="none", iterations=2, candidates=4, long_side_px=320)


class Building:
    """A scene with its renderer and its map; of known cameras, where some are given."""

    def __init__(self, scene, views, known=()):
        self.renderer = Renderer(scene, RenderSettings(threads=1))
        self.map = list(build_map(scene, MapSettings(views=views, side_px=240), known))[-1].map

    def target(self, camera):
        return PhotoLens(make_photo(self.renderer, camera), camera.intrinsics)


@pytest.fixture(scope="module")
def yard():
    return Building(buildings.courtyard(gaussians=9000), 10)


@pytest.fixture(scope="module")
def corridor():
    """Its map looks at every door, and at the end."""
    doors = [buildings.door_camera(bay + 0.05) for bay in range(buildings.BAYS)]
    return Building(buildings.corridor(gaussians=12_000), len(doors) + 1, [*doors, buildings.end_camera()])


@pytest.mark.parametrize("index", [1, 3, 5])
def test_the_right_one_of_forty_equal_windows_is_found(yard, index):
    camera = buildings.courtyard_cameras()[index]
    best = locate(yard.renderer, yard.target(camera), yard.map).hypotheses[0]
    distance, degrees = pose_error(best.pose, camera.pose)
    assert distance < 0.05 * best.depth
    assert degrees < 2


def test_one_of_many_equal_doors_is_to_be_checked(corridor):
    """Nothing tells it from the others: a camera that is right by luck must not pass for one that is sure."""
    truth = buildings.door_camera(1)
    report = find_camera(corridor.renderer, corridor.target(truth), corridor.map, RefineSettings(threads=1))
    assert report.verdict == "check"
    assert report.reasons[0] == RIVALS
    bays = (report.camera.pose.centre - truth.pose.centre)[2] / buildings.BAY
    assert abs(bays - np.rint(bays)) < 0.05  # it is a door, if perhaps another one


def test_the_end_of_the_corridor_is_like_no_other_place(corridor):
    camera = buildings.end_camera()
    target = corridor.target(
        replace(camera, pose=Pose.from_centre(camera.pose.R, camera.pose.centre + np.array([0.05, 0, 0.2])))
    )
    report = find_camera(corridor.renderer, target, corridor.map, QUICK)
    assert report.verdict == "trusted"
    assert RIVALS not in report.reasons
