"""Frozen dataclasses can be compared and put into sets, also those that hold arrays, on which Python's own == fails."""

import dataclasses
import importlib.util
import pkgutil
import typing
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import core
from core.geometry.camera import Camera, Intrinsics, Pose
from core.geometry.conventions import Similarity
from core.geometry.lie import so3_exp
from core.photos.photo import Photo
from core.pose.report import IterationRecord

LENS = Intrinsics(64, 48, 50.0, 50.0, 32.0, 24.0)


def test_poses_are_equal_by_their_numbers():
    a, b = (Pose(so3_exp([0.1, 0.2, 0.3]), [1.0, 0.0, 3.0]) for _ in range(2))
    other = Pose(a.R, [1.0, 0.0, 4.0])
    assert a == b and hash(a) == hash(b) and a != other
    assert len({a, b, other}) == 2
    assert a != "pose" and Pose() == Pose()
    assert Pose(np.eye(3), [0.0, 0.0, 0.0]) == Pose(np.eye(3), [-0.0, 0.0, 0.0])
    assert hash(Pose(np.eye(3), [0.0, 0.0, 0.0])) == hash(Pose(np.eye(3), [-0.0, 0.0, 0.0]))


def test_what_holds_a_pose_compares_with_it():
    a, b = (Camera(LENS, Pose(np.eye(3), [1.0, 2.0, 3.0]), "a.jpg") for _ in range(2))
    assert a == b and len({a, b}) == 1 and a != dataclasses.replace(a, pose=Pose())
    records = [IterationRecord(0, 7, 900, 800, 0.3, Pose(np.eye(3), [1.0, 2.0, z])) for z in (3.0, 3.0, 4.0)]
    assert records[0] == records[1] != records[2]


def test_similarities_are_equal_by_their_numbers():
    a, b = (Similarity.from_matrix(np.diag([2.0, 2, 2, 1])) for _ in range(2))
    assert a == b and hash(a) == hash(b) and a != a.inverse()


def test_what_holds_pixels_is_itself_alone():
    photo = other = Photo(np.zeros((4, 4, 3), np.uint8))
    assert photo == other and photo != dataclasses.replace(photo) and len({photo, photo}) == 1


def dataclasses_of_core():
    for module in pkgutil.walk_packages(core.__path__, "core."):
        if module.name.endswith("__main__") or (".dask_" in module.name and importlib.util.find_spec("distributed") is None):
            continue
        for value in vars(importlib.import_module(module.name)).values():
            if isinstance(value, type) and dataclasses.is_dataclass(value) and value.__module__ == module.name:
                yield value


def holds_array(hint):
    origin = typing.get_origin(hint)
    if origin is Callable:  # one that takes arrays holds none
        return False
    return hint is np.ndarray or origin in (np.ndarray, NDArray) or any(holds_array(part) for part in typing.get_args(hint))


CLASSES = sorted(dataclasses_of_core(), key=lambda c: (c.__module__, c.__qualname__))


@pytest.mark.parametrize("kind", CLASSES, ids=lambda c: f"{c.__module__}.{c.__qualname__}")
def test_no_dataclass_compares_arrays_with_pythons_own_equality(kind):
    """One that holds arrays brings its own ==, or compares by identity; the one that `dataclass` writes would raise."""
    hints = typing.get_type_hints(kind)
    if any(holds_array(hints[field.name]) for field in dataclasses.fields(kind)):
        assert not kind.__dataclass_params__.eq


def test_the_walk_finds_them():
    assert len(CLASSES) > 60
    assert sum(any(map(holds_array, typing.get_type_hints(kind).values())) for kind in CLASSES) > 20
