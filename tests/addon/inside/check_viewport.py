"""Splats in the viewport: against the engine's renderer where this machine can draw without a window.

And beside it what needs no graphics: reading, stopping, what is kept on objects.
"""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from core.render import Renderer, RenderSettings
from core.synthetic.room import make_scene
from core.synthetic.sample import sample_cameras

CLIP = (0.01, 1000.0)


@pytest.fixture(scope="module")
def room():
    """The built-in room with SH degree 0, which is what the viewport shows."""
    scene = make_scene(0)
    return replace(scene, sh=np.ascontiguousarray(scene.sh[:, :1]))


@pytest.fixture
def drawing(blender):
    """Blender's gpu module with a context, in background mode."""
    import gpu

    if not hasattr(gpu, "init"):
        pytest.skip("this Blender's gpu module needs a window")
    try:
        gpu.init()
    except SystemError as error:
        pytest.skip(f"nothing can be drawn here without a window: {error}")
    return gpu


def matrices(camera):
    """View and projection of the engine's camera as Blender's viewport has them."""
    from mathutils import Matrix

    k, (near, far) = camera.intrinsics, CLIP
    flip = np.diag([1.0, -1.0, -1.0])
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = flip @ camera.pose.R, flip @ camera.pose.t
    projection = np.zeros((4, 4))
    projection[0, 0], projection[0, 2] = 2 * k.fx / k.width, 1 - 2 * k.cx / k.width
    projection[1, 1], projection[1, 2] = 2 * k.fy / k.height, 2 * k.cy / k.height - 1
    projection[2, 2], projection[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
    projection[3, 2] = -1
    return Matrix(view.tolist()), Matrix(projection.tolist())


def base_of(scene):
    return np.concatenate([scene.sh[:, 0], scene.opacities[:, None]], axis=1)


def picture(gpu, extension, scene, camera, depth=None, slices=1, model=None):
    """The viewport's shader over an offscreen buffer: (H, W, 4), premultiplied."""
    from mathutils import Matrix

    data, drawer = extension("gssmc_addon.viewport.data"), extension("gssmc_addon.viewport.gpu")
    size = camera.intrinsics.width, camera.intrinsics.height
    view, projection = matrices(camera)
    view = view @ (model or Matrix.Identity(4))
    tables = data.build_tables(scene.means, scene.scales, scene.rotations, base_of(scene), 10**8)
    textures = drawer.SplatTextures(tables)
    while not textures.send_next():
        pass
    order = data.back_to_front(tables.means, np.array(view.row[2][:3]))
    draw = drawer.SplatDraw(textures, drawer.texture(data.order_table(order)), len(order), 1.0, view, projection, 0)
    ground = drawer.Ground(size, depth if depth is None else drawer.texture(depth), 1)
    buffer = gpu.types.GPUOffScreen(*size, format="RGBA32F")
    painter = drawer.Painter()
    bounds = np.linspace(0, len(order), slices + 1).astype(int)
    with buffer.bind():
        frame = gpu.state.active_framebuffer_get()
        frame.clear(color=(0.0, 0.0, 0.0, 0.0))
        for start, stop in pairwise(bounds):
            painter.draw_splats(draw, ground, range(start, stop))
        pixels = np.array(frame.read_color(0, 0, *size, 4, 0, "FLOAT"), np.float32)
    buffer.free()
    return pixels.reshape(size[1], size[0], 4)[::-1]


@pytest.mark.parametrize("index", [1, 4])
def test_the_shader_draws_what_the_engine_draws(drawing, extension, room, index):
    camera = sample_cameras()[index]
    got = picture(drawing, extension, room, camera)
    wanted = Renderer(room, RenderSettings.for_scene(room)).render(camera.intrinsics, camera.pose)
    colour, alpha = np.abs(got[..., :3] - wanted.color), np.abs(got[..., 3] - wanted.alpha)
    assert colour.mean() < 0.001, "colours have 8 bits: half a level is 0.002"
    assert colour.max() < 0.02
    assert alpha.mean() < 0.0005


def test_an_object_may_be_turned_and_scaled(drawing, extension, room):
    """A splat twice as large, seen by a camera at the place that corresponds, looks the same."""
    from mathutils import Euler, Matrix

    model = Matrix.LocRotScale((1, 2, 3), Euler((0.3, -0.2, 1.0)), (2.0, 2.0, 2.0))
    camera = sample_cameras()[0]
    plain = picture(drawing, extension, room, camera)
    linear, shift = np.array(model.to_3x3()) / 2, np.array(model.translation)
    centre = 2 * linear @ camera.pose.centre + shift
    moved = replace(camera, pose=type(camera.pose).from_centre(camera.pose.R @ linear.T, centre))
    got = picture(drawing, extension, room, moved, model=model)
    assert np.abs(got - plain).mean() < 1e-3


def test_slices_add_up_to_the_whole(drawing, extension, room):
    camera = sample_cameras()[2]
    whole, parts = (picture(drawing, extension, room, camera, slices=n) for n in (1, 7))
    np.testing.assert_array_equal(parts, whole)


def test_what_stands_before_hides(drawing, extension, room):
    """A depth of 0 in the left half, the background's in the right one."""
    camera = sample_cameras()[2]
    height, width = camera.intrinsics.height, camera.intrinsics.width
    depth = np.ones((height, width), np.float32)
    depth[:, : width // 2] = 0.0
    got, free = (picture(drawing, extension, room, camera, depth=d) for d in (depth, None))
    assert not got[:, : width // 2].any()
    np.testing.assert_array_equal(got[:, width // 2 :], free[:, width // 2 :])


def test_broken_gaussians_are_drawn_nowhere(drawing, extension, room):
    camera = sample_cameras()[1]
    few = replace(room, **{n: getattr(room, n)[:2000].copy() for n in ("means", "scales", "rotations", "opacities", "sh")})
    free = picture(drawing, extension, few, camera)
    many = {n: np.concatenate([getattr(few, n)] * 2) for n in ("means", "scales", "rotations", "opacities", "sh")}
    many["means"][2000:3000, 1] = np.nan
    many["rotations"][3000:] = 0.0
    got = picture(drawing, extension, replace(few, **many), camera)
    assert np.abs(got - free).max() < 1e-5


def test_back_to_front(extension):
    back_to_front = extension("gssmc_addon.viewport.data").back_to_front
    means = np.random.default_rng(3).normal(size=(500, 3)).astype(np.float32)
    direction = np.array([0.6, 0.0, -0.8])
    order = back_to_front(means, direction).astype(int)
    assert sorted(order) == list(range(500))
    assert (np.diff((means @ direction)[order]) >= -1e-6).all(), "a viewport looks along its -z: the nearest have the largest z"


# ---- without a graphics card


def test_shown_as_points_where_nobody_draws_splats(bpy, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), max_shown=5000, scale=2.5)
    obj = bpy.context.scene.gssmc.splat
    assert (obj.gssmc.show_as, obj.display_type, obj.gssmc.max_shown) == ("SPLATS", "TEXTURED", 5000)
    assert tuple(round(s, 5) for s in obj.matrix_world.to_scale()) == (2.5, 2.5, 2.5)
    obj.gssmc.show_as = "BOX"
    assert obj.display_type == "BOUNDS"
    obj.gssmc.show_as = "POINTS"
    assert obj.display_type == "TEXTURED"


def test_shown_as_splats_where_the_window_draws_them(bpy, extension, splat_file, monkeypatch):
    """By the extension over a box, or by Blender itself where it can (5.3): then nothing is drawn a second time."""
    props, by_blender = extension("gssmc_addon.viewport.props"), bpy.app.version >= (5, 3)
    monkeypatch.setitem(props._state, "drawable", True)
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    obj = bpy.context.scene.gssmc.splat
    assert obj.display_type == ("TEXTURED" if by_blender else "BOUNDS")
    assert props.shows_splats(obj) is not by_blender
    monkeypatch.setitem(props._state, "drawable", False)
    props.apply_all()
    assert obj.display_type == "TEXTURED", "the extension is switched off: points, never nothing"


@pytest.mark.parametrize("wait", [True, False])
def test_background_mode_waits_for_the_import(bpy, splat_file, wait):
    assert bpy.ops.gssmc.import_splats(filepath=str(splat_file), wait=wait) == {"FINISHED"}
    assert len(bpy.context.scene.gssmc.splat.data.points) == 200


def test_a_point_cloud_is_read_again_only_when_it_changed(bpy, extension, splat_file):
    clouds, threads = extension("gssmc_addon.viewport.clouds"), extension("gssmc_addon.viewport.thread")
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    block = bpy.context.scene.gssmc.splat.data
    thread = threads.BackThread()
    known = clouds.Clouds(thread)

    def settle():
        while known.step() or not thread.idle():
            for (_, uid), result in thread.answers():
                known.accept(uid, result)
        return known.get(block.session_uid)

    assert known.get(block.session_uid) == (None, 0)
    textures, version = settle()
    assert (textures.count, version) == (200, 1)
    known.mark_stale(block.session_uid)
    assert settle() == (textures, 1), "Blender said that it changed, but it did not"
    block.attributes["position"].data[7].vector = (9, 9, 9)
    known.mark_stale(block.session_uid)
    changed, version = settle()
    assert version == 2
    assert (changed.means == 9).all(axis=1).sum() == 1
    bpy.data.objects.remove(bpy.context.scene.gssmc.splat)
    bpy.data.pointclouds.remove(block)
    assert not known.step()
    thread.stop()
    assert thread.idle()


def test_the_thread_outlives_work_that_breaks(extension):
    thread = extension("gssmc_addon.viewport.thread").BackThread()
    thread.ask("bad", lambda: 1 / 0)
    thread.ask("good", lambda: 2)
    found = []
    while len(found) < 2:
        found += thread.answers()
    assert sorted(found) == [("bad", None), ("good", 2)]
    thread.stop()
    thread.ask("again", lambda: 3)
    while not (found := thread.answers()):
        pass
    assert found == [("again", 3)]
    thread.stop()


def test_slow_machines_get_less_to_do(extension):
    lod = extension("gssmc_addon.viewport.lod")
    slow, fast = lod.Budget(True), lod.Budget(False)
    for _ in range(30):
        slow.moved(slow.moving, 0.5)
        slow.sliced(slow.slice, 0.5)
        fast.moved(fast.moving, 0.001)
        fast.sliced(fast.slice, 0.001)
    assert (slow.moving, slow.shrink, slow.slice) == (lod.FEWEST, 4, lod.SMALLEST_SLICE)
    assert (fast.moving, fast.shrink) == (lod.MOST_MOVING, 1)
    assert fast.slice == lod.LARGEST
    fast.begin()
    slow.begin()
    assert (fast.slice, slow.slice) == (lod.SLICE[False], lod.SMALLEST_SLICE), "another view may be a slower one"


def pictures(budget, limit, seconds_each):
    """How many Gaussians the first pictures of a moving view show, on a card that takes so long for each."""
    shown = [min(budget.moving, limit)]
    for _ in range(20):
        budget.moved(shown[-1], 0.001 + shown[-1] * seconds_each)
        if not budget.leaps(shown[-1], limit):
            return shown
        shown.append(min(budget.moving, limit))
    raise AssertionError(f"no end of redraws: {shown}")


def test_the_first_picture_is_small_and_a_fast_card_is_there_soon(extension):
    lod = extension("gssmc_addon.viewport.lod")
    for software in (False, True):  # not every software GL says its name
        assert lod.Budget(software).moving <= 10_000
    fast = pictures(lod.Budget(False), 900_000, 1e-9)
    assert lod.LEAP * fast[-1] > 900_000, "all of them as soon as the view rests"
    assert len(fast) <= 3
    assert pictures(lod.Budget(False), 5_000, 1e-9) == [5_000], "all there is"
    assert pictures(lod.Budget(False), 0, 1e-9) == [0]
    budget = lod.Budget(True)
    assert pictures(budget, 900_000, 5e-6) == [10_000], "a redraw costs more than it would show"
    for _ in range(10):
        budget.moved(budget.moving, budget.moving * 2.5e-6)
    assert 0.5 * lod.MOVING_S < budget.moving * 2.5e-6 < lod.MOVING_S, "it grows to what there is time for, and stays there"


def drawn_room(extension, room, camera):
    """Painter, what it is to draw, and the viewport's empty depth, for a canvas."""
    data, drawer = extension("gssmc_addon.viewport.data"), extension("gssmc_addon.viewport.gpu")
    view, projection = matrices(camera)
    tables = data.build_tables(room.means, room.scales, room.rotations, base_of(room), 10**8)
    textures = drawer.SplatTextures(tables)
    while not textures.send_next():
        pass
    order = drawer.texture(data.order_table(data.back_to_front(tables.means, np.array(view.row[2][:3]))))
    depth = extension("gssmc_addon.viewport.canvas").Depth()
    depth.values = np.ones((camera.intrinsics.height, camera.intrinsics.width), np.float32)
    return drawer.Painter(), drawer.SplatDraw(textures, order, tables.count, 1.0, view, projection, 0), depth


def slices(canvas, painter, budget):
    """How many it takes between redraws until the picture stands; nothing half done may be shown."""
    for count in range(1, 1000):
        if canvas.advance(painter, budget):
            assert canvas.shows
            assert not canvas.working
            return count
        assert not canvas.shows
    raise AssertionError("the picture is never complete")


def test_a_resting_picture_grows_between_redraws(drawing, extension, room):
    """One redraw begins it, slices go on without another, and at the end it is the picture drawn in one go."""
    camera = sample_cameras()[2]
    size = camera.intrinsics.width, camera.intrinsics.height
    painter, draw, depth = drawn_room(extension, room, camera)
    budget, canvas = extension("gssmc_addon.viewport.lod").Budget(True), extension("gssmc_addon.viewport.canvas").Canvas()
    canvas.paint(painter, draw, depth, budget, moving=False)
    assert canvas.working
    assert not canvas.shows, "nothing half done is shown"
    assert slices(canvas, painter, budget) > 1
    with canvas._shown.bind():
        frame = drawing.state.active_framebuffer_get()
        pixels = np.array(frame.read_color(0, 0, *size, 4, 0, "FLOAT"), np.float32).reshape(size[1], size[0], 4)[::-1]
    canvas.free()
    whole = picture(drawing, extension, room, camera)
    assert np.abs(pixels - whole).mean() < 0.005, "half floats, blended in slices"


def test_only_the_first_picture_of_a_moving_view_takes_its_time(drawing, extension, room):
    """In slices, for nobody knows yet how long drawing takes; the next is drawn at once, be the first complete or not."""
    painter, draw, depth = drawn_room(extension, room, sample_cameras()[2])
    budget = extension("gssmc_addon.viewport.lod").Budget(True)
    turned = replace(draw, stamp=1)
    for complete in (True, False):
        canvas, measured = extension("gssmc_addon.viewport.canvas").Canvas(), []
        budget.moved = lambda drawn, seconds, measured=measured: measured.append(drawn)
        canvas.paint(painter, draw, depth, budget, moving=True)
        assert canvas.working
        assert not canvas.shows
        if complete:
            assert slices(canvas, painter, budget) == 2
            assert measured == [draw.count], "its time counts as that of any moving picture"
            budget.shrink = 4
            canvas.paint(painter, draw, depth, budget, moving=True)
            assert not canvas.working, "the same again is there already, be it finer than the next one"
            assert measured == [draw.count]
        canvas.paint(painter, turned, depth, budget, moving=True)
        assert canvas.shows
        assert not canvas.working
        assert measured[-1:] == [draw.count]
        assert len(measured) == 1 + complete
        canvas.free()


def test_an_imported_splat_is_written_in_steps(bpy, extension, splat_file):
    """Attributes are added first, then written one by one; a splat that is gone in between is said to be gone."""
    from samples import counts

    from core.splats import read_splats

    job_module, importer = extension("gssmc_addon.splat.import_job"), extension("gssmc_addon.splat.importer")
    read = job_module.ReadSplat.of(extension("core.splats").read_splats(splat_file))
    building = importer.Building("scan", read, importer.Placement())
    seen = []
    while not building.step():
        seen.append(building.fraction)
    assert seen[0] == 0.0
    assert len([f for f in seen if f > 0]) == 4 + 3 - 1, "SH degree 1: seven attributes, each in a step of its own"
    obj = building.finish(bpy.context, job_module.SplatDisplay.of(read, False))
    got = extension("gssmc_addon.splat.copy").read_splat(obj)
    np.testing.assert_array_equal(got.means, read_splats(splat_file).means)
    np.testing.assert_array_equal(got.sh, read_splats(splat_file).sh)
    before = counts(bpy)
    gone = importer.Building("gone", read, importer.Placement())
    gone.step()
    bpy.data.pointclouds.remove(bpy.data.pointclouds["gone"])
    with pytest.raises(extension("core.errors").SplatFormatError, match="was removed while"):
        gone.step()
    assert counts(bpy) == before


def laid_over(gpu, extension, splats, under, pictures=(), opacity=1.0):
    """The overlay of `splats` (H, W, 4), premultiplied, over light `under`, below the pictures: (H, W, 4)."""
    drawer = extension("gssmc_addon.viewport.gpu")
    height, width = splats.shape[:2]
    buffer = gpu.types.GPUOffScreen(width, height, format="RGBA32F")
    painter = drawer.Painter()
    with buffer.bind():
        frame = gpu.state.active_framebuffer_get()
        frame.clear(color=under)
        painter.lay_over(drawer.texture(splats), opacity, painter.with_textures(pictures))
        pixels = np.array(frame.read_color(0, 0, width, height, 4, 0, "FLOAT"), np.float32)
    buffer.free()
    return pixels.reshape(height, width, 4)


def decoded(shown):
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def grey(bpy, level, name="grey"):
    """A picture of one light, as Blender has it in memory."""
    image = bpy.data.images.new(name, 4, 4, float_buffer=True)
    image.pixels.foreach_set(np.tile(np.array([level, level, level, 1], np.float32), 16))
    image.update()
    return image


RIGHT_HALF = np.array([[2.0, 0, -1], [0, 1, 0]])
WHOLE = np.array([[1.0, 0, 0], [0, 1, 0]])


def test_splats_lie_below_a_photo_where_it_is_and_are_opaque_beside_it(drawing, bpy, extension):
    """Photo over splat over viewport, light by light; a splat of opacity c and a photo of opacity a."""
    front = extension("gssmc_addon.viewport.front")
    alpha, a, light, under = 0.8, 0.25, 0.6, (0.1, 0.2, 0.3, 0.0)
    colour = np.array([0.9, 0.5, 0.1])
    splats = np.zeros((6, 8, 4), np.float32)
    splats[..., :3], splats[..., 3] = colour * alpha, alpha
    got = laid_over(drawing, extension, splats, under, [front.FrontPicture(grey(bpy, light), RIGHT_HALF, a)])
    base = np.array(under[:3])
    beside = alpha * decoded(colour) + (1 - alpha) * base
    below = alpha * ((1 - a) * decoded(colour) + a * light) + (1 - alpha) * base
    np.testing.assert_allclose(got[:, :4, :3], np.broadcast_to(beside, (6, 4, 3)), atol=2e-3)
    np.testing.assert_allclose(got[:, 4:, :3], np.broadcast_to(below, (6, 4, 3)), atol=2e-3)
    assert np.ptp(got[..., 3]) < 1e-6, "how much of the viewport is covered does not depend on the photo"


def test_an_opaque_picture_hides_the_splat_there_alone(drawing, bpy, extension):
    """The preview over the half-transparent photo, the upper one last."""
    front = extension("gssmc_addon.viewport.front")
    splats = np.ones((6, 8, 4), np.float32)
    pictures = [
        front.FrontPicture(grey(bpy, 0.9, "photo"), WHOLE, 0.5),
        front.FrontPicture(grey(bpy, 0.2, "preview"), RIGHT_HALF, 1.0),
    ]
    got = laid_over(drawing, extension, splats, (0, 0, 0, 0), pictures)
    np.testing.assert_allclose(got[:, 4:, :3], 0.2, atol=2e-3)
    np.testing.assert_allclose(got[:, :4, :3], 0.95, atol=2e-3)


def test_where_a_picture_before_the_scene_is(bpy, extension):
    """In the middle of the frame, as large as fits whole; its corners in pixels of a region that is larger than the frame."""
    front = extension("gssmc_addon.viewport.front")
    border, region = np.array([[0.25, 0.25], [0.75, 0.75]]), (800, 400)  # a frame of 400 x 200 pixels

    def corners(aspect=1.0, **changes):
        values = {"frame_method": "FIT", "rotation": 0.0, "scale": 1.0, "offset": (0, 0), "use_flip_x": False}
        slot = SimpleNamespace(**{**values, "use_flip_y": False, **changes})
        place = front.place_of(slot, aspect, border, region)
        linear, shift = place[:, :2], place[:, 2]
        return np.array([np.linalg.solve(linear, corner - shift) * region for corner in ((0, 0), (1, 1))]).round(3).tolist()

    assert corners() == [[300, 100], [500, 300]]
    assert corners(aspect=4.0) == [[200, 150], [600, 250]]
    assert corners(frame_method="STRETCH") == [[200, 100], [600, 300]]
    assert corners(frame_method="CROP") == [[200, 0], [600, 400]]
    assert corners(scale=0.5) == [[350, 150], [450, 250]]
    assert corners(offset=(0.1, 0.0)) == [[340, 100], [540, 300]]
    assert corners(use_flip_x=True) == [[500, 100], [300, 300]]
    assert corners(rotation=np.pi / 2)[0] == [300, 300], "clockwise, as Blender turns it"


def test_which_pictures_stand_before_the_scene(bpy, extension):
    """Of a view through the camera, those in front that are switched on; none where overlays are off."""
    front = extension("gssmc_addon.viewport.front")
    data = bpy.data.cameras.new("camera")
    camera = bpy.data.objects.new("camera", data)
    data.show_background_images = True
    for depth in ("FRONT", "BACK", "FRONT"):
        slot = data.background_images.new()
        slot.image, slot.display_depth, slot.alpha = grey(bpy, 0.5), depth, 0.25
    projection = matrices(sample_cameras()[0])[1]
    overlay = SimpleNamespace(show_overlays=True)
    view = SimpleNamespace(
        scene=bpy.context.scene,
        region=SimpleNamespace(width=800, height=600),
        region_data=SimpleNamespace(view_perspective="CAMERA", window_matrix=projection),
        space_data=SimpleNamespace(camera=camera, overlay=overlay),
    )
    assert [picture.alpha for picture in front.front_pictures(view)] == [0.25, 0.25]
    data.background_images[0].show_background_image = False
    assert len(front.front_pictures(view)) == 1
    overlay.show_overlays = False
    assert front.front_pictures(view) == []
    overlay.show_overlays, view.region_data.view_perspective = True, "PERSP"
    assert front.front_pictures(view) == []
