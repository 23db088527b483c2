"""The matches between a photo and the render at one camera, for the eye; nothing here changes a pose."""

from __future__ import annotations

from ..features.frontend import make_frontend
from ..geometry.camera import Camera, FloatArray, Intrinsics
from ..photos.photo import Photo
from ..pose.search.observe import extract_photo_features, observe
from ..pose.settings import RefineSettings
from ..render.view import ViewRenderer
from .compare import DrawnMatches, judge_matches


def matches_at(renderer: ViewRenderer, photo: Photo, camera: Camera, settings: RefineSettings) -> DrawnMatches:
    """Matches the photo with the splat at `camera` as a refinement does; places in the photo's own distorted pixels.

    `camera` is at the photo's size. Raises FeatureError when the settings' features cannot be used.
    """
    with make_frontend(settings) as frontend:
        query = extract_photo_features(photo, camera.intrinsics, settings.long_side_px, frontend)
        found = observe(renderer, query, camera.pose, True, frontend).matches
    k = camera.intrinsics
    return judge_matches(_pixels(k, found.query), _pixels(k, found.view), max(photo.width, photo.height))


def _pixels(k: Intrinsics, points: FloatArray) -> FloatArray:
    """Image-plane points (N, 2) as the distorted pixels of `k`."""
    return k.distort_normalised(points) * (k.fx, k.fy) + (k.cx, k.cy)
