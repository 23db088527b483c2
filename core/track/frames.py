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
from ..pose.shared.lens import FOCAL, CameraUnknowns, LensPrior
from ..pose.shared.matches import ViewMatches, bearings, world_points
from ..pose.shared.surface import depth_at, solid_part
from ..pose.shared.working import WorkingPhoto
from ..render.view import ViewRenderer, sole_renderer
from .focal import FocalChange, grown

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
    matches: ViewMatches
    fit: JointFit
    median_depth: float

    @property
    def pose(self) -> Pose:
        return self.fit.camera.pose

    @property
    def lens(self) -> Intrinsics:
        """Of the picture that is matched."""
        return self.fit.camera.intrinsics

    @classmethod
    def of(cls, photo: WorkingPhoto, fit: JointFit, matches: ViewMatches, median_depth: float) -> SolvedFrame:
        """With the picture and the matches as the fitted lens has them."""
        return cls(*_seen_by(fit.camera.intrinsics, photo, matches), median_depth=median_depth, fit=fit)

    def placed(self, camera: CameraUnknowns) -> SolvedFrame:
        """The frame as `camera` has it."""
        return SolvedFrame.of(self.photo, replace(self.fit, camera=camera), self.matches, self.median_depth)

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
    """Solves frames with one lens, or with one that zooms. `lens`: the shot's, of the photos at their full size; `prior`: what
    is known of it; `change`: how its focal length may change, None where it does not; `grow`: the logarithm of the focal
    length that is expected over that of `lens`.
    """

    renderer: ViewRenderer
    lens: Intrinsics
    prior: LensPrior
    long_side_px: int
    change: FocalChange | None = None
    grow: float = 0.0

    def at(self, grow: float) -> FrameMatcher:
        """The matcher where another focal length is expected; itself where the lens does not zoom."""
        return self if self.change is None else replace(self, grow=grow)

    def grow_of(self, lens: Intrinsics) -> float:
        """How much longer the focal length of `lens` is than the shot's, of which `lens` may be a scaled picture."""
        return 0.0 if self.change is None else float(np.log(lens.fx / lens.width * self.lens.width / self.lens.fx))

    @property
    def working_lens(self) -> Intrinsics:
        """The lens that is expected, of the picture that is matched."""
        return grown(self.lens, self.grow).with_long_side(self.long_side_px)

    def working(self, photo: Photo) -> WorkingPhoto:
        """The frame as it is matched. Raises PhotoError where it is not of the size of the others."""
        if (photo.width, photo.height) != (self.lens.width, self.lens.height):
            size = f"{self.lens.width} x {self.lens.height}"
            raise PhotoError(f"The frame has {photo.width} x {photo.height} pixels and the others {size}; give them one size.")
        return WorkingPhoto.of(photo, grown(self.lens, self.grow), self.long_side_px)

    def link(self, before: SolvedFrame, photo: WorkingPhoto, guess: Pose) -> Carried | None:
        """The camera of `photo` by the corners of the neighbour `before`, followed from where `guess` expects them; None where
        too few can be followed, which is so after a cut.
        """
        matches = _carried(before, photo, guess)
        if len(matches) < max(MIN_LINKS, MIN_LINK_SHARE * len(before.matches)):
            return None
        return Carried(self._fit(CameraUnknowns(guess, photo.intrinsics), [matches], photo), matches)

    def solve(self, photo: WorkingPhoto, guess: CameraUnknowns, carried: Carried | None = None) -> SolvedFrame | None:
        """The frame tied to the splat; None where too little holds it. The `guess` may be off by as much as corners can be
        followed over coarse pictures, some ten pixels or more: a camera that is led by its neighbours alone would go astray,
        and find matches near to where it is led.
        """
        for _ in range(MAX_RENDERS):
            if carried is not None:
                carried = replace(carried, matches=_seen_by(guess.intrinsics, photo, carried.matches)[1])
            photo = _under(photo, guess.intrinsics)
            view = sole_renderer(self.renderer).render(photo.pinhole, guess.pose)
            corners = pick_corners(photo, guess.pose, view)
            coarse = _drawn_to(photo, PosedRender(view, guess.pose, reference=True), corners)
            if len(coarse) < MIN_MATCHES:
                return None
            camera = self._held(guess, coarse, carried, photo).camera
            if _moved_px(coarse, guess, camera) < AGAIN_PX:
                break
            guess = camera
        matches = match_corners(PosedRender(view, guess.pose, reference=True), photo, guess.pose, corners)
        if len(matches) < MIN_MATCHES:
            return None
        fit, depth = self._held(camera, matches, carried, photo), float(np.median(view.depth[solid_part(view)]))
        solved = SolvedFrame.of(photo, fit, matches, depth)
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

    def _held(self, guess: CameraUnknowns, matches: ViewMatches, carried: Carried | None, photo: WorkingPhoto) -> JointFit:
        """The fit of the matches with the splat, held by the corners carried over from the neighbour, where there are any; its
        problem is that of the splat alone.
        """
        alone = self._fit(guess, [matches], photo)
        if carried is None:
            return alone
        start, free = CameraUnknowns(carried.fit.camera.pose, guess.intrinsics), alone.problem.free
        both = JointProblem.of([matches, carried.matches], photo.intrinsics, alone.problem.prior, free)
        sigma = both.deviations_px(reproject(alone.camera, both.matches).across)
        count = len(alone.problem.weights)
        link = carried.fit.problem.deviations_px(reproject(carried.fit.camera, carried.fit.problem.matches).across)
        weights = both.weights.copy()
        weights[count:] *= HOLD * (link[0] / sigma[0]) ** 2
        fit = fit_joint(start, replace(both, weights=weights), "joint")
        return replace(fit, problem=alone.problem)

    def _fit(self, guess: CameraUnknowns, views: list[ViewMatches], photo: WorkingPhoto) -> JointFit:
        k, free = photo.intrinsics, FOCAL if self.change else ()
        prior = self.prior.resized(k.width, k.height)
        if self.change is not None:
            std = prior.std.copy()
            std[0] = self.change.step_std
            prior = replace(prior, lens=self.working_lens, std=std)
        return fit_joint(guess, JointProblem.of(views, k, prior, free), "joint")


def _under(photo: WorkingPhoto, lens: Intrinsics) -> WorkingPhoto:
    return photo if lens == photo.intrinsics else photo.with_intrinsics(lens)


def _seen_by(lens: Intrinsics, photo: WorkingPhoto, matches: ViewMatches) -> tuple[WorkingPhoto, ViewMatches]:
    """The picture, and the matches found in it, as another lens has them."""
    if lens == photo.intrinsics:
        return photo, matches
    pixels = photo.intrinsics.project(bearings(matches.query))
    return _under(photo, lens), replace(matches, query=lens.normalise(pixels))


def _carried(before: SolvedFrame, photo: WorkingPhoto, guess: Pose) -> ViewMatches:
    """The corners of `before`, each in its place in the world, followed into `photo` and back."""
    k, known = photo.pinhole, before.matches
    depth = before.pose.transform(world_points(known))[:, 2]
    places = ViewMatches(before.pose, known.query, known.query, depth, known.depth_std, reference=True)
    start = before.photo.pinhole.to_pixels(known.query)
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


def _moved_px(matches: ViewMatches, before: CameraUnknowns, after: CameraUnknowns) -> float:
    """How far the matches' points move in the picture between two cameras: the median, pixels."""
    points = world_points(matches)
    places = [c.intrinsics.pinhole().project(c.pose.transform(points)) for c in (before, after)]
    return float(np.nanmedian(np.linalg.norm(places[1] - places[0], axis=1)))


# Reads one frame of a plate by its number.
ReadFrame = Callable[[int], Photo]
