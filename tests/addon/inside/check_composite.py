"""F12 of a composite against what is exactly known: the plate, what hides the CG, the lens, the artist's view transform."""

import cv2
import numpy as np
import pytest
import shots


@pytest.fixture
def place(bpy, extension, tmp_path, splat_file):
    made = shots.make_place(bpy, extension, tmp_path, splat_file)
    made.scene.render.engine = "CYCLES"
    return made


def to_light(values):
    """sRGB of 0..255 to linear light."""
    share = values / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def test_cg_is_cut_off_where_the_place_hides_it_and_bent_as_the_photo(bpy, place, tmp_path):
    scene = place.scene
    scene.view_settings.view_transform = "Standard"
    white = shots.material(bpy, "Emission", (1, 1, 1))
    shots.add_ball(bpy, scene, shots.BALL, shots.RADIUS, white)
    targets = np.array([[x, y] for x in np.linspace(7, shots.WIDTH - 8, 8) for y in (6.0, 24.0)])
    k = np.linalg.inv(shots.matrix())
    straight = cv2.undistortPoints(targets[:, None], shots.matrix(), shots.DIST).reshape(-1, 2)
    dots = np.column_stack([straight, np.ones(len(straight))]) * 1.5
    for dot in dots:
        shots.add_ball(bpy, scene, dot, 2.2 * 1.5 * k[0, 0], white, rings=8)
    assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}
    with_cg = shots.render(bpy, scene, tmp_path / "cg.png", samples=16)
    light, plate = to_light(with_cg).min(axis=2), to_light(place.plate.astype(int)).min(axis=2)
    coverage = (light - plate) / np.maximum(1 - plate, 0.02)

    whole, visible = shots.ball_masks()
    assert 0.2 < visible.sum() / whole.sum() < 0.8
    near = cv2.dilate(whole.astype(np.uint8), np.ones((3, 3))).astype(bool)
    wrong = ((coverage > 0.5) != visible) & near
    assert wrong.sum() <= 0.01 * whole.sum()

    for at in shots.pixels(dots):
        x, y = (
            np.clip(np.arange(-6, 7) + round(c), 0, side - 1) for c, side in zip(at, (shots.WIDTH, shots.HEIGHT), strict=True)
        )
        x, y = np.unique(x), np.unique(y)
        weights = np.clip(coverage[np.ix_(y, x)], 0, 1)
        found = (weights.sum(axis=0) @ x / weights.sum(), weights.sum(axis=1) @ y / weights.sum())
        assert np.linalg.norm(np.array(found) - at) <= 0.3

    beside = ~near
    for at in shots.pixels(dots):
        beside &= np.hypot(*(np.mgrid[: shots.HEIGHT, : shots.WIDTH][::-1] - at[:, None, None])) > 8
    touched = np.abs(with_cg - place.plate)[: int(shots.CY) - 20][
        beside[: int(shots.CY) - 20]
    ]  # above the floor, no light falls
    assert touched.max() <= 1


@pytest.mark.main_only
def test_the_plate_stays_and_cg_has_shadow_and_the_artists_look(bpy, place, tmp_path):
    scene = place.scene
    scene.view_settings.view_transform, scene.view_settings.exposure, scene.view_settings.gamma = "AgX", 0.5, 1.1
    shots.add_light(bpy, scene)
    assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}
    assert np.abs(shots.render(bpy, scene, tmp_path / "empty.png", 1) - place.plate).max() <= 1
    ball = shots.add_ball(bpy, scene, shots.BALL, shots.RADIUS, shots.material(bpy, "BsdfDiffuse", (0.8, 0.3, 0.1)))
    shot = shots.render(bpy, scene, tmp_path / "shot.png", 16)
    whole, visible = shots.ball_masks()
    darker = (place.plate - shot).min(axis=2) * 1.0
    floor = np.zeros_like(whole)
    floor[134:142, 130:152] = True  # below the ball
    bright = place.plate.min(axis=2) > 60
    assert np.median(darker[floor & ~whole & bright]) > 8
    assert np.median(np.abs(shot - place.plate).max(axis=2)[:60]) <= 1  # the sky above casts and catches nothing

    ball.data.materials[0] = shots.material(bpy, "Emission", (0.8, 0.3, 0.1))
    shown = shots.render(bpy, scene, tmp_path / "emits.png", 4)
    scene.render.resolution_percentage = 50  # as one renders to try
    half = shots.render(bpy, scene, tmp_path / "half.png", 4)
    want = cv2.resize(shown.astype(np.uint8), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    assert half.shape == want.shape
    off = np.abs(half - want).max(axis=2)
    assert np.median(off) <= 3
    assert np.median(off[shots.ball_masks()[1][1::2, 1::2]]) <= 3
    bpy.ops.gssmc.remove_composite()
    assert scene.view_settings.view_transform == "AgX"
    place.proxy.hide_render = scene.gssmc.splat.hide_render = True
    scene.render.resolution_x, scene.render.resolution_y = shots.WIDTH // 4, shots.HEIGHT // 4
    assert scene.render.resolution_percentage == 100
    plain = shots.render(bpy, scene, tmp_path / "plain.png", 4)
    inside = cv2.erode(visible.astype(np.uint8), np.ones((7, 7))).astype(bool)
    assert inside.sum() > 200
    x, y = (shots.matrix() @ shots.BALL)[:2] / shots.BALL[2] / 4
    np.testing.assert_allclose(np.median(shown[inside], axis=0), plain[round(y), round(x)], atol=2)


@pytest.mark.main_only
def test_the_photo_can_be_straightened_instead(bpy, place, tmp_path):
    scene = place.scene
    scene.view_settings.view_transform = "Standard"
    dot = np.array([0.7, -0.45, 1.5])
    shots.add_ball(bpy, scene, dot, 0.02, shots.material(bpy, "Emission", (1, 1, 1)))
    assert bpy.ops.gssmc.set_up_composite(lens="PLATE") == {"FINISHED"}
    assert scene.camera.data.gssmc.overscan == 1
    got = shots.render(bpy, scene, tmp_path / "straight.png", 16)
    want = cv2.undistort(place.plate, shots.matrix(), shots.DIST)
    at = (shots.matrix() @ dot)[:2] / dot[2]
    y, x = np.mgrid[: shots.HEIGHT, : shots.WIDTH]
    away = np.hypot(x - at[0], y - at[1]) > 8
    inner = np.zeros_like(away)
    inner[12:-12, 12:-12] = True
    assert np.median(np.abs(got - want)[away & inner]) <= 2  # resampled by two programs
    weights = np.clip(to_light(got).min(axis=2) - to_light(want.astype(int)).min(axis=2), 0, 1) * ~away
    assert np.hypot((weights * x).sum() / weights.sum() - at[0], (weights * y).sum() / weights.sum() - at[1]) < 0.3
    images = len(bpy.data.images)
    bpy.ops.gssmc.remove_composite()
    assert len(bpy.data.images) == images - 1


@pytest.mark.main_only
def test_a_moving_plate_moves(bpy, extension, tmp_path, splat_file):
    frames = [np.full((40, 60, 3), 40 * k + 20, np.uint8) for k in range(4)]
    for number, frame in enumerate(frames, 12):
        cv2.imwrite(str(tmp_path / f"shot.{number:04d}.png"), frame)
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    bpy.ops.gssmc.add_plate(filepath=str(tmp_path / "shot.0012.png"), camera="NEW")
    scene = bpy.context.scene
    shots.solved(bpy, extension, scene, (60, 40))
    scene.render.engine = "CYCLES"
    assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}
    with pytest.raises(RuntimeError, match="still photo"):
        scene.camera.data.gssmc.k1 = -0.1
        bpy.ops.gssmc.set_up_composite(lens="PLATE")
    for offset in (2, 0):
        scene.frame_set(12 + offset)  # shown at its own number
        np.testing.assert_allclose(shots.render(bpy, scene, tmp_path / "out.png", 1), frames[offset], atol=1)


@pytest.mark.main_only
def test_a_lens_that_was_solved_since_is_not_lost(bpy, extension, place):
    """Refine while the composite is set up, then remove it: the new lens stays, in a frame that the photo fills again."""
    scene, camera = place.scene, place.scene.camera
    bridge, geometry = extension("gssmc_addon.camera.bridge"), extension("core.geometry.camera")
    bpy.ops.gssmc.set_up_composite()
    assert camera.data.gssmc.overscan > 1.03
    lens = geometry.Intrinsics(shots.WIDTH, shots.HEIGHT, 201.0, 201.0, 118.0, 91.0, (-0.05, 0, 0, 0, 0))
    bridge.write_camera(scene, camera, scene.gssmc.splat, geometry.Camera(lens, geometry.Pose()))
    bpy.ops.gssmc.remove_composite()
    got = bridge.read_camera(scene, camera, scene.gssmc.splat).at_size(shots.WIDTH, shots.HEIGHT).intrinsics
    np.testing.assert_allclose((got.fx, got.fy, got.cx, got.cy), (201, 201, 118, 91), atol=1e-3)
    assert camera.data.gssmc.overscan == 1
    assert camera.data.background_images[0].scale == pytest.approx(1)


@pytest.mark.main_only
def test_it_is_set_up_for_another_camera_anew(bpy, extension, place, tmp_path):
    scene = place.scene
    bpy.ops.gssmc.set_up_composite()
    first = scene.camera
    cv2.imwrite(str(tmp_path / "b.png"), np.full((50, 80, 3), 99, np.uint8))
    bpy.ops.gssmc.add_photo(filepath=str(tmp_path / "b.png"), camera="NEW")
    shots.solved(bpy, extension, scene)
    before = first.data.gssmc.overscan
    assert before > 1
    assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}
    assert first.data.gssmc.overscan == 1
    assert (scene.render.resolution_x, scene.render.resolution_y) == (80, 50)
    assert scene.gssmc.composite.camera == scene.camera


@pytest.mark.main_only
@pytest.mark.parametrize("first_gone", [0, 1])
def test_two_scenes_that_share_scan_and_proxy_leave_each_other_alone(bpy, extension, place, tmp_path, first_gone):
    scene, window = place.scene, bpy.context.window
    cv2.imwrite(str(tmp_path / "b.png"), np.full((60, 100, 3), 99, np.uint8))
    bpy.ops.gssmc.add_photo(filepath=str(tmp_path / "b.png"), camera="NEW")
    shots.solved(bpy, extension, scene)
    cameras = [bpy.data.objects["plate"], scene.camera]
    cameras[1].data.gssmc.k1 = -0.1
    other = bpy.data.scenes.new("other")
    for obj in (*cameras, scene.gssmc.splat, place.proxy):
        other.collection.objects.link(obj)
    scene.camera, other.camera, other.gssmc.splat = *cameras, scene.gssmc.splat
    other.render.engine = "CYCLES"
    if bpy.app.version < (5, 0):
        scene.use_nodes = True  # Blender makes its usual nodes, which would count as a change.
        scene.use_nodes = False
    bpy.context.view_layer.update()
    scenes, before = [scene, other], shots.everything(bpy, scene)
    for one in scenes:
        window.scene = one
        assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}
    lenses = [camera.data.gssmc.overscan for camera in cameras]
    assert min(lenses) > 1.03
    window.scene = scenes[first_gone]
    bpy.ops.gssmc.remove_composite()
    assert cameras[first_gone].data.gssmc.overscan == 1
    assert cameras[1 - first_gone].data.gssmc.overscan == lenses[1 - first_gone]
    assert place.proxy.is_shadow_catcher and scene.gssmc.splat.hide_render, "the other scene still needs them so"
    window.scene = scenes[1 - first_gone]
    bpy.ops.gssmc.remove_composite()
    after = shots.everything(bpy, scene)
    assert {key for key in before | after if repr(before.get(key)) != repr(after.get(key))} == set()


@pytest.mark.main_only
def test_a_copy_of_the_scene_or_of_the_camera_takes_no_lens_along(bpy, place):
    scene, data, window = place.scene, place.scene.camera.data, bpy.context.window
    slot = data.background_images[0]
    before = data.lens, data.shift_x, data.gssmc.overscan, slot.scale
    bpy.ops.gssmc.set_up_composite()
    wide = data.gssmc.overscan
    copy = data.copy()
    scene.collection.objects.link(bpy.data.objects.new("copy", copy))
    bpy.ops.scene.new(type="LINK_COPY")
    with pytest.raises(RuntimeError, match='in the composite of the scene "Scene"'):
        bpy.ops.gssmc.set_up_composite()
    bpy.ops.gssmc.remove_composite()
    assert data.gssmc.overscan == wide, "the scene itself still renders through it"
    window.scene = scene
    bpy.ops.gssmc.remove_composite()
    assert (data.lens, data.shift_x, data.gssmc.overscan, slot.scale) == before
    assert copy.gssmc.overscan == 1 and copy.lens == pytest.approx(data.lens)
    data.type = "ORTHO"
    with pytest.raises(RuntimeError, match="ortho"):
        bpy.ops.gssmc.set_up_composite()


@pytest.mark.main_only
def test_a_render_of_a_border_shows_that_part_of_the_plate(bpy, extension, place, tmp_path):
    scene = place.scene
    bpy.data.objects.remove(place.proxy)
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_max_x = 0.5
    bpy.ops.gssmc.set_up_composite()
    scene.render.use_crop_to_border = True  # as one may do afterwards
    got = shots.render(bpy, scene, tmp_path / "part.png", 1)
    half = slice(0, shots.WIDTH // 2)
    assert np.abs(got[:, half] - place.plate[:, half]).max() <= 1
    scene.view_layers[0].name = "renamed"
    assert extension("gssmc_addon.composite.setup").remove(scene) == [], "a photo's composite touches no layer"
    assert scene.render.use_border and scene.render.use_crop_to_border


@pytest.mark.main_only
def test_a_frame_of_the_splat_that_is_gone_is_named(bpy, place, tmp_path):
    scene = place.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.frame_end = 32, 24, 3
    for frame in (1, 3):
        scene.camera.location.x = frame / 10
        scene.camera.keyframe_insert("location", frame=frame)
    assert bpy.ops.gssmc.render_splat(folder=str(tmp_path / "frames")) == {"FINISHED"}
    (tmp_path / "frames" / "splat_0002.exr").unlink()
    with pytest.raises(RuntimeError, match="Frame 2 of the splat is missing"):
        bpy.ops.gssmc.set_up_composite(behind="SPLAT")
    assert bpy.ops.gssmc.render_splat(folder=str(tmp_path / "frames")) == {"FINISHED"}
    assert bpy.ops.gssmc.set_up_composite(behind="SPLAT") == {"FINISHED"}


@pytest.mark.main_only
def test_a_composite_of_a_deleted_scene_leaves_nothing_hidden(bpy, place):
    scene, camera = place.scene, place.scene.camera.data
    touched = [scene.gssmc.splat, place.proxy]
    names = ("hide_render", "is_holdout", "is_shadow_catcher")
    before = [[getattr(obj, name) for name in names] for obj in touched]
    other = bpy.data.scenes.new("other")
    for obj in (*touched, scene.camera):
        other.collection.objects.link(obj)
    bpy.context.view_layer.update()
    bpy.ops.gssmc.set_up_composite()
    assert touched[0].hide_render and camera.gssmc.overscan > 1
    bpy.data.scenes.remove(scene)
    bpy.context.view_layer.update()
    assert [[getattr(obj, name) for name in names] for obj in touched] == before
    assert camera.gssmc.overscan == 1
