"""Report a Problem: versions and the last job's record, on the clipboard."""

from __future__ import annotations

import bpy

from ..gssmc_addon.support import problem


class GSSMC_OT_report_problem(bpy.types.Operator):
    """Copy a text with versions and the last refinement's record to the clipboard, to be pasted into a report"""

    bl_idname = "gssmc.report_problem"
    bl_label = "Report a Problem"
    bl_options = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.clipboard = problem.text(context)
        self.report(
            {"INFO"},
            "Versions and the last job's record are on the clipboard, without names, paths or poses; paste them into a report.",
        )
        return {"FINISHED"}


classes = (GSSMC_OT_report_problem,)
