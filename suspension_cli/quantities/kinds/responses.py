"""Responses at one frequency, ratios of two, and the cross-coupling of an analysis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.linear import signals
from suspension_cli.linear.signals import Signal
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved
from suspension_cli.studies import builds, interpolated

if TYPE_CHECKING:
    from jaxtyping import Complex

COUPLING = "coupling"
"""Name of the cross-coupling that the analysis is about."""
SYNTAX = "write OUTPUT/INPUT:FREQUENCY or OVER/UNDER/INPUT:FREQUENCY, in Hz: test.x/support.x:10"


@dataclass(frozen=True)
class Ratio(Quantity):
    """Response of a motion to an input, or ratio of two motions for one input; complex.

    Attributes
    ----------
    under
        The motion that divides; None for a response.
    frequency
        Hz.
    """

    over: Signal
    under: Signal | None
    input: Signal
    frequency: float

    analytic: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    missing = "has no steady state, or a response that is divided by is 0"

    @property
    def function_count(self) -> int:
        """Numerator and denominator."""
        return 2

    def functions(self, solved: Solved) -> Complex[np.ndarray, "design 2"]:
        """Numerator and denominator, both times the determinant of the dynamic stiffness.

        So they are analytic also where a mode crosses the frequency.
        """
        own = interpolated.determinants(solved.found.model, 2 * np.pi * self.frequency)
        over = own * solved.response(self.input, self.over, self.frequency)
        under = own
        if self.under is not None:
            under = own * solved.response(self.input, self.under, self.frequency)
        return np.stack([over, under], axis=1)

    def of_functions(
        self, functions: Complex[np.ndarray, "design 2"]
    ) -> Complex[np.ndarray, " design"]:
        """Divide the numerator by the denominator."""
        return builds.divide(functions[:, 0], functions[:, 1])

    @property
    def needs(self) -> Needs:
        """Both motions at its frequency."""
        outputs = (self.over,) if self.under is None else (self.over, self.under)
        return Needs(inputs=(self.input,), outputs=outputs, frequency=(self.frequency,))

    def read(self, solved: Solved) -> Complex[np.ndarray, " design"]:
        """Read the response, or divide two; exactly 0 where a symmetry makes it vanish."""
        over = solved.response(self.input, self.over, self.frequency)
        if self.under is None:
            return over
        return builds.divide(over, solved.response(self.input, self.under, self.frequency))


def quotient_unit(over: Signal, under: Signal) -> str:
    """Unit of the ratio of two signals, ``m/(N m)``."""
    if over.unit == under.unit:
        return "1"
    return f"{over.unit}/{under.unit}".replace("/N m", "/(N m)")


def parse_paths(text: str, names: Names, option: str) -> tuple[Signal, Signal | None, Signal]:
    """Parse ``OUTPUT/INPUT`` or ``OVER/UNDER/INPUT``; raises `InputError`."""
    parts = [part.strip() for part in text.split("/")]
    if len(parts) not in (2, 3):
        raise InputError.of(option, "is no response", SYNTAX, format_value(text))
    *motions, drive = (signals.parse(part, option, names.signals) for part in parts)
    problem, remedy = "", ""
    if wrong := [signal for signal in motions if signal.acts]:
        problem = f"{wrong[0].text} is an input"
        remedy = "divide a motion by it"
    elif not signals.is_input(drive):
        problem = f"{drive.text} is an output"
        force = f"{drive.body}.{signals.FORCES[drive.dof]}"
        remedy = f"end with support.x, or a force such as {force}"
    if problem:
        raise InputError.of(option, problem, remedy, format_value(text))
    return motions[0], motions[1] if len(motions) > 1 else None, drive


def parse_numbers(text: str, count: int) -> tuple[str, list[float]] | None:
    """Split ``WHAT:NUMBER:NUMBER`` into what and its numbers, if there are so many.

    >>> parse_numbers("test.x/support.x:0.1:5", 2)
    ('test.x/support.x', [0.1, 5.0])
    """
    what, *given = text.rsplit(":", count)
    if len(given) != count:
        return None
    try:
        numbers = [float(number) for number in given]
    except ValueError:
        return None
    return (what.strip(), numbers) if all(map(math.isfinite, numbers)) else None


def write_number(number: float) -> str:
    """Write a number of a name, in full, so that no two quantities have one name.

    >>> write_number(10.0), write_number(0.40111234567)
    ('10', '0.40111234567')
    """
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def write_paths(paths: str) -> str:
    """Write ``OUTPUT/INPUT`` or ``OVER/UNDER/INPUT`` without blanks."""
    return "/".join(part.strip() for part in paths.split("/"))


def parse_ratio(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``test.x/support.x:10`` and ``test.x/test.z/support.z:50``."""
    if "/" not in text or " " in text.partition("/")[0].strip():
        return None
    given = parse_numbers(text, 1)
    if given is None or not 0 <= given[1][0] < 1e9:
        raise InputError.of(option, "is no response", SYNTAX, format_value(text))
    paths, [frequency] = given
    over, under, drive = parse_paths(paths, names, option)
    name = f"{write_paths(paths)}:{write_number(frequency)}"
    unit = quotient_unit(over, under or drive)
    return Ratio(name, unit, over, under, drive, frequency)


def parse_coupling(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``coupling``: that of the options of the analysis, at its last frequency."""
    if text != COUPLING:
        return None
    return replace(names.coupling, text=COUPLING)


KINDS = (
    Kind(
        "OUTPUT/INPUT:FREQUENCY, OVER/UNDER/INPUT:FREQUENCY",
        "test.x/support.x:10",
        "of the signals",
        "magnitude of a response, or of the ratio of two, at a frequency in Hz",
        parse_ratio,
    ),
    Kind(
        COUPLING,
        COUPLING,
        "1",
        "magnitude of the cross-coupling of [analysis.xcouple], or of the command's options",
        parse_coupling,
    ),
)
