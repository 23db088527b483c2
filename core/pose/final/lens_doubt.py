"""Whether a lens that was not solved for is wrong: how much likelier another one makes the matches.

The measure is the Bayes factor of two models, by Laplace's approximation: the lens as it was given, against one whose numbers S
are free under the prior of a guess. With c the cost of each at its answer, both weighed by the residuals of the second, A the
information on S after the pose has taken its part of it, and P the inverse covariance of the prior (its cost is part of c),

    log B = c_given - c_free - log det(I + A P^-1) / 2.

The last term is what the cost falls by chance, with the width of the prior as the measure: where the matches tell a number much
more sharply than the prior does, a lens that is right is confirmed by it, and log B is far below zero.

It answers a doubt; it does not choose what is solved for. Freed one group after the other by such a measure, unknown lenses
came out six times worse than with all numbers free under their priors (benchmarks/README.md), because a photo that cannot prove
any one number by itself still tells the whole lens.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...geometry.camera import pose_error
from ..shared.least_squares import reduced
from ..shared.lens import Free
from .joint import JointFit, cost_of, fit_joint

# The numbers of a lens that may be wrong: focal length, principal point, k1 and k2. The others are small beside these, and
# freeing them would only blunt the measure.
SUSPECTS: Free = (0, 1, 2, 3, 4)


@dataclass(frozen=True)
class LensDoubt:
    """What speaks against the lens that a fit held. log_odds: log B of another lens; shift_units (scene units), shift_deg: how
    far that lens would move the camera; focal_change: how much longer its focal length is, as a share of the one held.
    """

    log_odds: float
    shift_units: float = 0.0
    shift_deg: float = 0.0
    focal_change: float = 0.0


NO_DOUBT = LensDoubt(float("-inf"))


def doubt(fit: JointFit) -> LensDoubt:
    """What speaks against the numbers of the lens that `fit` held; nothing where it held none of SUSPECTS."""
    free = tuple(sorted({*fit.problem.free, *SUSPECTS}))
    more = [6 + free.index(n) for n in free if n not in fit.problem.free]
    if not more:
        return NO_DOUBT
    wide = replace(fit.problem, prior=fit.problem.prior.doubted(), free=free)
    freer = fit_joint(fit.camera, wide, fit.kind)
    given, other = (cost_of(camera, wide, fit.kind, freer.camera) for camera in (fit.camera, freer.camera))
    base = [*range(6), *(6 + free.index(n) for n in fit.problem.free)]
    prior = wide.prior.information[[free[i - 6] for i in more]]
    A = reduced(other.information, more, base)
    # The information holds the prior's part already, so that A is that of the formula with P added.
    chance = np.linalg.slogdet(A)[1] - np.log(prior).sum()
    return LensDoubt(
        float(given.cost - other.cost - chance / 2),
        *pose_error(freer.camera.pose, fit.camera.pose),
        freer.camera.intrinsics.focal / fit.camera.intrinsics.focal - 1,
    )
