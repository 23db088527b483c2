"""How well cameras sit on the frames of a plate, wherever these cameras come from: from a curve through others, say."""

from __future__ import annotations

from collections.abc import Generator, Mapping

from ..errors import GssmcError
from ..geometry.camera import Camera
from ..pose.shared.lens import LensPrior
from ..render.view import ViewRenderer
from .frames import FrameMatcher, ReadFrame
from .report import TrackProgress
from .track import GOOD_RMS_PX, LONG_SIDE_PX

Checking = Generator[TrackProgress, None, dict[int, str]]


def iterate_check(renderer: ViewRenderer, read: ReadFrame, cameras: Mapping[int, Camera], long_side_px: int) -> Checking:
    """Looks at every frame of `cameras` (world-to-camera in the splat's coordinates, for frames at their full
    size); a generator that yields a `TrackProgress` after each, and returns why frames do not sit on the splat, in sentences.
    """
    doubts: dict[int, str] = {}
    for done, (frame, camera) in enumerate(sorted(cameras.items()), 1):
        doubt = _doubt(renderer, read, frame, camera, long_side_px)
        if doubt:
            doubts[frame] = doubt
        yield TrackProgress(done / len(cameras), "checking", frame)
    return doubts


def _doubt(renderer: ViewRenderer, read: ReadFrame, frame: int, camera: Camera, long_side_px: int) -> str:
    k = camera.intrinsics
    matcher = FrameMatcher(renderer, k, LensPrior.of(camera), long_side_px)
    try:
        photo = matcher.working(read(frame))
    except GssmcError as error:
        return str(error)
    shift_px = matcher.shift_px(photo, camera.pose)
    if shift_px is None:
        return "Too little of the picture sits on the splat there."
    size = max(k.width, k.height)
    shift_px *= size / min(size, long_side_px)
    if shift_px * min(1.0, LONG_SIDE_PX / size) <= GOOD_RMS_PX:
        return ""
    return f"Its corners lie {shift_px:.1f} px beside the splat's."
