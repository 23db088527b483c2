"""Up Axis after the import: the splat turns, and the cameras of its photos stay where they are in the scan."""

import numpy as np
import pytest
from panels_drawn import Layout
from samples import write_photo

pytest.importorskip("bpy")  # which brings mathutils
from mathutils import Matrix, Vector

UP = {"Y_DOWN": (0, -1, 0), "Y_UP": (0, 1, 0), "Z_UP": (0, 0, 1), "Z_DOWN": (0, 0, -1)}


def matrix(obj):
    return np.array(obj.matrix_world)


def in_scan(scene, camera):
    """The camera's matrix among the points of the splat's file."""
    return np.linalg.inv(matrix(scene.gssmc.splat)) @ matrix(camera)


@pytest.mark.parametrize("axis", UP)
def test_the_chosen_axis_points_up(bpy, scene, axis):
    splat = scene.gssmc.splat
    assert bpy.ops.gssmc.up_axis(axis=axis) == {"FINISHED"}
    assert (splat.matrix_world.to_3x3() @ Vector(UP[axis]) - Vector((0, 0, 1))).length < 1e-6
    assert splat.gssmc.up_axis == axis


def test_solved_cameras_stay_on_the_splat_and_others_where_they_are(bpy, scene, extension):
    """Photo cameras move along; the artist's own, and the rest of the scene, do not."""
    splat, solved = scene.gssmc.splat, scene.camera
    solved.matrix_world = Matrix.Translation((1, 2, 3)) @ Matrix.Rotation(0.4, 4, (1, 2, 3))
    own = bpy.data.objects.new("own", bpy.data.cameras.new("own"))
    scene.collection.objects.link(own)
    own.location = (5, 0, 0)
    bpy.context.view_layer.update()
    place, stood = in_scan(scene, solved), matrix(own)
    read = extension("gssmc_addon.camera.bridge").read_camera
    before = read(scene, solved, splat).pose
    for axis in ("Y_DOWN", "Z_DOWN", "Y_UP", "Z_UP"):
        bpy.ops.gssmc.up_axis(axis=axis)
        np.testing.assert_allclose(in_scan(scene, solved), place, atol=1e-5)
        np.testing.assert_array_equal(matrix(own), stood)
    after = read(scene, solved, splat).pose
    np.testing.assert_allclose(after.R, before.R, atol=1e-5)
    np.testing.assert_allclose(after.t, before.t, atol=1e-5)


def test_what_the_user_did_to_the_splat_is_kept(bpy, scene):
    splat = scene.gssmc.splat
    placed = Matrix.Translation((1, -2, 0.5)) @ Matrix.Rotation(0.7, 4, "Z") @ Matrix.Scale(2.5, 4)
    splat.matrix_world = placed
    bpy.context.view_layer.update()
    bpy.ops.gssmc.up_axis(axis="Y_DOWN")
    turned = placed.inverted() @ splat.matrix_world
    assert (turned.to_3x3() @ Vector((0, -1, 0)) - Vector((0, 0, 1))).length < 1e-5
    bpy.ops.gssmc.up_axis(axis="Z_UP")
    np.testing.assert_allclose(matrix(splat), np.array(placed), atol=1e-5)


def test_every_key_of_a_plates_camera_moves(bpy, scene):
    camera = scene.camera
    for frame, x in ((1, 0.0), (11, 4.0), (21, -3.0)):
        camera.location, camera.rotation_euler = (x, 1, 6), (0.1 * x, 0.2, 0.3)
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(11)
    places = {}
    for frame in (1, 11, 21):
        scene.frame_set(frame)
        places[frame] = in_scan(scene, camera)
    scene.frame_set(11)
    bpy.ops.gssmc.up_axis(axis="Y_UP")
    assert scene.frame_current == 11
    for frame, place in places.items():
        scene.frame_set(frame)
        np.testing.assert_allclose(in_scan(scene, camera), place, atol=1e-5)


def test_a_camera_below_the_splat_is_not_moved_twice(bpy, scene):
    camera, splat = scene.camera, scene.gssmc.splat
    camera.parent = splat
    bpy.context.view_layer.update()
    place = in_scan(scene, camera)
    bpy.ops.gssmc.up_axis(axis="Y_DOWN")
    np.testing.assert_allclose(in_scan(scene, camera), place, atol=1e-5)


def hold(scene, what):
    if what == "camera":
        scene.camera.constraints.new("TRACK_TO").target = scene.gssmc.splat
    elif what == "splat":
        scene.gssmc.splat.constraints.new("LIMIT_LOCATION")
    else:
        scene.gssmc.splat.keyframe_insert("rotation_euler", frame=1)


@pytest.mark.parametrize("what", ["camera", "splat", "keys"])
def test_what_is_held_is_refused_and_nothing_changes(bpy, scene, what):
    hold(scene, what)
    bpy.context.view_layer.update()
    before = matrix(scene.camera), matrix(scene.gssmc.splat)
    with pytest.raises(RuntimeError, match=r"Track To|constrained"):
        bpy.ops.gssmc.up_axis(axis="Y_DOWN")
    bpy.context.view_layer.update()
    np.testing.assert_array_equal(matrix(scene.camera), before[0])
    np.testing.assert_array_equal(matrix(scene.gssmc.splat), before[1])
    assert scene.gssmc.splat.gssmc.up_axis == "Z_UP"


def test_the_panel_says_which_axis_is_up_of_any_splat(bpy, extension, splat_file):
    """Also of one that another importer made, or an older version of the extension."""
    props = extension("gssmc_addon.viewport.props")
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    splat = bpy.context.scene.gssmc.splat
    for known in (True, False):
        if not known:
            splat.gssmc.property_unset("up_axis")
        layout = Layout()
        props.draw_settings(layout, splat)
        assert "Up Axis: Y Down" in layout.said
    splat.matrix_world = Matrix.Identity(4)
    layout = Layout()
    props.draw_settings(layout, splat)
    assert "Up Axis: Z Up" in layout.said


def test_no_splat_no_turn(bpy):
    assert not bpy.ops.gssmc.up_axis.poll()


def test_the_folders_browser_shows_the_photos(bpy, tmp_path):
    """The directory of what is picked counts; a browser of folders alone shows a full folder as empty."""
    for name in ("a.png", "b.png"):
        write_photo(tmp_path / name)
    browser = bpy.ops.gssmc.add_photo_folder.get_rna_type().properties.keys()
    assert {"files", "filter_glob", "filter_folder", "directory", "filepath"} <= set(browser)
    assert bpy.ops.gssmc.add_photo_folder(directory=str(tmp_path), files=[{"name": "b.png"}]) == {"FINISHED"}
    assert len(bpy.context.scene.gssmc.photos) == 2


@pytest.mark.parametrize("name", ["import_splats", "import_cameras", "export_cameras", "add_photo_folder", "set_masks"])
def test_the_browsers_button_has_room_for_its_name(bpy, name):
    """Blender writes the operator's name on it and cuts off what is longer than about 18 characters."""
    assert len(getattr(bpy.ops.gssmc, name).get_rna_type().name) <= 18


def test_any_photo_of_the_folder_may_stand_for_it(bpy, tmp_path):
    for name in ("a.png", "b.png"):
        write_photo(tmp_path / name)
    assert bpy.ops.gssmc.add_photo_folder(filepath=str(tmp_path / "a.png")) == {"FINISHED"}
    assert len(bpy.context.scene.gssmc.photos) == 2
