"""Download Model: shows the licence, then downloads and checks the file."""

from __future__ import annotations

import textwrap
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty

from ..core.errors import FeatureError, GssmcError
from ..core.features.nets.models import KNOWN, KnownModel, address
from ..gssmc_addon.jobs.download import DownloadJob
from ..gssmc_addon.jobs.operator import AskingJobOperator
from ..gssmc_addon.registration import preferences
from ..gssmc_addon.support.texts import iface_, rpt_

WIDTH = 460  # The width of the dialog in Blender's units, about 76 characters.
ITEMS = tuple((model.name, model.title, f"{model.licence}, {model.bytes / 1e6:.1f} MB") for model in KNOWN)


class GSSMC_OT_download_model(AskingJobOperator, bpy.types.Operator):
    """Download a model for learned features, after you have accepted its licence"""

    bl_idname = "gssmc.download_model"
    bl_label = "Download Model"
    bl_options = {"INTERNAL"}

    __annotations__ = {
        "model": EnumProperty(name="Model", items=ITEMS, description="Which model to download"),
        "accept_licence": BoolProperty(
            name="I accept the licence", default=False, description="Nothing is downloaded without it", options={"SKIP_SAVE"}
        ),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not bpy.app.online_access:
            cls.poll_message_set(preferences.ONLINE_HINT)
            return False
        return super().poll(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.asked = True
        try:
            self._address(context)
        except GssmcError as error:
            return self.refuse(context, str(error))
        return context.window_manager.invoke_props_dialog(self, width=WIDTH, confirm_text="Download")

    def draw(self, context: bpy.types.Context) -> None:
        model, column = self._known(), self.layout.column()
        column.label(text=iface_("{model}, from the weights of {source}", model=model.title, source=model.source))
        for line in textwrap.wrap(model.licence_text, 76):
            column.label(text=line, translate=False)
        column.prop(self, "accept_licence")

    def make_job(self, context: bpy.types.Context) -> DownloadJob:
        model = self._known()
        if not self.accept_licence:
            raise FeatureError(rpt_("{model} is not downloaded until its licence is accepted.", model=model.title))
        return DownloadJob(model, self._address(context), preferences.model_folder(create=True))

    def apply(self, context: bpy.types.Context, job: DownloadJob, result: Any) -> set[str]:
        title = self._known().title
        return self.done(context, rpt_("{model} was downloaded; choose ALIKED or Auto in the panel's settings.", model=title))

    def stopped(self, context: bpy.types.Context, job: DownloadJob) -> set[str]:
        return self.refuse(context, rpt_("The download was stopped; the next one goes on from there."), level="INFO")

    def _known(self) -> KnownModel:
        return next(model for model in KNOWN if model.name == self.model)

    def _address(self, context: bpy.types.Context) -> str:
        own = preferences.of(context)
        return address(self._known(), own.base_url if own else "")


classes = (GSSMC_OT_download_model,)
