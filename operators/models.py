"""Download Model: the licence first, then the file, checked."""

import textwrap
from functools import partial

import bpy
from bpy.props import BoolProperty, EnumProperty

from ..core.errors import FeatureError, GssmcError
from ..core.features.nets.download import download
from ..core.features.nets.models import KNOWN, address
from ..gssmc_addon.jobs.worker import Failure, Finished, Worker
from ..gssmc_addon.registration import preferences
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import iface_, rpt_

TICK_S = 0.1
WIDTH = 460  # of the dialog, in Blender's units; about 76 characters
ITEMS = tuple((model.name, model.title, f"{model.licence}, {model.bytes / 1e6:.1f} MB") for model in KNOWN)


class GSSMC_OT_download_model(PlainOperator, bpy.types.Operator):
    """Download a model for learned features, after you have accepted its licence"""

    bl_idname = "gssmc.download_model"
    bl_label = "Download Model"
    bl_options = {"INTERNAL"}

    model: EnumProperty(name="Model", items=ITEMS, description="Which model to download")
    accept_licence: BoolProperty(
        name="I accept the licence", default=False, description="Nothing is downloaded without it", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        if not bpy.app.online_access:
            cls.poll_message_set(preferences.ONLINE_HINT)
            return False
        return True

    def invoke(self, context, event):
        try:
            self._address(context)
        except GssmcError as error:
            return self.refuse(str(error))
        return context.window_manager.invoke_props_dialog(self, width=WIDTH, confirm_text="Download")

    def draw(self, context):
        model, column = self._known(), self.layout.column()
        column.label(text=iface_("{model}, from the weights of {source}", model=model.title, source=model.source))
        for line in textwrap.wrap(model.licence_text, 76):
            column.label(text=line, translate=False)
        column.prop(self, "accept_licence")

    def run(self, context):
        """In the window the file comes beside other work; in background mode this waits for it."""
        model = self._known()
        if not self.accept_licence:
            raise FeatureError(rpt_("{model} is not downloaded until its licence is accepted.", model=model.title))
        self._worker = Worker(partial(download, model, self._address(context), preferences.model_folder(create=True)))
        self._worker.start()
        if not bpy.app.background and context.window is not None:
            self._timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
            context.window_manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        result = None
        while result is None:
            self._worker.join(TICK_S)
            result = self._watch(context)
        return result

    def modal(self, context, event):
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "The download was stopped; the next one goes on from there.")
            return {"CANCELLED"}
        result = self._watch(context) if event.type == "TIMER" else None
        if result is None:
            return {"PASS_THROUGH"}
        self._end(context)
        return result

    def cancel(self, context):
        """Blender ends the operator, or the user does."""
        self._worker.stop()
        self._end(context)

    def _watch(self, context):
        """The operator's result once there is one."""
        title = self._known().title
        for news in self._worker.news():
            if isinstance(news, Failure):
                return self.refuse(news.message)
            if isinstance(news, Finished):
                return self.done(context, rpt_("{model} is there; choose ALIKED or Auto in the panel's settings.", model=title))
            if context.workspace:
                done = iface_("Downloading {model}: {percent:.0f} %    Esc: stop", model=title, percent=100 * news.fraction)
                context.workspace.status_text_set(done)
        return None

    def _end(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)

    def _known(self):
        return next(model for model in KNOWN if model.name == self.model)

    def _address(self, context):
        own = preferences.of(context)
        return address(self._known(), own.base_url if own else "")


classes = (GSSMC_OT_download_model,)
