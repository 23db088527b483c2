"""Place by Pins, Set Floor and Set Scale, by their operators and by the events of the window gone by hand."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from by_hand import Context, operator
from panels_drawn import Layout
from samples import random_gaussians, write_ply

pytest.importorskip("bpy")  # which brings mathutils
from mathutils import Matrix, Vector

from core.geometry.camera import pose_error


@pytest.fixture
def solved(bpy, extension, scene):
    """The scene whose camera is calibrated; four points before it with the pixels at which it sees them; and its pose."""
    camera, splat = scene.camera, scene.gssmc.splat
    camera.data.gssmc.lens_state = "CALIBRATED"
    splat.matrix_world = Matrix.Translation((3, -1, 0.5)) @ Matrix.Rotation(0.6, 4, (1, 2, 3)) @ Matrix.Scale(1.7, 4)
    camera.matrix_world = Matrix.Translation((3.2, -1.1, 8.0)) @ Matrix.Rotation(0.1, 4, (1, 1, 0))
    bpy.context.view_layer.update()
    state = extension("gssmc_addon.pins.state")
    now = state.camera_of(scene, camera, splat)
    points = [Vector(p) for p in ((2.0, -2.4, 0.4), (4.5, -2.2, -1.5), (4.2, 0.7, 2.0), (1.8, 0.9, -0.5), (3.4, -0.8, 1.2))]
    in_splat = [tuple(splat.matrix_world.inverted() @ p) for p in points]
    pixels = now.intrinsics.project(now.pose.transform(in_splat))
    return SimpleNamespace(scene=scene, camera=camera, splat=splat, points=points, pixels=pixels, pose=now.pose, state=state)


def pin(bpy, solved, number, **more):
    x, y = solved.pixels[number]
    return bpy.ops.gssmc.add_pin(photo_x=x, photo_y=y, world=solved.points[number], **more)


def test_pins_place_the_camera_and_keep_how_sure_that_is(bpy, solved):
    camera, data = solved.camera, solved.camera.data.gssmc
    camera.matrix_world = Matrix.Translation((0.5, -0.4, 0.3)) @ camera.matrix_world @ Matrix.Rotation(0.1, 4, "X")
    for number in range(5):
        assert pin(bpy, solved, number) == {"FINISHED"}
    assert data.verdict == "NONE"
    assert bpy.ops.gssmc.solve_pins() == {"FINISHED"}
    found = solved.state.camera_of(solved.scene, camera, solved.splat)
    distance, degrees = pose_error(found.pose, solved.pose)
    assert distance < 0.06 and degrees < 0.6
    assert data.verdict == "PINNED" and "Placed by pins: 5 pins" in data.reasons
    assert all(0 <= p.error_px < 0.5 for p in data.pins)
    camera.location.x += 0.5
    bpy.context.view_layer.update()
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert pose_error(solved.state.camera_of(solved.scene, camera, solved.splat).pose, found.pose)[0] < 1e-4
    assert bpy.ops.gssmc.place_by_pins() == {"FINISHED"}  # in a script it solves


def test_a_pin_goes_without_the_camera(bpy, solved):
    pin(bpy, solved, 0)
    pin(bpy, solved, 1, weight=3.0, solve=True)
    assert solved.camera.data.gssmc.verdict == "NONE", "two pins place nothing"
    assert solved.camera.data.gssmc.pins[1].weight == 3.0
    before = solved.camera.matrix_world.copy()
    assert bpy.ops.gssmc.remove_pin(index=0) == {"FINISHED"}
    assert len(solved.camera.data.gssmc.pins) == 1 and solved.camera.matrix_world == before
    bpy.ops.gssmc.remove_pin(all=True)
    assert not bpy.ops.gssmc.remove_pin.poll()


def test_refine_holds_pins_where_that_is_asked_for_and_a_pinned_camera_outlives_its_failure(bpy, solved, extension):
    """The photo shows nothing of this scan, so that Refine fails: the camera of the pins stays one."""
    for number in range(5):
        pin(bpy, solved, number)
    bpy.ops.gssmc.solve_pins()
    jobs, settings = extension("gssmc_addon.refine.job"), extension("core.pose.settings").RefineSettings()
    for hold, count in ((False, 0), (True, 5)):
        solved.scene.gssmc.hold_pins = hold
        job = jobs.prepare(solved.scene, solved.splat, solved.camera, settings)
        assert len(job.inputs.pins) == count
        job.close()
    before = solved.camera.matrix_world.copy()
    assert bpy.ops.gssmc.refine(locate=False, iterations=1, candidates=2) == {"CANCELLED"}
    assert solved.camera.matrix_world == before
    assert solved.camera.data.gssmc.verdict == "PINNED" and "photo shows only" in solved.camera.data.gssmc.reasons


def test_pins_on_one_line_leave_the_camera_where_it_is(bpy, solved):
    for number, share in enumerate((0.0, 0.4, 1.0)):
        point = solved.points[0].lerp(solved.points[1], share)
        x, y = solved.pixels[0] + share * (solved.pixels[1] - solved.pixels[0])
        assert bpy.ops.gssmc.add_pin(photo_x=x + 5 * number, photo_y=y, world=point) == {"FINISHED"}
    before = solved.camera.matrix_world.copy()
    with pytest.raises(RuntimeError, match="one line"):
        bpy.ops.gssmc.solve_pins()
    assert solved.camera.matrix_world == before and solved.camera.data.gssmc.verdict == "NONE"


def test_pins_of_a_plate_belong_to_their_frame(bpy, solved):
    scene, camera, data = solved.scene, solved.camera, solved.camera.data
    pin(bpy, solved, 0)
    scene.frame_set(scene.frame_current + 4)
    pin(bpy, solved, 1)
    assert len(solved.state.of(scene, data)) == 2, "a still has all of them at all frames"
    data.gssmc.photo.source = "SEQUENCE"
    assert solved.state.numbers(scene, data) == [1]
    assert len(solved.state.errors_now(scene, camera, solved.splat)) == 1
    solved.state.put(scene, data, [])
    scene.frame_set(scene.frame_current - 4)
    assert solved.state.numbers(scene, data) == [0]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, "photo_x"),
        ({"photo_x": 1, "photo_y": 2}, "point"),
        ({"photo_x": 1, "photo_y": 2, "splat_x": np.nan, "splat_y": 2}, "shows nothing there"),
        ({"photo_x": 1, "photo_y": -900, "world": (0, 0, 0)}, "far outside"),
    ],
)
def test_half_a_pin_is_refused(bpy, solved, more, said):
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.gssmc.add_pin(**more)
    assert not len(solved.camera.data.gssmc.pins)


def wall(bpy, tmp_path, height=0.0):
    """A splat that is an opaque square floor at that height, of small Gaussians."""
    columns = random_gaussians(2500, 0, 3)
    grid = np.stack(np.meshgrid(np.linspace(-2, 2, 50), np.linspace(-2, 2, 50)), -1).reshape(-1, 2).astype(np.float32)
    columns["x"], columns["y"] = grid.T
    columns["z"][:] = height
    columns["opacity"][:] = 8.0
    for axis, size in enumerate((-2.6, -2.6, -7.0)):
        columns[f"scale_{axis}"][:] = size
    for k in range(4):
        columns[f"rot_{k}"][:] = float(k == 0)
    bpy.ops.gssmc.import_splats(filepath=str(write_ply(tmp_path / "wall.ply", columns)), orientation="Z_UP")
    return bpy.context.scene.gssmc.splat


def test_a_pin_lands_on_what_the_camera_sees(bpy, scene, tmp_path, extension):
    splat, camera = wall(bpy, tmp_path, 1.0), scene.camera
    scene.gssmc.splat = splat
    camera.matrix_world = Matrix.Translation((0.3, 0.2, 6.0)) @ Matrix.Rotation(0.2, 4, "X")
    bpy.context.view_layer.update()
    bpy.ops.gssmc.add_pin(photo_x=20, photo_y=50, splat_x=31.2, splat_y=40.7)
    point = Vector(camera.data.gssmc.pins[0].world)
    assert point.z == pytest.approx(1.0, abs=0.03)
    state = extension("gssmc_addon.pins.state")
    now = state.camera_of(scene, camera, splat)
    np.testing.assert_allclose(now.intrinsics.project(now.pose.transform([point]))[0], (31.2, 40.7), atol=0.02)
    with pytest.raises(RuntimeError, match="shows nothing"):
        bpy.ops.gssmc.add_pin(photo_x=20, photo_y=50, splat_x=-5000, splat_y=0)


# ---- with the mouse


class Area:
    """A 3D viewport of 600 x 900 pixels that looks through the scene's camera; the picture of 60 x 90 fills it."""

    type = "VIEW_3D"

    def __init__(self, scene):
        matrix = scene.camera.calc_matrix_camera(scene.view_layers[0].depsgraph, x=600, y=900)
        eye = scene.camera.matrix_world.inverted()
        self.said = None
        self.regions = [SimpleNamespace(type="WINDOW", x=100, y=50, width=600, height=900)]
        view = SimpleNamespace(view_perspective="PERSP", window_matrix=matrix, view_matrix=eye)
        self.spaces = SimpleNamespace(active=SimpleNamespace(region_3d=view))

    def follow(self, scene):
        """As Blender does before each event."""
        self.spaces.active.region_3d.view_matrix = scene.camera.matrix_world.inverted()

    def tag_redraw(self):
        pass

    def header_text_set(self, text):
        self.said = text


class Window(Context):
    """Blender's context in that viewport."""

    def __init__(self, bpy, area):
        super().__init__(bpy)
        self.area, self.window = area, SimpleNamespace(screen=SimpleNamespace(areas=[area]))
        self.workspace = SimpleNamespace(status_text_set=lambda text: None)
        self.window_manager.event_timer_add = lambda *_, **__: object()
        self.window_manager.event_timer_remove = lambda timer: None


class Hand:
    """A mouse and a keyboard; places are pixels of the photo."""

    def __init__(self, bpy, hand, context, scene):
        self.hand, self.context, self.scene, self.bpy = hand, context, scene, bpy
        self.at = (0, 0)

    def __call__(self, kind, value="PRESS", photo=None, ctrl=False):
        if photo is not None:
            self.at = (100 + round(10 * photo[0]), 50 + 900 - round(10 * photo[1]))
        self.bpy.context.view_layer.update()
        self.context.area.follow(self.scene)
        event = SimpleNamespace(type=kind, value=value, mouse_x=self.at[0], mouse_y=self.at[1], ctrl=ctrl)
        return self.hand.modal(self.context, event)

    def wait(self):
        """Until the splat is prepared."""
        for _ in range(1000):
            self("TIMER", "NOTHING", photo=(30, 45))
            if self.hand._surface is not None:
                return
            time.sleep(0.01)

    def drag(self, start, end):
        self("LEFTMOUSE", photo=start)
        self("MOUSEMOVE", "NOTHING", photo=((start[0] + end[0]) / 2, (start[1] + end[1]) / 2))
        self("MOUSEMOVE", "NOTHING", photo=end)
        return self("LEFTMOUSE", "RELEASE")


@pytest.fixture
def session(bpy, scene, tmp_path, extension):
    """The floor, a calibrated camera above it, and the operator in its viewport, with the splat prepared."""
    splat, camera = wall(bpy, tmp_path), scene.camera
    scene.gssmc.splat = splat
    scene.render.resolution_x, scene.render.resolution_y = 60, 90
    camera.matrix_world = Matrix.Translation((0.1, 0.2, 5.0)) @ Matrix.Rotation(0.15, 4, "X")
    camera.data.gssmc.lens_state = "CALIBRATED"
    bpy.context.view_layer.update()
    window = Window(bpy, Area(scene))
    hand = operator(bpy, extension("operators.place_by_pins").GSSMC_OT_place_by_pins)
    assert hand.invoke(window, None) == {"RUNNING_MODAL"}, hand.said
    mouse = Hand(bpy, hand, window, scene)
    mouse.wait()
    return SimpleNamespace(hand=hand, mouse=mouse, window=window, camera=camera, pins=camera.data.gssmc.pins, scene=scene)


def test_dragging_three_points_moves_the_camera_as_if_it_had_stood_there(bpy, session, extension):
    """The photo is one from another place: each point of the floor is dragged to where that camera sees it."""
    camera, state, splat = session.camera, extension("gssmc_addon.pins.state"), session.scene.gssmc.splat
    start = camera.matrix_world.copy()
    camera.matrix_world = Matrix.Translation((0.1, -0.1, 0.2)) @ start @ Matrix.Rotation(0.06, 4, "Z")
    bpy.context.view_layer.update()
    truth = state.camera_of(session.scene, camera, splat)
    rays = np.column_stack([truth.intrinsics.normalise([(10, 15), (50, 20), (45, 75), (15, 70)]), np.ones(4)]) @ truth.pose.R
    spots = truth.pose.centre - rays * (truth.pose.centre[2] / rays[:, 2:])
    camera.matrix_world = start
    for spot in spots:
        bpy.context.view_layer.update()
        now = state.camera_of(session.scene, camera, splat)
        seen, wanted = (c.intrinsics.project(c.pose.transform([spot]))[0] for c in (now, truth))
        assert session.mouse.drag(seen, wanted) == {"RUNNING_MODAL"}, (session.hand.said, seen, wanted)
    assert len(session.pins) == 4 and all(p.world[2] == pytest.approx(0, abs=0.02) for p in session.pins)
    assert session.window.area.said.startswith("Placed by pins: 4 pins")
    assert session.mouse("RET") == {"FINISHED"}
    bpy.context.view_layer.update()
    distance, degrees = pose_error(state.camera_of(session.scene, camera, splat).pose, truth.pose)
    assert distance < 0.15 and degrees < 1.5  # the mouse knows whole pixels, a tenth of the photo's
    assert camera.data.gssmc.verdict == "PINNED"


def test_esc_ends_a_drag_then_the_session_and_the_pins_stay(bpy, session):
    before = session.camera.matrix_world.copy()
    session.mouse.drag((20, 30), (24, 33))
    moved = session.camera.matrix_world.copy()
    assert moved != before and len(session.pins) == 1
    session.mouse("LEFTMOUSE", photo=(40, 60))
    session.mouse("MOUSEMOVE", "NOTHING", photo=(30, 50))
    assert len(session.pins) == 2
    session.mouse("ESC")
    assert len(session.pins) == 1
    np.testing.assert_allclose(session.camera.matrix_world, moved, atol=1e-4)
    assert session.mouse("ESC") == {"FINISHED"}
    assert len(session.pins) == 1
    np.testing.assert_allclose(session.camera.matrix_world, before, atol=1e-4)


def test_pins_are_moved_deleted_and_taken_back(bpy, session):
    session.mouse.drag((20, 30), (20, 30))
    session.mouse.drag((20.2, 30.1), (28, 35))
    assert len(session.pins) == 1 and tuple(session.pins[0].photo) == pytest.approx((28, 35), abs=0.11)
    session.mouse("Z", ctrl=True)
    assert tuple(session.pins[0].photo) == pytest.approx((20, 30), abs=0.11)
    session.mouse("X", photo=(20, 30))
    assert len(session.pins) == 0
    session.mouse("Z", ctrl=True)
    session.mouse("LEFTMOUSE", photo=(20, 30), ctrl=True)
    session.mouse("LEFTMOUSE", "RELEASE")
    assert len(session.pins) == 0
    assert session.mouse("MOUSEMOVE", "NOTHING", photo=(-20, 30)) == {"PASS_THROUGH"}, "that is beside the viewport"
    session.hand._end(session.window, keep=True)


def test_what_is_drawn_of_pins_lies_on_the_photo(bpy, session, extension):
    marks, screen = extension("gssmc_addon.pins.marks"), extension("gssmc_addon.pins.screen")
    session.mouse.drag((20, 30), (20, 30))
    session.hand._end(session.window, keep=True)
    photo = screen.PhotoOnScreen((60, 90), (0, 0), (600, 900))
    session.pins[0].photo = (20, 34)
    drawn = marks.marks_of(session.scene, session.camera, session.scene.gssmc.splat, photo)
    assert drawn.rings[0][0] == (pytest.approx(200), pytest.approx(560))
    assert drawn.crosses[0][0] == (pytest.approx(200, abs=1), pytest.approx(600, abs=1))
    assert drawn.words[0][1] == "1: 4.0 px" and drawn.rings[0][1] != marks.FINE
    wide = screen.PhotoOnScreen.fitted((60, 90), 1.0, np.array([[0.1, 0.1], [0.9, 0.9]]), (1000, 900))
    assert wide.to_photo(wide.to_region((7, 80))) == (pytest.approx(7), pytest.approx(80))
    assert (wide.low[1], wide.high[1]) == (90, 810) and wide.low[0] == 500 - 240
    view, region = session.window.area.spaces.active.region_3d, session.window.area.regions[0]
    whole = screen.PhotoOnScreen.of(session.scene, session.camera, region, view)
    session.camera.data.gssmc.overscan = 1.25  # as a composite sets it: the frame shows more than the photo
    part = screen.PhotoOnScreen.of(session.scene, session.camera, region, view)
    assert part.high[0] - part.low[0] == pytest.approx((whole.high[0] - whole.low[0]) / 1.25)
    assert part.low[1] + part.high[1] == pytest.approx(whole.low[1] + whole.high[1])
    session.camera.data.gssmc.overscan = 1.0
    lens = extension("core.geometry.camera").Intrinsics(60, 90, 70, 70, 31, 44, (-0.2, 0.05, 0.001, 0.0, 0.0))
    bent = screen.PhotoOnScreen((60, 90), (0, 0), (600, 900), lens)
    assert bent.to_photo(bent.to_region((5, 8))) == (pytest.approx(5, abs=1e-6), pytest.approx(8, abs=1e-6))
    x, y = lens.undistort([(5, 8)])[0]
    assert bent.to_region((5, 8)) == (pytest.approx(10 * x), pytest.approx(900 - 10 * y))
    layout = Layout()
    extension("gssmc_addon.pins.panel").GSSMC_PT_pins.draw(
        SimpleNamespace(layout=layout), SimpleNamespace(scene=session.scene, region=SimpleNamespace(width=900))
    )
    assert "gssmc.solve_pins" in layout.said and "hold_pins" in layout.said


# ---- floor and scale


def in_splat(scene, obj):
    return np.array(scene.gssmc.splat.matrix_world.inverted() @ obj.matrix_world)[:3, 3]


def test_three_points_become_the_floor_and_cameras_keys_and_children_go_along(bpy, solved):
    scene, camera, splat = solved.scene, solved.camera, solved.splat
    camera.data.gssmc.verdict = "TRUSTED"
    for frame, x in ((1, 0.0), (11, 2.0)):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_euler", frame=frame)
    hidden = camera.copy()
    hidden.data = camera.data.copy()
    hidden.animation_data.action = camera.animation_data.action.copy()
    scene.collection.objects.link(hidden)
    hidden.hide_viewport = True  # Blender does not evaluate it
    child = bpy.data.objects.new("proxy", bpy.data.meshes.new("proxy"))
    scene.collection.objects.link(child)
    child.parent = splat
    bpy.context.view_layer.update()
    corners = [Vector(p) for p in ((1, 0, 0.2), (3, 0, 0.8), (1, 2, -0.3))]
    mine = [splat.matrix_world.inverted() @ p for p in corners]
    places = []
    for frame in (1, 11):
        scene.frame_set(frame)
        places.append(in_splat(scene, camera))
    below = in_splat(scene, child)
    assert bpy.ops.gssmc.set_floor(method="POINTS", points=[v for p in corners for v in p]) == {"FINISHED"}
    for point in mine:
        assert (splat.matrix_world @ point).z == pytest.approx(0, abs=1e-5)
    assert camera.matrix_world.translation.z > 0
    for frame, place in zip((1, 11), places, strict=True):
        scene.frame_set(frame)
        np.testing.assert_allclose(in_splat(scene, camera), place, atol=1e-5)
    np.testing.assert_allclose(in_splat(scene, child), below, atol=1e-6)
    hidden.hide_viewport = False
    for frame, place in zip((1, 11), places, strict=True):
        scene.frame_set(frame)
        np.testing.assert_allclose(in_splat(scene, hidden), place, atol=1e-5)
    with pytest.raises(RuntimeError, match="one line"):
        bpy.ops.gssmc.set_floor(method="POINTS", points=(0, 0, 0, 1, 0, 0, 2, 0, 0))


def test_a_distance_becomes_true_and_a_solved_camera_stays_solved(bpy, solved, extension):
    scene, camera, splat = solved.scene, solved.camera, solved.splat
    for number in range(5):
        pin(bpy, solved, number)
    bpy.ops.gssmc.solve_pins()
    before, reach = splat.matrix_world.copy(), camera.data.clip_end
    a, b = Vector((3, 0, 0)), Vector((3, 4, 0))
    mine = [before.inverted() @ p for p in (a, b)]
    assert bpy.ops.gssmc.set_scale(points=(*a, *b), distance=1.0) == {"FINISHED"}
    one, other = (splat.matrix_world @ p for p in mine)
    assert (one - other).length == pytest.approx(1.0, abs=1e-5) and one.z == pytest.approx(0, abs=1e-5)
    assert camera.data.clip_end == pytest.approx(reach / 4)
    assert tuple(camera.matrix_world.to_scale()) == pytest.approx((1, 1, 1), abs=1e-5)
    assert extension("gssmc_addon.camera.solution").verdict(scene, camera) == "PINNED", "it is the same camera in the splat"
    for points, distance in (((0, 0, 0, 0, 0, 0), 1.0), ((*a, *b), 0.0)):
        with pytest.raises(RuntimeError, match="two points"):
            bpy.ops.gssmc.set_scale(points=points, distance=distance)


@pytest.mark.parametrize(
    ("distance", "said"), [(np.nan, "no finite"), (1e-30, "times as large"), (1e30, "times as large"), (0, "how far")]
)
def test_what_is_no_place_or_size_moves_nothing(bpy, solved, distance, said):
    before = solved.splat.matrix_world.copy()
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.gssmc.set_scale(points=(0, 0, 0, 1, 0, 0), distance=distance)
    with pytest.raises(RuntimeError, match="no finite"):
        bpy.ops.gssmc.set_floor(method="POINTS", points=(0, 0, 0, 1, 0, 0, 0, 1, np.nan))
    assert solved.splat.matrix_world == before


def test_the_floor_is_found_and_told_from_walls(bpy, scene, tmp_path):
    """A leaning room of a floor, a larger wall and dust: the floor counts, for it is level by the photo's camera."""
    splat = wall(bpy, tmp_path)
    scene.gssmc.splat = splat
    lean = Matrix.Translation((1, 2, 3)) @ Matrix.Rotation(0.3, 4, (1, 0.5, 0)) @ Matrix.Scale(2, 4)
    splat.matrix_world = lean
    camera = scene.camera
    camera.data.gssmc.verdict = "TRUSTED"
    camera.matrix_world = lean @ Matrix.Translation((0, 0, 1.5)) @ Matrix.Rotation(1.5, 4, "X")
    bpy.context.view_layer.update()
    assert bpy.ops.gssmc.set_floor(method="AUTO") == {"FINISHED"}
    up = splat.matrix_world.to_3x3().normalized() @ Vector((0, 0, 1))
    assert up.z == pytest.approx(1, abs=1e-4) and splat.matrix_world.translation.z == pytest.approx(0, abs=0.01)
    assert camera.matrix_world.translation.z == pytest.approx(3.0, abs=0.02)


def test_clicks_of_the_floor_are_taken_one_after_the_other(bpy, session, extension, monkeypatch):
    session.hand._end(session.window, keep=True)
    splat = session.scene.gssmc.splat
    splat.matrix_world = Matrix.Rotation(0.2, 4, "Y")
    bpy.context.view_layer.update()
    monkeypatch.setattr(bpy.types.SpaceView3D, "draw_handler_add", staticmethod(lambda *_: None), raising=False)
    hand = operator(bpy, extension("operators.set_floor").GSSMC_OT_set_floor, method="POINTS")
    assert hand.invoke(session.window, None) == {"RUNNING_MODAL"}, hand.said
    mouse = Hand(bpy, hand, session.window, session.scene)
    mouse.wait()
    for place in ((20, 30), (45, 35), (30, 70)):
        result = mouse("LEFTMOUSE", photo=place)
    assert result == {"FINISHED"}, hand.said
    up = splat.matrix_world.to_3x3() @ Vector((0, 0, 1))
    assert up.z == pytest.approx(1, abs=1e-3)
