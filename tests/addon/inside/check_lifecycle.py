"""Register, unregister, register: nothing is left behind, nothing is missing."""

import pytest

MODULE = "bl_ext.user_default.gssmc"


def traces(bpy):
    """What a registered extension leaves in Blender, by name."""
    types = {name for name in dir(bpy.types) if "gssmc" in name.lower()}
    handlers = {
        f"{kind}:{handler.__name__}"
        for kind in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, kind), list)
        for handler in getattr(bpy.app.handlers, kind)
        if "gssmc" in getattr(handler, "__module__", "")
    }
    owners = ("Scene", "Camera", "Object", "WindowManager")
    properties = {cls for cls in owners if "gssmc" in getattr(bpy.types, cls).bl_rna.properties}
    menus = (bpy.types.TOPBAR_MT_file_import, bpy.types.TOPBAR_MT_file_export)
    menu = {f.__name__ for menu in menus for f in menu._dyn_ui_initialize() if "gssmc" in f.__module__}
    return types, handlers, properties, menu


def test_nothing_is_left_and_all_comes_back(bpy):
    import addon_utils  # Blender's own module, there once bpy is

    before = traces(bpy)
    assert all(before), "the probe itself must see the registered extension"
    for _ in range(2):
        addon_utils.disable(MODULE)
        assert traces(bpy) == (set(), set(), set(), set())
        with pytest.raises(AttributeError):
            bpy.ops.gssmc.import_splats(filepath="")
        assert addon_utils.enable(MODULE) is not None
        assert traces(bpy) == before


def test_every_operator_has_a_tooltip(bpy):
    names = [name for name in dir(bpy.ops.gssmc) if not name.startswith("_")]
    assert len(names) > 10
    assert [n for n in names if len(getattr(bpy.ops.gssmc, n).get_rna_type().description) < 10] == []


def test_settings_have_the_engines_defaults(bpy, extension):
    settings = extension("core.pose.settings").RefineSettings()
    assert extension("gssmc_addon.registration.settings").settings_from(bpy.context.scene.gssmc) == settings


def test_every_setting_has_a_tooltip(bpy, extension):
    names = extension("gssmc_addon.registration.settings").settings_annotations()
    rna = bpy.context.scene.gssmc.bl_rna.properties
    assert [n for n in names if len(rna[n].description) < 10] == []


def test_core_inside_blender_is_the_zips_own(bpy, extension):
    import core.geometry.camera

    assert extension("core.geometry.camera").__file__ != core.geometry.camera.__file__
