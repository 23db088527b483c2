"""The extension in another language, in the real window: a label, a report and the panel, by a dictionary registered here.

See full_job.py for how it is run. Beside it: scene.ply and photo.jpg. Needs a Blender that has languages:
its file `languages` must name de_DE (Debian keeps it in /usr/share/locale); translations of Blender's own are not needed.
"""

# ruff: noqa: F821 - the driver provides view3d, sidebar and shot

import os

import bpy
from bpy.app import translations

HERE = os.path.dirname(__file__)
NO_SPLAT = "No splat is picked; import one with File > Import > Gaussian Splats, or pick it in the panel."
HINT = "Find Camera looks for it in the scan; Refine Camera starts from where the camera stands."
GERMAN = {
    ("Operator", "Refine Camera"): "Kamera bestimmen",
    ("Operator", "Add Photo"): "Foto laden",
    ("*", "Photo Camera"): "Fotokamera",
    ("*", "Move Camera With View"): "Kamera folgt der Ansicht",
    ("*", HINT): "Kamera suchen findet sie im Scan; Kamera bestimmen beginnt, wo sie steht.",
    (
        "*",
        'The camera "{name}" is {kind}; set its type to Perspective.',
    ): 'Die Kamera "{name}" ist {kind}, nicht perspektivisch.',
    ("*", NO_SPLAT): "Es ist kein Splat gewählt; importiere einen mit Datei > Importieren > Gaussian Splats.",
    ("*", '"{photo}" ({x} x {y}) is set behind "{camera}".'): 'Hinter "{camera}" steht jetzt "{photo}", {x} mal {y}.',
}


def in_view(operator, *args, **kwargs):
    window, area, region, _, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*args, **kwargs)


def steps():
    view = bpy.context.preferences.view
    translations.register("gssmc_german", {"de_DE": GERMAN})
    view.language = "de_DE"
    view.use_translate_interface = view.use_translate_tooltips = view.use_translate_reports = True
    assert translations.locale == "de_DE"
    assert translations.pgettext_iface("Refine Camera", "Operator") == "Kamera bestimmen", "what Blender's buttons look up"

    try:
        in_view(bpy.ops.gssmc.refine)
        raise AssertionError("without a splat nothing can be refined")
    except RuntimeError as error:
        assert "kein Splat gewählt" in str(error), error  # why the button is grey

    bpy.data.objects.remove(bpy.data.objects["Cube"])
    in_view(bpy.ops.gssmc.import_splats, filepath=HERE + "/scene.ply", show_colours=False)
    bpy.context.scene.gssmc.splat.gssmc.show_as = "BOX"  # without a graphics card, drawing splats delays everything
    in_view(bpy.ops.gssmc.add_photo, filepath=HERE + "/photo.jpg", camera="NEW")
    data = bpy.context.scene.camera.data
    data.type = "ORTHO"
    try:
        in_view(bpy.ops.gssmc.refine)
        raise AssertionError("through an orthographic camera nothing can be refined")
    except RuntimeError as error:
        assert "ist ortho" in str(error), error
    assert "ist ortho" in bpy.context.window_manager.gssmc.message, "the panel's line"
    data.type = "PERSP"
    view3d()[3].show_region_ui = True
    yield 2.0
    sidebar("GS-SMC")
    yield 2.0
    shot("extra-german.png")
    translations.unregister("gssmc_german")
    yield 1.0
