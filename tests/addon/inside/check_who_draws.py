"""Who draws a splat: Blender does, of a point cloud that has the type for it, which files of older Blenders lack."""

import numpy as np
import pytest

NATIVE = (5, 3)


def is_native(cloud):
    return getattr(cloud, "type", None) == "GAUSSIAN_SPLAT"


@pytest.fixture
def new_blender(bpy):
    if bpy.app.version < NATIVE:
        pytest.skip("this Blender draws no splats itself")
    return bpy


@pytest.fixture
def props(extension, monkeypatch):
    """As in a window with a graphics card."""
    module = extension("gssmc_addon.viewport.props")
    monkeypatch.setitem(module._state, "drawable", True)
    return module


def test_the_cloud_is_asked_and_not_the_version(bpy, props, extension, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    splat, splat_object = bpy.context.scene.gssmc.splat, extension("gssmc_addon.splat.object")
    assert splat_object.is_native(splat.data) == (bpy.app.version >= NATIVE)
    assert splat.display_type == ("TEXTURED" if bpy.app.version >= NATIVE else "BOUNDS")
    if bpy.app.version >= NATIVE:
        splat.data.type = "POINTS"
        assert not splat_object.is_native(splat.data)
        props.apply_all()
    assert props.shows_splats(splat), "whoever has no type for it is drawn by the extension"


def as_an_older_blender_made_it(bpy, extension, splat):
    """The object as the extension leaves it in a window of a Blender without the type."""
    cloud, display = splat.data, extension("gssmc_addon.splat.display")
    cloud.type = "POINTS"
    display.dress_splat(cloud, np.full(len(cloud.points), 0.1, np.float32))
    splat.display_type = "BOUNDS"


def test_what_an_older_blender_saved_becomes_blenders_own(new_blender, props, extension, splat_file):
    bpy, native = new_blender, extension("gssmc_addon.viewport.native")
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    splat = bpy.context.scene.gssmc.splat
    as_an_older_blender_made_it(bpy, extension, splat)
    native.take_over([(splat.data, (5, 3, 1))])
    assert not is_native(splat.data), "there, points are what the user chose"
    native.take_over([(splat.data, (5, 2, 45))])
    props.apply_all()
    assert is_native(splat.data)
    assert splat.display_type == "TEXTURED"
    assert not splat.data.materials, "the points' colours would change those of the splats"


def test_other_point_clouds_stay_points(new_blender, extension):
    cloud = new_blender.data.pointclouds.new("plain")
    cloud.resize(5)
    extension("gssmc_addon.viewport.native").take_over([(cloud, (5, 2, 0))])
    assert cloud.type == "POINTS"


def test_saved_in_the_old_and_opened_in_this(bpy, extension, props, splat_file, tmp_path):
    """A file goes through saving and opening, or is linked and appended, and its splat is one that somebody draws."""
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    path = str(tmp_path / "scan.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for how in ("open", "append", "link"):
        bpy.ops.wm.read_homefile(use_empty=True)
        if how == "open":
            bpy.ops.wm.open_mainfile(filepath=path)
            splat = bpy.context.scene.gssmc.splat
        else:
            with bpy.data.libraries.load(path, link=how == "link") as (there, here):
                here.objects = there.objects
            splat = here.objects[0]
            bpy.context.scene.collection.objects.link(splat)
        assert is_native(splat.data) or props.shows_splats(splat), how


@pytest.mark.parametrize(("name", "value"), [("opacity", 0.5), ("max_shown", 5000), ("show_as", "BOX")])
def test_what_a_script_sets_is_drawn(bpy, props, splat_file, name, value):
    """Blender is told of the change, which has the viewports drawn anew; nobody clicks in the panel."""
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    splat, told = bpy.context.scene.gssmc.splat, []
    bpy.context.view_layer.update()

    def listen(_scene, depsgraph):
        told.extend(update.id.original for update in depsgraph.updates)

    bpy.app.handlers.depsgraph_update_post.append(listen)
    try:
        setattr(splat.gssmc, name, value)
        bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(listen)
    assert splat in told


def test_one_number_a_row(bpy, props, splat_file):
    """Two beside each other lose their last digits in a narrow sidebar, and a number's name says what it counts."""
    from panels_drawn import Layout

    class Rows(Layout):
        def row(self, **_):
            inner = Layout()
            rows.append(inner.said)
            return inner

    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    splat = bpy.context.scene.gssmc.splat
    if is_native(splat.data):
        pytest.skip("Blender draws it, without these settings")
    rows, layout = [], Rows()
    props.draw_settings(layout, splat)
    assert [name for name in layout.said if name in ("max_shown", "opacity")] == ["max_shown", "opacity"]
    assert not any("max_shown" in said and len(said) > 1 for said in rows)
    assert splat.gssmc.bl_rna.properties["max_shown"].name == "Most Shown"
