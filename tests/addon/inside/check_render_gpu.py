"""Views from the graphics card: their pictures against the slow twin's, what becomes of a card that fails, and a refinement."""

import gc
import json
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rooms
from render_scenes import assert_same_view, cloud, make_scene
from samples import random_gaussians, write_photo, write_ply

from core.geometry.camera import Intrinsics, Pose
from core.render import Renderer, render_reference
from core.splats import read_splats

MODULE = "bl_ext.user_default.gssmc"
CAMERA = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)
MEANS, SCALES = cloud()


@pytest.fixture(scope="module")
def card(extension):
    """The extension's modules by their last name, once there is a device to draw with."""
    names = ("choice", "draw", "executor", "offer", "renderer", "tables")
    modules = {name: extension(f"gssmc_addon.render_gpu.{name}") for name in names}
    plan = modules["choice"].plan("GPU")
    if not plan.card:
        pytest.skip(f"nothing can be drawn here: {plan.reason}")
    yield type("Card", (), modules)
    modules["choice"].forget()


@pytest.fixture
def own(bpy):
    own = bpy.context.preferences.addons[MODULE].preferences
    yield own
    own.renderer = "AUTO"


def theirs(extension, scene):
    """The scene as the installed extension's own type, which is another class than the one of this folder."""
    kinds = ("means", "scales", "rotations", "opacities", "sh", "antialiased")
    return extension("core.splats.scene").GaussianScene(**{kind: getattr(scene, kind) for kind in kinds})


def drawn(card, scene, camera, pose, near=0.2):
    """The card's view, with no renderer around it that could put something else in its place."""
    scan = card.tables.scan_texels(scene)

    def work():
        there = card.draw.GpuScan(card.choice.shaders(), scan)
        yield from there.send(scan)
        return (yield from there.draw(card.draw.ViewRequest(camera, pose, card.tables.seen_points(scan, camera, pose, near))))

    return card.executor.executor.ask(work, card.executor.Holder())


def deep_tile(opacity):
    rng = np.random.default_rng(7)
    means = np.hstack([rng.normal(size=(3000, 2)) * 0.05, rng.uniform(2, 5, (3000, 1))])
    return make_scene(means, 0.05, opacity=opacity)


MOVED = Pose(t=np.array([0.1, -0.2, 0.3]))
SMALL = Intrinsics(24, 20, 60.0, 60.0, 12.0, 10.0)
VIEWS = {
    **{f"{k} SH coefficients": (make_scene(*cloud(400, seed=k), coefficients=k), CAMERA, MOVED) for k in (1, 4, 9, 16)},
    **{f"antialiased {s}": (replace(make_scene(MEANS, SCALES * s), antialiased=True), CAMERA, Pose()) for s in (0.3, 3.0)},
    **{f"thousands of opacity {o}": (deep_tile(o), SMALL, Pose()) for o in (0.02, 0.3, 1.0)},
    "camera inside": (make_scene(np.subtract(MEANS, (0, 0, 4)), SCALES), CAMERA, Pose()),
    "opaque": (make_scene(MEANS, SCALES * 4, opacity=1.0), CAMERA, Pose()),
    "larger than the world": (make_scene(MEANS, 1e15, opacity=0.1), CAMERA, Pose()),
    "needles": (make_scene(MEANS, (20.0, 1e-4, 1e-4)), CAMERA, Pose()),
    "discs": (make_scene(MEANS, (1.0, 1.0, 1e-6)), CAMERA, Pose()),
    "points": (make_scene(MEANS, 0.0), CAMERA, Pose()),
    "centres far outside": (make_scene(np.add(MEANS, (500, 0, 0)), 200.0), CAMERA, Pose()),
    "far from the origin": (
        make_scene(np.add(MEANS, (4e5, 5e6, 0)), SCALES),
        CAMERA,
        Pose(t=-np.array([4e5, 5e6, 0.0])),
    ),
    "equal depths": (make_scene(np.tile([0.0, 0.0, 3.0], (40, 1)), 0.3, opacity=0.6), CAMERA, Pose()),
    "one pixel": (make_scene(MEANS, SCALES), Intrinsics(1, 1, 5.0, 5.0, 0.5, 0.5), Pose()),
}


@pytest.mark.parametrize("name", VIEWS)
def test_the_card_draws_what_the_slow_twin_draws(card, name):
    scene, camera, pose = VIEWS[name]
    right = render_reference(scene, camera, pose)
    assert right.alpha.max() > 0.05, "the case shows nothing, hence would prove nothing"
    assert_same_view(drawn(card, scene, camera, pose), right)


def test_what_is_not_seen_is_black(card):
    away = Pose(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))
    for scene, pose in ((make_scene(MEANS, SCALES), away), (make_scene(MEANS, SCALES, opacity=0.001), Pose())):
        view = drawn(card, scene, CAMERA, pose)
        assert view.color.shape == (CAMERA.height, CAMERA.width, 3)
        assert not any(part.any() for part in (view.color, view.depth, view.alpha, view.depth_variance))


def test_the_near_plane_cuts(card):
    scene = make_scene([[0, 0, 0.1]], 0.01, opacity=0.9)
    assert not drawn(card, scene, CAMERA, Pose()).alpha.any()
    assert drawn(card, scene, CAMERA, Pose(), near=0.05).alpha.max() > 0.5


SCENES = Path(__file__).parents[3].parent / "shared" / "scenes"


@pytest.mark.parametrize("name", ["fox", "monstree", "room"])
def test_the_card_draws_a_real_scan_as_the_processor_does(card, name):
    """Which is held against the slow twin and against another program; a small picture, for software GL is slow."""
    if not (SCENES / name / "reference.json").exists():
        pytest.skip("the real scans (shared/scenes) are not here")
    scene = read_splats(SCENES / name / "scene.ply")
    frame = json.loads((SCENES / name / "reference.json").read_text())["frames"][0]
    whole = Intrinsics(*(frame[key] for key in ("width", "height", "fx", "fy", "cx", "cy")))
    camera, pose = whole.resized(whole.width // 5, whole.height // 5), Pose(frame["R"], frame["t"])
    right = Renderer(scene).render(camera, pose)
    assert right.alpha.mean() > 0.5
    assert_same_view(drawn(card, scene, camera, pose), right)


class Asking:
    """Views asked for by a thread beside the main one, which serves it here as Blender's timers do in a window."""

    def __init__(self, card, renderer):
        self.card, self.renderer = card, renderer

    def views(self, count=2):
        found = []

        def ask():
            try:
                found.append(self.renderer.render(CAMERA, Pose()))
            except Exception as error:  # noqa: BLE001 - the caller judges it
                found.append(error)

        threads = [threading.Thread(target=ask) for _ in range(count)]
        for thread in threads:
            thread.start()
        end = time.monotonic() + 60
        while any(thread.is_alive() for thread in threads) and time.monotonic() < end:
            self.card.executor.executor.serve()
            time.sleep(0.002)
        assert not any(thread.is_alive() for thread in threads)
        return found


@pytest.fixture
def asking(card, extension):
    """A scene's renderer on the card, with the processor's behind it; the scene and how often the processor was asked for."""
    scene, made = theirs(extension, make_scene(MEANS, SCALES)), []
    render = extension("core.render")

    def processor():
        made.append(None)
        return render.ProcessRenderer(scene, render.RenderSettings())

    owner = card.executor.executor.hold()
    renderer = card.renderer.GpuRenderer(scene, render.RenderSettings(), processor, owner)
    yield Asking(card, renderer), render_reference(make_scene(MEANS, SCALES), CAMERA, Pose()), made
    renderer.close()


def test_threads_get_their_views_from_the_main_thread(asking):
    threads, right, made = asking
    for view in threads.views():
        assert_same_view(view, right)
    assert not threads.renderer.fault
    assert not made


def test_a_view_for_the_main_thread_waits_for_one_that_is_half_drawn(card, asking):
    """They share the textures that they are drawn in."""
    threads, right, _ = asking
    found = []
    thread = threading.Thread(target=lambda: found.append(threads.renderer.render(CAMERA, Pose())))
    threads.views(1)
    thread.start()
    while not card.executor.executor._tasks:
        time.sleep(0.002)
    assert card.executor.executor.serve(0.0), "the view was drawn in one step, hence this would prove nothing"
    wide = replace(CAMERA, fx=20.0)
    assert_same_view(threads.renderer.render(wide, Pose()), render_reference(make_scene(MEANS, SCALES), wide, Pose()))
    thread.join(20)
    assert_same_view(found[0], right)


def raising(*_):
    raise RuntimeError("the device was lost")
    yield


def no_numbers(self, request):
    view = yield from self.right_draw(request)
    view.color[3, 4] = np.nan
    return view


def nothing(self, request):
    view = yield from self.right_draw(request)
    return replace(view, **{name: np.zeros_like(getattr(view, name)) for name in ("color", "alpha", "depth", "depth_variance")})


def not_compiled(*_):
    raise Exception("Shader Compile Error, see console for more details")
    yield


def out_of_memory(*_):
    raise MemoryError
    yield


@pytest.mark.parametrize(
    ("fails", "says"),
    [
        (raising, "device was lost"),
        (no_numbers, "no numbers"),
        (nothing, "drew nothing"),
        (not_compiled, "Compile"),
        (out_of_memory, "MemoryError"),
    ],
)
def test_a_card_that_fails_costs_no_view(card, asking, monkeypatch, caplog, fails, says):
    threads, right, made = asking
    monkeypatch.setattr(card.draw.GpuScan, "right_draw", card.draw.GpuScan.draw, raising=False)
    monkeypatch.setattr(card.draw.GpuScan, "draw", fails)
    for view in [*threads.views(), *threads.views()]:
        assert_same_view(view, right)
    assert says in threads.renderer.fault
    assert len(made) == 1
    assert sum("not used any more" in record.getMessage() for record in caplog.records) == 1


def test_a_main_thread_that_does_not_come_costs_no_view(card, asking, monkeypatch):
    """As one that waits for the very thread that asks."""
    threads, right, _ = asking
    monkeypatch.setattr(card.executor, "LIMIT_S", 0.2)
    found = []
    thread = threading.Thread(target=lambda: found.append(threads.renderer.render(CAMERA, Pose())))
    thread.start()
    thread.join(20)
    assert_same_view(found[0], right)
    assert threads.renderer.fault == card.executor.LATE


def test_closing_frees_the_card_and_ends_what_waits(card, asking, extension):
    threads, _, _ = asking
    threads.views(1)
    found = []

    def ask():
        try:
            threads.renderer.render(CAMERA, Pose())
        except extension("core.errors").Cancelled as error:
            found.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    time.sleep(0.1)
    threads.renderer.close()
    thread.join(10)
    assert found
    gc.collect()
    assert not [thing for thing in gc.get_objects() if type(thing) is card.draw.GpuScan]
    with pytest.raises(extension("core.errors").Cancelled):
        threads.renderer.render(CAMERA, Pose())


def test_the_choice(card, monkeypatch):
    choice = card.choice
    assert choice.plan("CPU") == choice.Plan(False)
    monkeypatch.setattr(choice, "_device_is_there", lambda: True)
    monkeypatch.setattr(choice, "is_software", lambda: True)
    assert not choice.plan("AUTO").card
    assert choice.plan("GPU").card
    monkeypatch.setattr(choice, "is_software", lambda: False)
    assert choice.plan("AUTO").card
    slow, wrong = choice.DeviceTest(0.5, 0.1), choice.DeviceTest(0.01, 0.1, "it is wrong")
    assert "0.500 s" in choice.refusal(slow, False, 1)
    assert choice.refusal(slow, True, 1) == ""
    assert choice.refusal(wrong, True, 1) == "it is wrong"
    assert choice.refusal(choice.DeviceTest(0.01, 0.1), False, 4) == ""
    assert choice.refusal(choice.DeviceTest(0.04, 0.1), False, 4) != ""


def test_the_test_view_is_right_here(card):
    owner = card.executor.executor.hold()
    test = card.choice.tested(owner)
    assert test.fault == ""
    assert min(test.card_s, test.thread_s) > 0
    card.executor.executor.release(owner)


def test_a_card_that_fails_its_test_is_not_used(card, monkeypatch):
    monkeypatch.setattr(card.draw.GpuScan, "send", not_compiled)
    monkeypatch.setattr(card.choice._session, "test", None)
    owner = card.executor.executor.hold()
    assert "Shader Compile Error" in card.choice.refusal(card.choice.tested(owner), True, 1)
    card.executor.executor.release(owner)


def test_a_scan_beyond_the_memory_limit_stays_with_the_processor(card, extension, caplog):
    scene, settings = theirs(extension, make_scene(MEANS, SCALES)), extension("core.render").RenderSettings()
    offer = card.offer.CardOffer("GPU", 1000, 1)
    assert offer.renderer(scene, settings, lambda: "processor") == "processor"
    assert "more than the memory limit leaves" in caplog.text
    assert not offer.fault


@pytest.fixture
def chosen(card, monkeypatch):
    """The renderers on the card that are made from here on."""
    made, kind = [], card.offer.GpuRenderer
    monkeypatch.setattr(card.offer, "GpuRenderer", lambda *given: made.append(kind(*given)) or made[-1])
    return made


def test_the_command_line_draws_with_the_card_and_saves_the_scene(bpy, card, chosen, extension, tmp_path):
    """The command runs beside the main thread then, and saving is the main thread's."""
    main = extension("gssmc_addon.headless.command").main
    write_ply(tmp_path / "scan.ply", random_gaussians(300, 0))
    write_photo(tmp_path / "a.png", 60, 90)
    frame = {"file": "a.png", "width": 60, "height": 90, "fx": 80, "fy": 80, "cx": 30, "cy": 45}
    (tmp_path / "start.json").write_text(json.dumps({"frames": [frame | {"R": np.eye(3).tolist(), "t": [0, 0, 6.0]}]}))
    words = ["refine", tmp_path / "scan.ply", tmp_path / "a.png", "--camera", tmp_path / "start.json", "--no-locate"]
    words += ["--out", tmp_path / "result.json", "--blend", tmp_path / "out.blend"]
    assert main([*map(str, words), "--renderer", "gpu"]) == 3, "a photo of another place must fail"
    assert [renderer.fault for renderer in chosen] == [""]
    assert (tmp_path / "out.blend").exists()
    assert main([*map(str, words), "--renderer", "cpu"]) == 3
    assert main([*map(str, words), "--renderer", "gpu", "--features", "nonsense"]) == 2
    assert len(chosen) == 1


def test_where_nothing_can_be_drawn_the_processor_draws_and_the_log_says_why(extension, monkeypatch, caplog):
    choice, offer = extension("gssmc_addon.render_gpu.choice"), extension("gssmc_addon.render_gpu.offer")
    monkeypatch.setattr(choice, "_no_context", lambda: "there is no context")
    made = offer.CardOffer("GPU", 0, 1)
    assert not made.asks
    assert made.renderer(None, None, lambda: "processor") == "processor"
    assert "there is no context" in caplog.text
    made.close()


QUICK = {**rooms.QUICK, "long_side_px": 160, "iterations": 2, "threads": 2}


def test_a_refinement_on_the_card_ends_where_the_processors_does(bpy, own, card, chosen, tmp_path, monkeypatch):
    """Also one whose card fails in the middle, which says so."""
    room, _, starts = rooms.photos(tmp_path, 1)
    bpy.ops.gssmc.import_splats(filepath=str(room.scene))
    bpy.ops.gssmc.add_photo(filepath=str(room.folder / "photos" / "p0.png"), camera_file=str(starts), camera="NEW")
    scene, found = bpy.context.scene, {}
    start = scene.camera.matrix_world.copy()
    draw, drawings = card.draw.GpuScan.draw, []

    def fails_later(self, request):
        drawings.append(None)
        if len(drawings) > 3:
            raise RuntimeError("the device was lost")
        return (yield from draw(self, request))

    for run, renderer in (("processor", "CPU"), ("card", "GPU"), ("failing", "GPU")):
        own.renderer, scene.camera.matrix_world = renderer, start
        if run == "failing":
            monkeypatch.setattr(card.draw.GpuScan, "draw", fails_later)
        bpy.ops.gssmc.refine(locate=False, **QUICK)
        assert ("graphics card failed" in bpy.context.window_manager.gssmc.message) == (run == "failing")
        found[run] = (np.array(scene.camera.matrix_world), scene.camera.data.gssmc.verdict)
        assert len(chosen) == {"processor": 0, "card": 1, "failing": 2}[run]
    assert not chosen[0].fault
    assert chosen[1].fault == "the device was lost"
    centre, verdict = found["processor"]
    assert verdict in ("TRUSTED", "CHECK")
    for run in ("card", "failing"):
        assert found[run][1] == verdict
        assert np.linalg.norm(found[run][0][:3, 3] - centre[:3, 3]) < 0.02
        assert np.abs(found[run][0][:3, :3] - centre[:3, :3]).max() < 0.01
