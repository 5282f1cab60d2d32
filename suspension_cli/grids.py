"""Grids as users write them: ``start:stop:count[:log|lin]``, a comma list, or a single number."""

from __future__ import annotations

import math

from suspension_cli.errors import Fault, InputError, shown

MAX_POINTS = 10_000_000
"""Longest grid; more is a slip of the keyboard."""


def grid(text: str, option: str, default: str = "lin", *, lowest: float = -math.inf) -> list[float]:
    """The numbers that a grid stands for.

    Parameters
    ----------
    text : str
    option : str
        The option that it was given to, for faults.
    default : {"lin", "log"}
        Spacing if the grid does not say.
    lowest : float
        Every number must lie above it.

    Raises
    ------
    InputError
        If it is no grid.
    """
    remedy = "write start:stop:count[:log|lin], numbers with commas, or one number"
    try:
        values = _colon(text, default) if ":" in text else [float(part) for part in text.split(",")]
    except (ValueError, OverflowError) as error:
        raise InputError([Fault(option, f"is no grid ({error})", remedy, shown(text))]) from None
    if not values or not all(math.isfinite(value) and value > lowest for value in values):
        bound = "" if lowest == -math.inf else f" above {lowest:g}"
        raise InputError([Fault(option, f"must hold finite numbers{bound}", remedy, shown(text))])
    return values


def _colon(text: str, default: str) -> list[float]:
    parts = text.split(":")
    if len(parts) < 3:
        raise ValueError("the count is missing")
    start, stop, number, *spacing = parts
    if len(spacing) > 1 or (spacing and spacing[0] not in ("lin", "log")):
        raise ValueError("spacing is lin or log")
    first, last, count = float(start), float(stop), int(number)
    if not 1 <= count <= MAX_POINTS:
        raise ValueError(f"count is from 1 to {MAX_POINTS}")
    if count == 1:
        return [first]
    steps = range(count)
    if (spacing or [default])[0] == "lin":
        return [first + (last - first) * n / (count - 1) for n in steps[:-1]] + [last]
    if first <= 0 or last <= 0:
        raise ValueError("a log grid needs positive ends")
    ratio = math.log(last / first)
    return [first * math.exp(ratio * n / (count - 1)) for n in steps[:-1]] + [last]
