"""The main panel: its steps, the box that never changes its height, lines that fit, and the three qualities."""

from dataclasses import fields
from types import SimpleNamespace

import pytest
from panels_drawn import Layout

LONG = "A sentence that goes on for quite a while, as those of a verdict do, with figures such as 1000000 and 0.32 px in it."
WIDTHS = (140, 220, 280, 480)  # pixels; Blender's own sidebar is about 280 wide when it is opened


class Heights(Layout):
    """`rows`: what is drawn, a text for each line of the panel, with how high it is; things side by side share a line."""

    def __init__(self):
        super().__init__()
        self.rows, self._inside, self.scale_y = [], None, 1.0

    def _put(self, text):
        if self._inside is None:
            self.rows.append([self.scale_y, text])
        else:
            self._inside.append(text)

    def label(self, text="", icon="NONE", translate=True, icon_value=0):
        self._put(("label", text, icon))

    def progress(self, factor=0.0, text=""):
        self._put(("progress", text, "NONE"))

    def operator(self, name, **_):
        self._put(("operator", name, "NONE"))
        return SimpleNamespace()

    def prop(self, owner, name, **_):
        assert hasattr(owner, name)
        self._put(("prop", name, "NONE"))

    def prop_enum(self, owner, name, value, **_):
        self._put(("prop", value, "NONE"))

    def column(self, **_):
        found = Heights()
        found.rows = self.rows
        return found

    box = column

    def row(self, **_):
        found, line = Heights(), [1.0]
        found._inside = line
        self.rows.append(line)
        return RowOf(found, line)


class RowOf:
    """A row, whose height is known once it is set."""

    def __init__(self, heights, line):
        object.__setattr__(self, "_heights", heights)
        object.__setattr__(self, "_line", line)

    def __getattr__(self, name):
        return getattr(self._heights, name)

    def __setattr__(self, name, value):
        if name == "scale_y":
            self._line[0] = value


def context(bpy, width):
    return SimpleNamespace(
        scene=bpy.context.scene,
        window_manager=bpy.context.window_manager,
        space_data=SimpleNamespace(lock_camera=False),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1)),
        region=SimpleNamespace(width=width),
    )


def lines(bpy, extension, width, panel="GSSMC_PT_main"):
    layout = Heights()
    getattr(extension("gssmc_addon.refine.panel"), panel).draw(SimpleNamespace(layout=layout), context(bpy, width))
    return layout.rows


def height(bpy, extension, width):
    return sum(line[0] for line in lines(bpy, extension, width))


def note(extension, scene, *reasons):
    extension("gssmc_addon.registration.camera_props").keep_verdict(scene.camera.data, "check", reasons, 3, 12.5)


@pytest.mark.parametrize("width", WIDTHS)
def test_the_panel_is_as_high_before_a_refinement_as_while_it_runs_and_after(bpy, scene, extension, width):
    jobs, slot = extension("gssmc_addon.refine.job"), extension("gssmc_addon.jobs.slot")
    own = bpy.context.window_manager.gssmc
    before = height(bpy, extension, width)
    job = jobs.prepare(scene, scene.gssmc.splat, scene.camera, extension("core.pose.settings").RefineSettings())
    slot.begin(bpy.context, job)
    try:
        heights = [height(bpy, extension, width)]
        job.detail = "Iteration 2 of 5"
        heights.append(height(bpy, extension, width))
    finally:
        job.cancel()
        slot.end(job)
        job.join(60)
    note(extension, scene, "Short.")
    heights.append(height(bpy, extension, width))
    note(extension, scene, *[LONG] * 5)
    heights.append(height(bpy, extension, width))
    own.tell(LONG, "ERROR")
    heights.append(height(bpy, extension, width))
    assert heights == [before] * len(heights)


def test_what_is_folded_can_be_unfolded(bpy, scene, extension):
    own, reasons = bpy.context.window_manager.gssmc, ["First of all.", LONG, "And last."]
    note(extension, scene, *reasons)

    def told():
        return " ".join(part[1] for line in lines(bpy, extension, 220) for part in line[1:] if part[0] == "label")

    assert "First of all." in told()
    assert "And last." not in told()
    assert "\u2026" in told()
    own.details = True
    assert "And last." in told()
    assert "\u2026" not in told()


def test_the_hint_is_of_the_next_step_and_gives_way_to_a_message(bpy, extension, scene):
    def labels():
        return " ".join(part[1] for line in lines(bpy, extension, 480) for part in line[1:] if part[0] == "label")

    assert "Not solved yet" in labels() and "Find Camera looks for it in the scan" in labels()
    bpy.context.window_manager.gssmc.tell("The search was cancelled; the camera was not changed.")
    assert "The search was cancelled" in labels() and "Find Camera looks" not in labels()
    bpy.context.window_manager.gssmc.tell("")
    bpy.data.objects.remove(scene.camera)
    assert "Add a photo that was taken in the scanned place." in labels()
    scene.gssmc.splat = None
    assert "Import a splat and add a photo that was taken there." in labels()


@pytest.mark.parametrize("width", WIDTHS)
def test_no_line_is_wider_than_the_sidebar(bpy, scene, extension, width):
    """Measured with Blender's own letters; an icon takes its share."""
    note(extension, scene, LONG, LONG)
    bpy.context.window_manager.gssmc.tell(LONG, "ERROR")
    bpy.context.window_manager.gssmc.details = True
    texts = [part for line in lines(bpy, extension, width) for part in line[1:] if part[0] == "label"]
    told = [(text, icon) for _, text, icon in texts if text and text in LONG]
    assert len(told) > 4 * 280 / width
    assert any(icon == "ERROR" for _, icon in told)
    import blf  # there once bpy is

    blf.size(0, 11)
    for text, icon in told:
        assert blf.dimensions(0, text)[0] <= width - 60 - (20 if icon != "NONE" else 0), text


def test_a_title_that_has_no_room_is_the_verdict_alone(bpy, scene, extension):
    note(extension, scene, "Short.")
    titles = [
        next(part[1] for line in lines(bpy, extension, width) for part in line[1:] if "Check" in part[1]) for width in WIDTHS
    ]
    assert titles == ["Check", "Check", "Check: 3 iterations, 12.5 s", "Check: 3 iterations, 12.5 s"]


def test_a_number_of_the_splat_has_a_line_of_its_own(bpy, scene, extension, monkeypatch):
    """A million is cut to a thousand where it shares a narrow sidebar with another field."""
    module = extension("gssmc_addon.viewport.props")
    monkeypatch.setattr(module, "is_drawable", lambda: True)
    monkeypatch.setattr(extension("gssmc_addon.splat.object"), "is_native", lambda cloud: False)
    shown = [line for line in lines(bpy, extension, 220) if any(part[1] == "max_shown" for part in line[1:])]
    assert [len(line) - 1 for line in shown] == [1]


def test_the_panel_tells_the_steps_in_their_order(bpy, scene, extension):
    headings = [part[1] for line in lines(bpy, extension, 280) for part in line[1:] if part[0] == "label"]
    assert [text for text in headings if text[:1].isdigit()] == ["1  Splat", "2  Photo", "3  Camera", "4  Find or Refine"]


def test_the_steps_are_there_before_anything_else(bpy, extension):
    headings = [part[1] for line in lines(bpy, extension, 280) for part in line[1:] if part[0] == "label"]
    assert [text for text in headings if text[:1].isdigit()] == ["1  Splat", "2  Photo", "3  Camera", "4  Find or Refine"]


def test_undo_takes_the_message_along(bpy, scene):
    bpy.ops.ed.undo_push(message="before")
    scene.camera.location.x += 1
    bpy.ops.ed.undo_push(message="after")
    for way in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        bpy.context.window_manager.gssmc.tell("3 of 3 photos: 3 trusted.", "ERROR")
        assert way() == {"FINISHED"}
        assert bpy.context.window_manager.gssmc.message == ""


def values(bpy, extension):
    return extension("gssmc_addon.registration.settings").settings_from(bpy.context.scene.gssmc)


def test_a_quality_sets_what_costs_and_nothing_else(bpy, extension):
    own, defaults = bpy.context.scene.gssmc, extension("core.pose.settings").RefineSettings()
    assert own.quality == "NORMAL"
    assert values(bpy, extension) == defaults
    own.seed, own.features, own.lens = 7, "akaze", "full"
    assert own.quality == "NORMAL"
    work = {}
    for word in ("DRAFT", "BEST", "NORMAL"):
        own.quality = word
        assert own.quality == word
        found = values(bpy, extension)
        assert (found.seed, found.features, found.lens) == (7, "akaze", "full")
        work[word] = found.candidates * found.long_side_px, found.final_long_side_px
    assert work["DRAFT"] < work["NORMAL"] < work["BEST"]
    same = [f.name for f in fields(defaults) if f.name not in ("seed", "features", "lens")]
    assert [name for name in same if getattr(values(bpy, extension), name) != getattr(defaults, name)] == []


def test_values_of_ones_own_are_no_quality_and_a_reset_brings_it_back(bpy, extension):
    own = bpy.context.scene.gssmc
    own.iterations, own.seed, own.lens, own.multiview = 9, 3, "focal", False
    assert own.quality == "CUSTOM"
    own.quality = "CUSTOM"  # as a click on it: nothing to set
    assert own.iterations == 9
    assert bpy.ops.gssmc.reset_settings() == {"FINISHED"}
    assert own.quality == "NORMAL"
    assert values(bpy, extension) == extension("core.pose.settings").RefineSettings(lens="focal")


def test_a_quality_is_kept_in_the_file_by_its_values(bpy, extension, tmp_path):
    bpy.context.scene.gssmc.quality = "BEST"
    best = values(bpy, extension)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert bpy.context.scene.gssmc.quality == "BEST"
    assert values(bpy, extension) == best


def test_the_values_are_folded_below_the_quality(bpy, extension):
    quality = lines(bpy, extension, 280, "GSSMC_PT_quality")
    assert [part[1] for part in quality[0][1:]] == ["DRAFT", "NORMAL", "BEST"]
    panel = extension("gssmc_addon.refine.panel").GSSMC_PT_settings
    assert panel.bl_parent_id == "GSSMC_PT_quality"
    assert panel.bl_options == {"DEFAULT_CLOSED"}
    drawn = [line[1][1] for line in lines(bpy, extension, 280, "GSSMC_PT_settings")]
    assert len(drawn) == 16
    assert drawn[-1] == "gssmc.reset_settings"
