"""Download Model: the licence first, then the file, checked."""

import textwrap
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty

from ..core.errors import FeatureError, GssmcError
from ..core.models import KNOWN, address
from ..gssmc_addon import preferences
from ..gssmc_addon.model_download import ModelDownload

TICK_S = 0.1
WIDTH = 460  # of the dialog, in Blender's units; about 76 characters
ITEMS = tuple((model.name, model.title, f"{model.licence}, {model.bytes / 1e6:.1f} MB") for model in KNOWN)


class GSSMC_OT_download_model(bpy.types.Operator):
    """Download a model for learned features, after you have accepted its licence"""

    bl_idname = "gssmc.download_model"
    bl_label = "Download Model"
    bl_options = {"INTERNAL"}

    model: EnumProperty(name="Model", items=ITEMS)
    accept_licence: BoolProperty(name="I accept the licence", default=False, options={"SKIP_SAVE"})

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
            return self._refuse(str(error))
        return context.window_manager.invoke_props_dialog(self, width=WIDTH, confirm_text="Download")

    def draw(self, context):
        model, column = self._known(), self.layout.column()
        column.label(text=f"{model.title}, from the weights of {model.source}")
        for line in textwrap.wrap(model.licence_text, 76):
            column.label(text=line)
        column.prop(self, "accept_licence")

    def execute(self, context):
        """In the window the file comes beside other work; in background mode this waits for it."""
        try:
            if not self.accept_licence:
                raise FeatureError(f"{self._known().title} is not downloaded until its licence is accepted.")
            self._job = ModelDownload(self._known(), self._address(context), preferences.model_folder(create=True))
        except GssmcError as error:
            return self._refuse(str(error))
        self._job.start()
        if not bpy.app.background and context.window is not None:
            self._timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
            context.window_manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        result = None
        while result is None:
            self._job.join(TICK_S)
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
        self._job.stop()
        self._end(context)

    def _watch(self, context):
        """The operator's result once there is one."""
        for news in self._job.news():
            if isinstance(news, GssmcError):
                return self._refuse(str(news))
            if isinstance(news, Path):
                self.report({"INFO"}, f"{self._known().title} is there; choose ALIKED or Auto in the panel's settings.")
                return {"FINISHED"}
            if context.workspace:
                done = f"Downloading {self._known().title}: {100 * news.fraction:.0f} %    Esc: stop"
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

    def _refuse(self, message):
        self.report({"ERROR"}, message)
        return {"CANCELLED"}


classes = (GSSMC_OT_download_model,)
