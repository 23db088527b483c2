"""See the fit: pictures of photo and render, made without moving anything."""

from dataclasses import replace

import numpy as np
import pytest
import rooms
from samples import counts

from core.cameras.files import camera_to_dict
from core.synthetic import sample_cameras

STYLES = ("SIDE_BY_SIDE", "DIAGONAL", "WIPE", "SQUARES", "DIFFERENCE", "RENDER", "FLICKER", "MATCHES")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A room with a distorted photo and its true camera."""
    import json

    room = rooms.Room(tmp_path_factory.mktemp("room"))
    truth = room.take("photo.png", sample_cameras()[0])
    bent = replace(truth, intrinsics=replace(truth.intrinsics, dist=(-0.2, 0.05, 0, 0, 0)))
    room.take("bent.png", bent)
    for name, camera in (("photo", truth), ("bent", bent)):
        (room.folder / f"{name}.json").write_text(json.dumps(camera_to_dict(replace(camera, file=f"{name}.png"))))
    return room


def set_up(bpy, room, name="photo"):
    bpy.ops.gssmc.import_splats(filepath=str(room.scene))
    file = str(room.folder / name)
    bpy.ops.gssmc.add_photo(filepath=file + ".png", camera="NEW", camera_file=file + ".json")
    return bpy.context.scene


def pixels(image):
    values = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)[::-1, :, :3]


def find(extension, kind):
    return extension("gssmc_addon.preview.images").find(kind)


def test_every_style_makes_a_picture_and_renders_once(bpy, place, extension, monkeypatch):
    scene = set_up(bpy, place)
    module, made = extension("gssmc_addon.splat.renderer"), []
    original = module.Renderer
    monkeypatch.setattr(module, "Renderer", lambda *args: made.append(args) or original(*args))
    before = [x for row in scene.camera.matrix_world for x in row], scene.camera.data.lens
    kinds = counts(bpy)
    for style in STYLES:
        assert bpy.ops.gssmc.preview(style=style) == {"FINISHED"}
        image = find(extension, "render" if style == "FLICKER" else "picture")
        wide = style in ("SIDE_BY_SIDE", "MATCHES")
        assert tuple(image.size) == (rooms.WIDTH * 2 + 4 if wide else rooms.WIDTH, rooms.HEIGHT), style
        assert np.ptp(pixels(image)) > 0.3, style
    assert len(made) == 2  # once for all, and once for the matches
    assert ([x for row in scene.camera.matrix_world for x in row], scene.camera.data.lens) == before
    assert counts(bpy) == {**kinds, "images": kinds["images"] + 3}
    assert "matches sit" in bpy.context.window_manager.gssmc.message
    assert "Open an Image Editor" in bpy.context.window_manager.gssmc.message


@pytest.mark.parametrize("name", ["photo", "bent"])
def test_the_render_lies_on_the_photo_distortion_and_all(bpy, place, extension, name):
    set_up(bpy, place, name)
    bpy.ops.gssmc.preview(style="RENDER")
    photo, render = (pixels(find(extension, kind)).mean(axis=2) for kind in ("photo", "render"))
    assert np.corrcoef(photo.ravel(), render.ravel())[0, 1] > 0.97
    moved = np.roll(render, 4, axis=1)
    assert np.corrcoef(photo.ravel(), moved.ravel())[0, 1] < 0.93


def test_a_moved_camera_is_rendered_again(bpy, place, extension):
    scene = set_up(bpy, place)
    bpy.ops.gssmc.preview(style="RENDER")
    first = pixels(find(extension, "picture"))
    scene.camera.location.x += 0.2
    bpy.ops.gssmc.preview(style="RENDER")
    assert np.abs(pixels(find(extension, "picture")) - first).mean() > 0.01


def test_the_wipe_follows_the_panel_without_the_button(bpy, place, extension):
    set_up(bpy, place)
    bpy.ops.gssmc.preview(style="WIPE", position=0.0)
    own = bpy.context.window_manager.gssmc.preview
    render, photo = (pixels(find(extension, kind)) for kind in ("render", "photo"))
    np.testing.assert_allclose(pixels(find(extension, "picture")), render, atol=1e-3)
    own.style, own.position = "WIPE", 1.0
    np.testing.assert_allclose(pixels(find(extension, "picture")), photo, atol=1e-3)


def test_in_the_viewport_by_itself_and_away_on_request(bpy, place, extension):
    data = set_up(bpy, place).camera.data
    bpy.ops.gssmc.preview(style="DIAGONAL")
    images = [slot.image for slot in data.background_images]
    assert images == [data.gssmc.photo, find(extension, "picture")]
    assert bpy.context.window_manager.gssmc.message == "", "it is to be seen"
    bpy.ops.gssmc.preview(style="DIAGONAL", background=False)
    assert [slot.image for slot in data.background_images] == [data.gssmc.photo]
    with pytest.raises(RuntimeError, match="Image Editor only"):
        bpy.ops.gssmc.preview(style="MATCHES", background=True)


def test_the_panels_switch_acts_at_once_where_the_pictures_are_kept(bpy, place, extension):
    data = set_up(bpy, place).camera.data
    own = bpy.context.window_manager.gssmc.preview
    own.style = "SQUARES"
    assert own.background, "what an artist presses shows in the layout that Blender starts with"
    assert [slot.image for slot in data.background_images] == [data.gssmc.photo]  # nothing is rendered yet
    bpy.ops.gssmc.preview()
    picture = find(extension, "picture")
    assert [slot.image for slot in data.background_images] == [data.gssmc.photo, picture]
    own.background = False
    assert [slot.image for slot in data.background_images] == [data.gssmc.photo]
    own.background = True
    assert [slot.image for slot in data.background_images] == [data.gssmc.photo, picture]
    own.style = "MATCHES"  # whose panel has no such switch
    assert [slot.image for slot in data.background_images] == [data.gssmc.photo], "no picture of another style is left"
    assert bpy.ops.gssmc.preview() == {"FINISHED"}
    assert [slot.image for slot in data.background_images] == [data.gssmc.photo]


def in_viewport(data, photo):
    """What viewports show through the camera besides its photo."""
    return [slot.image for slot in data.background_images if slot.image != photo]


def test_a_double_picture_never_stands_in_the_viewport(bpy, place, extension):
    data = set_up(bpy, place).camera.data
    own, photo = bpy.context.window_manager.gssmc.preview, data.gssmc.photo
    own.style = "DIAGONAL"
    bpy.ops.gssmc.preview()
    assert in_viewport(data, photo) == [find(extension, "picture")]
    own.style = "SIDE_BY_SIDE"
    assert tuple(find(extension, "picture").size) == (rooms.WIDTH * 2 + 4, rooms.HEIGHT), "it is made, for an Image Editor"
    assert in_viewport(data, photo) == []
    own.style = "SQUARES"
    assert in_viewport(data, photo) == [find(extension, "picture")]
    assert tuple(find(extension, "picture").size) == (rooms.WIDTH, rooms.HEIGHT)


def test_flicker_begins_and_ends_with_the_choice_of_the_style(bpy, place, extension):
    data = set_up(bpy, place).camera.data
    own, photo = bpy.context.window_manager.gssmc.preview, data.gssmc.photo
    own.style = "RENDER"
    bpy.ops.gssmc.preview()
    own.style = "FLICKER"
    assert own.flicker
    assert in_viewport(data, photo) == [find(extension, "render")]
    extension("gssmc_addon.preview.flicker")._toggle()
    assert in_viewport(data, photo) == [find(extension, "photo")]
    extension("gssmc_addon.preview.flicker")._toggle()
    assert in_viewport(data, photo) == [find(extension, "render")]
    own.style = "DIFFERENCE"
    assert not own.flicker
    assert in_viewport(data, photo) == [find(extension, "picture")]


def test_the_viewports_preview_goes_when_it_shows_the_past(bpy, place, extension):
    """A moved camera, splat or lens; a picture of what the camera saw before would hide the splat and tell of a fit."""
    scene = set_up(bpy, place)
    camera, photo, look = scene.camera, scene.camera.data.gssmc.photo, extension("gssmc_addon.preview.watch")
    changes = [
        lambda: setattr(camera, "location", camera.location + camera.location),
        lambda: setattr(scene.gssmc.splat, "location", (0, 0, 1)),
        lambda: setattr(camera.data, "lens", 20),
        lambda: setattr(camera.data, "shift_x", 0.1),
    ]
    for change in changes:
        bpy.ops.gssmc.preview(style="DIAGONAL")
        bpy.context.view_layer.update()
        look.take_away_when_stale()
        assert in_viewport(camera.data, photo) == [find(extension, "picture")], "nothing was moved"
        change()
        bpy.context.view_layer.update()
        look.take_away_when_stale()
        assert in_viewport(camera.data, photo) == []
    assert [slot.image for slot in camera.data.background_images] == [photo]


@pytest.mark.parametrize("attribute", ["position", "scale", "rotation", "radiance:base", "radiance:sh_2"])
def test_an_edited_splat_is_rendered_again(bpy, place, extension, attribute, monkeypatch):
    """As many Gaussians as before, one of them another."""
    scene = set_up(bpy, place)
    module, made = extension("gssmc_addon.splat.renderer"), []
    original = module.Renderer
    monkeypatch.setattr(module, "Renderer", lambda *args: made.append(args) or original(*args))
    bpy.ops.gssmc.preview(style="RENDER")
    bpy.ops.gssmc.preview(style="DIFFERENCE")
    assert len(made) == 1
    item = scene.gssmc.splat.data.attributes[attribute].data[7]
    name = next(n for n in ("vector", "value", "color") if n in item.bl_rna.properties)
    setattr(item, name, [x * 0.5 + 0.1 for x in getattr(item, name)])
    bpy.ops.gssmc.preview(style="DIFFERENCE")
    assert len(made) == 2


def test_a_replaced_photo_is_read_again(bpy, place, extension, tmp_path):
    """Another picture under the same name."""
    import os
    import shutil

    file = tmp_path / "photo.png"
    shutil.copy(place.folder / "photo.png", file)
    bpy.ops.gssmc.import_splats(filepath=str(place.scene))
    bpy.ops.gssmc.add_photo(filepath=str(file), camera="NEW", camera_file=str(place.folder / "photo.json"))
    bpy.ops.gssmc.preview(style="RENDER")
    before = pixels(find(extension, "photo"))
    shutil.copy(place.folder / "bent.png", file)
    os.utime(file, ns=(1, 1))
    bpy.ops.gssmc.preview(style="RENDER")
    assert np.abs(pixels(find(extension, "photo")) - before).mean() > 0.01


def test_one_camera_at_a_time_has_the_preview_behind_it(bpy, place, extension):
    scene = set_up(bpy, place)
    first = scene.camera
    bpy.ops.gssmc.preview(style="DIAGONAL", background=True)
    file = str(place.folder / "bent")
    bpy.ops.gssmc.add_photo(filepath=file + ".png", camera="NEW", camera_file=file + ".json")
    bpy.ops.gssmc.preview(style="DIAGONAL", background=True)
    behind = [[slot.image for slot in camera.data.background_images] for camera in (first, scene.camera)]
    photos = [camera.data.gssmc.photo for camera in (first, scene.camera)]
    assert behind == [[photos[0]], [photos[1], find(extension, "picture")]]


def test_refusals_are_sentences_and_change_nothing(bpy, place):
    scene = set_up(bpy, place)
    camera, photo = scene.camera, scene.camera.data.gssmc.photo
    before = counts(bpy)

    def refused(words, **options):
        with pytest.raises(RuntimeError, match=words) as error:
            bpy.ops.gssmc.preview(**options)
        assert "Traceback" not in str(error.value)
        assert counts(bpy) == before

    refused("no camera", camera="nobody")
    scene.camera = None
    refused("no photo")
    scene.camera, photo.filepath = camera, "/nowhere/gone.png"
    refused("gone.png")
    camera.data.type = "ORTHO"
    refused("Perspective")
    scene.gssmc.splat = None
    refused("No splat")


def test_a_cancelled_preview_stops_soon(bpy, place, extension):
    scene = set_up(bpy, place)
    preview = extension("gssmc_addon.preview.job")
    options = preview.PreviewOptions("RENDER", 0.5, 8192)
    job = preview.prepare(bpy.context, scene.camera, options, extension("core.pose.settings").RefineSettings())
    job.start()
    job.cancel()
    assert job.join(5)
    assert find(extension, "render") is None
