"""Results of builds and requirements on them, by name.

A quantity is the frequency of a mode (by label or number), ``coupling`` (the magnitude of the
analysis' cross-coupling at its last frequency), a static displacement or rotation such as ``test
static pitch``, or the magnitude of a named response (`linear.named_results`). A requirement is
``QUANTITY in LEAST:LARGEST``, or ``QUANTITY < LIMIT`` or ``QUANTITY > LIMIT`` for magnitudes.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.faults import suggest
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.named_results import Mode, Ratio

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.files.hdf5 import Stored

COUPLING = "coupling"
"""Name of the cross-coupling of the analysis."""
STATIC = ("x", "y", "height", "roll", "pitch", "yaw")
"""Coordinates of the static pose of a body."""
STATIC_UNITS = ("m", "m", "m", "rad", "rad", "rad")
"""Names of static displacements and rotations, in the order of a body's coordinates."""
SYNTAX = "write 'QUANTITY in LEAST:LARGEST', 'QUANTITY < LIMIT' or 'QUANTITY > LIMIT', in SI units"


@dataclass(frozen=True)
class Quantity:
    """One result of every build.

    Attributes
    ----------
    unit
        SI; Hz for modes.
    column, place
        Dataset with the values, and their place in a row.
    ratio
        Of a named response or coupling.
    """

    name: str
    unit: str
    column: str
    place: tuple[int, ...]
    ratio: Ratio | None = None

    @property
    def shown(self) -> tuple[str, float]:
        """Printed unit, and the factor from SI to it."""
        if self.column != "static":
            return self.unit, 1
        return DISPLAYED.get(self.unit, (self.unit, 1.0))

    def read(self, group: Stored, rows: slice = slice(None)) -> Float[np.ndarray, " build"]:
        """Read the values in builds; magnitudes if complex, NaN where a build failed."""
        values = group[self.column][(rows, *self.place)]
        return np.abs(values) if np.iscomplexobj(values) else values


RATIO = Quantity(COUPLING, "1", "ratio", (-1,))
"""The cross-coupling."""


@dataclass(frozen=True)
class Requirement:
    """A requirement on one quantity.

    Attributes
    ----------
    low, high
        Least and largest value, SI; infinite without limit.
    magnitude
        Whether the limit is on the magnitude, which must not equal it.
    """

    quantity: Quantity
    low: float
    high: float
    magnitude: bool

    @property
    def text(self) -> str:
        """Text for ``--require``, exact to the last digit."""
        name, low, high = self.quantity.name, self.low, self.high
        if not self.magnitude:
            return f"{name} in {low!r}:{high!r}"
        return f"{name} < {high!r}" if high < math.inf else f"{name} > {low!r}"

    @property
    def shown(self) -> str:
        """Text to print, in usual units."""
        unit, per = self.quantity.shown
        low, high, name = self.low * per, self.high * per, self.quantity.name
        end = f" {unit}" if unit != "1" else ""
        if not self.magnitude:
            return f"{name} in {low:g} to {high:g}{end}"
        sign, limit = ("<", high) if high < math.inf else (">", low)
        return (
            f"|{name}| {sign} {limit:g}{end}"
            if self.quantity.column == "static"
            else (f"{name} {sign} {limit:g}{end}")
        )

    def is_met(self, values: Float[np.ndarray, " build"]) -> Bool[np.ndarray, " build"]:
        """Whether builds with these values meet it; failed builds (NaN) do not."""
        if self.magnitude:
            size = np.abs(values)
            return (size > self.low) & (size < self.high)
        return (values >= self.low) & (values <= self.high)


@dataclass(frozen=True)
class Names:
    """Names that quantities of a design may have.

    Attributes
    ----------
    modes
        Nominal modes.
    known
        Bodies with signals.
    """

    modes: Modes
    stages: tuple[str, ...]
    known: tuple[str, ...]

    def every_mode(self) -> tuple[Quantity, ...]:
        """List the frequencies of all modes."""
        names = named_results.labels(self.modes)
        return tuple(Quantity(name, "Hz", "frequency", (n,)) for n, name in enumerate(names))

    def every_static(self) -> tuple[Quantity, ...]:
        """List all static displacements and rotations."""
        return tuple(
            Quantity(f"{stage} static {name}", "m" if i < 3 else "rad", "static", (n, i))
            for n, stage in enumerate(self.stages)
            for i, name in enumerate(STATIC)
        )

    def parse(self, text: str, key: str, ratios: dict[Ratio, int]) -> Quantity:
        """Parse the name of a quantity.

        Parameters
        ----------
        key
            Key or option to name in error messages.
        ratios
            Places of named responses; new ones are added.
        """
        text = " ".join(text.split())
        plain = {item.name: item for item in self.every_static()}
        if text.endswith(" static z"):
            text = f"{text[:-1]}height"
        if text == COUPLING:
            return RATIO
        if text in plain:
            return plain[text]
        if "/" in text:
            [ratio] = named_results.parse([text], self.modes, self.known, key)
            assert isinstance(ratio, Ratio)
            place = ratios.setdefault(ratio, len(ratios))
            return Quantity(ratio.text, ratio.unit, "response", (place,), ratio)
        labels = named_results.labels(self.modes)
        if text.isdigit() or text in (*labels, *self.modes.label):
            [mode] = named_results.parse([text], self.modes, (), key)
            assert isinstance(mode, Mode)
            return Quantity(mode.text, "Hz", "frequency", (mode.number,))
        close = suggest(text, [*labels, COUPLING, *plain])
        remedy = (
            close
            if close.startswith("did you mean")
            else "give a mode's label (pendsus modes lists them), coupling, STAGE static"
            f" {'|'.join(STATIC)}, or a response OUTPUT/INPUT:FREQUENCY"
        )
        raise InputError.of(key, "is no quantity of builds", remedy, format_value(text))


def requirements(
    design: Design, options: tuple[str, ...], names: Names, *, lenient: bool = False
) -> tuple[Requirement, ...]:
    """Parse the requirements of a design and of ``--require``.

    If `lenient`, those with faults are left out: another model may have a mode of that label. Else
    raises `InputError` with the faults of all.
    """
    ratios: dict[Ratio, int] = {}
    found: list[Requirement] = []
    faults: list[Fault] = []
    given = design.tolerance.require if design.tolerance else []
    for n, item in enumerate((*given, *options), 1):
        try:
            if isinstance(item, str):
                found.append(parse(item, names, ratios))
                continue
            quantity = names.parse(item.quantity, f"tolerance.require.{n}.quantity", ratios)
            low, high = item.band or (item.above or -math.inf, item.below or math.inf)
            found.append(Requirement(quantity, low, high, item.band is None))
        except InputError as error:
            faults += error.faults
    if faults and not lenient:
        raise InputError(faults)
    return tuple(dict.fromkeys(found))


def parse(
    text: str, names: Names, ratios: dict[Ratio, int], option: str = "--require"
) -> Requirement:
    """Parse one requirement as ``--require`` takes it."""

    def refused(problem: str, remedy: str = SYNTAX) -> InputError:
        return InputError.of(option, problem, remedy, format_value(text))

    band = re.fullmatch(r"\s*(.+?)\s+in\s+([^:\s]+)\s*:\s*([^:\s]+)\s*", text)
    bound = re.fullmatch(r"\s*([^<>]+?)\s*([<>])\s*([^\s<>]+)\s*", text)
    found = band or bound
    if found is None:
        raise refused("is no requirement")
    try:
        numbers = [float(word) for word in (found.groups()[1:] if band else [found[3]])]
    except ValueError:
        raise refused("has a limit that is no number") from None
    if not all(map(math.isfinite, numbers)):
        raise refused("has a limit that is not finite")
    if band:
        low, high = numbers
        if not low < high:
            raise refused("is a reversed or empty band", "give LEAST:LARGEST")
    else:
        [limit] = numbers
        if not limit > 0:
            problem = "limits a magnitude to a value that is not positive"
            raise refused(problem, "give a positive limit")
        low, high = (-math.inf, limit) if found[2] == "<" else (limit, math.inf)
    return Requirement(names.parse(found[1], option, ratios), low, high, not band)
