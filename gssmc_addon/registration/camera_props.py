"""What the extension keeps on a camera: its photo, its lens, and what the last refinement said of it."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..photo import image as photo_image
from ..photo import mask as mask_source
from ..support.texts import iface_

VERDICTS = (
    ("NONE", "None", "Not refined yet"),
    ("TRUSTED", "Trusted", "The camera fits the photo"),
    ("CHECK", "Check", "Look at the result before you rely on it"),
    ("FAILED", "Failed", "No camera was found; nothing was changed"),
)
VERDICT_NAMES = {item[0]: item[1] for item in VERDICTS}
VERDICT_ICONS = {"NONE": "NONE", "TRUSTED": "CHECKMARK", "CHECK": "QUESTION", "FAILED": "ERROR"}


def verdict_title(note: GssmcCamera) -> str:
    """One line for the panel: the verdict, with the iterations, or of a plate the frames, and the time that it took."""
    values = {"verdict": iface_(VERDICT_NAMES[note.verdict]), "count": note.iterations_done, "seconds": note.seconds}
    if note.frames_done:
        values["count"] = note.frames_done
        one = iface_("{verdict}: 1 frame, {seconds:.1f} s", **values)
        return one if note.frames_done == 1 else iface_("{verdict}: {count} frames, {seconds:.1f} s", **values)
    if note.iterations_done == 1:
        return iface_("{verdict}: 1 iteration, {seconds:.1f} s", **values)
    return iface_("{verdict}: {count} iterations, {seconds:.1f} s", **values)


def note_verdict(data: bpy.types.Camera, verdict: str, reasons: Sequence[str], iterations: int, seconds: float) -> None:
    """Keeps on the camera what was said of it; `verdict` as the engine spells it, or "none"."""
    note = data.gssmc
    note.verdict, note.reasons = verdict.upper(), "\n".join(reasons)
    note.iterations_done, note.seconds, note.frames_done = iterations, seconds, 0


def _photo_picked(self: GssmcCamera, context: bpy.types.Context) -> None:
    if self.photo:
        context.window_manager.gssmc.tell("")  # that there was none
        photo_image.show_behind(self.id_data, self.photo)


class GssmcCamera(bpy.types.PropertyGroup):
    """On the camera data: its photo, lens distortion (OpenCV's k1 k2 p1 p2 k3), and what the last refinement said of it."""

    __annotations__ = {
        "photo": PointerProperty(
            name="Photo",
            description="The photograph taken by this camera",
            type=bpy.types.Image,
            poll=lambda self, image: image.source != "VIEWER",  # Render Result and Viewer Node
            update=_photo_picked,
        ),
        "mask": PointerProperty(
            name="Mask",
            description="Leaves people, sky and cars out of matching: white is used, black is not. A picture of the photo's "
            "size, upright, from a file or painted in Blender",
            type=bpy.types.Image,
            poll=lambda self, image: image.source in mask_source.SINGLE and image != self.photo,
        ),
        **{
            name: FloatProperty(name=name, precision=6, step=0.1, description=f"Lens distortion {name} in OpenCV's model")
            for name in ("k1", "k2", "p1", "p2", "k3")
        },
        "undistorted": PointerProperty(
            name="Undistorted", description="The photo's copy without lens distortion, for the background", type=bpy.types.Image
        ),
        "lens_calibrated": BoolProperty(
            name="Calibrated",
            description="The focal length is known well, from a calibration. Otherwise it is a guess (from EXIF, or by eye), "
            "for which Refine solves when Solve For is Auto",
        ),
        "frame_x": IntProperty(name="Frame X", description="Render resolution that the lens belongs to; 0: the scene's", min=0),
        "frame_y": IntProperty(name="Frame Y", description="Render resolution that the lens belongs to; 0: the scene's", min=0),
        "verdict": EnumProperty(name="Verdict", items=VERDICTS, default="NONE"),
        "reasons": StringProperty(name="Reasons", description="Why, one sentence per line"),
        "iterations_done": IntProperty(name="Iterations", description="Iterations of the last refinement"),
        "frames_done": IntProperty(name="Frames", description="Frames of the last refinement of a plate; 0: it was of a photo"),
        "seconds": FloatProperty(name="Seconds", description="Wall time of the last refinement"),
        "bad_frames": StringProperty(
            name="Bad Frames", description="Frames of a plate that could not be refined and have no key"
        ),
    }
