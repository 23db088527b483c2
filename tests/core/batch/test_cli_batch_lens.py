"""A batch of photos of one lens that nobody told: one shared lens in the results, and the own ones to be had back."""

import json
from dataclasses import replace

import numpy as np
import pytest
from cli_place import FAST, Place, hurt_readers

from core.cameras.files import camera_from_dict
from core.cli.main import main
from core.geometry.camera import pose_error
from core.pose.shared_records import own_record
from core.support.sealed import sealed


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = Place(tmp_path_factory.mktemp("place"), photos=2)
    starts = []
    for start in place.starts:
        k = start.intrinsics
        starts.append(replace(start, intrinsics=replace(k, fx=1.1 * k.fx, fy=1.1 * k.fy)))
    place.file = place.json(place.folder / "q.json", starts, focal_guessed=True)
    return place


def batch(place, out, *more):
    return main(["batch", str(place.scene), place.file, "--out", str(out), "--no-locate", *FAST, *more])


def frames(out):
    return json.loads(out.read_text())["frames"]


def test_photos_share_their_lens_and_get_their_own_back_without_refining(place, tmp_path, capsys, monkeypatch):
    out = tmp_path / "r.json"
    assert batch(place, out, "--workers", "2", "--shared-lens", "one") == 0
    assert "One lens for 2 photos: focal length " in capsys.readouterr().out
    first, shared = out.read_text(), frames(out)
    assert len({(f["fx"], f["cx"], *f["dist"]) for f in shared}) == 1
    assert all("Its lens is shared with 1 other photo: " in f["reasons"][-1] for f in shared)
    for frame, truth in zip(shared, place.truths, strict=True):
        assert abs(frame["fx"] / truth.intrinsics.fx - 1) < 0.03
        assert camera_from_dict(frame).focal_guessed, "a shared lens is no calibration"

    hurt_readers(tmp_path / "hook", monkeypatch)  # counts the workers from here on
    own = [sealed(own_record(f)) for f in shared]
    for sharing in ("off", "auto"):  # the photos tell no camera
        assert batch(place, out, "--shared-lens", sharing) == 0
        assert frames(out) == own
        assert "One lens" not in capsys.readouterr().out
    assert batch(place, out, "--shared-lens", "one", "--poses", str(tmp_path / "p.txt")) == 0
    assert out.read_text() == first
    assert not list((tmp_path / "hook").glob("*.pid"))
    errors = [
        [pose_error(camera_from_dict(f).pose, t.pose)[0] for f, t in zip(some, place.truths, strict=True)]
        for some in (own, shared)
    ]
    assert np.linalg.norm(errors[1]) < 1.5 * np.linalg.norm(errors[0])
    assert str(shared[0]["t"][0])[:12] in (tmp_path / "p.txt").read_text()
