"""Preferences: threads, memory, default preset, log file, and the model files of learned features with their download."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from ...core.features.nets.models import KNOWN, KnownModel, find_model, recognise
from ...core.features.registry import AUTO, EXTRACTORS, MATCHERS, ExtractorKind, MatcherKind
from ...core.render.memory import machine_bytes
from ..render_gpu.choice import Wanted
from ..support import log_file
from ..support.texts import iface_, n_

PACKAGE = __package__.rsplit(".", 2)[0]  # The package name under which Blender stores the extension's preferences.
_KINDS: dict[str, ExtractorKind | MatcherKind] = {**EXTRACTORS, **MATCHERS}
LEARNED = {name: kind for name, kind in _KINDS.items() if kind.needs_model}
ONLINE_HINT = n_("Downloads need Allow Online Access in Preferences > System")
NO_ADDRESS = n_("No address is set: put the file in by hand, or ask your studio where its models lie")
AUTO_MODEL = "aliked"
PRESET_ITEMS = (
    ("NONE", "Standard", "GS-SMC's own settings, for scans of any unit"),
    ("7scenes", "7-Scenes", "The paper's settings for rooms; the scan's unit must be the metre"),
    ("cambridge", "Cambridge", "The paper's settings for outdoors; the scan's unit must be the metre"),
)
MAP_PLACES = (
    ("CACHE", "Cache Folder", "In the user's folder for files that can be made again"),
    ("SCAN", "Beside the Scan", "In the folder of the scan's file, where other machines find them too"),
)
RENDERERS = (
    ("AUTO", "Automatic", "The graphics card where a short test says that it is right and pays, else the processor"),
    ("CPU", "Processor", "Always the processor"),
    ("GPU", "Graphics Card", "The graphics card also where it does not pay; the processor only where it fails"),
)
_log_trouble = [""]  # Says what is wrong with the log file; empty when nothing is.


def of(context: bpy.types.Context) -> bpy.types.AddonPreferences | None:
    """The extension's preferences; None while it is not enabled in them."""
    addon = context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


def memory_limit(context: bpy.types.Context) -> int:
    """Bytes that a refinement may take: the preference, else the machine's memory; 0 when neither is known."""
    own = of(context)
    return int(own.memory_limit_gb * 1e9) if own and own.memory_limit_gb else machine_bytes()


def threads(context: bpy.types.Context, wanted: int) -> int:
    """The scene's number of threads, where that is 0 the preference's."""
    own = of(context)
    return wanted or (own.threads if own else 0)


def renderer(context: bpy.types.Context) -> Wanted:
    """What is to draw the views of refinements."""
    own = of(context)
    return own.renderer if own else "AUTO"


def preset(context: bpy.types.Context) -> str:
    """The preset that new scenes begin with; "NONE" for the standard settings."""
    own = of(context)
    return own.default_preset if own else "NONE"


def maps_beside_scans(context: bpy.types.Context) -> bool:
    """Whether maps of scans are to lie beside them."""
    own = of(context)
    return own is not None and own.map_place == "SCAN"


def model_folder(create: bool = False) -> Path:
    """Where downloaded models lie: in the user's own folder of this extension, which outlives updates."""
    return Path(bpy.utils.extension_path_user(PACKAGE, path="models", create=create))


def model_for(context: bpy.types.Context, name: str) -> str:
    """The model file for the features or matcher `name`: the one picked, else one that was downloaded; "" for none."""
    name = AUTO_MODEL if name == AUTO else name
    if name not in LEARNED:
        return ""
    own = of(context)
    picked = getattr(own, f"model_{name}") if own else ""
    if picked:
        return bpy.path.abspath(picked)
    found = find_model(model_folder(), name)
    return str(found) if found else ""


def describe(path: str) -> tuple[str, str]:
    """What a picked file is, and an icon for it."""
    file = Path(bpy.path.abspath(path))
    if not file.is_file():
        return iface_("There is no such file"), "ERROR"
    known = recognise(file)
    if known is None:
        return iface_("Not one of the known models; it may work"), "QUESTION"
    return f"{known.title}, {known.licence}", "CHECKMARK"


def _log_changed(self: GSSMC_AP_preferences, context: bpy.types.Context) -> None:
    _log_trouble[0] = log_file.set_file(self.log_file)


class GSSMC_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = PACKAGE

    __annotations__ = {
        "threads": IntProperty(
            name="Threads",
            min=0,
            max=256,
            description="Views rendered at the same time where a scene's own value is 0; 0: one per processor core",
        ),
        "renderer": EnumProperty(
            name="Render Views With",
            items=RENDERERS,
            description="What draws the splat's views that a photo is compared with; both give the same pictures",
        ),
        "memory_limit_gb": FloatProperty(
            name="Memory Limit (GB)",
            min=0.0,
            precision=1,
            description="A refinement that would take more is refused; 0: the machine's memory, where the system tells it",
        ),
        "default_preset": EnumProperty(
            name="Default Preset", items=PRESET_ITEMS, description="Settings of a scene when it gets its first splat"
        ),
        "map_place": EnumProperty(
            name="Keep Maps",
            items=MAP_PLACES,
            description="Where Find Camera keeps the maps of scans, so that only the first photo of a scan waits for one",
        ),
        "log_file": StringProperty(
            name="Log File",
            subtype="FILE_PATH",
            update=_log_changed,
            description="The file that the engine's log is written to; empty: none",
        ),
        **{
            f"model_{name}": StringProperty(
                name=kind.title,
                subtype="FILE_PATH",
                description=f"Network file (.onnx) for {kind.title}; empty: a downloaded one, where there is one",
            )
            for name, kind in LEARNED.items()
        },
        "base_url": StringProperty(
            name="Address",
            description="Web address of a folder that holds the model files by their names; this project publishes none",
        ),
    }

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        column = layout.column()
        for name in ("renderer", "threads", "memory_limit_gb", "default_preset", "log_file"):
            column.prop(self, name)
        if _log_trouble[0] and self.log_file:
            column.label(text=_log_trouble[0], icon="ERROR")
        row = column.row(align=True)
        row.prop(self, "map_place")
        row.operator("gssmc.clear_maps", text="Clear", icon="TRASH")
        column.operator("gssmc.report_problem", icon="COPYDOWN")
        layout.label(text="SIFT, AKAZE and ORB need nothing. Learned features need a model file each:")
        for name in LEARNED:
            column = layout.column(align=True)
            column.prop(self, f"model_{name}")
            if path := getattr(self, f"model_{name}"):
                text, icon = describe(path)
                column.label(text=text, icon=icon)
        box = layout.box()
        box.label(text="Download Models", icon="IMPORT")
        box.prop(self, "base_url")
        if not bpy.app.online_access:
            box.label(text=ONLINE_HINT, icon="INFO")
        elif not self.base_url.strip():
            box.label(text=NO_ADDRESS, icon="INFO")
        for model in KNOWN:
            _draw_model(box, model)


def _draw_model(layout: bpy.types.UILayout, model: KnownModel) -> None:
    row = layout.row()
    there = (model_folder() / model.name).is_file()
    values = {"model": model.title, "licence": model.licence, "size": model.bytes / 1e6}
    row.label(text=iface_("{model}: {licence}, {size:.1f} MB", **values), icon="CHECKMARK" if there else "BLANK1")
    row.operator("gssmc.download_model", text="Download Again" if there else "Download").model = model.name


classes = (GSSMC_AP_preferences,)


def register() -> None:
    """Opens the log file that was set in an earlier session."""
    own = of(bpy.context)
    _log_trouble[0] = log_file.set_file(own.log_file) if own else ""


def unregister() -> None:
    log_file.stop()
