"""Levenberg-Marquardt on any state: the caller says what the normal equations are and how a step moves the state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ...geometry.camera import FloatArray

MAX_STEPS = 30
MIN_GAIN = 1e-7
MAX_DAMPING = 1e8

State = TypeVar("State")


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Cost, its gradient J^T W r (n,) and the Gauss-Newton matrix J^T W J (n, n) at one state."""

    cost: float
    gradient: FloatArray
    information: FloatArray


def reduced(information: FloatArray, kept: Sequence[int], others: Sequence[int]) -> FloatArray:
    """The information (k, k) on the unknowns `kept` after the `others` have taken their part of it: the Schur complement of
    theirs in `information` (n, n).
    """
    H, k, o = information, list(kept), list(others)
    return np.asarray(H[np.ix_(k, k)] - H[np.ix_(k, o)] @ np.linalg.pinv(H[np.ix_(o, o)], hermitian=True) @ H[np.ix_(o, k)])


def newton_step(information: FloatArray, gradient: FloatArray) -> FloatArray | None:
    """The step (n,) to where the gradient is 0; None where there is none, for the equations leave a direction open or hold a
    value that is not finite.
    """
    try:
        step = np.linalg.solve(information, -gradient)
    except np.linalg.LinAlgError:
        return None
    return step if np.isfinite(step).all() else None


def levenberg_marquardt(
    state: State,
    equations: Callable[[State], NormalEquations],
    move: Callable[[State, FloatArray], State],
    min_gain: float = MIN_GAIN,
    max_steps: int = MAX_STEPS,
) -> State:
    """The state of least cost near `state`; `move(state, step)` applies a step (n,). The search ends when the cost falls, or
    could at best fall, by less than the share `min_gain` of it, or after `max_steps`.
    """
    damping, now = 1e-3, equations(state)
    for _ in range(max_steps):
        diagonal = np.maximum(np.diag(now.information), 1e-12)
        step = newton_step(now.information + damping * np.diag(diagonal), now.gradient)
        if step is None:
            break
        trial = move(state, step)
        new = equations(trial)
        if new.cost < now.cost:
            gain = (now.cost - new.cost) / max(now.cost, 1e-300)
            state, now = trial, new
            damping = max(damping / 10, 1e-9)
            if gain < min_gain:
                break
        else:
            promised = -(now.gradient @ step) - 0.5 * step @ now.information @ step
            damping *= 10
            if promised < min_gain * now.cost or damping > MAX_DAMPING:
                break
    return state
