"""Another language: what the extension says is looked up in Blender's translations, and filled in afterwards.

Blender's Python module is built without languages, so here a dictionary stands where Blender's lookup would be asked;
tests/ui/languages.py does the same with a real dictionary in a real window.
"""

from types import SimpleNamespace

import pytest
from panels_drawn import drawn
from samples import write_photo

GERMAN = {
    "No splat is picked; import one with File > Import > Gaussian Splats, or pick it in the panel.": "Kein Splat.",
    'The camera "{name}" is {kind}; set its type to Perspective.': "Nur Perspektive.",
    '"{photo}" ({x} x {y}) is set behind "{camera}".': 'Hinter "{camera}" steht "{photo}", {x} mal {y}.',
    "{verdict}: {count} iterations, {seconds:.1f} s": "{seconds:.0f} s, {count} Runden: {verdict}",
    "Check": "Prüfen",
    "Find Camera looks for it in the scan; Refine Camera starts from where the camera stands.": "Kamera finden lassen.",
    "The work broke off through a fault of the extension; the system console has the details.": "Abgebrochen.",
    "The work broke off ({reason}).": "Abgebrochen: {reason}.",
    "Every Gaussian of the splat object holds a value that is not finite; import the file again.": "Nichts Endliches.",
    "Look through the camera of the next photo of the list": "Zum nächsten Foto",
}


@pytest.fixture
def german(bpy, extension, monkeypatch):
    """Blender's three lookups, answering in German."""
    asked = {f"pgettext_{kind}": lambda text: GERMAN.get(text, text) for kind in ("iface", "rpt", "tip")}
    monkeypatch.setattr(extension("gssmc_addon.support.texts"), "translations", SimpleNamespace(**asked))


def test_blender_has_the_lookups(bpy):
    """In every version that the extension is for."""
    from bpy.app import translations

    assert all(callable(getattr(translations, f"pgettext_{kind}")) for kind in ("iface", "rpt", "tip", "n"))


def test_a_report_and_the_panels_line_are_translated(bpy, extension, scene, german):
    scene.gssmc.splat = None
    with pytest.raises(RuntimeError, match=r"Kein Splat\."):  # why the button is grey
        bpy.ops.gssmc.refine()
    scene.gssmc.splat = next(obj for obj in scene.objects if obj.type == "POINTCLOUD")
    scene.camera.data.type = "ORTHO"
    with pytest.raises(RuntimeError, match=r"Nur Perspektive\."):
        bpy.ops.gssmc.refine()
    assert bpy.context.window_manager.gssmc.message == "Nur Perspektive."
    assert "Nur Perspektive." in drawn(bpy, extension)


def test_values_stand_where_the_language_wants_them(bpy, extension, scene, german, tmp_path, capfd):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "b.png")), camera="NEW")
    assert 'Hinter "b" steht "b.png", 60 mal 90.' in capfd.readouterr().out
    extension("gssmc_addon.registration.camera_props").keep_verdict(scene.camera.data, "check", ("Look.",), 2, 3.0)
    assert "3 s, 2 Runden: Prüfen" in drawn(bpy, extension)


def test_a_hint_is_translated_before_it_is_wrapped(bpy, extension, scene, german):
    assert "Kamera finden lassen." in drawn(bpy, extension)


def test_a_tooltip_is_translated(bpy, extension, german):
    description = extension("operators.review").GSSMC_OT_review.description
    assert description(bpy.context, SimpleNamespace(step=1, skip_trusted=False)) == "Zum nächsten Foto"


def test_a_threads_errors_are_translated_in_the_main_thread(bpy, extension, german):
    failure, errors = extension("gssmc_addon.jobs.worker").Failure, extension("core.errors")
    assert failure(OverflowError("deep inside")).message == "Abgebrochen."
    assert failure(OSError(28, "No space left on device")).message == "Abgebrochen: No space left on device."
    assert failure(OSError(5, "Input/output error", "a.ply")).message == (
        "The work broke off, for 'a.ply' cannot be used (Input/output error)."
    )
    whole = next(text for text in GERMAN if text.startswith("Every Gaussian"))
    assert failure(errors.SplatFormatError(whole)).message == "Nichts Endliches."
    assert failure(errors.SplatFormatError("What the engine says of {x}.")).message == "What the engine says of {x}."


@pytest.mark.parametrize("wrong", ["{zahl} dazu", "{count", "{count.nothing}", "{count:,.2q}", "{} dazu"])
def test_a_dictionarys_mistake_costs_nothing(bpy, extension, german, monkeypatch, wrong):
    monkeypatch.setitem(GERMAN, "{count} added", wrong)
    assert extension("gssmc_addon.support.texts").rpt_("{count} added", count=3) == "3 added"
