"""A Blender with the extension's zip freshly installed."""

import os
import sys

import plan
import pytest
import rooms
from samples import random_gaussians, write_photo, write_ply

MODULE = "bl_ext.user_default.gssmc"


def pytest_collection_modifyitems(items):
    """Long checks that say the same in every Blender run in one of them, so that the whole run stays short."""
    import bpy

    for item in items:
        if item.get_closest_marker("asked") and not os.environ.get("GSSMC_LONG"):
            item.add_marker(pytest.mark.skip("it is long, and shorter ones cover its parts; set GSSMC_LONG=1"))
    if bpy.app.version[:2] != plan.MAIN:
        for item in items:
            if item.get_closest_marker("main_only"):
                item.add_marker(pytest.mark.skip(f"it is long and runs in Blender {plan.MAIN[0]}.{plan.MAIN[1]}"))


@pytest.fixture(scope="session")
def blender():
    """bpy with the extension installed from the zip and enabled."""
    import bpy

    os.environ["XDG_CACHE_HOME"] = os.path.join(os.environ["BLENDER_USER_RESOURCES"], "cache")  # where maps of scans go
    bpy.ops.extensions.package_install_files(filepath=os.environ["GSSMC_ZIP"], repo="user_default", enable_on_install=True)
    assert os.environ["BLENDER_USER_RESOURCES"] in sys.modules[MODULE].__file__
    return bpy


@pytest.fixture
def bpy(blender):
    """An empty scene with nothing left from the test before."""
    blender.ops.wm.read_homefile(use_empty=True)
    return blender


@pytest.fixture(scope="session")
def extension(blender):
    """Modules of the installed extension by their path below its root."""

    def module(name):
        __import__(f"{MODULE}.{name}")
        return sys.modules[f"{MODULE}.{name}"]

    return module


@pytest.fixture
def splat_file(tmp_path):
    return write_ply(tmp_path / "scan.ply", random_gaussians(200, 1))


@pytest.fixture
def scene(bpy, tmp_path, splat_file):
    """A splat, a photo of something else, and a camera that looks at the splat from 6 units away."""
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Z_UP")
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW")
    bpy.context.scene.camera.location = (0, 0, 6)
    bpy.context.view_layer.update()
    return bpy.context.scene


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return rooms.photos(tmp_path_factory.mktemp("room"))


@pytest.fixture
def listed(bpy, place):
    """The room with its three photos on the list."""
    room, _, starts = place
    bpy.ops.gssmc.import_splats(filepath=str(room.scene))
    assert bpy.ops.gssmc.add_photo_folder(directory=str(room.folder / "photos"), camera_file=str(starts)) == {"FINISHED"}
    return bpy.context.scene
