"""Points evenly spaced on circles, with mirror images that agree to the last bit."""

from __future__ import annotations

import math
from fractions import Fraction

STEPS = 24
"""Angles within rounding of n/24 of a quarter turn are taken as exactly that."""


def direction(phase: float, number: int, count: int) -> tuple[float, float]:
    """Cosine and sine of the angle of one of `count` points evenly spaced on a circle.

    Point 0 is at the angle `phase` (rad).
    """
    quarters = Fraction(4 * number, count)
    turns = phase / (math.pi / 2)
    nearest = Fraction(round(turns * STEPS), STEPS)
    if abs(turns - nearest) < 1e-9:
        exact = nearest + quarters
        whole = round(exact)
        rest = float(exact - whole) * math.pi / 2
    else:
        whole, rest = 0, phase + float(quarters) * math.pi / 2
    x, y = math.cos(rest), math.sin(rest)
    for _ in range(whole % 4):
        x, y = -y, x
    return x, y
