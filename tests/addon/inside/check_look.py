"""Align and Comp, the photo's opacity, the photos' collection, and files that are dropped on the viewport."""

import numpy as np
import pytest
from samples import write_photo


def slot(camera):
    return camera.data.background_images[0]


def overlays(bpy):
    spaces = [s for screen in bpy.data.screens for area in screen.areas for s in area.spaces if s.type == "VIEW_3D"]
    return [(s.overlay.show_floor, s.overlay.show_extras, s.overlay.show_overlays) for s in spaces]


@pytest.fixture
def photos(bpy, scene, tmp_path):
    """Three photos on the list, the first of them picked."""
    files = [write_photo(tmp_path / f"{name}.png") for name in "abc"]
    names = [{"name": file.name} for file in files]
    assert bpy.ops.gssmc.add_photos(directory=str(tmp_path), files=names) == {"FINISHED"}
    return [entry.camera for entry in scene.gssmc.photos]


def test_one_key_lays_the_photo_behind_and_hides_the_helpers(bpy, scene, photos):
    before = overlays(bpy)
    scene.gssmc.photo_opacity = 0.3
    assert [(slot(c).display_depth, slot(c).alpha) for c in photos] == [("FRONT", pytest.approx(0.3))] * 3
    assert bpy.ops.gssmc.look() == {"FINISHED"}
    assert [(slot(c).display_depth, slot(c).alpha) for c in photos] == [("BACK", 1.0)] * 3
    assert {floor for floor, _, _ in overlays(bpy)} == {False}
    assert [on for _, _, on in overlays(bpy)] == [on for _, _, on in before], "the photo is an overlay, and stays"
    assert bpy.ops.gssmc.look() == {"FINISHED"}
    assert [(slot(c).display_depth, slot(c).alpha) for c in photos] == [("FRONT", pytest.approx(0.3))] * 3
    assert overlays(bpy) == before


def test_undo_shows_the_helpers_again(bpy, scene, photos):
    before = overlays(bpy)
    assert any(floor or extras for floor, extras, _ in before)
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.gssmc.look() == {"FINISHED"}
    hidden = overlays(bpy)
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert (bpy.context.scene.gssmc.look, overlays(bpy)) == ("ALIGN", before)
    bpy.ops.ed.redo()
    assert (bpy.context.scene.gssmc.look, overlays(bpy)) == ("COMP", hidden)
    assert bpy.ops.gssmc.look() == {"FINISHED"}
    assert overlays(bpy) == before


def test_a_photo_that_is_added_has_the_look(bpy, scene, photos, tmp_path):
    assert bpy.ops.gssmc.look() == {"FINISHED"}
    assert bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "d.png")), camera="NEW") == {"FINISHED"}
    assert (slot(scene.camera).display_depth, slot(scene.camera).alpha) == ("BACK", 1.0)


def test_the_cameras_have_a_collection_and_one_of_them_shows(bpy, scene, photos):
    kept = scene.gssmc.photo_collection
    assert set(kept.objects) == set(photos)
    assert not set(photos) & set(scene.collection.objects)
    for picked in (1, 0):
        scene.gssmc.photo_index = picked
        assert [camera.hide_get() for camera in photos] == [camera != photos[picked] for camera in photos]
        assert scene.camera == photos[picked]
    scene.gssmc.show_all_cameras = True
    assert [camera.hide_get() for camera in photos] == [False] * 3


def test_a_camera_that_the_user_sorted_stays(bpy, scene, extension, tmp_path):
    mine = bpy.data.collections.new("Mine")
    scene.collection.children.link(mine)
    assert bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW") == {"FINISHED"}
    camera = scene.camera
    for collection in camera.users_collection:
        collection.objects.unlink(camera)
    mine.objects.link(camera)
    extension("gssmc_addon.look.cameras").take_in(scene, camera)
    assert camera.users_collection == (mine,)


def test_the_line_is_dragged_with_the_mouse_alone(bpy, scene):
    with pytest.raises(RuntimeError, match="There is no wipe"):
        bpy.ops.gssmc.drag_wipe()


def test_a_point_lies_in_a_card_or_beside_it(extension):
    """Both orders round, and corners that are no rectangle."""
    is_inside, corners = extension("gssmc_addon.look.cards").is_inside, np.array([(0, 0), (10, 1), (9, 8), (-1, 6)], float)
    for order in (corners, corners[::-1]):
        assert is_inside(order, np.array((5.0, 4.0)))
        assert not any(is_inside(order, np.array(point)) for point in ((-2.0, 3.0), (5.0, 9.0), (11.0, 4.0), (5.0, -0.5)))


def test_a_card_is_chosen_with_the_mouse_alone(bpy):
    with pytest.raises(RuntimeError, match="photo_index"):
        bpy.ops.gssmc.look_through_card()


def test_pictures_are_dropped_where_there_is_a_splat(bpy, scene):
    handler = bpy.types.GSSMC_FH_photos
    assert ".jpg" in handler.bl_file_extensions.split(";")
    assert handler.bl_import_operator == "gssmc.add_photos"
