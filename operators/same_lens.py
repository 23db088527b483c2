"""Same Lens: photos of one camera get one lens."""

from __future__ import annotations

import bpy

from ..core.errors import RefineError
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.photo import same_lens
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_same_lens(Idle, PlainOperator, bpy.types.Operator):
    """Give the photos of one camera the lens that all of them tell together, and move each camera along. Photos are of one
    camera as their EXIF says, or where their groups have the same name"""

    bl_idname = "gssmc.same_lens"
    bl_label = "Same Lens"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return photo_list.poll(cls, context.scene) and super().poll(context)

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        splat_object.picked(context.scene, context.scene.gssmc.splat)
        shared = same_lens.share(context.scene)
        message = " ".join(shared.sentences)
        if not message and not shared.changed:
            raise RefineError(
                rpt_("No two photos of one camera have a lens that was solved; refine them first, or name their group.")
            )
        message = message or rpt_("No lens is shared any more; each photo has its own.")
        result = self.done(context, message, line=message)
        return result if shared.changed else {"CANCELLED"}


classes = (GSSMC_OT_same_lens,)
