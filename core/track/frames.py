"""One frame of a plate: carried over from a neighbour, then tied to the splat by one render.

Corners of the neighbour, whose places in the world are known, are followed into the frame; the pose that explains where they
went is right to a pixel or so. One render of the splat there, and patches aligned between frame and render as the last stage of
a refinement does it, tie the frame to the splat itself: errors of one frame are not handed to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ..features.subpixel import LK_CRITERIA
from ..geometry.camera import FloatArray, Intrinsics, Pose
from ..geometry.conventions import from_opencv_pixels, to_opencv_pixels
from ..photos.photo import Photo
from ..pose.final.guided import PosedRender, match_corners, pick_corners
from ..pose.final.joint import JointFit, JointProblem, fit_joint
from ..pose.shared.corners import filled_cells
from ..pose.shared.lens import CameraUnknowns, LensPrior
from ..pose.shared.matches import BoolArray, ViewMatches, world_points
from ..pose.shared.surface import solid_part
from ..pose.shared.working import WorkingPhoto
from ..render.view import ViewRenderer, sole_renderer

# Fewer corners on the splat do not hold a camera; fewer than GOOD, or on fewer of the CELLS x CELLS cells, hold it loosely.
MIN_MATCHES, GOOD_MATCHES = 25, 100
CELLS, MIN_CELLS, GOOD_CELLS = 6, 5, 9
# At a wrong pose a tenth of the corners finds a place by chance.
MIN_SHARE, GOOD_SHARE = 0.2, 0.35
# Corners followed from one frame to the next: fewer, or a smaller share of them, are no motion but a cut.
MIN_LINKS, MIN_LINK_SHARE = 30, 0.2
LINK_WINDOW_PX, LINK_LEVELS = 21, 4
LINK_RETURN_PX = 0.3
# The frame is rendered once more where its pose moved by so much after the first render: matches are looked for near places.
AGAIN_PX = 1.5
MAX_RENDERS = 3


@dataclass(frozen=True, eq=False)
class SolvedFrame:
    """A frame tied to the splat: its picture, the fit, the matches that hold it, of how many corners, and the median depth
    there (scene units).
    """

    photo: WorkingPhoto
    fit: JointFit
    matches: ViewMatches
    corners: int
    median_depth: float

    @property
    def share(self) -> float:
        """Of the corners on the splat, the share (0..1) that sits on it."""
        return len(self.matches) / self.corners

    @property
    def pose(self) -> Pose:
        return self.fit.camera.pose

    @property
    def cells(self) -> int:
        k = self.photo.pinhole
        return filled_cells(k.to_pixels(self.matches.query), (k.width, k.height), CELLS)


@dataclass(frozen=True)
class FrameMatcher:
    """Solves frames with one lens. `lens`: of the photos at their full size; `prior`: what is known of it."""

    renderer: ViewRenderer
    lens: Intrinsics
    prior: LensPrior
    long_side_px: int

    def working(self, photo: Photo) -> WorkingPhoto:
        return WorkingPhoto.of(photo, self.lens, self.long_side_px)

    def link(self, before: SolvedFrame, photo: WorkingPhoto, guess: Pose) -> JointFit | None:
        """The pose of `photo` by the corners of the neighbour `before`, followed from where `guess` expects them; None where
        too few can be followed, which is so after a cut.
        """
        matches = _carried(before, photo, guess)
        if len(matches) < max(MIN_LINKS, MIN_LINK_SHARE * len(before.matches)):
            return None
        return self._fit(guess, [matches], photo)

    def solve(self, photo: WorkingPhoto, guess: Pose) -> SolvedFrame | None:
        """The frame tied to the splat, from a `guess` that is a few pixels off at most; None where too little holds it."""
        solved = None
        for _ in range(MAX_RENDERS):
            solved = self._once(photo, guess)
            if solved is None or _moved_px(solved, guess) < AGAIN_PX:
                break
            guess = solved.pose
        return solved

    def _once(self, photo: WorkingPhoto, guess: Pose) -> SolvedFrame | None:
        view = sole_renderer(self.renderer).render(photo.pinhole, guess)
        solid = solid_part(view)
        corners = pick_corners(photo, guess, view)
        if len(corners.pixels) < MIN_MATCHES or not solid.any():
            return None
        matches = match_corners(PosedRender(view, guess, reference=True), photo, guess, corners)
        if len(matches) < MIN_MATCHES:
            return None
        fit, depth = self._fit(guess, [matches], photo), float(np.median(view.depth[solid]))
        solved = SolvedFrame(photo, fit, matches, len(corners.pixels), depth)
        return solved if solved.cells >= MIN_CELLS and solved.share >= MIN_SHARE else None

    def _fit(self, guess: Pose, views: list[ViewMatches], photo: WorkingPhoto) -> JointFit:
        k = photo.intrinsics
        prior = self.prior.resized(k.width, k.height)
        return fit_joint(CameraUnknowns(guess, k), JointProblem.of(views, k, prior), "joint")


def _carried(before: SolvedFrame, photo: WorkingPhoto, guess: Pose) -> ViewMatches:
    """The corners of `before`, each in its place in the world, followed into `photo` and back."""
    k, known = photo.pinhole, before.matches
    depth = before.pose.transform(world_points(known))[:, 2]
    places = ViewMatches(before.pose, known.query, known.query, depth, known.depth_std, reference=True)
    start = k.to_pixels(known.query)
    with np.errstate(divide="ignore", invalid="ignore"):
        first = k.project(guess.transform(world_points(places)))
    first = np.where(np.isfinite(first), first, start)
    pixels, good = _follow(before.photo, photo, start, first)
    inside = (pixels > 0).all(1) & (pixels < (k.width, k.height)).all(1)
    taken = places.take(good & inside & np.isfinite(depth) & (depth > 0))
    return ViewMatches(
        taken.pose,
        k.normalise(pixels[good & inside & np.isfinite(depth) & (depth > 0)]),
        taken.view,
        taken.depth,
        taken.depth_std,
        reference=True,
    )


def _follow(a: WorkingPhoto, b: WorkingPhoto, start: FloatArray, first: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Places (N, 2) in `b` of the pixels `start` (N, 2) of `a`, looked for around `first`, and which came back (N,)."""
    there, ok = _flow(a, b, start, first)
    back, back_ok = _flow(b, a, there, start)
    return there, ok & back_ok & (np.linalg.norm(back - start, axis=1) < LINK_RETURN_PX)


def _flow(a: WorkingPhoto, b: WorkingPhoto, points: FloatArray, first: FloatArray) -> tuple[FloatArray, BoolArray]:
    if not len(points):
        return points, np.zeros(0, np.bool_)
    start, guess = (np.ascontiguousarray(to_opencv_pixels(p), np.float32).reshape(-1, 1, 2) for p in (points, first))
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        a.aligned,
        b.aligned,
        start,
        guess.copy(),
        winSize=(LINK_WINDOW_PX, LINK_WINDOW_PX),
        maxLevel=LINK_LEVELS,
        criteria=LK_CRITERIA,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return from_opencv_pixels(found.reshape(-1, 2)), np.asarray(status.ravel() > 0)


def _moved_px(solved: SolvedFrame, guess: Pose) -> float:
    """How far the corners moved in the picture from where `guess` put them: the median, pixels."""
    k, points = solved.photo.pinhole, world_points(solved.matches)
    moved = k.project(solved.pose.transform(points)) - k.project(guess.transform(points))
    return float(np.nanmedian(np.linalg.norm(moved, axis=1)))


# Reads one frame of a plate by its number.
ReadFrame = Callable[[int], Photo]
