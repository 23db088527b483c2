"""Pictures whose pixels are not square: anamorphic lenses, and video that was stored with another width than it was taken with.

Almost all photos have square pixels, so that fx / fy is no unknown of a fit unless its matches make a squeeze likelier. The
measure is the Bayes factor of `lens_doubt`, from the gradient and the information at the fit's own answer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..shared.least_squares import reduced
from ..shared.lens import ALL, MODES, SQUEEZE
from .joint import JointFit, fit_joint

# log fx / fy of pictures that are squeezed: from some per cent of old video to half of a film's.
SQUEEZE_STD = 0.2
# log B from which a picture counts as squeezed: odds of twenty to one.
DECISIVE = 3.0


def with_squeeze(fit: JointFit) -> JointFit:
    """The fit with fx / fy free as well, where the rest of the lens was free and the matches ask for it; else `fit` itself."""
    if fit.problem.free != MODES["full"] or squeeze_log_odds(fit) < DECISIVE:
        return fit
    std = fit.problem.prior.std.copy()
    std[SQUEEZE] = SQUEEZE_STD
    problem = replace(fit.problem, prior=replace(fit.problem.prior, std=std), free=ALL)
    return fit_joint(fit.camera, problem, fit.kind)


def squeeze_log_odds(fit: JointFit) -> float:
    """log B of a squeezed picture against one whose pixels are as the prior's lens has them."""
    base, one = [*range(6), *(6 + n for n in fit.problem.free)], 6 + SQUEEZE
    gradient, prior = float(fit.evidence.gradient[one]), SQUEEZE_STD**-2
    known = np.zeros(len(fit.evidence.gradient))
    known[base[6:]] = fit.problem.prior.information[list(fit.problem.free)]
    A = float(reduced(fit.evidence.information + np.diag(known), [one], base)[0, 0])
    return 0.5 * gradient**2 / (A + prior) - 0.5 * float(np.log1p(A / prior))
