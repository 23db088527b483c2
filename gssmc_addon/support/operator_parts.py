"""What operators share: a refusal is one sentence, a file comes from the browser, the scene camera has its photo."""

from __future__ import annotations

import logging

import bpy
from bpy_extras.io_utils import ImportHelper

from ...core.errors import GssmcError
from ..jobs.operator import AskingJobOperator, Idle, Reporter
from ..photo import image as photo_image
from ..refine.job import missing
from .texts import sentence

log = logging.getLogger(__name__)


class PlainOperator(Reporter):
    """A mixin for operators that are done at once: `run` does the work, and what it raises becomes the report."""

    def run(self, context: bpy.types.Context) -> set[str]:
        """The operator's result. Raises GssmcError, with nothing changed."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            return self.run(context)
        except GssmcError as error:
            return self.refuse(str(error))
        except Exception as error:
            log.exception("The work broke off")
            self.refuse(sentence(error))
            return {"FINISHED"}  # It may have come in the middle of writing; finishing gives an undo step.

    def refuse(self, message: str) -> set[str]:
        self.report({"ERROR"}, message)
        return {"CANCELLED"}


class NeedsPhoto(Idle):
    """A mixin for operators on splat and photo: their button is grey while one of them is not there, and says which."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lack = missing(context.scene)
        if lack:
            cls.poll_message_set(lack)
            return False
        return super().poll(context)


class FromFile(ImportHelper):
    """A mixin: the file browser, which leaves the name that was chosen as it is."""

    def check(self, context: bpy.types.Context) -> bool:
        return False  # ImportHelper would append a file extension


class JobFromFile(AskingJobOperator, FromFile):
    """A mixin for jobs on files from the browser."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.asked = True
        return FromFile.invoke(self, context, event)


class OfPhoto(PlainOperator):
    """A mixin for operators on the scene camera and its photo."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera = context.scene.camera
        if camera is None or camera.type != "CAMERA" or photo_image.camera_photo(camera) is None:
            cls.poll_message_set("The scene camera has no photo; use Add Photo, or pick another one on the list")
            return False
        return True
