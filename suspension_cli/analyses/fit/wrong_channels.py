"""Channels that are not what the file of measurements says: exchanged, of other sign, scaled.

Measured and computed functions are compared before any fit, in ways that resonances at wrong
frequencies hardly change: magnitudes as logarithms that are averaged over `SMOOTH` of the
frequency, with heavily damped modes in the model; signs by the phase between both, which is wrong
only between a measured and a computed resonance. After a fit, chi^2 of every alternative is
computed with the fitted numbers.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.channels import TABLES, Channels
from suspension_cli.analyses.fit.response_problem import ResponseProblem

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.analyses.fit.array_types import Frequencies, Unknowns

SIGN, EXCHANGE, FACTOR = "sign", "exchange", "factor"
MOST_EXCHANGES = 4
SMOOTH = 0.08
"""Standard deviation of ln frequency over which magnitudes are averaged."""
POINTS = 48
"""Frequencies at which averaged magnitudes are compared."""
HEAVY = 1 / 20
"""Added damping 1/Q of all modes of the model in that comparison."""
LARGEST = 3.0
"""Difference of ln of magnitudes from which more does not count."""
EXCHANGED = 0.25
"""Mean decrease of that difference, per function, from which an exchange is assumed."""
SCALED = 0.4
"""ln of a factor from which it is assumed before a fit."""
FACTOR_KNOWN = 0.5
"""Relative uncertainty of a gain that is off by a factor: its calibration says nothing."""
AGREEMENT = 0.3
"""Mean cosine of the phase between measured and computed values that counts as an agreement."""
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
"""Factors that calibrations are often wrong by."""
NEAR_FACTOR = 0.06
"""ln of a ratio to one of these within which it is named."""
BETTER = 0.5
"""Fraction of chi^2 to which a change must reduce it after a fit to be made."""


@dataclass(frozen=True)
class Correction:
    """A change of what a channel is, which the data require.

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
        Whether the file of measurements claims otherwise (a sign it calls unknown is found, not
        wrong).
    also
        Another channel whose change explains the data as well; "" if there is none.
    chi_squared
        chi^2 with the fitted numbers but without this change; NaN where not computed.
    """

    kind: str
    side: int
    channel: tuple[str, ...]
    factor: float = 1.0
    known: bool = True
    also: str = ""
    chi_squared: float = math.nan

    def apply(self, channels: Channels) -> Channels:
        """Make this change."""
        if self.kind == EXCHANGE:
            return channels.with_exchange(self.side, *self.channel)
        name = self.channel[0]
        item = channels.transducer[self.side][name]
        change: dict[str, object] = {"gain": item.gain * self.factor}
        if self.kind == FACTOR:
            change["gain_uncertainty"] = FACTOR_KNOWN
        return channels.with_transducer(self.side, name, **change)

    def undo(self, channels: Channels) -> Channels:
        """Undo this change."""
        if self.kind == EXCHANGE:
            return self.apply(channels)
        item = channels.transducer[self.side][self.channel[0]]
        return channels.with_transducer(self.side, self.channel[0], gain=item.gain / self.factor)

    @property
    def text(self) -> str:
        """The change in words."""
        table = TABLES[self.side]
        name = " and ".join(self.channel)
        if self.kind == EXCHANGE:
            other = f" (or {self.also})" if self.also else ""
            return f"{table}s {name} are exchanged{other}"
        other = f" (or of {self.also})" if self.also else ""
        if self.kind == SIGN:
            verb = "is wrong" if self.known else "is negative"
            return f"the sign of {table} {name}{other} {verb}"
        return f"the gain of {table} {name}{other} is {name_factor(self.factor)} times as large"


def name_factor(factor: float) -> str:
    """Name a factor, with its usual cause if it has one.

    >>> name_factor(3.15)
    '3.15 (the root of 10: a missing calibration, or 10 dB)'
    """
    text = f"{factor:.3g}"
    for value, name in KNOWN_FACTORS:
        for known, form in ((value, name), (1 / value, f"1 / {value:.4g}, inverse of {name}")):
            if abs(math.log(abs(factor) / known)) < NEAR_FACTOR:
                return f"{text} ({form})"
    return text


def guess(problem: ResponseProblem, z: Unknowns) -> tuple[list[Correction], Channels]:
    """Find exchanged, scaled and inverted channels before a fit."""
    found: list[Correction] = []
    channels = problem.channels
    compared = _Comparison.of(problem, z)
    for _ in range(MOST_EXCHANGES):
        change = compared.exchange()
        if change is None:
            break
        found.append(change)
        channels = change.apply(channels)
        compared = _Comparison.of(problem.changed(channels=channels), z)
    for make in (compared.factors, compared.signs):
        for change in make():
            found.append(change)
            channels = change.apply(channels)
    return found, channels


@dataclass(frozen=True)
class _Comparison:
    """Measured functions beside the computed ones of all pairs of channels.

    Attributes
    ----------
    measured
        Averaged ln magnitudes of the functions.
    computed
        The same of every pair of channels, at the frequencies of each function.
    agreement
        Mean cosine of the phase between the measured and the computed function.
    """

    channels: Channels
    pairs: list[tuple[int, int]]
    measured: Float[np.ndarray, "function place"]
    computed: Float[np.ndarray, "function sensor actuator place"]
    agreement: Float[np.ndarray, " function"]

    @staticmethod
    def of(problem: ResponseProblem, z: Unknowns) -> _Comparison:
        channels, now = problem.channels, problem.predict(z)
        values = problem.nuisance_values(z)
        heavy = np.full(len(now.order), HEAVY)
        count = len(channels.function)
        measured = np.zeros((count, POINTS))
        shape = (count, len(channels.names(0)), len(channels.names(1)), POINTS)
        computed, agreement = np.zeros(shape), np.zeros(count)
        for (frequency, own), light in zip(channels.grids, now.response, strict=True):
            damped = now.plant.respond(frequency, light.inputs, light.outputs, heavy)
            sharp = channels.combine(light.value, light.omega, values)
            broad = channels.combine(damped.value, damped.omega, values)
            average = _averaging(frequency)
            for n in own:
                item = channels.function[n]
                sigma = np.asarray(item.uncertainty)[:, None, None]
                level = np.log(np.maximum(np.abs(broad), sigma))
                computed[n] = np.tensordot(average, level, (1, 0)).transpose(1, 2, 0)
                size = np.log(np.maximum(np.abs(item.value), item.uncertainty))
                measured[n] = average @ size
                model = sharp[(slice(None), *channels.pair(n))]
                clear = (np.abs(item.value) > 3 * item.uncertainty) & (
                    np.abs(model) > 3 * item.uncertainty
                )
                product = np.conj(model[clear]) * item.value[clear]
                if clear.sum() > 3:
                    agreement[n] = float((np.real(product) / np.abs(product)).mean())
                    agreement[n] *= min(1.0, clear.mean() * 5)
        pairs = [channels.pair(n) for n in range(count)]
        return _Comparison(channels, pairs, measured, computed, agreement)

    def exchange(self) -> Correction | None:
        """Two channels of one side that fit best exchanged; None if none does much better."""
        gains = []
        for side in (0, 1):
            names = self.channels.names(side)
            cost, number = np.zeros((len(names), len(names))), np.zeros(len(names))
            for n, pair in enumerate(self.pairs):
                computed = self.computed[n, :, pair[1]] if side == 0 else self.computed[n, pair[0]]
                off = np.minimum(np.abs(computed - self.measured[n]), LARGEST).mean(1)
                cost[pair[side]] += off
                number[pair[side]] += 1
            for a, b in itertools.combinations(range(len(names)), 2):
                gain = cost[a, a] + cost[b, b] - cost[a, b] - cost[b, a]
                gains.append((gain, gain / max(number[a] + number[b], 1), side, names[a], names[b]))
        gains.sort(key=lambda item: (-round(item[0], 3), item[2]))
        best = next((item for item in gains if item[1] > EXCHANGED), None)
        if best is None:
            return None
        gain, _, side, first, second = best
        same = [item for item in gains if item[2] != side and item[0] > 0.98 * gain]
        also = f"{TABLES[1 - side]}s {same[0][3]} and {same[0][4]}" if same else ""
        return Correction(EXCHANGE, side, (first, second), also=also)

    def factors(self) -> list[Correction]:
        """Channels whose magnitudes are off by a factor throughout."""
        own = np.array([self.computed[n, a, b] for n, (a, b) in enumerate(self.pairs)])
        off = np.median(self.measured - own, axis=1)
        off[np.abs(self.measured - own).max(1) == 0] = 0.0
        weight = np.minimum(np.abs(self.agreement) / AGREEMENT, 1.0)
        found: list[Correction] = []
        for _ in range(4):
            best: tuple[float, int, int, float] | None = None
            for side in (0, 1):
                for row in range(len(self.channels.names(side))):
                    mine = np.array([pair[side] == row for pair in self.pairs]) & (weight > 0.5)
                    if not mine.any():
                        continue
                    shift = float(np.median(off[mine]))
                    gain = float((weight * (np.abs(off) - np.abs(off - shift * mine))).sum())
                    if abs(shift) > SCALED and (best is None or gain > best[0] + 1e-6):
                        best = (gain, side, row, shift)
            if best is None or best[0] < SCALED / 2:
                break
            gain, side, row, shift = best
            mine = np.array([pair[side] == row for pair in self.pairs])
            also = self._also(side, mine & (weight > 0.5))
            name = self.channels.names(side)[row]
            found.append(Correction(FACTOR, side, (name,), math.exp(shift), also=also))
            off = off - shift * mine
        return found

    def signs(self) -> list[Correction]:
        """Channels of other sign: as few as explain the signs of all functions."""
        left = np.where(np.abs(self.agreement) > AGREEMENT, self.agreement, 0.0)
        found: list[Correction] = []
        for _ in range(len(self.channels.names(0)) + len(self.channels.names(1))):
            best: tuple[float, int, int] | None = None
            for side in (0, 1):
                for row, item in enumerate(self.channels.transducer[side].values()):
                    mine = np.array([pair[side] == row for pair in self.pairs])
                    gain = -float(left[mine].sum()) + (1e-3 if not item.sign_known else 0.0)
                    if gain > AGREEMENT and (best is None or gain > best[0] + 1e-6):
                        best = (gain, side, row)
            if best is None:
                break
            _, side, row = best
            mine = np.array([pair[side] == row for pair in self.pairs])
            item = list(self.channels.transducer[side].values())[row]
            also = self._also(side, mine & (left != 0)) if item.sign_known else ""
            found.append(
                Correction(SIGN, side, (item.name,), -1.0, known=item.sign_known, also=also)
            )
            left = np.where(mine, -left, left)
        return found

    def _also(self, side: int, functions: Bool[np.ndarray, " function"]) -> str:
        """Name the channel of the other side that is in the same functions alone; "" if none is."""
        others = {self.pairs[n][1 - side] for n in np.flatnonzero(functions)}
        if len(others) != 1:
            return ""
        other = others.pop()
        clear = np.abs(self.agreement) > AGREEMENT
        theirs = np.array([pair[1 - side] == other for pair in self.pairs]) & clear
        if (theirs & ~functions).any():
            return ""
        return f"{TABLES[1 - side]} {self.channels.names(1 - side)[other]}"


def _averaging(frequency: Frequencies) -> Float[np.ndarray, "place frequency"]:
    """Compute the weights of Gaussian averages over ln frequency at `POINTS` frequencies."""
    place = np.log(frequency)
    centers = np.linspace(place[0], place[-1], POINTS)
    width = max(SMOOTH, float(place[-1] - place[0]) / POINTS / 2)
    spacing = np.gradient(place) if len(place) > 1 else np.ones(1)
    weight = np.exp(-0.5 * ((place - centers[:, None]) / width) ** 2) * spacing
    return weight / np.maximum(weight.sum(1, keepdims=True), 1e-300)


def alternatives(problem: ResponseProblem, z: Unknowns) -> list[Correction]:
    """Changes of one channel, or exchanges of two, with their chi^2 at the values z, best first.

    `chi_squared` is that with the change.
    """
    channels, now, found = problem.channels, problem.predict(z), []
    values = problem.nuisance_values(z)

    def chi_squared(other: Channels) -> float:
        total = 0.0
        for response, (_, own) in zip(now.response, channels.grids, strict=True):
            readings = other.combine(response.value, response.omega, values)
            for n in own:
                item = channels.function[n]
                off = (readings[(slice(None), *channels.pair(n))] - item.value) / item.uncertainty
                total += float(np.vdot(off, off).real)
        return total

    for side in (0, 1):
        for name, item in channels.transducer[side].items():
            found.append(Correction(SIGN, side, (name,), -1.0, known=item.sign_known))
        for pair in itertools.combinations(channels.names(side), 2):
            found.append(Correction(EXCHANGE, side, pair))
    rated = [replace(one, chi_squared=chi_squared(one.apply(channels))) for one in found]
    return sorted(rated, key=lambda one: one.chi_squared)
