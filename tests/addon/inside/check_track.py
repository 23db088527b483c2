"""Track Plate: every frame keyed where the camera truly was, what is lost filled and said, nothing changed on refusal."""

import numpy as np
import pytest
import rooms
from check_sequence import BAD_FRAME, COUNT, errors, keyed, plate, set_up  # noqa: F401  # `plate` is a fixture

FRAMES = range(1, COUNT + 1)


def track(bpy, **options):
    return bpy.ops.gssmc.track_plate(**{**rooms.QUICK, **options})


def kinds(camera):
    """The types of the keys of the camera's place, by frame."""
    strips = [s for layer in camera.animation_data.action.layers for s in layer.strips]
    curves = [c for s in strips for c in s.channelbag(camera.animation_data.action_slot).fcurves if c.data_path == "location"]
    return {int(p.co.x): p.type for p in curves[0].keyframe_points}


def test_every_frame_is_keyed_where_the_camera_was(bpy, plate, extension):  # noqa: F811
    scene = set_up(bpy, plate)
    lens = scene.camera.data.lens
    assert track(bpy) == {"FINISHED"}
    assert all(frames == set(FRAMES) for frames in keyed(scene.camera, "location"))
    assert set(kinds(scene.camera).values()) == {"KEYFRAME"}
    off = errors(bpy, extension, scene, plate[1], FRAMES)
    assert (np.sqrt((off**2).mean(0)) < (0.004, 0.08)).all() and (off.max(0) < (0.01, 0.15)).all()
    data = scene.camera.data
    assert (data.gssmc.verdict, data.gssmc.bad_frames, data.gssmc.frames_done) == ("TRUSTED", "", COUNT)
    assert data.lens == pytest.approx(lens)
    assert extension("gssmc_addon.camera.solution").change(scene, scene.camera) == ""


def test_a_lost_frame_is_filled_and_said(bpy, plate, extension):  # noqa: F811
    scene = set_up(bpy, plate, "broken")
    assert track(bpy) == {"FINISHED"}
    found = kinds(scene.camera)
    assert [frame for frame, kind in found.items() if kind == "GENERATED"] == [BAD_FRAME]
    data = scene.camera.data.gssmc
    assert (data.verdict, data.bad_frames) == ("CHECK", str(BAD_FRAME))
    assert f"Frame {BAD_FRAME}: " in data.reasons
    for step in (1, -1, 1):
        assert bpy.ops.gssmc.weak_frame(step=step) == {"FINISHED"}
        assert scene.frame_current == BAD_FRAME
    assert errors(bpy, extension, scene, plate[1], FRAMES)[:, 0].max() < 0.03


def test_what_cannot_be_tracked_is_refused_and_nothing_keyed(bpy, plate):  # noqa: F811
    scene = set_up(bpy, plate)
    scene.frame_set(7)
    with pytest.raises(RuntimeError, match="begins at the frame that is shown, 7; go to one from 1 to 4"):
        track(bpy, start=1, end=4)
    assert scene.camera.animation_data is None
