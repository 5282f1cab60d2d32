"""Points evenly spaced on circles, with mirror images that agree to the last bit."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

STEPS = 24
"""Angles within rounding of n/24 of a quarter turn are taken as exactly that."""


def direction(phase: complex, number: int, count: int) -> tuple[Any, Any]:
    """Cosine and sine of the angle of one of `count` points evenly spaced on a circle.

    Point 0 is at the angle `phase` (rad), which may carry a complex step.
    """
    quarters = Fraction(4 * number, count)
    turns = phase.real / (math.pi / 2)
    nearest = Fraction(round(turns * STEPS), STEPS)
    if abs(turns - nearest) < 1e-9:
        exact = nearest + quarters
        whole = round(exact)
        rest = float(exact - whole) * math.pi / 2
    else:
        whole, rest = 0, phase.real + float(quarters) * math.pi / 2
    x, y = math.cos(rest), math.sin(rest)
    for _ in range(whole % 4):
        x, y = -y, x
    if isinstance(phase, complex):
        x, y = x - 1j * phase.imag * y, y + 1j * phase.imag * x
    return x, y
