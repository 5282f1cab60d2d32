"""What may explain measurements: wrong channels, exchanged labels, one number, a missing link."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from suspension_cli.conventions import DOFS
from suspension_cli.files.documents import Layout
from suspension_cli.measurements.transfer_function import TABLES, Channels

SIGN, EXCHANGE, FACTOR = "sign", "exchange", "factor"
KNOWN_FACTORS = (
    (1e6, "micro against SI units"),
    (1e3, "milli against SI units"),
    (180 / math.pi, "degrees against radians"),
    (math.sqrt(10), "the root of 10: a missing calibration, or 10 dB"),
    (10.0, "20 dB"),
    (2 * math.pi, "2 pi: Hz against rad/s"),
    (4.0, "4"),
    (2.0, "2: peak to peak, or one of two coils"),
    (math.sqrt(2), "the root of 2: peak against rms"),
)
"""Usual errors of calibrations."""
NEAR_FACTOR = 0.06
"""Difference of ln to one of these up to which it is named."""


@dataclass(frozen=True)
class Correction:
    """A change of one channel (`side` 0: a sensor, 1: an actuator), or of two that are exchanged.

    `kind` is ``"sign"``, ``"exchange"`` or ``"factor"``, `factor` that on the gain. `known` says
    whether the file of measurements claims otherwise, `also` names another channel whose change
    explains the data as well. `chi_squared` is that of the fitted parameters without this change.
    """

    in_json: ClassVar = Layout(
        names={
            "channel": "channels",
            "known": "claimed_otherwise",
            "chi_squared": "chi_squared_without",
        },
        also="text",
    )
    kind: str
    side: int
    channel: tuple[str, ...]
    factor: float = 1.0
    known: bool = True
    also: str = ""
    chi_squared: float = math.nan

    def apply(self, channels: Channels, *, undo: bool = False) -> Channels:
        """Make the change, or undo it."""
        if self.kind == EXCHANGE:
            return channels.with_exchange(self.side, *self.channel)
        name = self.channel[0]
        factor = 1 / self.factor if undo else self.factor
        gain = channels.transducer[self.side][name].gain * factor
        return channels.with_transducer(self.side, name, gain=gain)

    @property
    def what(self) -> str:
        """The channels in words."""
        return f"{TABLES[self.side]}{'s' * (len(self.channel) - 1)} {' and '.join(self.channel)}"

    @property
    def text(self) -> str:
        """The change in words."""
        if self.kind == EXCHANGE:
            other = f" (or {self.also})" if self.also else ""
            return f"{self.what} are exchanged{other}"
        what = f"{self.what} (or of {self.also})" if self.also else self.what
        if self.kind == SIGN:
            return f"the sign of {what} is {'wrong' if self.known else 'negative'}"
        return f"the gain of {what} is {name_factor(self.factor)} times the one given"


def name_factor(factor: float) -> str:
    """Name a factor and its usual cause.

    >>> name_factor(3.15)
    '3.15 (the root of 10: a missing calibration, or 10 dB)'
    """
    for value, name in KNOWN_FACTORS:
        for known, form in ((value, name), (1 / value, f"inverse of {name}")):
            if abs(math.log(abs(factor) / known)) < NEAR_FACTOR:
                return f"{factor:.3g} ({form})"
    return f"{factor:.3g}"


@dataclass(frozen=True)
class Exchange:
    """Two labels of an experiment (from 0) that fit better exchanged, and chi^2 of that fit."""

    experiment: int
    labels: tuple[str, str]
    chi_squared: float


@dataclass(frozen=True)
class SingleChange:
    """Fit with one parameter of the design free (its path, value and change, SI)."""

    name: str
    start: float
    change: float
    chi_squared: float


@dataclass(frozen=True)
class MissingLink:
    """A link that the design lacks, with which it fits better.

    `between` are its bodies, `stiffness` that along x, y, z and about these axes at the centre of
    mass of the first stage (N/m, N m/rad; 0 where the data do not show it), `chi_squared` that of
    the fit with the link.
    """

    between: tuple[str, str]
    stiffness: tuple[float, ...]
    chi_squared: float

    @property
    def text(self) -> str:
        """The link in words."""
        units = ("N/m",) * 3 + ("N m/rad",) * 3
        parts = [
            f"{size:.3g} {unit} ({dof})"
            for size, unit, dof in zip(self.stiffness, units, DOFS, strict=True)
            if size
        ]
        return f"between {' and '.join(self.between)} of stiffness {', '.join(parts)}"
