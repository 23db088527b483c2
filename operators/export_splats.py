"""File > Export > Gaussian Splats: our splat objects and Blender's own, in the layout of INRIA's trainer."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..core.errors import SplatFormatError
from ..gssmc_addon.splat import export as splat_export
from ..gssmc_addon.splat.import_options import left_out
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.outputs import check_export
from ..gssmc_addon.support.texts import n_, rpt_

NO_SPLAT = n_("No splat is active or picked; import one first")
COORDINATES = (
    ("OBJECT", "Object", "The splat's own coordinates, those of the file it came from: poses found in that file still fit"),
    (
        "SCENE",
        "Scene, Z Up",
        "As it stands in the scene: the object's rotation, scale and place are applied; z is up",
    ),
    ("SCENE_Y_DOWN", "Scene, Y Down", "As it stands in the scene, turned so that y is down, as most splat programs expect"),
)


class GSSMC_OT_export_splats(PlainOperator, bpy.types.Operator, ExportHelper):
    """Export the active splat, or else the picked one, as Gaussian splats"""

    bl_idname = "gssmc.export_splats"
    bl_label = "Export Gaussian Splats"
    bl_options = {"PRESET"}

    filename_ext = ".ply"
    __annotations__ = {
        "filter_glob": StringProperty(default="*.ply", options={"HIDDEN"}),
        "coordinates": EnumProperty(
            name="Coordinates",
            items=COORDINATES,
            default="OBJECT",
            description="Whether the object's rotation and scale are applied to what is written; "
            "the object itself stays as it is",
        ),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if splat_export.splat_of(context) is None:
            cls.poll_message_set(NO_SPLAT)
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()
        path = Path(bpy.path.abspath(self.filepath))
        check_export(path)
        splat = splat_export.splat_of(context)
        if splat is None:
            raise SplatFormatError(rpt_(NO_SPLAT))
        written = splat_export.write(path, splat, self.coordinates)
        scene = written.scene
        sentences = [
            rpt_("{count:,} Gaussians, SH degree {degree}: '{path}'.", count=len(scene), degree=scene.sh_degree, path=path)
        ]
        sentences += left_out(scene)
        if written.sh_left_out:
            sentences.append(rpt_("SH above degree 3 were left out, for the layout has no place for them."))
        return self.done(context, " ".join(sentences), "WARNING" if scene.dropped or written.sh_left_out else "INFO")


classes = (GSSMC_OT_export_splats,)
