"""See the fit: the splat rendered through a camera and set against its photo, in a thread; the last pair is kept."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import RefineError
from ...core.geometry.camera import Camera, Intrinsics, Pose
from ...core.photos.photo import Photo, check_size
from ...core.pictures import compare as compare_pictures
from ...core.pictures.compare import Comparison, DrawnMatches, Image
from ...core.pose.settings import RefineSettings
from ...core.render import Renderer
from ...core.render.view import RenderedView
from ..camera import bridge as camera_bridge
from ..camera.bridge import CameraCopy
from ..jobs.machine import Job
from ..jobs.worker import Steps
from ..photo import image as photo_image
from ..photo import mask as mask_source
from ..photo.source import PhotoSource
from ..plate import source as plate_source
from ..splat import object as splat_object
from ..splat.copy import SplatCopying, digest
from ..splat.renderer import SplatRenderer
from ..support.texts import n_, rpt_
from . import images as preview_images


@dataclass(frozen=True)
class PreviewOptions:
    """As in preview_options."""

    style: str
    position: float
    long_side_px: int


@dataclass(frozen=True)
class PreviewInputs:
    """Everything a preview needs, copied out of Blender. `kept` is the pair of this view as PNG where there is one; `splat` is
    None where that is enough.
    """

    options: PreviewOptions
    photo: PhotoSource
    camera: CameraCopy
    settings: RefineSettings
    splat: SplatRenderer | None
    kept: tuple[bytes, bytes] | None
    key: preview_images.Key


@dataclass(frozen=True)
class Preview:
    """The picture, the pair it was made of, and whether that was drawn anew."""

    picture: Image
    pair: Comparison
    new: bool
    matches: DrawnMatches | None = None


class PreviewJob(Job):
    """Its result is a Preview."""

    status = n_("Rendering the preview    Esc: cancel")

    def __init__(self, inputs: PreviewInputs, copying: SplatCopying | None = None) -> None:
        super().__init__(partial(_steps, inputs, lambda: self.cancelled), copying)
        self.inputs = inputs

    def on_progress(self, news: tuple[str, float]) -> None:
        self.step, self.fraction = news


@dataclass(frozen=True)
class _Stoppable:
    """A renderer that gives up in the middle of a view when the job is cancelled."""

    renderer: Renderer
    should_stop: Callable[[], bool]

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        return self.renderer.render(intrinsics, pose, self.should_stop)


def _steps(inputs: PreviewInputs, stopped: Callable[[], bool]) -> Steps:
    options = inputs.options
    pair = preview_images.unpack_pair(inputs.kept) if inputs.kept else None
    new = pair is None
    if pair is not None and options.style != "MATCHES":
        yield "Composing", 0.9
        return Preview(compose(options, pair), pair, False)
    yield "Reading the photo", 0.05
    photo, camera = _at_preview_size(inputs)
    yield "Preparing the splat", 0.15
    if inputs.splat is None:
        raise RefineError(n_("The kept pictures of the preview are gone; press Preview again."))
    own = inputs.splat.get()
    renderer = _Stoppable(own, stopped) if isinstance(own, Renderer) else own
    if pair is None:
        yield "Rendering the splat", 0.35
        pair = Comparison(photo.pixels, *compare_pictures.render_photo_like(renderer, camera))
    matches = None
    if options.style == "MATCHES":
        from ...core.pictures.matches import matches_at

        yield "Matching", 0.7
        matches = matches_at(renderer, photo, camera, inputs.settings)
    return Preview(compose(options, pair, matches), pair, new, matches)


def _at_preview_size(inputs: PreviewInputs) -> tuple[Photo, Camera]:
    photo = inputs.photo.read()
    camera = inputs.camera.at_size(photo.width, photo.height)
    camera = replace(camera, intrinsics=check_size(photo, camera.intrinsics))
    return compare_pictures.at_long_side(photo, camera, inputs.options.long_side_px)


def compose(options: PreviewOptions, pair: Comparison, matches: DrawnMatches | None = None) -> Image:
    """The picture of a style; for the flicker, which is two, the render."""
    if options.style == "WIPE":
        return compare_pictures.wipe(pair, options.position)
    if options.style == "MATCHES" and matches is not None:
        return compare_pictures.matched(pair, matches)
    if options.style.lower() in compare_pictures.STYLES:
        return compare_pictures.STYLES[options.style.lower()](pair)
    return pair.render


def prepare(
    context: bpy.types.Context, camera: bpy.types.Object | None, options: PreviewOptions, settings: RefineSettings
) -> PreviewJob:
    """Copies the inputs. Raises GssmcError, with what to do, when something is missing or unfit."""
    scene, splat = context.scene, context.scene.gssmc.splat
    splat = splat_object.picked(scene, splat)
    photo = photo_image.camera_photo(camera) if camera and camera.type == "CAMERA" else None
    if camera is None or photo is None:
        raise RefineError(rpt_("The scene's camera has no photo; use Add Photo in the GS-SMC panel."))
    copy, source = camera_bridge.read_camera(scene, camera, splat), plate_source.source_at(scene, camera, photo)
    key = preview_images.Key(view_key(copy, source, splat, options), content_key(splat))
    kept = preview_images.packed_pair(key)
    needed = kept is None or options.style == "MATCHES"
    copying = SplatCopying(splat) if needed else None
    renderer = SplatRenderer(copying, single=True) if copying else None
    if options.style == "MATCHES":  # The other styles do not show the mask.
        source = mask_source.masked(source, mask_source.of(camera))
    return PreviewJob(PreviewInputs(options, source, copy, settings, renderer, kept, key), copying)


def view_key(copy: CameraCopy, source: PhotoSource, splat: bpy.types.Object, options: PreviewOptions) -> str:
    """Tells one view of one photo from another, so that changing the style does not render again. `content_key` tells what the
    splat holds.
    """
    numbers = np.concatenate([copy.pose.R.ravel(), copy.pose.t, copy.dist])
    photo = (source.name, source.path, _stamp(Path(source.path)), zlib.crc32(getattr(source, "packed", None) or b""))
    parts = (numbers.tobytes(), copy.lens, copy.frame, copy.photo_pixel, photo, splat.session_uid, options.long_side_px)
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def content_key(splat: bpy.types.Object) -> str:
    """Tells an edited splat from what it was: of all its values, 0.2 s for a million Gaussians of SH degree 3."""
    return f"{len(splat.data.points)} {digest(splat.data):08x}"


def _stamp(path: Path) -> tuple[int, int]:
    """Tells a file from another that took its place; zeros where there is none."""
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


def options_of(own: bpy.types.bpy_struct) -> PreviewOptions:
    """A copy of the panel's options, which may be changed while the preview is made."""
    return PreviewOptions(own.style, own.position, own.long_side_px)
