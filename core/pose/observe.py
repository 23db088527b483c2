"""From images to matches: the photo's features once, then one rendered view at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera import FloatArray, Intrinsics, Pose
from ..features.frontend import Frontend
from ..features.subpixel import SubpixelAligner, normalise_locally
from ..features.types import Features
from ..photo import Photo
from ..render.view import RenderedView, ViewRenderer
from .matches import BoolArray, ViewMatches

MIN_ALPHA = 0.5  # below this a pixel of the render shows the background as much as the scan
MIN_DEPTH_STD_RATIO = 1e-3


@dataclass(frozen=True)
class Query:
    """The photo at working size: `intrinsics` with distortion, `features` in its distorted pixels, `points` (N, 2) their ideal
    image-plane coordinates, `aligned` (H, W) uint8 the undistorted photo, locally normalised, `grey` the same before that.
    """

    intrinsics: Intrinsics
    features: Features
    points: FloatArray
    grey: NDArray[np.uint8]
    aligned: NDArray[np.uint8]

    @property
    def pinhole(self) -> Intrinsics:
        return self.intrinsics.pinhole()


@dataclass(frozen=True)
class Observation:
    """One rendered view and its matches with the photo. `grey` (H, W) uint8 is the render, `solid` (H, W) where it is opaque,
    `median_depth` over that (NaN when there is none), scene units.
    """

    matches: ViewMatches
    grey: NDArray[np.uint8]
    solid: BoolArray
    median_depth: float

    @property
    def opaque(self) -> float:
        """Share of solid pixels, 0..1."""
        return float(self.solid.mean())

    @property
    def pose(self) -> Pose:
        return self.matches.pose


def make_query(photo: Photo, intrinsics: Intrinsics, long_side_px: int, frontend: Frontend) -> Query:
    """Resizes the photo and its camera to the working size and extracts its features once."""
    work = intrinsics.with_long_side(long_side_px)
    full = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
    size = (work.width, work.height)
    grey = np.asarray(cv2.resize(full, size, interpolation=cv2.INTER_AREA) if full.shape[::-1] != size else full, np.uint8)
    mask = None
    if photo.mask is not None:
        mask = cv2.resize(photo.mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    features = frontend.photo_features(grey, mask)
    straight = undistorted(grey, work)
    return Query(work, features, work.normalise(features.keypoints), straight, normalise_locally(straight))


def undistorted(image: NDArray[np.uint8], intrinsics: Intrinsics) -> NDArray[np.uint8]:
    """`image` as `intrinsics.pinhole()` would have seen it."""
    if not intrinsics.has_distortion:
        return image
    K = intrinsics.matrix
    K[:2, 2] -= 0.5  # OpenCV puts the centre of the first pixel at 0
    size = (intrinsics.width, intrinsics.height)
    map_x, map_y = cv2.initUndistortRectifyMap(K, np.asarray(intrinsics.dist), np.eye(3), K, size, cv2.CV_32FC1)
    return np.asarray(cv2.remap(image, map_x, map_y, cv2.INTER_CUBIC), np.uint8)


def grey_of(view: RenderedView) -> NDArray[np.uint8]:
    """The render as a grey image (H, W) uint8, rounded."""
    rgb = (np.clip(view.color, 0, 1) * 255 + 0.5).astype(np.uint8)
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)


def observe(renderer: ViewRenderer, query: Query, pose: Pose, reference: bool, frontend: Frontend) -> Observation:
    """Renders the splat at `pose` with the photo's pinhole camera and matches the photo with it."""
    pinhole = query.pinhole
    view = renderer.render(pinhole, pose)
    grey = grey_of(view)
    solid = view.alpha >= MIN_ALPHA
    features = frontend.extractor.extract(grey, solid)
    pairs = frontend.matcher.match(query.features, features).indices
    pairs = _distinct(pairs, query.features.keypoints, features.keypoints)
    pixels = features.keypoints[pairs[:, 1]]
    cell = np.clip(pixels.astype(np.intp), 0, (pinhole.width - 1, pinhole.height - 1))
    depth = view.depth[cell[:, 1], cell[:, 0]].astype(np.float64)
    std = np.sqrt(np.maximum(view.depth_variance[cell[:, 1], cell[:, 0]], 0)).astype(np.float64)
    matches = ViewMatches(
        pose,
        query.points[pairs[:, 0]],
        pinhole.normalise(pixels),
        depth,
        np.maximum(std, MIN_DEPTH_STD_RATIO * depth),
        reference,
    )
    median = float(np.median(view.depth[solid])) if solid.any() else float("nan")
    return Observation(matches, grey, np.asarray(solid), median)


def _distinct(pairs: NDArray[np.intp], a: FloatArray, b: FloatArray) -> NDArray[np.intp]:
    """One pair per place: SIFT returns a point once per orientation, and such copies would count as independent matches."""
    places = np.round(2 * np.concatenate([a[pairs[:, 0]], b[pairs[:, 1]]], axis=1)).astype(np.int64)
    _, first = np.unique(places, axis=0, return_index=True)
    return pairs[np.sort(first)]


def align_matches(observation: Observation, query: Query, keep: BoolArray, aligner: SubpixelAligner) -> ViewMatches:
    """The matches in `keep` (M,), their places in the view aligned to the photo's patches; what does not align is left out."""
    pinhole = query.pinhole
    scale, shift = (pinhole.fx, pinhole.fy), (pinhole.cx, pinhole.cy)
    matches = observation.matches.take(keep)
    view = normalise_locally(observation.grey)
    pixels, good = aligner.align(query.aligned, view, matches.query * scale + shift, matches.view * scale + shift)
    return replace(matches, view=(pixels - shift) / scale).take(good)
