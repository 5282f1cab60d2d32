"""Grids of numbers: ``start:stop:count[:log|lin]``, a comma list, or a single number."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from suspension_cli.errors import InputError, format_value

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

Grid = str | tuple[float, ...]
"""A grid as its text, or as its numbers."""
HIGHEST = 1e9
"""Highest frequency of a result, Hz; numbers of far higher ones overflow."""
FEW = 12
"""Number of frequencies, as of a list, that tables show completely."""
MAX_POINTS = 10_000_000
"""Longest grid; a longer one is taken for a typing error."""


def parse_grid(
    grid: Grid,
    option: str,
    default: str = "lin",
    *,
    lowest: float = -math.inf,
    highest: float = math.inf,
) -> list[float]:
    """List the numbers of a grid that `option` gave; `default` is the spacing if it names none.

    Raises `InputError` if it is none, or not all numbers are above `lowest` and at most `highest`.

    >>> parse_grid("1:4:3:log", "--frequency")
    [1.0, 2.0, 4.0]
    >>> parse_grid((1.0, 3.0), "--frequency")
    [1.0, 3.0]
    """
    remedy = "write start:stop:count[:log|lin], numbers with commas, or one number"
    try:
        values = _parse_text(grid, default) if isinstance(grid, str) else [*grid]
    except (ValueError, OverflowError) as error:
        problem = f"is not a grid ({error})"
        raise InputError.of(option, problem, remedy, format_value(grid)) from None
    is_finite = all(map(math.isfinite, values))
    if not is_finite or not lowest < min(values) or max(values) > highest:
        bounds = [f"above {lowest:g}"] * (lowest > -math.inf)
        bounds += [f"at most {highest:g}"] * (highest < math.inf)
        problem = f"must contain finite numbers {' and '.join(bounds)}".rstrip()
        raise InputError.of(option, problem, remedy, format_value(write_grid(grid)))
    return values


def write_grid(grid: Grid) -> str:
    """Write a grid as its text; every number keeps all its digits.

    >>> write_grid((0.1, 2.0))
    '0.1,2.0'
    """
    return grid if isinstance(grid, str) else ",".join(map(repr, grid))


def is_numbers(value: object) -> bool:
    """Whether the value of an option is a grid given as its numbers."""
    return isinstance(value, tuple) and bool(value) and isinstance(value[0], float)


def parse_frequencies(grid: Grid, option: str = "--frequency") -> list[float]:
    """Parse a grid of frequencies, Hz, above 0 and at most `HIGHEST`; see `parse_grid`."""
    values = parse_grid(grid, option, "log", lowest=0.0)
    if max(values) > HIGHEST:
        problem = f"contains a frequency above {HIGHEST:g} Hz, where no suspension moves"
        remedy = "give frequencies in Hz"
        raise InputError.of(option, problem, remedy, format_value(write_grid(grid)))
    return values


def parse_band(
    text: str, option: str, *, with_zero: bool = False, before: str = ""
) -> tuple[float, float]:
    """Parse the ends of a band of frequencies, ``FROM:TO`` in Hz, above or `with_zero` from 0 on.

    `before` is what stands before it in the option, for messages.

    >>> parse_band("0.1:100", "--band")
    (0.1, 100.0)
    """
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        low = high = math.nan
    if not (low > 0 or (with_zero and low == 0)) or not low < high < math.inf:
        remedy = f"write its ends in Hz, for example {before}0.1:100"
        shown = format_value(before + text)
        raise InputError.of(option, "is no band of frequencies", remedy, shown)
    return low, high


def parse_place(text: str, count: int) -> int | None:
    """Parse a number from 1 to `count`, given instead of a name, as a place from 0.

    None for any other text; Python reads no integers of more than 4300 digits.

    >>> parse_place("2", 3), parse_place("4", 3), parse_place("test", 3), parse_place("9" * 5000, 3)
    (1, None, None, None)
    """
    is_number = text.isascii() and text.isdigit() and len(text) <= len(str(count))
    return int(text) - 1 if is_number and 1 <= int(text) <= count else None


def _parse_text(text: str, default: str) -> list[float]:
    """Numbers of the text of a grid."""
    return _range(text, default) if ":" in text else [_number(part) for part in text.split(",")]


def _range(text: str, default: str) -> list[float]:
    """Numbers of ``start:stop:count[:log|lin]``, both ends exact."""
    parts = text.split(":")
    if len(parts) < 3:
        raise ValueError("the count is missing")
    start, stop, number, *spacing = parts
    if len(spacing) > 1 or (spacing and spacing[0] not in ("lin", "log")):
        raise ValueError("the spacing must be lin or log")
    first = _number(start)
    last = _number(stop)
    last_place = parse_place(number.strip(), MAX_POINTS)
    if last_place is None:
        raise ValueError(f"the count must be an integer from 1 to {MAX_POINTS}")
    count = last_place + 1
    if count == 1:
        return [first]
    steps = range(count)
    if (spacing or [default])[0] == "lin":
        return [first + (last - first) * n / (count - 1) for n in steps[:-1]] + [last]
    if first <= 0 or last <= 0:
        raise ValueError("a log grid needs ends above 0")
    ratio = math.log(last / first)
    return [first * math.exp(ratio * n / (count - 1)) for n in steps[:-1]] + [last]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text.strip()!r} is no number") from None


def table_points(frequency: Float[np.ndarray, " frequency"]) -> list[int]:
    """Choose the points of a grid that tables show: all of a few, else the `decade_points`."""
    return list(range(len(frequency))) if are_few(frequency) else decade_points(frequency)


def are_few(frequency: Float[np.ndarray, " frequency"]) -> bool:
    """Whether tables show a row of each frequency."""
    return len(frequency) <= FEW


def decade_points(frequency: Float[np.ndarray, " frequency"]) -> list[int]:
    """Find the points of a grid nearest to 1 Hz, 10 Hz, ...; its ends if there are none."""
    import numpy as np

    low = float(frequency.min())
    high = float(frequency.max())
    first = math.ceil(math.log10(low) - 1e-9)
    last = math.floor(math.log10(high) + 1e-9)
    targets = [10.0**n for n in range(first, last + 1)] or [low, high]
    return list(dict.fromkeys(int(np.abs(np.log(frequency / at)).argmin()) for at in targets))
