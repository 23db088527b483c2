"""What the matches of a frame, or of two neighbouring ones, know of the cameras: a quadratic cost of a fixed size.

The unknowns of a piece of evidence are xi (6) of the pose, T <- exp(xi) T, the lens numbers (9) of `lens.NAMES`, and w (6),
which a rolling shutter adds: the row at height s (-1/2 at the first row, 1/2 at the last) is seen from exp(s w) T, where w is
the motion from frame to frame times the share of that time which reading out takes. Columns of w are those of xi times s.
So many numbers a frame are kept, and no matches, however long the shot is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.camera import FloatArray
from ..pose.final.joint import CERTAINTY, JointFit, linearised, products
from ..pose.final.reprojection import reproject
from ..pose.shared.least_squares import NormalEquations
from ..pose.shared.lens import ALL

XI, LENS, ROWS = slice(0, 6), slice(6, 15), slice(15, 21)
SIZE = 21
# Residuals beyond so many robust deviations are no part of a frame's error: they show something else than the splat.
INLIER = 3.0
# With a rolling shutter, residuals are weighed as if they deviated so much more, and at least by so many pixels.
ROLLING, ROLLING_PX = 2.0, 1.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """At one camera: `equations` (21), weighed as the fit weighs them, in units of its deviations; `pixels` (21), of the
    inliers alone, in pixels of the matched picture; `matches`: how many inliers there are.
    """

    equations: NormalEquations
    pixels: NormalEquations
    matches: int

    def rms_px(self, step: FloatArray) -> float:
        """RMS distance of the inliers from their places after a step (21,) of the unknowns, pixels of the matched picture."""
        e = self.pixels
        squared = 2 * (e.cost + e.gradient @ step + step @ e.information @ step / 2)
        return math.sqrt(max(float(squared), 0.0) / self.matches) if self.matches else float("nan")


def evidence_of(fit: JointFit, height: int, rolling: bool = False) -> Evidence:
    """What the matches of `fit` know at its camera; `height`: that of the picture they were found in, pixels; `rolling`: a
    rolling shutter is to be solved for, so that what it displaces must not be taken for outliers.
    """
    camera, problem = fit.camera, fit.problem
    r = reproject(camera, problem.matches)
    sigma = problem.deviations_px(r.across)
    if rolling:
        sigma = np.maximum(ROLLING * sigma, ROLLING_PX)
    rows = problem.matches.observed[1] / height - 0.5
    line = linearised(camera, replace(problem, free=ALL), fit.kind, sigma)
    weighed = products(_with_rows(line.jacobian, rows), line.residual)
    equations = NormalEquations(CERTAINTY * line.cost, CERTAINTY * weighed[0], CERTAINTY * weighed[1])
    size = np.linalg.norm(r.residual, axis=0)
    inside = (r.points[2] > 0) & (size < INLIER * np.maximum(sigma, np.median(size)))
    J = _with_rows(r.jacobian(_identity(len(rows)), ALL), rows)[:, :, inside]
    residual = r.residual[:, inside]
    pixels = NormalEquations(float((residual**2).sum()) / 2, *products(J, residual))
    return Evidence(equations, pixels, int(inside.sum()))


def _with_rows(jacobian: FloatArray, rows: FloatArray) -> FloatArray:
    """The columns by xi and the lens (15, 2, M), and behind them those by w."""
    return np.concatenate([jacobian, jacobian[XI] * rows])


def _identity(count: int) -> FloatArray:
    return np.repeat(np.eye(2)[:, :, None], count, axis=2)
