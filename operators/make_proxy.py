"""Make Proxy: a mesh of what cameras see of the splat."""

from __future__ import annotations

import bpy

from ..core.errors import ProxyError
from ..core.proxy import ProxyMesh
from ..gssmc_addon.jobs.operator import AskingJobOperator
from ..gssmc_addon.proxy import build as proxy_build
from ..gssmc_addon.proxy import cameras as proxy_cameras
from ..gssmc_addon.proxy import options as proxy_options
from ..gssmc_addon.proxy.job import ProxyJob
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.support import problem
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_make_proxy(AskingJobOperator, bpy.types.Operator):
    """Make a mesh of what cameras see of the splat: CG is hidden behind it, casts shadows on it, collides with it or snaps
    to it"""

    bl_idname = "gssmc.make_proxy"
    bl_label = "Make Proxy"
    bl_options = {"UNDO"}

    __annotations__ = proxy_options.proxy_annotations()

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.asked = True
        return context.window_manager.invoke_props_dialog(self, confirm_text="Make Proxy")

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        column = self.layout.column()
        for name in proxy_options.DIALOG:
            if name != "step" or self.cameras == "PLATE":
                column.prop(self, name)

    def make_job(self, context: bpy.types.Context) -> ProxyJob:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        scene = context.scene
        splat = splat_object.picked(scene, self._named(self.splat) or scene.gssmc.splat)
        camera = self._named(self.camera) or scene.camera
        settings = proxy_options.settings_of(self, context)
        cameras = proxy_cameras.cameras_of(scene, splat, camera, self.cameras, self.step)
        job = ProxyJob(scene, splat, cameras, settings)
        job.doubts = proxy_cameras.doubts(scene, camera, self.cameras)
        problem.begin(self.bl_label)
        return job

    def apply(self, context: bpy.types.Context, job: ProxyJob, result: ProxyMesh) -> set[str]:
        scene, splat = job.find()
        made = proxy_build.put(scene, splat, proxy_build.Made(result, job.cameras), self.use, self.replace)
        values = {"name": made.name, "count": len(result.faces), "views": len(job.cameras)}
        told = rpt_('"{name}": {count:,} triangles, from {views} cameras.', **values)
        if len(job.cameras) == 1:
            told = rpt_('"{name}": {count:,} triangles, from 1 camera.', **values)
        return self.done(context, " ".join([told, job.doubts]).strip(), line=job.doubts)

    def _named(self, name: str) -> bpy.types.Object | None:
        """The object of that name, None for "". Raises ProxyError where there is none."""
        found = bpy.data.objects.get(name) if name else None
        if name and found is None:
            raise ProxyError(rpt_('There is no object "{name}"; give the name of one of the scene.', name=name))
        return found


classes = (GSSMC_OT_make_proxy,)
