"""A photo's search in a growing map: pairs of each view once, each seed's RANSAC once, hypotheses anew over all views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..features.matchers.nearest import MutualNearest
from ..features.types import Matcher
from ..geometry.camera import Pose
from ..pose.search.observe import PhotoFeatures
from .hypotheses import Hypothesis, grown_pose, merged, sampled_pose
from .landmarks import MapView
from .matching import Pairs, pair_view

SEEDS, SEEDS_GUESSED = 24, 12  # views with the most matches; with an unknown focal length each costs five times as much


class Search:
    """One photo's search. `guessed`: the focal length is searched for as well."""

    def __init__(self, query: PhotoFeatures, guessed: bool, matcher: Matcher | None = None) -> None:
        self.query, self.guessed = query, guessed
        self._matcher = matcher or MutualNearest()
        self._pairs: list[Pairs] = []
        self._starts: dict[int, tuple[Pose, float] | None] = {}

    def __len__(self) -> int:
        return len(self._pairs)

    @property
    def most_pairs(self) -> int:
        """The pairs of the view that has most."""
        return max((len(pairs) for pairs in self._pairs), default=0)

    def extend(self, views: Sequence[MapView]) -> None:
        """Pairs the photo with more views of the map."""
        self._pairs += [pair_view(self.query.features, view, self._matcher) for view in views]

    def hypotheses(self, all_seeds: bool = False) -> list[Hypothesis]:
        """The hypotheses from all views so far, the best first; unless `all_seeds`, the search ends at one that is clear."""
        pool = Pairs.joined(self._pairs)
        order = np.argsort([-len(pairs) for pairs in self._pairs], kind="stable")
        found: list[Hypothesis] = []
        for seed in order[: SEEDS_GUESSED if self.guessed else SEEDS].tolist():
            if seed not in self._starts:
                self._starts[seed] = sampled_pose(self.query, self._pairs[seed], self.guessed)
            start = self._starts[seed]
            grown = None if start is None else grown_pose(self.query, pool, *start, self.guessed)
            if grown is not None:
                found.append(grown)
                if grown.clear and not all_seeds:
                    break
        return merged(found)
