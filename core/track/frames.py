"""One frame of a plate: carried over from a neighbour, then tied to the splat by one render.

Corners of the neighbour, whose places in the world are known, are followed into the frame; the pose that explains where they
went is right to a pixel or so. One render of the splat there, and patches aligned between frame and render as the last stage of
a refinement does it, tie the frame to the splat itself: errors of one frame are not handed to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..errors import PhotoError
from ..features.subpixel import LK_CRITERIA, normalise_locally
from ..geometry.camera import FloatArray, Intrinsics, Pose
from ..geometry.conventions import from_opencv_pixels, to_opencv_pixels
from ..photos.photo import Photo
from ..pose.final.guided import Corners, PosedRender, match_corners, pick_corners
from ..pose.final.joint import JointFit, JointProblem, fit_joint
from ..pose.final.reprojection import reproject
from ..pose.search.observe import grey_of
from ..pose.shared.corners import filled_cells
from ..pose.shared.lens import CameraUnknowns, LensPrior
from ..pose.shared.matches import BoolArray, ViewMatches, world_points
from ..pose.shared.surface import depth_at, solid_part
from ..pose.shared.working import GreyImage, WorkingPhoto
from ..render.view import ViewRenderer, sole_renderer

# Fewer corners on the splat do not hold a camera (at a wrong pose up to eight of 1500 find a place by chance); fewer than GOOD,
# or on fewer of the CELLS x CELLS cells, hold it loosely.
MIN_MATCHES, GOOD_MATCHES = 25, 80
CELLS, MIN_CELLS, GOOD_CELLS = 6, 5, 9
# Corners followed from one frame to the next: fewer, or a smaller share of them, are no motion but a cut.
HOLD = 3.0
MIN_LINKS, MIN_LINK_SHARE = 30, 0.2
WINDOW_PX, LEVELS = 21, 3
RETURN_PX = 0.5
# The frame is rendered once more where its pose moved by so much after the first render: matches are looked for near places.
AGAIN_PX = 1.5
MAX_RENDERS = 3


@dataclass(frozen=True, eq=False)
class SolvedFrame:
    """A frame tied to the splat: its picture, the fit, the matches that hold it, and the median depth there (scene units)."""

    photo: WorkingPhoto
    fit: JointFit
    matches: ViewMatches
    median_depth: float

    @property
    def pose(self) -> Pose:
        return self.fit.camera.pose

    @property
    def cells(self) -> int:
        k = self.photo.pinhole
        return filled_cells(k.to_pixels(self.matches.query), (k.width, k.height), CELLS)


@dataclass(frozen=True, eq=False)
class Carried:
    """Corners carried over from a neighbour: their fit, and the matches, whose view is the neighbour."""

    fit: JointFit
    matches: ViewMatches


@dataclass(frozen=True)
class FrameMatcher:
    """Solves frames with one lens. `lens`: of the photos at their full size; `prior`: what is known of it."""

    renderer: ViewRenderer
    lens: Intrinsics
    prior: LensPrior
    long_side_px: int

    def working(self, photo: Photo) -> WorkingPhoto:
        """The frame as it is matched. Raises PhotoError where it is not of the size of the others."""
        if (photo.width, photo.height) != (self.lens.width, self.lens.height):
            size = f"{self.lens.width} x {self.lens.height}"
            raise PhotoError(f"The frame has {photo.width} x {photo.height} pixels and the others {size}; give them one size.")
        return WorkingPhoto.of(photo, self.lens, self.long_side_px)

    def link(self, before: SolvedFrame, photo: WorkingPhoto, guess: Pose) -> Carried | None:
        """The pose of `photo` by the corners of the neighbour `before`, followed from where `guess` expects them; None where
        too few can be followed, which is so after a cut.
        """
        matches = _carried(before, photo, guess)
        if len(matches) < max(MIN_LINKS, MIN_LINK_SHARE * len(before.matches)):
            return None
        return Carried(self._fit(guess, [matches], photo), matches)

    def solve(self, photo: WorkingPhoto, guess: Pose, carried: Carried | None = None) -> SolvedFrame | None:
        """The frame tied to the splat; None where too little holds it. The `guess` may be off by as much as corners can be
        followed over coarse pictures, some ten pixels or more: a camera that is led by its neighbours alone would go astray,
        and find matches near to where it is led.
        """
        for _ in range(MAX_RENDERS):
            view = sole_renderer(self.renderer).render(photo.pinhole, guess)
            corners = pick_corners(photo, guess, view)
            coarse = _drawn_to(photo, PosedRender(view, guess, reference=True), corners)
            if len(coarse) < MIN_MATCHES:
                return None
            pose = self._held(guess, coarse, carried, photo).camera.pose
            if _moved_px(photo, coarse, guess, pose) < AGAIN_PX:
                break
            guess = pose
        matches = match_corners(PosedRender(view, guess, reference=True), photo, guess, corners)
        if len(matches) < MIN_MATCHES:
            return None
        fit, depth = self._held(pose, matches, carried, photo), float(np.median(view.depth[solid_part(view)]))
        solved = SolvedFrame(photo, fit, matches, depth)
        return solved if solved.cells >= MIN_CELLS else None

    def _held(self, guess: Pose, matches: ViewMatches, carried: Carried | None, photo: WorkingPhoto) -> JointFit:
        """The fit of the matches with the splat, held by the corners carried over from the neighbour, where there are any; its
        problem is that of the splat alone.
        """
        alone = self._fit(guess, [matches], photo)
        if carried is None:
            return alone
        both = JointProblem.of([matches, carried.matches], photo.intrinsics, alone.problem.prior)
        sigma = both.deviations_px(reproject(alone.camera, both.matches).across)
        count = len(alone.problem.weights)
        link = carried.fit.problem.deviations_px(reproject(carried.fit.camera, carried.fit.problem.matches).across)
        weights = both.weights.copy()
        weights[count:] *= HOLD * (link[0] / sigma[0]) ** 2
        fit = fit_joint(CameraUnknowns(carried.fit.camera.pose, photo.intrinsics), replace(both, weights=weights), "joint")
        return replace(fit, problem=alone.problem)

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
    pixels, good = _follow(before.photo.aligned, photo.aligned, start, first)
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


def _follow(a: GreyImage, b: GreyImage, start: FloatArray, first: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Places (N, 2) in `b` of the pixels `start` (N, 2) of `a`, looked for around `first`, and which came back (N,)."""
    there, ok = _flow(a, b, start, first)
    back, back_ok = _flow(b, a, there, start)
    return there, ok & back_ok & (np.linalg.norm(back - start, axis=1) < RETURN_PX)


def _flow(a: GreyImage, b: GreyImage, points: FloatArray, first: FloatArray) -> tuple[FloatArray, BoolArray]:
    if not len(points):
        return points, np.zeros(0, np.bool_)
    start, guess = (np.ascontiguousarray(to_opencv_pixels(p), np.float32).reshape(-1, 1, 2) for p in (points, first))
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        a,
        b,
        start,
        guess.copy(),
        winSize=(WINDOW_PX, WINDOW_PX),
        maxLevel=LEVELS,
        criteria=LK_CRITERIA,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return from_opencv_pixels(found.reshape(-1, 2)), np.asarray(status.ravel() > 0)


def _drawn_to(photo: WorkingPhoto, render: PosedRender, corners: Corners) -> ViewMatches:
    """Matches of the photo's corners with a render that is some pixels off, followed there and back over coarse pictures."""
    k = photo.pinhole
    pixels, good = _follow(photo.aligned, normalise_locally(grey_of(render.view)), corners.pixels, corners.pixels)
    depth, std = depth_at(render.view, pixels)
    matches = ViewMatches(render.pose, k.normalise(corners.pixels), k.normalise(pixels), depth, std, reference=True)
    return matches.take(good & np.isfinite(depth) & (depth > 0))


def _moved_px(photo: WorkingPhoto, matches: ViewMatches, before: Pose, after: Pose) -> float:
    """How far the matches' points move in the picture between two poses: the median, pixels."""
    k, points = photo.pinhole, world_points(matches)
    moved = k.project(after.transform(points)) - k.project(before.transform(points))
    return float(np.nanmedian(np.linalg.norm(moved, axis=1)))


# Reads one frame of a plate by its number.
ReadFrame = Callable[[int], Photo]
