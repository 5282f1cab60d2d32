"""Largest and smallest magnitudes of responses over a band of frequencies.

Resonances are narrow: the band is sampled on a grid in the logarithm of frequency and around every
mode in it, and the extreme is then searched between the neighbours of the largest sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.linear import response
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.linear.solver import Solver
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.responses import (
    parse_numbers,
    parse_paths,
    quotient_unit,
    write_number,
    write_paths,
)
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.design.schema import Design

Extreme = Literal["peak", "largest", "smallest"]
PER_DECADE = 60
"""Samples per decade of frequency."""
BESIDE = np.array([-3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0])
"""Samples around a resonance, in units of its half width f / 2Q."""
STEPS = 40
"""Golden-section steps, which narrow an interval 2e8 times."""
GOLDEN = (5**0.5 - 1) / 2


@dataclass(frozen=True)
class OverBand(Quantity):
    """Largest (``peak`` too) or smallest magnitude of a response or ratio over a band, Hz."""

    extreme: Extreme
    over: Signal
    under: Signal | None
    input: Signal
    low: float
    high: float

    bends: ClassVar[bool] = True
    slow: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    missing = "has no steady state, or an infinite response"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Search each design."""
        return solved.with_bending(lambda bent: bent.each(self._search))

    def _search(self, solver: Solver, design: Design) -> float:
        del design
        outputs = [self.over] if self.under is None else [self.over, self.under]
        drive = np.array([linear_form(self.input, solver.system)])
        rows = np.array([linear_form(signal, solver.system) for signal in outputs])
        sign = 1.0 if self.extreme == "smallest" else -1.0

        def height(frequency: Float[np.ndarray, " point"]) -> Float[np.ndarray, " point"]:
            value, _ = response.transfer(
                solver,
                2 * np.pi * frequency,
                drive,
                [self.input.acts],
                rows,
                finite=False,
                ground=[self.input.is_ground],
            )
            size = np.abs(value[:, :, 0])
            if self.under is not None:
                size[:, 0] = size[:, 0] / size[:, 1]
            return sign * size[:, 0]

        with np.errstate(all="ignore"):
            return sign * _minimise(height, self._samples(solver))

    def _samples(self, solver: Solver) -> Float[np.ndarray, " point"]:
        count = max(int(PER_DECADE * np.log10(self.high / self.low)), 2)
        modes = solver.modes
        known = np.isfinite(modes.frequency) & (modes.frequency > 0)
        width = modes.frequency[known] / (2 * np.maximum(modes.q[known], 1.0))
        beside = (modes.frequency[known, None] + BESIDE * width[:, None]).ravel()
        within = beside[(beside > self.low) & (beside < self.high)]
        return np.union1d(np.geomspace(self.low, self.high, count), within)


def _minimise(height: Callable[[Array], Array], frequency: Array) -> float:
    """Find the least value of a function of frequency between samples, by golden sections."""
    value = height(frequency)
    if not np.isfinite(value).any():
        return np.nan
    place = int(np.nanargmin(value))
    best = float(value[place])
    low = frequency[max(place - 1, 0)]
    high = frequency[min(place + 1, len(frequency) - 1)]
    for _ in range(STEPS):
        inner = np.array([high - GOLDEN * (high - low), low + GOLDEN * (high - low)])
        first, second = height(inner)
        best = min(best, float(first), float(second))
        if first < second:
            high = inner[1]
        else:
            low = inner[0]
    return best


def parse(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``peak of test.x/support.x:0.1:5``, ``largest of ...`` and ``smallest of ...``."""
    word, of, rest = text.partition(" of ")
    if not of or word not in ("peak", "largest", "smallest") or "/" not in rest:
        return None
    given = parse_numbers(rest, 2)
    if given is None or not 0 < given[1][0] < given[1][1] < 1e9:
        remedy = f"write {word} of OUTPUT/INPUT:LOW:HIGH, in Hz: {word} of test.x/support.x:0.1:5"
        raise InputError.of(option, "has no band of frequencies", remedy, format_value(text))
    paths, (low, high) = given
    over, under, drive = parse_paths(paths, names, option)
    unit = quotient_unit(over, under or drive)
    name = f"{word} of {write_paths(paths)}:{write_number(low)}:{write_number(high)}"
    return OverBand(name, unit, word, over, under, drive, low, high)


KINDS = (
    Kind(
        "peak|largest|smallest of OUTPUT/INPUT:LOW:HIGH",
        "peak of test.x/support.x:0.1:5",
        "of the signals",
        "largest or smallest magnitude of a response, or of a ratio, over a band in Hz",
        parse,
    ),
)
