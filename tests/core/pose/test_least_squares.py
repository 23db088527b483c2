"""Levenberg-Marquardt on problems whose answers are known."""

import numpy as np
import pytest

from core.pose.shared.least_squares import NormalEquations, levenberg_marquardt, newton_step


class Valley:
    """r = (2 (y - x^2), 1 - x) and two constants, least at (1, 1); counts how often it is asked."""

    asked = 0

    def __call__(self, at):
        self.asked += 1
        x, y = at
        r = np.array([2 * (y - x * x), 1 - x, 3.0, 4.0])
        J = np.array([[-4 * x, 2.0], [-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
        return NormalEquations(0.5 * float(r @ r), J.T @ r, J.T @ J)


@pytest.mark.parametrize("start", [(-1.2, 1.0), (0.0, 0.0), (2.0, -1.0)])
def test_the_bottom_of_a_bent_valley_is_found(start):
    found = levenberg_marquardt(np.array(start), Valley(), np.add)
    np.testing.assert_allclose(found, (1.0, 1.0), atol=1e-3)


def test_a_search_that_begins_at_its_end_ends_at_once():
    """There is nothing to gain there by a shorter step either."""
    problem = Valley()
    found = levenberg_marquardt(np.array([1.0, 1.0]) + 1e-13, problem, np.add)
    np.testing.assert_allclose(found, (1.0, 1.0), atol=1e-12)
    assert problem.asked <= 3


def test_equations_that_leave_a_direction_open_end_the_search_and_raise_nothing():
    assert newton_step(np.zeros((2, 2)), np.ones(2)) is None
    assert newton_step(np.array([[np.nan, 0], [0, 1.0]]), np.ones(2)) is None
    open_end = NormalEquations(1.0, np.array([1.0, np.inf]), np.diag([1.0, 0.0]))
    assert levenberg_marquardt(5.0, lambda _: open_end, lambda s, _: s + 1) == 5.0
