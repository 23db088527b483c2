"""Where on the photo the render sits: the regions in which corners stay in place far more often than chance lets them.

A corner on something that the scan does not have, a passer-by or a tree before the facade, says nothing of the pose. What does
is a part of the photo in which most corners stay within a few tenths of a pixel. How many would by chance is measured on the
same two pictures: the same corners are followed into the render from places some pixels away from their own.

Where a place repeats itself, a wrong pose can sit as well as the right one. Then patches of the photo are found again in the
render, a window or a tile farther on, and look more alike there than here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...features.subpixel import SubpixelAligner
from ...geometry.camera import FloatArray
from ..shared.corners import CornerDetector, filled_cells
from ..shared.matches import BoolArray
from ..shared.working import GreyImage

# A corner that moved less than this between photo and render stays, pixels of the matched picture.
STAYED_PX = 1.5
FOLLOW = SubpixelAligner(window_px=21, max_move_px=6.0, max_return_px=0.5)
# Corners are taken from each cell alike, because those of a gaudy foreground would outnumber all others.
CANDIDATES = CornerDetector(count=4000, quality=0.0005, spacing_px=7.0)
# Cells along the long side, and the most corners of one cell.
CELLS, CELL_CORNERS = 12, 10
# Places as far away as this hold what belongs elsewhere: they are out of the aligner's reach, pixels.
ELSEWHERE = np.array([(16, 5), (-5, 16), (-16, -5), (5, -16)], np.float64)
# The share of a cell's corners that stay where the render is right, as supposed in the comparison with chance.
RIGHT_SHARE = 0.5
# Chance is measured as if so many corners had been tried before, of which so many stayed.
PRIOR_CORNERS, PRIOR_HITS = 300, 3
# A region of fewer corners in place, or with less log-likelihood than this beyond the number of cells, is chance.
MIN_REGION, MIN_EVIDENCE = 4, 3.0
# Cells in each direction in which the spread is counted.
SPREAD_CELLS = 6

# Patches are looked for elsewhere at half the size: their number, half their side, and how far around, pixels of that size.
PATCHES, HALF_PATCH_PX, REACH_PX = 16, 20, 80
# A patch counts as here within the first distance of its place, as elsewhere beyond the second one.
HERE_PX, APART_PX = 2, 6
# How much a repeated thing is drawn out (across, down) where the facade that it is on is seen at a slant.
STRETCHES = ((1.0, 1.0), (0.87, 0.93), (1.15, 1.07), (0.75, 0.87), (1.33, 1.15))


@dataclass(frozen=True)
class Region:
    """The parts of the photo in which the render sits, all together.

    corners: of the photo that stay in place there; share: (0..1) of all corners there; expected: how many would by chance;
    area: share (0..1) of the photo within their convex hull; spread: share (0..1) of the photo's 6 x 6 cells with one of them;
    offset_px: their median displacement, pixels of the matched picture, NaN where there are none; unrivalled: share (0..1) of
    patches there that the render shows nowhere around better than in their place, NaN where none can be looked for.
    """

    corners: int = 0
    share: float = 0.0
    expected: float = 0.0
    area: float = 0.0
    spread: float = 0.0
    offset_px: float = float("nan")
    unrivalled: float = float("nan")


@dataclass(frozen=True, eq=False)
class Pictures:
    """What is compared, all (H, W) uint8: the photo as it is and locally normalised, the render locally normalised, and where
    both can be compared (not 0).
    """

    photo: GreyImage
    aligned: GreyImage
    render: GreyImage
    inside: NDArray[np.uint8]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.photo.shape[1], self.photo.shape[0]


def agreeing_region(pictures: Pictures) -> Region:
    """The region of the photo in which the render sits; one without corners where there is none."""
    corners = spread_corners(pictures)
    if len(corners) == 0:
        return Region()
    places, good = FOLLOW.align(pictures.aligned, pictures.render, corners, corners)
    moved = np.linalg.norm(places - corners, axis=1)
    stayed = good & (moved < STAYED_PX)
    if stayed.sum() < MIN_REGION:
        return Region()
    chance = _chance(pictures, corners)
    there = _coherent(corners, stayed, chance, pictures.size)
    kept = stayed & there
    if not kept.any():
        return Region()
    held, (w, h) = corners[kept], pictures.size
    area = float(cv2.contourArea(cv2.convexHull(held.astype(np.float32)))) / (h * w)
    spread = filled_cells(held, (w, h), SPREAD_CELLS) / SPREAD_CELLS**2
    offset, share = float(np.median(moved[kept])), len(held) / int(there.sum())
    return Region(len(held), share, chance * len(corners), area, spread, offset, _unrivalled(pictures, held))


def spread_corners(pictures: Pictures) -> FloatArray:
    """Corners (N, 2) of the photo, pixels: the strongest ones of each cell."""
    found = CANDIDATES.detect(pictures.photo, pictures.inside)
    cell = _cells(found, pictures.size)[0]
    # The strongest come first, and a stable order keeps them first within their cell.
    order = np.argsort(cell, kind="stable")
    rank = np.arange(len(order)) - np.searchsorted(cell[order], cell[order])
    return found[np.sort(order[rank < CELL_CORNERS])]


def _cells(pixels: FloatArray, size: tuple[int, int]) -> tuple[NDArray[np.int64], tuple[int, int]]:
    """The number (N,) of the cell, counted row by row, that each of `pixels` (N, 2) lies in; and the rows and columns."""
    side = max(size) / CELLS
    columns, rows = (int(np.ceil(length / side)) for length in size)
    return np.floor(pixels / side).astype(np.int64) @ (1, columns), (rows, columns)


def _chance(pictures: Pictures, corners: FloatArray) -> float:
    """The share (0..1) of corners that stay by chance, measured at ELSEWHERE, each with its part of the corners."""
    hits, tries = PRIOR_HITS, PRIOR_CORNERS
    for number, offset in enumerate(ELSEWHERE):
        some = corners[number :: len(ELSEWHERE)]
        column, row = np.floor(some + offset).astype(np.int64).T
        within = (column >= 0) & (column < pictures.size[0]) & (row >= 0) & (row < pictures.size[1])
        within[within] = pictures.inside[row[within], column[within]] > 0
        start = some[within]
        places, good = FOLLOW.align(pictures.aligned, pictures.render, start, start + offset)
        hits += int((good & (np.linalg.norm(places - start - offset, axis=1) < STAYED_PX)).sum())
        tries += len(start)
    return min(hits / tries, RIGHT_SHARE / 2)


def _coherent(corners: FloatArray, stayed: BoolArray, chance: float, size: tuple[int, int]) -> BoolArray:
    """Which corners (N,) lie in cells that hang together and hold far more corners in place than chance explains: by the
    log-likelihood of a share of RIGHT_SHARE against that of `chance`.
    """
    cell, shape = _cells(corners, size)
    count = np.bincount(cell, minlength=shape[0] * shape[1])
    held = np.bincount(cell[stayed], minlength=len(count))
    evidence = held * np.log(RIGHT_SHARE / chance) + (count - held) * np.log((1 - RIGHT_SHARE) / (1 - chance))
    likely = ((evidence > 0) & (held > 0)).astype(np.uint8).reshape(shape)
    number, labels = cv2.connectedComponents(likely, connectivity=8)
    label = labels.ravel()
    total = np.bincount(label, evidence, number)
    good = (np.bincount(label, held, number) >= MIN_REGION) & (total > np.log(len(count)) + MIN_EVIDENCE)
    good[0] = False  # the cells that are not likely
    return np.asarray(good[label[cell]])


def _unrivalled(pictures: Pictures, places: FloatArray) -> float:
    """See `Region`: of patches around some of `places` (N, 2)."""
    photo, render = (
        cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for image in (pictures.aligned, pictures.render)
    )
    middles = np.floor(places[:: max(1, len(places) // PATCHES)] / 2).astype(np.int64)
    won = [here >= elsewhere for here, elsewhere in _likenesses(np.asarray(photo), np.asarray(render), middles)]
    return float(np.mean(won)) if won else float("nan")


def _likenesses(
    photo: NDArray[np.uint8], render: NDArray[np.uint8], middles: NDArray[np.int64]
) -> Iterator[tuple[float, float]]:
    """Of each patch of the photo around `middles` (N, 2) that lies within it: its greatest correlation (-1..1) with the render
    in its place, and elsewhere around.
    """
    h, w = photo.shape
    half = HALF_PATCH_PX
    for x, y in middles:
        if not (half <= x < w - half and half <= y < h - half):
            continue
        patch = photo[y - half : y + half, x - half : x + half]
        left, top = max(0, x - half - REACH_PX), max(0, y - half - REACH_PX)
        around = render[top : y + half + REACH_PX, left : x + half + REACH_PX]
        here, elsewhere = -1.0, -1.0
        for across, down in STRETCHES:
            drawn = np.asarray(cv2.resize(patch, None, fx=across, fy=down, interpolation=cv2.INTER_LINEAR))
            if drawn.shape[0] > around.shape[0] or drawn.shape[1] > around.shape[1]:
                continue
            likeness = cv2.matchTemplate(around, drawn, cv2.TM_CCOEFF_NORMED)
            column, row = x - drawn.shape[1] // 2 - left, y - drawn.shape[0] // 2 - top
            if (across, down) == STRETCHES[0]:
                here = float(likeness[_around(row, HERE_PX), _around(column, HERE_PX)].max(initial=-1.0))
            likeness[_around(row, APART_PX), _around(column, APART_PX)] = -1
            elsewhere = max(elsewhere, float(likeness.max()))
        yield here, elsewhere


def _around(middle: int, distance: int) -> slice:
    return slice(max(0, middle - distance), max(0, middle + distance + 1))
