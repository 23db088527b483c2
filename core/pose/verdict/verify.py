"""An independent look at the answer: does the splat, rendered through the refined camera, sit on the photo?

None of the matches that made the pose take part: corners of the photo are followed into the final render, starting from the
same pixel. At the right pose they stay where they are; anywhere else they wander off or do not come back.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from ...features.subpixel import normalise_locally
from ...geometry.camera import Pose
from ...render.view import ViewRenderer, sole_renderer
from ..search.observe import grey_of
from ..shared.corners import CornerDetector
from ..shared.surface import solid_part
from ..shared.working import WorkingPhoto
from .regions import FOLLOW, STAYED_PX, Pictures, Region, agreeing_region

# Pixels are those of the picture that the loop works on; its long side is `RefineSettings.long_side_px`, or less where the
# photo is smaller.
DETECTOR = CornerDetector(count=600, quality=0.01, spacing_px=7.0)


@dataclass(frozen=True)
class FinalView:
    """How the final render agrees with the photo.

    corners: corners of the photo over the opaque part of the render; agreement: share of them (0..1) that stay within 1.5 px;
    offset_px_of_photo: median displacement of those that could be followed, in pixels of the photo as it is (NaN when none);
    similarity: normalised cross-correlation (-1..1) of the two locally normalised images, hence free of exposure; opaque: share
    of the render that is solid, 0..1; region: where on the photo the render sits; photo_px: how many pixels of the photo as it
    is one pixel of the compared pictures spans.
    """

    corners: int
    agreement: float
    offset_px_of_photo: float
    similarity: float
    opaque: float
    region: Region = field(default_factory=Region)
    photo_px: float = 1.0


def view_at(renderer: ViewRenderer, photo: WorkingPhoto, pose: Pose) -> FinalView:
    """Renders the splat at `pose` and measures how it agrees with the photo."""
    view = sole_renderer(renderer).render(photo.pinhole, pose)
    return compare(photo, grey_of(view), solid_part(view))


def compare(photo: WorkingPhoto, grey: NDArray[np.uint8], solid: NDArray[np.bool_]) -> FinalView:
    """How a render, `grey` and `solid` (H, W), agrees with the photo pixel by pixel."""
    render = normalise_locally(grey)
    if photo.usable is not None:
        solid = solid & photo.usable
    inner = np.asarray(cv2.erode(solid.astype(np.uint8), np.ones((9, 9), np.uint8), borderValue=0), np.uint8)
    corners = DETECTOR.detect(photo.grey, inner)
    if len(corners) == 0:
        return FinalView(0, 0.0, float("nan"), 0.0, float(solid.mean()))
    places, good = FOLLOW.align(photo.aligned, render, corners, corners)
    moved = np.linalg.norm(places - corners, axis=1)
    agreement = float(np.mean(good & (moved < STAYED_PX)))
    offset = photo.photo_px * float(np.median(moved[good])) if good.any() else float("nan")
    similar = _correlation(photo.aligned, render, inner > 0)
    region = agreeing_region(Pictures(photo.grey, photo.aligned, render, inner))
    return FinalView(len(corners), agreement, offset, similar, float(solid.mean()), region, photo.photo_px)


def _correlation(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: NDArray[np.bool_]) -> float:
    x, y = a[mask].astype(np.float64), b[mask].astype(np.float64)
    x, y = x - x.mean(), y - y.mean()
    norm = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / norm if norm > 0 else 0.0
