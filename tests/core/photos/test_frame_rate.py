"""Frame rates: a decimal in a file's header stands for the fraction that was meant."""

from fractions import Fraction

import pytest

from core.photos.frame_rate import exact_rate


@pytest.mark.parametrize(
    ("told", "meant"),
    [
        (23.976, Fraction(24000, 1001)),
        (23.976023976, Fraction(24000, 1001)),
        (24.0, 24),
        (25.0, 25),
        (29.97, Fraction(30000, 1001)),
        (59.94, Fraction(60000, 1001)),
        (119.88, Fraction(120000, 1001)),
        (12.5, Fraction(25, 2)),
        (0.5, Fraction(1, 2)),
        (0.0, None),
        (float("nan"), None),
        (90000.0, None),
    ],
)
def test_a_rate_is_the_fraction_that_was_meant(told, meant):
    assert exact_rate(told) == meant
