"""From a photo and a map to hypotheses of its camera, each confirmed by the render at it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from ..features.extractors.sift import RootSift
from ..features.frontend import Frontend
from ..geometry.camera import Camera, Intrinsics
from ..photos.lens_guess import guess_lens
from ..photos.photo import Photo
from ..pose.search.observe import PhotoFeatures, extract_photo_features
from ..render.view import ViewRenderer
from ..support.words import counted
from .check import checked
from .hypotheses import MIN_INLIERS, Hypothesis
from .landmarks import LandmarkMap, MapView
from .search import Search

PHOTO_SIDE_PX = 640
MAX_FEATURES, CONTRAST = 2000, 0.01
MIN_FEATURES = 30
FIRST_STAGE = 10  # views of the map that are tried first; then twice as many, and so on
CHECKS_A_STAGE, WEAK_CHECKS = 4, 4  # renders at hypotheses: at most, in a stage; of weak ones, for a photo
WEAK_INLIERS = 25
RIVAL = 0.5  # of the score of a photo's hypothesis, from which that of another place is as good
BETTER = 1.5  # times the score of an earlier hypothesis of the same place, from which that is looked at again


@dataclass(frozen=True)
class Located:
    """What the map says of a photo. `hypotheses`: confirmed by the render there, the best first; empty with a `reason`, one
    sentence. `lens`: the photo's lens at its full size, guessed where none was given. `views`: how many of the map were tried.
    """

    hypotheses: tuple[Hypothesis, ...]
    lens: Intrinsics
    guessed: bool
    views: int
    reason: str = ""

    def camera(self, hypothesis: Hypothesis, file: str = "") -> Camera:
        """The camera of a hypothesis, as a start for the refinement; a guessed focal length stays a guess."""
        lens = replace(self.lens, fx=self.lens.fx * hypothesis.factor, fy=self.lens.fy * hypothesis.factor)
        return Camera(lens, hypothesis.pose, file, focal_guessed=self.guessed)


@dataclass(frozen=True)
class PhotoLens:
    """A photo and its lens at the photo's full size; `intrinsics` None: guessed from the photo. `guessed`: the focal length may
    be off by up to 1.7 times.
    """

    photo: Photo
    intrinsics: Intrinsics | None = None
    guessed: bool = False


class Locator:
    """One photo's search: takes views of the map as they come, hands out hypotheses that the renders at them confirm.

    Every view is matched once. What a smaller map has confirmed is never forgotten.
    """

    def __init__(self, renderer: ViewRenderer, target: PhotoLens) -> None:
        """Extracts the photo's features."""
        self.guessed = target.guessed or target.intrinsics is None
        self.lens = target.intrinsics or guess_lens(target.photo).intrinsics
        self._renderer = renderer
        self._frontend = Frontend(RootSift(MAX_FEATURES, CONTRAST))
        self.query: PhotoFeatures = extract_photo_features(target.photo, self.lens, PHOTO_SIDE_PX, self._frontend)
        self._search = Search(self.query, self.guessed, self._frontend.matcher)
        self._refused: list[Hypothesis] = []
        self._confirmed: list[tuple[Hypothesis, Hypothesis]] = []  # as the map had it, and as the render there has it
        self._weak_left = WEAK_CHECKS

    @property
    def blind(self) -> bool:
        """Whether the photo shows too little to be searched for."""
        return len(self.query.features) < MIN_FEATURES

    @property
    def views(self) -> int:
        return len(self._search)

    def extend(self, views: Sequence[MapView]) -> list[Hypothesis]:
        """Takes more views of the map; the hypotheses that were confirmed because of them, the best first."""
        self._search.extend(views)
        new: list[Hypothesis] = []
        checks = CHECKS_A_STAGE
        for one in self._search.hypotheses():
            weak = one.inliers < WEAK_INLIERS
            if checks == 0 or (weak and self._weak_left == 0) or self._seen(one):
                continue
            checks -= 1
            self._weak_left -= weak
            found = checked(self._renderer, self.query, one, self._frontend)
            if found is None:
                self._refused.append(one)
                continue
            self._confirmed.append((one, found))
            new.append(found)
            if one.clear:
                break
        return new

    def rivals(self, winner: Hypothesis) -> list[Hypothesis]:
        """Other places that the photo fits about as well as the confirmed `winner`'s, the best first; among equal doors there
        are many. Only what the map shows so far can be told.
        """
        found = []
        checks = CHECKS_A_STAGE
        for one in self._search.hypotheses(all_seeds=True):
            if checks == 0 or one.same_as(winner) or one.score < RIVAL * winner.score:
                continue
            checks -= 1
            other = checked(self._renderer, self.query, one, self._frontend)
            if other is not None and not other.same_as(winner) and other.score >= RIVAL * winner.score:
                found.append(other)
        return found

    def located(self) -> Located:
        """All that was confirmed so far, the best first."""
        found = tuple(sorted((found for _, found in self._confirmed), key=lambda h: -h.score))
        return Located(found, self.lens, self.guessed, self.views, "" if found else self._reason())

    def _seen(self, one: Hypothesis) -> bool:
        """Whether this place was looked at before with no less behind it."""
        earlier = [*self._refused, *(before for before, _ in self._confirmed)]
        return any(one.same_as(other) and one.score < BETTER * other.score for other in earlier)

    def _reason(self) -> str:
        features = counted(len(self.query.features), "feature")
        if self.blind:
            return f"The photo shows only {features}; it is too dark, blurred or plain to be placed."
        if self.views == 0:
            return "The map of the scan has no views, for the scan shows nothing to be found by; place the camera by hand."
        best = max((h.inliers for h in self._refused), default=0)
        agree = f"at most {best}" if best else f"fewer than {MIN_INLIERS}"
        return (
            "No place in the scan matches the photo: it may show another place; try more views, or place the camera by hand "
            f"({agree} of its {features} agree on a place, over {counted(self.views, 'view')} of the map)."
        )


def stages(count: int) -> Iterator[int]:
    """The sizes of map at which a photo is tried, up to `count`: FIRST_STAGE, doubled, and `count` itself."""
    size = FIRST_STAGE
    while size < count:
        yield size
        size *= 2
    if count:
        yield count


def locate(renderer: ViewRenderer, target: PhotoLens, landmarks: LandmarkMap) -> Located:
    """The photo's hypotheses in the map, by growing prefixes of it until one is clear; see `Located`."""
    locator = Locator(renderer, target)
    if locator.blind:
        return locator.located()
    for size in stages(len(landmarks)):
        new = locator.extend(landmarks.views[locator.views : size])
        if any(one.clear for one in new):
            break
    return locator.located()
