"""The camera of a photo from pins alone, for photos that nothing else can match, and as a start for all others.

Three pins leave up to four cameras, of which the one nearest to the start is taken. From four pins on all of them are fitted
together, and the focal length with them where it is a guess; from five on one that contradicts the others loses its weight.
One or two pins only guide the camera: it moves as little as it can, so that an artist sees from the first one what a drag does.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...errors import RefineError
from ...geometry.camera import Camera, FloatArray, Pose, pose_error
from ..final.pinned import PinnedPoints
from ..final.solution import deviations
from ..shared.lens import ALL, FOCAL, CameraUnknowns, Free, LensPrior
from . import sentences
from .candidates import FOCAL_SCALES, rough_cameras
from .fit import Near, PinProblem, fit_pins, settled
from .pin import OUTLIER, Pin, pin_std_px, pinned_points, worlds
from .report import PinReport

PinLens = Literal["auto", "fixed", "focal"]

LEAST = 3
# With fewer pins the focal length is not told, and an outlier not seen.
FOCAL_PINS, ROBUST_PINS = 4, 5
# So many of the likeliest candidates are fitted. Pins count as outliers there from so many deviations on, for each candidate
# was made of three clicks alone, whose errors it hands on to the others.
FITTED, WIDE = 2, 10.0
# A camera that is more than e^2 times as likely as another one leaves no doubt which is meant.
DECISIVE = 2.0
# Two cameras nearer to each other than this (per cent of the distance, degrees) are one.
SAME_PCT, SAME_DEG = 1.0, 1.0
# Per cent of the distance; a camera that is known less well is doubtful.
DOUBTFUL_PCT = 10.0
# A click's deviation, as the pins of one camera show it themselves, counts against PIN_PX as much as so many measurements.
PRIOR_COUNT = 4.0
# Points whose spread beside a line is less than this share of that along it lie on the line: pins across half of a photo are
# clicked no better.
LINE = 0.01
# Steps of a fit that follows a mouse: the next move goes on from there.
FOLLOWED = 8
# What nearness counts where nobody knows where the camera stands: enough to keep the equations solvable.
UNKNOWN = 1e-8
# Pins whose errors are so many times what a hand does contradict each other.
CONTRADICTED = 4.0


@dataclass(frozen=True)
class PinOptions:
    """`lens`: what of it is solved for: "auto" the focal length where that is a guess, from four pins on; `focal_35mm`: what
    the photo's EXIF says of it (mm); `start_known`: whether the start camera stands about right, so that the answer is near;
    `last`: the answer for nearly the same pins, as while one of them is dragged: where the camera that follows from it alone
    shows the pins well, no other one is looked for, which takes a fraction of the time.
    """

    lens: PinLens = "auto"
    focal_35mm: float | None = None
    start_known: bool = True
    last: Camera | None = None


def place_by_pins(start: Camera, pins: Sequence[Pin], options: PinOptions | None = None) -> PinReport:
    """The camera that shows the points of `pins` at their pixels, near `start` where the pins leave a choice.

    `start`: its lens belongs to the photo at its full size, its pose is world-to-camera in the coordinates of the pins. Raises
    RefineError when there is no pin, when three and more lie on one line, or when no camera has the points before it.
    """
    began, options = time.perf_counter(), options or PinOptions()
    if not pins:
        raise RefineError("There is no pin to place the camera by; set one on a point of the scan and drag it to the photo's.")
    if len(pins) >= LEAST and on_one_line(worlds(pins)):
        raise RefineError(sentences.one_line())
    solves = options.lens == "focal" or (options.lens == "auto" and start.focal_guessed)
    free: Free = FOCAL if solves and len(pins) >= FOCAL_PINS else ()
    prior = LensPrior.of(start, options.focal_35mm)
    placing = _Placing.of(start, tuple(pins), prior.solving(free) if options.lens == "focal" else prior, free)
    placing = placing if options.start_known else replace(placing, nearness=UNKNOWN)
    found = placing.followed(options.last) or placing.solve()
    if not found:
        raise RefineError("No camera has the pinned points before it; check the pins, or move the camera closer to the view.")
    return _report(placing, found, began)


def on_one_line(points: FloatArray) -> bool:
    """Whether points (N, 3) lie on one line or at one place, as far as hands can tell: a camera may then turn around it."""
    along, across, _ = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(across <= LINE * along)


@dataclass(frozen=True, eq=False)
class _Placing:
    """What is given, and what is solved for. `depth`: the median distance of the points from the start camera; it serves as a
    scale alone. `nearness`: how much the start counts, 1 where it stands about right.
    """

    start: Camera
    pins: tuple[Pin, ...]
    problem: PinProblem
    depth: float
    nearness: float = 1.0

    @classmethod
    def of(cls, start: Camera, pins: tuple[Pin, ...], prior: LensPrior, free: Free) -> _Placing:
        scale = OUTLIER if len(pins) >= ROBUST_PINS + len(free) else np.inf
        problem = PinProblem(pinned_points(pins, start.intrinsics, scale), prior, free)
        return cls(start, pins, problem, float(np.median(np.linalg.norm(worlds(pins) - start.pose.centre, axis=1))) or 1.0)

    @property
    def points(self) -> PinnedPoints:
        return self.problem.points

    @property
    def near(self) -> Near:
        return Near(self.start.pose, self.depth, self.nearness)

    def followed(self, last: Camera | None) -> list[CameraUnknowns]:
        """The camera of least cost near `last`; none without that, or where half of the pins contradict it."""
        if last is None or len(self.pins) < LEAST:
            return []
        camera = fit_pins(CameraUnknowns(last.pose, last.intrinsics), self.problem, self.near, FOLLOWED)
        errors, limit = self.points.errors_px(camera), CONTRADICTED * self.points.std_px
        fits = np.isfinite(errors).all() and np.median(errors) <= limit
        return [camera] if fits else []

    def solve(self) -> list[CameraUnknowns]:
        """The cameras that the pins may mean, the likeliest first; none where all have a point behind them."""
        here = CameraUnknowns(self.start.pose, self.start.intrinsics)
        options = [here, *self.likely()] if len(self.pins) >= LEAST else [here]
        fits = [fit_pins(option, self.problem, self.near) for option in options]
        least = min(LEAST, len(self.pins))
        usable = [camera for camera in fits if np.isfinite(self.points.errors_px(camera)).sum() >= least]
        best = sorted(usable, key=self.merit)
        return [settled(best[0], self.problem, self.near), *best[1:]] if best else []

    def likely(self) -> list[CameraUnknowns]:
        """The likeliest of the cameras that three pins leave, each far from the others."""
        scales = (1.0, *FOCAL_SCALES) if self.problem.free else (1.0,)
        rough = rough_cameras(self.start.intrinsics, self.pins, scales)
        squared, limit = (rough.errors_px / self.points.std_px) ** 2, min(self.points.scale, WIDE) ** 2
        cost = (0.5 * limit * squared / (limit + np.minimum(squared, 1e12))) @ self.points.weights
        if self.problem.free:
            cost += 0.5 * self.problem.prior.information[0] * np.log(rough.scales) ** 2
        centres, degrees = rough.centres, rough.turned_deg(self.start.pose)
        cost += self.near.choice(np.linalg.norm(centres - self.start.pose.centre, axis=1), degrees)
        chosen: list[CameraUnknowns] = []
        for index in np.argsort(cost, kind="stable"):
            camera = rough.camera(int(index))
            if len(chosen) < FITTED and not any(self.is_same(camera, other) for other in chosen):
                chosen.append(camera)
            if len(chosen) == FITTED:
                break
        return chosen

    def is_same(self, one: CameraUnknowns, other: CameraUnknowns) -> bool:
        distance, degrees = pose_error(one.pose, other.pose)
        return 100 * distance <= SAME_PCT * self.depth and degrees <= SAME_DEG

    def merit(self, camera: CameraUnknowns) -> float:
        """Minus the logarithm of a camera's likelihood: by the pins, by the lens, and by how far it is from the start."""
        distance, degrees = (np.array([value]) for value in pose_error(camera.pose, self.start.pose))
        return (
            self.points.equations(camera, ()).cost
            + self.problem.lens_cost(camera)
            + float(self.near.choice(distance, degrees)[0])
        )


def _report(placing: _Placing, found: Sequence[CameraUnknowns], began: float) -> PinReport:
    camera, points = found[0], placing.points
    depths = camera.pose.transform(worlds(placing.pins))[:, 2]
    depth = float(np.median(depths[depths > 0])) if (depths > 0).any() else placing.depth
    covariance, std = _covariance(placing, camera, depth)
    report = PinReport(
        camera=replace(placing.start, pose=camera.pose, intrinsics=camera.intrinsics),
        start=placing.start,
        state="placed",
        reasons=(),
        pins=placing.pins,
        errors_px=points.errors_px(camera),
        counts=points.counts(camera),
        median_depth=depth,
        covariance=covariance,
        translation_std_pct=100 * float(np.linalg.norm(std[:3])) / depth,
        rotation_std_deg=float(np.degrees(np.linalg.norm(std[3:6]))),
        focal_std_pct=100 * float(std[6]),
        solved_focal=bool(placing.problem.free),
        seconds=time.perf_counter() - began,
    )
    return _judged(report, _other(placing, found))


def _covariance(placing: _Placing, camera: CameraUnknowns, depth: float) -> tuple[FloatArray, FloatArray]:
    """The covariance (15, 15) of pose and lens, and its deviations. How well a hand clicks is told by the pins themselves where
    they are many, and by habit where they are few; what the lens may be off is in it.
    """
    points, problem = placing.points, placing.problem
    sure = points.equations(camera, ALL)
    spare = max(0, 2 * len(placing.pins) - 6 - len(problem.free))
    spread = (PRIOR_COUNT + 2 * points.equations(camera, ()).cost) / (PRIOR_COUNT + spare)
    information = sure.information / max(spread, 1e-12) + np.diag([*[0.0] * 6, *problem.prior.information])
    std = deviations(information, depth)
    if not np.isfinite(std).all():
        return np.full_like(information, np.inf), std
    scale = np.ones(len(information))
    scale[:3] = depth
    inverse = np.linalg.inv(information * np.outer(scale, scale))
    return np.asarray(inverse * np.outer(scale, scale)), std


def _other(placing: _Placing, found: Sequence[CameraUnknowns]) -> tuple[float, float] | None:
    """How far from the answer another camera stands that the pins may mean as well: scene units and degrees."""
    best = found[0]
    limit = placing.merit(best) + DECISIVE
    for candidate in found[1:]:
        if placing.is_same(candidate, best) or placing.merit(candidate) >= limit:
            continue
        camera = settled(candidate, placing.problem, placing.near)  # It may have been on its way to the answer.
        if not placing.is_same(camera, best) and placing.merit(camera) < limit:
            return pose_error(camera.pose, best.pose)
    return None


def _judged(report: PinReport, other: tuple[float, float] | None) -> PinReport:
    """The report with its state and its sentences."""
    if len(report.pins) < LEAST:
        return replace(report, state="guided", reasons=(sentences.guided(len(report.pins)),))
    limit = CONTRADICTED * pin_std_px(report.camera.intrinsics)
    doubts = [
        sentences.unbounded() if not np.isfinite(report.translation_std_pct) else "",
        sentences.contradicted(report.errors_px) if np.median(report.errors_px / limit) > 1 else "",
        sentences.two_cameras(100 * other[0] / report.median_depth, other[1]) if other else "",
        sentences.spread_out() if DOUBTFUL_PCT < report.translation_std_pct < np.inf else "",
    ]
    doubts = [doubt for doubt in doubts if doubt]
    off = np.flatnonzero(report.errors_px > limit)
    told = [
        sentences.placed(report),
        *doubts,
        *([] if len(off) == len(report.pins) else sentences.outliers(off, report.errors_px)),
    ]
    if len(report.pins) == LEAST:
        told.append(sentences.three_always_fit())
    return replace(report, state="doubtful" if doubts else "placed", reasons=tuple(told))


def look_at_pins(pins: Sequence[Pin]) -> Pose:
    """A pose that has the pinned points before it, for who knows none."""
    points = worlds(pins)
    middle = points.mean(axis=0)
    reach = float(np.linalg.norm(points - middle, axis=1).max()) or 1.0
    return Pose.from_centre(np.eye(3), middle - [0.0, 0.0, 3 * reach])
