"""Results of builds and requirements on them, by name.

A quantity is the frequency of a mode (by label or number), ``coupling`` (the magnitude of the
analysis' cross-coupling at its last frequency), a static displacement or rotation such as ``test
static pitch``, or the magnitude of a named response (`linear.named_results`). A requirement is
``QUANTITY in LEAST:LARGEST``, or ``QUANTITY < LIMIT`` or ``QUANTITY > LIMIT`` for magnitudes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.faults import suggest
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError, format_value, gather
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.named_results import Mode, Ratio

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

    from suspension_cli.files.hdf5 import Stored

COUPLING = "coupling"
"""Name of the cross-coupling of the analysis."""
STATIC = {"x": "m", "y": "m", "height": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}
"""Units of the static displacements and rotations of a body, in the order of its coordinates."""
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
    signed
        Whether a complex result is taken with its sign (see `with_sign`) instead of its magnitude.
    """

    name: str
    unit: str
    column: str
    place: tuple[int, ...]
    ratio: Ratio | None = None
    signed: bool = False

    @property
    def displayed(self) -> tuple[str, float]:
        """Unit in which values are shown, "" for ratios, and the factor from SI to it."""
        name, factor = DISPLAYED.get(self.unit, (self.unit, 1.0))
        return ("" if name == "1" else name), factor

    def read(self, group: Stored, builds: slice = slice(None)) -> Float[np.ndarray, " build"]:
        """Read the values in builds; NaN where a build failed."""
        values = group[self.column][(builds, *self.place)]
        if self.signed:
            return with_sign(values)
        return np.abs(values) if np.iscomplexobj(values) else values


RATIO = Quantity(COUPLING, "1", "ratio", (-1,))
"""The cross-coupling."""
SIGNED = Quantity("coupling with its sign", "1", "ratio", (-1,), signed=True)
"""The same with its sign."""


def with_sign(ratio: Complex[np.ndarray, " build"]) -> Float[np.ndarray, " build"]:
    """Parts of complex numbers along the phase in which they vary most; NaN of NaN.

    Small imperfections add up with their signs, which magnitudes hide. Real ratios are unchanged.

    >>> with_sign(np.array([2.0, -1.0, 0.5]) * (1 + 0j))
    array([ 2. , -1. ,  0.5])
    """
    known = ratio[np.isfinite(ratio)]
    if not len(known):
        return np.full(len(ratio), np.nan)
    phase = np.angle(((known - known.mean()) ** 2).sum()) / 2
    return (ratio * np.exp(-1j * phase)).real


@dataclass(frozen=True)
class Requirement:
    """A requirement on one quantity.

    Attributes
    ----------
    quantity
        Its name.
    low, high
        Least and largest value, SI; infinite without limit.
    magnitude
        Whether the limit is on the magnitude, which must not equal it.
    key
        Key or option that gave it, for error messages.
    """

    quantity: str
    low: float
    high: float
    magnitude: bool
    key: str = field(default="--require", compare=False)

    @property
    def text(self) -> str:
        """Text for ``--require``, exact to the last digit."""
        low, high = self.low, self.high
        if not self.magnitude:
            return f"{self.quantity} in {low!r}:{high!r}"
        return f"{self.quantity} " + (f"< {high!r}" if high < math.inf else f"> {low!r}")

    def describe(self, quantity: Quantity) -> str:
        """Describe it in usual units, with the unique name of its quantity."""
        unit, per = quantity.displayed
        low, high = self.low * per, self.high * per
        if not self.magnitude:
            return f"{quantity.name} in {low:g} to {high:g} {unit}".rstrip()
        name = f"|{quantity.name}|" if quantity.column == "static" else quantity.name
        limit = f"< {high:g}" if high < math.inf else f"> {low:g}"
        return f"{name} {limit} {unit}".rstrip()

    def is_met(self, values: Float[np.ndarray, " build"]) -> Bool[np.ndarray, " build"]:
        """Whether builds with these values meet it; failed builds (NaN) do not."""
        if self.magnitude:
            size = np.abs(values)
            return (size > self.low) & (size < self.high)
        return (values >= self.low) & (values <= self.high)


def requirements(design: Design, options: Sequence[str]) -> tuple[Requirement, ...]:
    """Parse the requirements of a design and of ``--require``.

    Raises `InputError` with the faults of all; the names of quantities are not looked up.
    """
    found = []
    for n, one in enumerate(design.tolerance.require if design.tolerance else (), 1):
        low, high = one.band or (one.above or -math.inf, one.below or math.inf)
        key = f"tolerance.require.{n}.quantity"
        found.append(Requirement(one.quantity, low, high, one.band is None, key))
    return tuple(dict.fromkeys((*found, *gather(parse, options))))


def parse(text: str) -> Requirement:
    """Parse one requirement as ``--require`` takes it."""

    def refused(problem: str, remedy: str = SYNTAX) -> InputError:
        return InputError.of("--require", problem, remedy, format_value(text))

    found = re.fullmatch(r"\s*(.+?)\s+(in)\s+([^:\s]+)\s*:\s*([^:\s]+)\s*", text)
    found = found or re.fullmatch(r"\s*([^<>]+?)\s*([<>])\s*([^\s<>]+)\s*", text)
    if found is None:
        raise refused("is no requirement")
    name, sign, *words = found.groups()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise refused("has a limit that is no number") from None
    if not np.isfinite(numbers).all():
        raise refused("has a limit that is not finite")
    if sign == "in":
        low, high = numbers
        if not low < high:
            raise refused("is a reversed or empty band", "give LEAST:LARGEST")
        return Requirement(name, low, high, magnitude=False)
    [limit] = numbers
    if not limit > 0:
        problem = "limits a magnitude to a value that is not positive"
        raise refused(problem, "give a positive limit")
    low, high = (-math.inf, limit) if sign == "<" else (limit, math.inf)
    return Requirement(name, low, high, magnitude=True)


def of_modes(modes: Modes) -> list[Quantity]:
    """List the frequencies of all modes."""
    names = named_results.labels(modes)
    return [Quantity(name, "Hz", "frequency", (n,)) for n, name in enumerate(names)]


def of_stages(stages: Sequence[str]) -> list[Quantity]:
    """List all static displacements and rotations."""
    return [
        Quantity(f"{stage} static {name}", unit, "static", (n, i))
        for n, stage in enumerate(stages)
        for i, (name, unit) in enumerate(STATIC.items())
    ]


def find(
    name: str, key: str, modes: Modes, stages: Sequence[str], known: tuple[str, ...]
) -> Quantity:
    """Find a quantity by name; that of a response has no place yet.

    `modes` are the nominal ones, `known` the bodies with signals, and `key` is the key or option to
    name in error messages.
    """
    name = " ".join(name.split())
    if name.endswith(" static z"):
        name = f"{name[:-1]}height"
    every = {one.name: one for one in (*of_modes(modes), RATIO, *of_stages(stages))}
    if name in every:
        return every[name]
    if "/" in name or name.isdigit() or name in modes.label:
        [found] = named_results.parse([name], modes, known if "/" in name else (), key)
        if isinstance(found, Mode):
            return every[found.text]
        return Quantity(found.text, found.unit, "response", (), found)
    remedy = suggest(name, [*every])
    if not remedy.startswith("did you mean"):
        remedy = (
            "give a mode's label (pendsus modes lists them), coupling, STAGE static"
            f" {'|'.join(STATIC)}, or a response OUTPUT/INPUT:FREQUENCY"
        )
    raise InputError.of(key, "is no quantity of builds", remedy, format_value(name))
