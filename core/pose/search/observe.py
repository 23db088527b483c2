"""From images to matches: the photo's features once, then one rendered view at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ...features.frontend import Frontend
from ...features.subpixel import SubpixelAligner, normalise_locally
from ...features.types import Features
from ...geometry.camera import FloatArray, Intrinsics, Pose
from ...photos.photo import Photo
from ...render.view import RenderedView, ViewRenderer
from ..shared.matches import BoolArray, ViewMatches
from ..shared.surface import depth_at, solid_part
from ..shared.working import GreyImage, WorkingPhoto


@dataclass(frozen=True)
class PhotoFeatures:
    """The photo at working size with its features, which lie in its distorted pixels."""

    image: WorkingPhoto
    features: Features

    def __len__(self) -> int:
        return len(self.features)

    @property
    def pinhole(self) -> Intrinsics:
        return self.image.pinhole

    @cached_property
    def points(self) -> FloatArray:
        """Ideal image-plane coordinates of the features (N, 2), lens distortion undone."""
        return self.image.intrinsics.normalise(self.features.keypoints)

    def with_intrinsics(self, k: Intrinsics) -> PhotoFeatures:
        """The same photo and features under another lens."""
        return PhotoFeatures(self.image.with_intrinsics(k), self.features)


@dataclass(frozen=True, eq=False)
class Observation:
    """One rendered view and its matches with the photo. `pinhole` are the intrinsics it was drawn with, `grey` (H, W) uint8 the
    render, `solid` (H, W) where it is opaque, `median_depth` over that (NaN when there is none), scene units.
    """

    matches: ViewMatches
    pinhole: Intrinsics
    grey: GreyImage
    solid: BoolArray
    median_depth: float

    @property
    def opaque(self) -> float:
        """Share of solid pixels, 0..1."""
        return float(self.solid.mean())

    @property
    def pose(self) -> Pose:
        return self.matches.pose


def extract_photo_features(photo: Photo, intrinsics: Intrinsics, long_side_px: int, frontend: Frontend) -> PhotoFeatures:
    """Resizes the photo and its camera to the working size and extracts its features once."""
    image = WorkingPhoto.of(photo, intrinsics, long_side_px)
    return PhotoFeatures(image, frontend.photo_features(image.raw, image.mask))


def grey_of(view: RenderedView) -> GreyImage:
    """The render as a grey image (H, W) uint8, rounded."""
    rgb = (np.clip(view.color, 0, 1) * 255 + 0.5).astype(np.uint8)
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)


def observe(renderer: ViewRenderer, photo: PhotoFeatures, pose: Pose, reference: bool, frontend: Frontend) -> Observation:
    """Renders the splat at `pose` with the photo's pinhole camera and matches the photo with it."""
    pinhole = photo.pinhole
    view = renderer.render(pinhole, pose)
    grey = grey_of(view)
    solid = solid_part(view)
    features = frontend.extractor.extract(grey, solid)
    pairs = frontend.matcher.match(photo.features, features).indices
    pairs = _distinct(pairs, photo.features.keypoints, features.keypoints)
    pixels = features.keypoints[pairs[:, 1]]
    depth, std = depth_at(view, pixels)
    matches = ViewMatches(pose, photo.points[pairs[:, 0]], pinhole.normalise(pixels), depth, std, reference)
    median = float(np.median(view.depth[solid])) if solid.any() else float("nan")
    return Observation(matches, pinhole, grey, solid, median)


def _distinct(pairs: NDArray[np.intp], a: FloatArray, b: FloatArray) -> NDArray[np.intp]:
    """One pair per place: SIFT returns a point once per orientation, and such copies would count as independent matches."""
    places = np.round(2 * np.concatenate([a[pairs[:, 0]], b[pairs[:, 1]]], axis=1)).astype(np.int64)
    _, first = np.unique(places, axis=0, return_index=True)
    return pairs[np.sort(first)]


def align_matches(observation: Observation, photo: PhotoFeatures, keep: BoolArray, aligner: SubpixelAligner) -> ViewMatches:
    """The matches in `keep` (M,), their places in the view aligned to the photo's patches; what does not align is left out."""
    matches, view = observation.matches.take(keep), normalise_locally(observation.grey)
    pinhole = observation.pinhole
    pixels, good = aligner.align(
        photo.image.aligned, view, photo.pinhole.to_pixels(matches.query), pinhole.to_pixels(matches.view)
    )
    return replace(matches, view=pinhole.normalise(pixels)).take(good)
