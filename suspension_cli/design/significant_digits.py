"""Rounding of numbers that were found, to the digits that matter, before a file gets them."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context


def round_to_digits(value: float, digits: int, side: int = 0) -> float:
    """Round to significant digits: to the nearest number, or up (`side` 1) or down (-1).

    >>> round_to_digits(0.123456, 3), round_to_digits(0.123456, 3, side=1)
    (0.123, 0.124)
    """
    mode = {0: ROUND_HALF_EVEN, 1: ROUND_CEILING, -1: ROUND_FLOOR}[side]
    return float(Context(prec=digits, rounding=mode).create_decimal(value))
