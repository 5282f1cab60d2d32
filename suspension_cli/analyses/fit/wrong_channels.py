"""Channels that the file of measurements describes wrongly: exchanged, scaled, inverted.

Before a fit, measured and computed functions are compared in two ways that resonances at wrong
frequencies hardly affect: ln magnitudes, with heavily damped modes in the model, up to a largest
difference; and the phase between both, which is wrong only between a measured resonance and the
computed one. The change of a channel that improves the agreement most is made, until none does
enough. After a fit, chi^2 of every alternative is computed with the fitted parameters.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.measurements.transfer_function import TABLES, Channels

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

SIGN, EXCHANGE, FACTOR = "sign", "exchange", "factor"
HEAVY = 1 / 20
"""Added damping 1/Q of all modes of the model in that comparison."""
LARGEST = 3.0
"""Largest difference of ln magnitudes that counts."""
ASSUMED = 0.25
"""Decrease of the disagreement per function of a channel from which a change is assumed."""
SCALED = 0.4
"""ln of the least factor that is assumed before a fit."""
FACTOR_KNOWN = 0.5
"""Relative uncertainty of a gain that is off by a factor."""
SURE = 0.15
"""Least mean cosine of the phase between measured and computed values that are not noise."""
CLEAR = 3.0
"""Least size of values whose phase counts, standard deviations."""
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
ALIKE = 0.98
"""Fraction of the best improvement from which another channel explains the data as well."""


@dataclass(frozen=True)
class Correction:
    """A change of a channel that the data require.

    Attributes
    ----------
    kind
        ``"sign"``, ``"exchange"`` or ``"factor"``.
    side
        0 for sensors, 1 for actuators.
    channel
        The channel, or the two that are exchanged.
    factor
        On the gain; 1 for an exchange.
    known
        Whether the file of measurements says otherwise; False for a sign that it leaves open.
    also
        Another channel whose change explains the data as well; "" if there is none.
    chi_squared
        chi^2 with the fitted parameters but without this change; NaN where not computed.
    """

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
        gain = channels.transducer[self.side][name].gain
        gain = gain / self.factor if undo else gain * self.factor
        return channels.with_transducer(self.side, name, gain=gain)

    def is_undone_by(self, other: Correction) -> bool:
        """Whether another exchange, or change of sign, is the same."""
        mine, its = ((one.kind, one.side, {*one.channel}) for one in (self, other))
        return mine == its

    @property
    def text(self) -> str:
        """The change in words."""
        table, name = TABLES[self.side], " and ".join(self.channel)
        if self.kind == EXCHANGE:
            other = f" (or {self.also})" if self.also else ""
            return f"{table}s {name} are exchanged{other}"
        other = f" (or of {self.also})" if self.also else ""
        if self.kind == SIGN:
            return (
                f"the sign of {table} {name}{other} {'is wrong' if self.known else 'is negative'}"
            )
        size = name_factor(self.factor)
        return f"the gain of {table} {name}{other} is {size} times the one given"


def name_factor(factor: float) -> str:
    """Name a factor and its usual cause.

    >>> name_factor(3.15)
    '3.15 (the root of 10: a missing calibration, or 10 dB)'
    """
    text = f"{factor:.3g}"
    for value, name in KNOWN_FACTORS:
        for known, form in ((value, name), (1 / value, f"inverse of {name}")):
            if abs(math.log(abs(factor) / known)) < NEAR_FACTOR:
                return f"{text} ({form})"
    return text


def guess(problem: Problem, z: Array) -> tuple[list[Correction], Channels]:
    """Find exchanged, scaled and inverted channels before a fit."""
    channels, found = problem.channels, list[Correction]()
    while len(found) < 2 * (len(channels.names(0)) + len(channels.names(1))):
        gains = _improvements(replace(problem, channels=channels), z)
        if not gains:
            break
        gain, best = max(gains, key=lambda item: (round(item[0], 3), -item[1].side))
        same = [
            one
            for g, one in gains
            if (one.kind, one.side) == (best.kind, 1 - best.side) and g > ALIKE * gain
        ]
        if same and best.known:
            table, names = TABLES[same[0].side], " and ".join(same[0].channel)
            also = f"{table}{'s' if best.kind == EXCHANGE else ''} {names}"
            best = replace(best, also=also)
        found.append(best)
        channels = best.apply(channels)
    for one in found:
        if one.kind == FACTOR:
            wide = {"gain_uncertainty": FACTOR_KNOWN}
            channels = channels.with_transducer(one.side, one.channel[0], **wide)
    return sorted(found, key=lambda one: one.kind), channels


def _improvements(problem: Problem, z: Array) -> list[tuple[float, Correction]]:
    """Rate all changes that reduce the disagreement enough."""
    found, channels = [], problem.channels
    before, shift = _disagreement(problem, z)
    for change in _changes(channels, EXCHANGE, FACTOR, SIGN):
        rows = [channels.names(change.side).index(name) for name in change.channel]
        mine = np.isin(np.array(channels.pairs)[:, change.side], rows)
        sure = mine & np.isfinite(shift)
        if change.kind == FACTOR:
            by = float(np.median(shift[sure])) if sure.any() else 0.0
            if abs(by) < SCALED:
                continue
            change = replace(change, factor=math.exp(by))
        after, _ = _disagreement(replace(problem, channels=change.apply(channels)), z)
        gain = float((before - after)[mine].sum())
        doubt = ASSUMED * (mine if change.kind == EXCHANGE else sure).sum()
        if gain > (doubt if change.known else 0.0):
            found.append((gain, change))
    return found


def _changes(channels: Channels, *kinds: str) -> Iterator[Correction]:
    """All changes of some kinds."""
    for kind, (side, items) in itertools.product(kinds, enumerate(channels.transducer)):
        if kind == EXCHANGE:
            yield from (Correction(kind, side, pair) for pair in itertools.combinations(items, 2))
        for name, item in items.items() if kind != EXCHANGE else ():
            known = item.sign_known or kind == FACTOR
            yield Correction(kind, side, (name,), -1.0, known)


def _disagreement(problem: Problem, z: Array) -> tuple[Array, Array]:
    """Compare measured and computed functions.

    Returns
    -------
    disagreement
        Mean difference of ln magnitudes up to `LARGEST`, with heavily damped modes, less the mean
        cosine of the phase (0 where unknown), per function.
    shift
        Median difference of ln magnitudes; NaN where the phases do not agree either way.
    """
    heavy, rows = z.copy(), []
    heavy[problem.parts[2]] = math.log(HEAVY)
    computed = zip(problem.readings(z), problem.readings(heavy), strict=True)
    for (value, damped), item in zip(computed, problem.channels.function, strict=True):
        level, own, other = (
            np.log(np.maximum(np.abs(part), item.uncertainty))
            for part in (item.value, value, damped)
        )
        clear = np.minimum(np.abs(value), np.abs(item.value)) > CLEAR * item.uncertainty
        turn = np.cos(np.angle(np.conj(value[clear]) * item.value[clear]))
        cosine = min(1.0, 5 * clear.mean()) * turn.mean() if clear.sum() > 3 else 0.0
        distance = np.minimum(np.abs(level - other), LARGEST).mean()
        shift = np.median(level - own) if abs(cosine) > SURE else np.nan
        rows.append((distance - cosine, shift))
    disagreement, shift = np.array(rows, dtype=float).T
    return disagreement, shift


def alternatives(problem: Problem, z: Array) -> list[Correction]:
    """Rate changes of a sign and exchanges of two channels by chi^2 at z, best first."""
    rated = []
    for one in _changes(problem.channels, SIGN, EXCHANGE):
        changed = replace(problem, channels=one.apply(problem.channels))
        rated.append(replace(one, chi_squared=changed.chi_squared(z)))
    return sorted(rated, key=lambda one: one.chi_squared)
