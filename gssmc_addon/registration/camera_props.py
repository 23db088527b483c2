"""What the extension keeps on a camera: its photo, its lens, and what the last refinement said of it."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..camera import bridge as camera_bridge
from ..photo import image as photo_image
from ..photo import mask as mask_source
from ..pins.props import GssmcPin
from ..support.texts import iface_

VERDICTS = (
    ("NONE", "None", "Not solved yet"),
    ("TRUSTED", "Trusted", "The camera fits the photo"),
    ("CHECK", "Check", "Look at the result before you rely on it"),
    ("FAILED", "Failed", "No camera was found; nothing was changed"),
    ("PINNED", "Placed by Pins", "Pins that were set by hand place the camera, as well as the reasons say"),
)
LENS_STATES = (
    ("GUESSED", "Guessed", "From EXIF, or set by eye. Refine solves for it when Solve For is Auto"),
    ("SOLVED", "Solved", "Refine found it. The next Refine starts from it, and solves for it again when Solve For is Auto"),
    (
        "CALIBRATED",
        "Calibrated",
        "Known from a calibration, as you or a file say. Refine holds it when Solve For is Auto",
    ),
)
GUESSED, SOLVED, CALIBRATED = range(len(LENS_STATES))
NOTHING_SAID = -1
VERDICT_NAMES = {item[0]: item[1] for item in VERDICTS}
# CHANGED means that the camera is no longer the one that got the verdict.
VERDICT_ICONS = {
    "NONE": "NONE",
    "TRUSTED": "CHECKMARK",
    "CHECK": "QUESTION",
    "FAILED": "ERROR",
    "PINNED": "PINNED",
    "CHANGED": "LOOP_BACK",
}


def verdict_title(props: GssmcCamera) -> str:
    """One line for the panel: the verdict, with the iterations, or of a plate the frames, and the time that it took."""
    values = {"verdict": iface_(VERDICT_NAMES[props.verdict]), "count": props.iterations_done, "seconds": props.seconds}
    if props.verdict == "PINNED":
        return iface_(VERDICT_NAMES[props.verdict])
    if props.frames_done:
        values["count"] = props.frames_done
        one = iface_("{verdict}: 1 frame, {seconds:.1f} s", **values)
        return one if props.frames_done == 1 else iface_("{verdict}: {count} frames, {seconds:.1f} s", **values)
    if props.iterations_done == 0:  # Nothing was refined, for nothing was found.
        return iface_("{verdict}: {seconds:.1f} s", verdict=values["verdict"], seconds=props.seconds)
    if props.iterations_done == 1:
        return iface_("{verdict}: 1 iteration, {seconds:.1f} s", **values)
    return iface_("{verdict}: {count} iterations, {seconds:.1f} s", **values)


def keep_verdict(data: bpy.types.Camera, verdict: str, reasons: Sequence[str], iterations: int, seconds: float) -> None:
    """Keeps on the camera what was said of it; `verdict` as the engine spells it, or "none", which also forgets a solution and
    a track.
    """
    props = data.gssmc
    props.lens_state = props.lens_state  # In a file of an older version this is derived from the verdict until it is set.
    if verdict == "none":
        props.solution, props.solved_photo, props.track = "", None, ""
    props.verdict, props.reasons = verdict.upper(), "\n".join(reasons)
    props.iterations_done, props.seconds, props.frames_done = iterations, seconds, 0


def _photo_picked(self: GssmcCamera, context: bpy.types.Context) -> None:
    if self.photo:
        context.window_manager.gssmc.tell("")  # that there was none
        photo_image.show_behind(self.id_data, self.photo)
        camera_bridge.show_pixel(self.id_data)


def _lens_state(self: GssmcCamera) -> int:
    """What was said of the lens. Older versions props only whether it was calibrated, and said so themselves when they had
    solved for it: there only a camera that was never refined has it from the user.
    """
    if self.lens_said != NOTHING_SAID:
        return self.lens_said
    if not self.lens_calibrated:
        return GUESSED
    return CALIBRATED if self.verdict == "NONE" else SOLVED


def _set_lens_state(self: GssmcCamera, state: int) -> None:
    self.lens_calibrated = state == CALIBRATED
    self.lens_said = state  # This comes last, because the update function of the line above sets it too.


def _calibrated_set(self: GssmcCamera, context: bpy.types.Context) -> None:
    """For scripts that were written for older versions."""
    if self.lens_calibrated:
        self.lens_said = CALIBRATED
    elif self.lens_said in (NOTHING_SAID, CALIBRATED):
        self.lens_said = GUESSED


class GssmcCamera(bpy.types.PropertyGroup):
    """On the camera data: its photo, lens distortion (OpenCV's k1 k2 p1 p2 k3), and what the last refinement said of it."""

    __annotations__ = {
        "photo": PointerProperty(
            name="Photo",
            description="The photograph taken by this camera",
            type=bpy.types.Image,
            poll=lambda self, image: image.source != "VIEWER",  # This leaves out Render Result and Viewer Node.
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
        "lens_state": EnumProperty(
            name="Lens Is",
            description="Where the focal length comes from, hence whether Refine solves for it",
            items=LENS_STATES,
            get=_lens_state,
            set=_set_lens_state,
        ),
        "lens_said": IntProperty(
            name="Lens Said", description="The state of the lens as it was set; -1: it was never set", default=NOTHING_SAID
        ),
        "lens_calibrated": BoolProperty(
            name="Calibrated", description="What files and scripts of older versions say of the lens", update=_calibrated_set
        ),
        "frame_x": IntProperty(name="Frame X", description="Render resolution that the lens belongs to; 0: the scene's", min=0),
        "frame_y": IntProperty(name="Frame Y", description="Render resolution that the lens belongs to; 0: the scene's", min=0),
        "frame_pixel": FloatProperty(
            name="Frame Pixel",
            description="Width over height of the render's pixels that the lens belongs to; 0: the scene's",
            min=0,
        ),
        "photo_pixel": FloatProperty(
            name="Photo Pixel", description="Width over height of the photo's pixels; 0: the frame's", min=0
        ),
        "overscan": FloatProperty(
            name="Overscan",
            description="How many times as wide and high as its photo the camera's frame is; more than 1 while a composite is "
            "set up whose lens bends the rendered picture",
            default=1,
            min=1,
        ),
        "framed": PointerProperty(
            name="Framed Photo", description="The photo whose size was stored last", type=bpy.types.Image
        ),
        "photo_x": IntProperty(name="Photo X", description="Width of the photo in its own file; 0: unknown", min=0),
        "photo_y": IntProperty(name="Photo Y", description="Height of the photo in its own file; 0: unknown", min=0),
        "solution": StringProperty(name="Solution", description="The solved camera as JSON, with its verdict"),
        "solved_photo": PointerProperty(
            name="Solved Photo", description="The photo for which the camera was solved", type=bpy.types.Image
        ),
        "pins": CollectionProperty(
            type=GssmcPin, name="Pins", description="Points of the splat, pinned to pixels of the photo"
        ),
        "verdict": EnumProperty(name="Verdict", items=VERDICTS, default="NONE"),
        "reasons": StringProperty(name="Reasons", description="The reasons for the verdict, one sentence per line"),
        "iterations_done": IntProperty(name="Iterations", description="Iterations of the last refinement"),
        "frames_done": IntProperty(name="Frames", description="Frames of the last refinement of a plate; 0: it was of a photo"),
        "seconds": FloatProperty(name="Seconds", description="How long the last refinement took"),
        "frame_error_px": FloatProperty(
            name="Error (px)",
            description="RMS distance of this frame's corners from where the splat has them, in pixels of the plate. Its curve "
            "is in the Graph Editor",
            min=0,
            precision=2,
        ),
        "track": StringProperty(name="Track", description="The tracked plate as JSON, every frame with how well it is held"),
        "pinned_frames": StringProperty(
            name="Pinned Frames", description="The numbers of the frames whose camera is the user's; tracking holds it exactly"
        ),
        "weak_frames": StringProperty(name="Weak Frames", description="The numbers of all frames that are not held well"),
        "bad_frames": StringProperty(
            name="Bad Frames", description="Frames of a plate that could not be refined and have no key"
        ),
    }
