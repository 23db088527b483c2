"""What stands in which column of the tables that one stage of the renderer hands to the next."""

from __future__ import annotations

from enum import IntEnum


class BlendColumn(IntEnum):
    """Of the table that blending gathers from, a row for each splat.

    The exponent of a splat is log_opacity - (l1 dx + l2 dy)^2 - (l3 dy)^2, with l1, l2 and l3 divided by sqrt(2); XX, XY and YY
    are its coefficients of dx^2, dx dy and dy^2. From FEATURES on: red, green, blue, 1, and room for the depth and its square.
    """

    X = 0
    Y = 1
    Z = 2
    L1 = 3
    L2 = 4
    L3 = 5
    LOG_OPACITY = 6
    XX = 7
    XY = 8
    YY = 9
    FEATURES = 10


# A row fills one cache line (16 floats), so that reading a pair of splat and tile costs one cache miss.
BLEND_COLUMNS = 16


class EllipseColumn(IntEnum):
    """Of the table that binning into tiles gathers from, a row for each splat.

    X and Y: the centre less half a pixel; SKEW: l2 / l1; INVERSE_L1: 1 / l1. X, SKEW and INVERSE_L1 are in tiles. CUT: the
    value of the quadratic form at which alpha is 1/255; TILT: the dy of the rightmost point of that ellipse.
    """

    X = 0
    SKEW = 1
    INVERSE_L1 = 2
    Y = 3
    L3 = 4
    CUT = 5
    TILT = 6


ELLIPSE_COLUMNS = 8
