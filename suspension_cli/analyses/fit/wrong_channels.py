"""Channels that the file of measurements describes wrongly: exchanged, scaled, inverted.

Before a fit, measured and computed functions are compared in two ways that resonances at wrong
frequencies hardly affect: ln magnitudes, averaged over `SMOOTH` and with heavily damped modes in
the model; and the phase between both, which is wrong only between a measured resonance and the
computed one. After a fit, chi^2 of every alternative is computed with the fitted parameters.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.channels import TABLES, Channels
from suspension_cli.analyses.fit.problem import Problem

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.scene.arrays import Array

SIGN, EXCHANGE, FACTOR = "sign", "exchange", "factor"
SMOOTH = 0.08
"""Standard deviation of the average of magnitudes over ln frequency."""
POINTS = 48
"""Frequencies at which averaged magnitudes are compared."""
HEAVY = 1 / 20
"""Added damping 1/Q of all modes of the model in that comparison."""
LARGEST = 3.0
"""Largest difference of ln magnitudes that counts."""
EXCHANGED = 0.25
"""Mean decrease of this difference per function from which an exchange is assumed."""
SCALED = 0.4
"""ln of the least factor that is assumed before a fit."""
FACTOR_KNOWN = 0.5
"""Relative uncertainty of a gain that is off by a factor."""
AGREEMENT = 0.3
"""Least mean cosine of the phase between measured and computed values for an agreement."""
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
        change = {"gain": gain / self.factor if undo else gain * self.factor}
        if self.kind == FACTOR and not undo:
            change["gain_uncertainty"] = FACTOR_KNOWN
        return channels.with_transducer(self.side, name, **change)

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
    """Find exchanged, then scaled, then inverted channels before a fit."""
    assert problem.channels is not None
    channels, compared = problem.channels, _Comparison.of(problem, z)
    found: list[Correction] = []
    for kind in (EXCHANGE, FACTOR, SIGN):
        for _ in range(len(channels.names(0)) + len(channels.names(1))):
            gains = compared.improvements(kind, channels)
            best = max(gains, key=lambda item: (round(item[0], 3), -item[1].side), default=None)
            if best is None:
                break
            gain, change = best
            same = [c for g, c in gains if c.side != change.side and g > ALIKE * gain]
            if same and change.known:
                table, names = TABLES[same[0].side], " and ".join(same[0].channel)
                also = f"{table}{'s' if kind == EXCHANGE else ''} {names}"
                change = replace(change, also=also)
            found.append(change)
            channels = change.apply(channels)
            compared = compared.changed(change, channels)
    return found, channels


@dataclass(frozen=True)
class _Comparison:
    """Measured functions beside those computed for all pairs of channels.

    Attributes
    ----------
    distance
        Mean difference of averaged ln magnitudes.
    shift
        Median of measured less computed ln magnitudes.
    cosine
        Mean cosine of the phase between measured and computed functions.
    """

    distance: Float[np.ndarray, "function sensor actuator"]
    shift: Float[np.ndarray, "function sensor actuator"]
    cosine: Float[np.ndarray, "function sensor actuator"]

    @staticmethod
    def of(problem: Problem, z: Array) -> _Comparison:
        channels = problem.channels
        assert channels is not None
        shape = (len(channels.function), len(channels.names(0)), len(channels.names(1)))
        distance, shift, cosine = np.zeros((3, *shape))
        for light, (grid, own) in zip(problem.solve_responses(z), channels.grids, strict=True):
            heavy = np.full(len(light.plant.modes.omega_squared), HEAVY)
            broad = light.plant.respond(grid, light.inputs, light.outputs, heavy)
            sharp, broad = (channels.combine(one.value, grid) for one in (light, broad))
            average = _averaging(grid)
            for n in own:
                item = channels.function[n]
                sigma, size = item.uncertainty, np.abs(item.value)
                level = np.log(np.maximum(np.abs(broad), sigma[:, None, None]))
                off = average @ np.log(np.maximum(size, sigma)) - np.tensordot(
                    level, average, (0, 1)
                )
                distance[n] = np.minimum(np.abs(off), LARGEST).mean(-1)
                shift[n] = np.median(off, axis=-1)
                clear = (size > 3 * sigma)[:, None, None] & (
                    np.abs(sharp) > 3 * sigma[:, None, None]
                )
                turn = np.cos(np.angle(np.conj(sharp) * item.value[:, None, None]))
                seen = clear.sum(0)
                part = np.where(clear, turn, 0.0).sum(0) / np.maximum(seen, 1)
                cosine[n] = part * np.minimum(1.0, 5 * seen / len(grid)) * (seen > 3)
        return _Comparison(distance, shift, cosine)

    def improvements(self, kind: str, channels: Channels) -> list[tuple[float, Correction]]:
        """Rate all changes of a kind that improve the agreement enough."""
        pairs = np.array(channels.pairs)
        every = np.arange(len(pairs))
        shift, cosine = (part[every, *pairs.T] for part in (self.shift, self.cosine))
        weight = np.minimum(np.abs(cosine) / AGREEMENT, 1.0)
        clear = np.where(np.abs(cosine) > AGREEMENT, cosine, 0.0)
        found = []
        for side in (0, 1):
            names = channels.names(side)
            for a, b in itertools.combinations(range(len(names)), 2) if kind == EXCHANGE else ():
                swapped = pairs.copy()
                swapped[:, side] = np.select(
                    [pairs[:, side] == a, pairs[:, side] == b], [b, a], pairs[:, side]
                )
                gain = (self.distance[every, *pairs.T] - self.distance[every, *swapped.T]).sum()
                if gain > EXCHANGED * np.isin(pairs[:, side], (a, b)).sum():
                    found.append((float(gain), Correction(kind, side, (names[a], names[b]))))
            for row, item in enumerate(channels.transducer[side].values()):
                mine = pairs[:, side] == row
                if kind == SIGN:
                    gain = -float(clear[mine].sum()) + (0.0 if item.sign_known else 1e-3)
                    if gain > AGREEMENT:
                        change = Correction(kind, side, (item.name,), -1.0, item.sign_known)
                        found.append((gain, change))
                elif kind == FACTOR and (mine & (weight > 0.5)).any():
                    by = float(np.median(shift[mine & (weight > 0.5)]))
                    gain = weight @ (np.abs(shift) - np.abs(shift - by * mine))
                    if abs(by) > SCALED and gain > SCALED / 2:
                        change = Correction(kind, side, (item.name,), math.exp(by))
                        found.append((float(gain), change))
        return found

    def changed(self, change: Correction, channels: Channels) -> _Comparison:
        """Compare again after a change."""
        side, names = change.side, channels.names(change.side)
        rows = [names.index(name) for name in change.channel]
        if change.kind == EXCHANGE:
            order = np.arange(len(names))
            order[rows] = rows[::-1]
            parts = (self.distance, self.shift, self.cosine)
            return _Comparison(*(part.take(order, axis=1 + side) for part in parts))
        mine = (np.array(channels.pairs)[:, side] == rows[0])[:, None, None]
        if change.kind == SIGN:
            return replace(self, cosine=np.where(mine, -self.cosine, self.cosine))
        return replace(self, shift=self.shift - math.log(change.factor) * mine)


def _averaging(frequency: Array) -> Float[np.ndarray, "place frequency"]:
    """Weights of Gaussian averages over ln frequency at `POINTS` frequencies."""
    place = np.log(frequency)
    centers = np.linspace(place[0], place[-1], POINTS)
    width = max(SMOOTH, float(place[-1] - place[0]) / POINTS / 2)
    spacing = np.gradient(place) if len(place) > 1 else np.ones(1)
    weight = np.exp(-0.5 * ((place - centers[:, None]) / width) ** 2) * spacing
    return weight / np.maximum(weight.sum(1, keepdims=True), 1e-300)


def alternatives(problem: Problem, z: Array) -> list[Correction]:
    """Rate changes of a sign and exchanges of two channels by chi^2 at z, best first."""
    channels, found = problem.channels, []
    assert channels is not None
    for side in (0, 1):
        for name, item in channels.transducer[side].items():
            found.append(Correction(SIGN, side, (name,), -1.0, known=item.sign_known))
        for pair in itertools.combinations(channels.names(side), 2):
            found.append(Correction(EXCHANGE, side, pair))
    rated = []
    for one in found:
        residual = problem.changed(channels=one.apply(channels)).residual(z)
        rated.append(replace(one, chi_squared=float(residual @ residual)))
    return sorted(rated, key=lambda one: one.chi_squared)
