"""Clear Maps: the files that Find Camera keeps of scans."""

import bpy

from ..gssmc_addon.find import place as map_place
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_clear_maps(PlainOperator, bpy.types.Operator):
    """Delete the maps of scans that Find Camera keeps: those in its own folder, and those beside the scans of this file. The
    next Find Camera makes what it needs anew"""

    bl_idname = "gssmc.clear_maps"
    bl_label = "Clear Maps"
    bl_options = {"INTERNAL"}

    def run(self, context: bpy.types.Context) -> set[str]:
        freed, gone, held = 0, 0, ""
        for path in map_place.kept(bpy.data.scenes):
            try:
                size = path.stat().st_size
                path.unlink()
            except OSError as error:
                held = rpt_("The map '{file}' cannot be deleted ({reason}).", file=path.name, reason=error.strerror)
                continue
            freed, gone = freed + size, gone + 1
        said = rpt_("{count} maps were deleted, {size:.1f} MB.", count=gone, size=freed / 1e6)
        if gone == 1:
            said = rpt_("1 map was deleted, {size:.1f} MB.", size=freed / 1e6)
        return self.done(context, f"{said} {held}".strip(), "WARNING" if held else "INFO")


classes = (GSSMC_OT_clear_maps,)
