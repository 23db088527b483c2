"""One frame of a plate: carried over from a neighbour, then tied to the splat by one render.

Corners of the neighbour, whose places in the world are known, are followed into the frame; the pose that explains where they
went is right to a pixel or so. One render of the splat there, and patches aligned between frame and render as the last stage of
a refinement does it, tie the frame to the splat itself: errors of one frame are not handed to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import PhotoError
from ..features.subpixel import SubpixelAligner, normalise_locally
from ..geometry.camera import Intrinsics, Pose
from ..photos.photo import Photo
from ..pose.final.guided import Corners, PosedRender, match_corners, pick_corners
from ..pose.final.joint import JointFit, JointProblem, fit_joint
from ..pose.final.reprojection import reproject
from ..pose.search.observe import grey_of
from ..pose.shared.corners import filled_cells
from ..pose.shared.lens import CameraUnknowns, LensPrior
from ..pose.shared.matches import ViewMatches, world_points
from ..pose.shared.surface import depth_at, solid_part
from ..pose.shared.working import WorkingPhoto
from ..render.view import ViewRenderer, sole_renderer

# Fewer corners on the splat do not hold a camera (at a wrong pose up to eight of 1500 find a place by chance); fewer than GOOD,
# or on fewer of the CELLS x CELLS cells, hold it loosely.
MIN_MATCHES, GOOD_MATCHES = 25, 80
CELLS, MIN_CELLS, GOOD_CELLS = 6, 5, 9
# Corners followed from one frame to the next: fewer, or a smaller share of them, are no motion but a cut.
HOLD = 3.0
MIN_LINKS, MIN_LINK_SHARE = 30, 0.2
# Over pictures halved so often, a corner is found some ten pixels and more from where it is looked for.
FOLLOWER = SubpixelAligner(window_px=21, max_move_px=float("inf"), max_return_px=0.5, levels=3)
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

    def shift_px(self, photo: WorkingPhoto, pose: Pose) -> float | None:
        """How far the photo's corners lie from where the splat, rendered at `pose`, shows them: the median, pixels of `photo`.
        None where too few are found again, as deep in motion blur, or far from the true pose.
        """
        view = sole_renderer(self.renderer).render(photo.pinhole, pose)
        corners = pick_corners(photo, pose, view)
        found, k = _drawn_to(photo, PosedRender(view, pose, reference=True), corners), photo.pinhole
        if len(found) < MIN_MATCHES:
            return None
        return float(np.median(np.linalg.norm(k.to_pixels(found.query) - k.to_pixels(found.view), axis=1)))

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
    pixels, good = FOLLOWER.align(before.photo.aligned, photo.aligned, start, first)
    inside = (pixels > 0).all(1) & (pixels < (k.width, k.height)).all(1)
    return replace(places, query=k.normalise(pixels)).take(good & inside & np.isfinite(depth) & (depth > 0))


def _drawn_to(photo: WorkingPhoto, render: PosedRender, corners: Corners) -> ViewMatches:
    """Matches of the photo's corners with a render that is some pixels off, followed there and back over coarse pictures."""
    k = photo.pinhole
    drawn = normalise_locally(grey_of(render.view))
    pixels, good = FOLLOWER.align(photo.aligned, drawn, corners.pixels, corners.pixels)
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
