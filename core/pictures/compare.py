"""A photo and the splat's render through its camera, set against each other in one picture. All pictures are RGB uint8."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ..geometry.conventions import pixel_centres, to_opencv_pixels
from ..photos.photo import Photo
from ..render.view import RenderedView, ViewRenderer
from ..support.quiet import quiet_opencv
from .through_lens import render_through_lens

Image = NDArray[np.uint8]

SOLID = 0.5  # alpha from which on a pixel of the render shows the scan
SQUARES = 6  # along the longer side of the chessboard
LINE = (255, 255, 255)
# A difference of this many grey levels (of 255) gets the hottest colour.
FULL_HEAT = 64.0
# Grain and one pixel of lost sharpness are no misfit.
HEAT_BLUR_PX = 1.5
# How much of the photo shows under the heat.
GREY_SHARE = 0.35
# More lines would hide the pictures.
MAX_LINES = 60
GOOD, BAD = (60, 220, 90), (235, 70, 60)
# A share of the long side. A match that moved less than this between photo and render sits where it should.
STAYED_SHARE = 0.004
SOLID_PIXELS_FOR_EXPOSURE = 100


@dataclass(frozen=True, eq=False)
class Comparison:
    """The photo and its render, both (H, W, 3) RGB uint8 in the photo's distorted pixels; `solid` (H, W) bool, where the render
    shows the scan.
    """

    photo: Image
    render: Image
    solid: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class DrawnMatches:
    """Matches between photo and render at one camera: `photo` and `render` (M, 2) distorted pixels; `good` (M,) those that sit
    at the same place in both.
    """

    photo: FloatArray
    render: FloatArray
    good: NDArray[np.bool_]


def at_long_side(photo: Photo, camera: Camera, long_side_px: int) -> tuple[Photo, Camera]:
    """The photo and its camera scaled down to a long side of `long_side_px`, never up."""
    k = camera.intrinsics.resized(photo.width, photo.height).with_long_side(long_side_px)
    height, width = photo.pixels.shape[:2]
    pixels = photo.pixels
    if (width, height) != (k.width, k.height):
        pixels = np.asarray(cv2.resize(pixels, (k.width, k.height), interpolation=cv2.INTER_AREA), np.uint8)
    small = replace(photo, pixels=pixels, mask=None, full_size=None)
    return small, replace(camera, intrinsics=k)


def render_photo_like(renderer: ViewRenderer, camera: Camera) -> tuple[Image, NDArray[np.bool_]]:
    """The splat as the camera's real lens would show it, (H, W, 3), and where it is solid (H, W)."""
    drawn = render_through_lens(_WithAlpha(renderer), camera)
    return _bytes(drawn[..., :3]), np.asarray(drawn[..., 3] >= SOLID)


class _WithAlpha:
    """A renderer whose colour has alpha as its fourth channel, so that the lens bends both alike."""

    def __init__(self, renderer: ViewRenderer) -> None:
        self._renderer = renderer

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        view = self._renderer.render(intrinsics, pose)
        return replace(view, color=np.dstack([view.color, view.alpha]))


def side_by_side(pair: Comparison) -> Image:
    """Photo left, render right, with a gap."""
    gap = np.full((pair.photo.shape[0], _gap(pair), 3), 255, np.uint8)
    return np.concatenate([pair.photo, gap, pair.render], axis=1)


def diagonal(pair: Comparison) -> Image:
    """The photo above the diagonal from bottom left to top right, the render below it, as in the paper's figures."""
    height, width = pair.photo.shape[:2]
    y, x = pixel_centres(height)[:, None] / height, pixel_centres(width)[None, :] / width
    return _split(pair, 1 - y - x, 1 / max(width, height))


def wipe(pair: Comparison, position: float) -> Image:
    """The photo left of `position` (0..1 of the width), the render right of it."""
    height, width = pair.photo.shape[:2]
    x = np.broadcast_to(pixel_centres(width)[None, :] / width, (height, width))
    return _split(pair, position - x, 1 / width)


def _split(pair: Comparison, side: FloatArray, pixel: float) -> Image:
    """Photo where `side` (H, W) > 0, else render; a white line of about two pixels between them where both show."""
    out = np.where((side > 0)[..., None], pair.photo, pair.render)
    if (side > 0).any() and (side <= 0).any():
        out[np.abs(side) <= pixel] = LINE
    return np.asarray(out, np.uint8)


def squares(pair: Comparison) -> Image:
    """Photo and render in turn, as on a chessboard: edges break where the camera is wrong."""
    height, width = pair.photo.shape[:2]
    side = max(1, max(height, width) // SQUARES)
    rows, columns = np.arange(height)[:, None] // side, np.arange(width)[None, :] // side
    return np.asarray(np.where(((rows + columns) % 2 == 0)[..., None], pair.photo, pair.render), np.uint8)


def difference(pair: Comparison) -> Image:
    """How far photo and render differ once their exposures are evened out: dark is the same, bright is different. Grey photo
    where the scan has nothing.
    """
    grey = np.asarray(cv2.cvtColor(cv2.cvtColor(pair.photo, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB), np.float32)
    photo, render = (cv2.GaussianBlur(image.astype(np.float32), (0, 0), HEAT_BLUR_PX) for image in (pair.photo, pair.render))
    gap = np.abs(photo - _exposed_like(render, photo, pair.solid)).mean(axis=2)
    heat: Any = cv2.applyColorMap(_bytes(gap / FULL_HEAT), cv2.COLORMAP_INFERNO)
    hot = cv2.cvtColor(heat, cv2.COLOR_BGR2RGB).astype(np.float32)
    mixed = hot + GREY_SHARE * grey * (1 - hot.max(axis=2, keepdims=True) / 255)
    return np.asarray(np.clip(np.where(pair.solid[..., None], mixed, grey), 0, 255), np.uint8)


def _exposed_like(render: Any, photo: Any, solid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The render with each channel's mean and contrast made the photo's, over the solid part."""
    if solid.sum() < SOLID_PIXELS_FOR_EXPOSURE:
        return np.asarray(render, np.float32)
    a, b = render[solid], photo[solid]
    gain = np.clip(b.std(axis=0) / np.maximum(a.std(axis=0), 1.0), 0.2, 5.0)
    return np.asarray((render - a.mean(axis=0)) * gain + b.mean(axis=0), np.float32)


def matched(pair: Comparison, matches: DrawnMatches) -> Image:
    """Photo and render side by side with their matches: green lines where both ends sit at the same place, red where not."""
    out = np.ascontiguousarray(side_by_side(pair))
    shift = np.array([pair.photo.shape[1] + _gap(pair), 0.0])
    order = np.concatenate([np.flatnonzero(~matches.good), np.flatnonzero(matches.good)])  # the good ones on top
    step = max(1, -(-len(order) // MAX_LINES))
    for i in order[::step]:
        ends = [tuple(int(v) for v in np.round(to_opencv_pixels(p))) for p in (matches.photo[i], matches.render[i] + shift)]
        cv2.line(out, ends[0], ends[1], GOOD if matches.good[i] else BAD, 1, cv2.LINE_AA)
    for i in order:
        for place in (matches.photo[i], matches.render[i] + shift):
            centre = tuple(int(v) for v in np.round(to_opencv_pixels(place)))
            cv2.circle(out, centre, 2, GOOD if matches.good[i] else BAD, -1, cv2.LINE_AA)
    return out


def judge_matches(photo: FloatArray, render: FloatArray, long_side_px: int) -> DrawnMatches:
    """Tells the matches (M, 2) each, distorted pixels, that sit at the same place from those that do not."""
    moved = np.linalg.norm(photo - render, axis=1)
    return DrawnMatches(photo, render, np.asarray(moved <= max(1.5, STAYED_SHARE * long_side_px)))


STYLES: dict[str, Callable[[Comparison], Image]] = {
    "side_by_side": side_by_side,
    "diagonal": diagonal,
    "squares": squares,
    "difference": difference,
}


def encode_png(image: Image) -> bytes:
    """An RGB or RGBA image (H, W, 3 or 4) as PNG, quickly. Raises OSError when it cannot be encoded."""
    turned = image[..., ::-1] if image.shape[2] == 3 else image[..., [2, 1, 0, 3]]
    ok, data = cv2.imencode(".png", np.ascontiguousarray(turned), [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not ok:
        raise OSError("The picture could not be encoded as PNG.")
    return data.tobytes()


def decode_png(data: bytes) -> Image | None:
    """The image of `encode_png`, None when the bytes are none."""
    with quiet_opencv():
        found: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if found is None or found.ndim != 3:
        return None
    return np.asarray(found[..., ::-1] if found.shape[2] == 3 else found[..., [2, 1, 0, 3]], np.uint8)


def _gap(pair: Comparison) -> int:
    return max(4, int(pair.photo.shape[1]) // 100)


def _bytes(values: Any) -> Image:
    """0..1 as 0..255, rounded."""
    return np.asarray(np.clip(np.asarray(values) * 255 + 0.5, 0, 255), np.uint8)
