"""What the choice of views begins with: candidates that the surface alone suggests, in the order in which to look at them."""

from __future__ import annotations

import logging
from collections.abc import Generator
from itertools import islice

import numpy as np

from .candidates import MOST_FILLED, SOME_FILLED, Candidate, candidate_views, measured_ratio, spread_out
from .explore import Exploration
from .surface import Surface

log = logging.getLogger(__name__)

POSITIONS, RATIO_POSITIONS = 400, 24
FEWEST_CANDIDATES, MOST_CANDIDATES = 100, 2000
RATIO_SPREAD = (0.7, 1.0, 1.4)  # of the measured ratio of distance and width: photographs were taken from near and far
STEP_POSITIONS = 25  # positions between two steps


def sieved(surface: Surface, rng: np.random.Generator) -> Generator[float, None, Exploration]:
    """The start of an exploration. Yields the share of the work that is done, 0..1.

    Candidates whose views are less filled follow where hardly a view is filled.
    """
    ratio, found = 1.0, list[Candidate]()
    for filled, begin, share in ((MOST_FILLED, 0.0, 0.9), (SOME_FILLED, 0.9, 0.1)):
        yield begin
        ratio = measured_ratio(surface, RATIO_POSITIONS, rng, filled)
        log.info("surfaces are taken to have been photographed from %.0f times their Gaussians' width", ratio)
        views = candidate_views(surface, tuple(ratio * spread for spread in RATIO_SPREAD), POSITIONS, rng, filled)
        for index, some in enumerate(views):
            found += some
            if index % STEP_POSITIONS == 0:
                yield begin + share * index / POSITIONS
        if len(found) >= FEWEST_CANDIDATES:
            break
    ahead = (candidate.viewpoint for candidate in islice(spread_out(found), MOST_CANDIDATES))
    return Exploration(ratio, tuple(ahead), dict(rng.bit_generator.state))
