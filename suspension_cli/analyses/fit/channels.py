"""Readings of sensors per drive of actuators, with unknown gains, delays and mixing.

A sensor reads g exp(-i omega tau) (signal + sum of m_j other_j); an actuator exerts the same
combination of forces per unit of drive (`measurements.transfer_function`). With the responses H
of the signals, the readings per drive are S H A^T, where S and A have the weights of the signals in
sensors and actuators.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.conventions import GROUND
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Measured, Transducer
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.measurements.transfer_function import MeasuredResponse, channel_weights

if TYPE_CHECKING:
    from jaxtyping import Complex

    from suspension_cli.scene.arrays import Array

TABLES = ("sensor", "actuator")
"""Their tables in files of measurements."""
GAIN, DELAY, MIX = "gain", "delay", "mix"
STEP = 1e-3
"""Step of derivatives by a property of a channel, standard deviations of its prior."""


@dataclass(frozen=True)
class Nuisance:
    """One unknown property of a sensor (`side` 0) or an actuator (1), 0 at its nominal value.

    `kind` is ``"gain"`` (relative), ``"delay"`` (s) or ``"mix"`` (amount of the signal `other`);
    `sigma` is the standard deviation of the prior.
    """

    side: int
    channel: str
    kind: str
    sigma: float
    other: str = ""

    @property
    def name(self) -> str:
        """Key path: ``sensor.top-x.gain``, ``sensor.top-x.mix.top.y``."""
        end = f".{self.other}" if self.other else ""
        return f"{TABLES[self.side]}.{self.channel}.{self.kind}{end}"


@dataclass(frozen=True)
class Channels:
    """Sensors and actuators of measured functions.

    Attributes
    ----------
    transducer
        Sensors, then actuators, by name. A signal that is measured directly has a transducer of its
        own name.
    signal
        Signals in sensors and in actuators.
    """

    transducer: tuple[dict[str, Transducer], dict[str, Transducer]] = ({}, {})
    signal: tuple[tuple[Signal, ...], tuple[Signal, ...]] = ((), ())
    function: tuple[MeasuredResponse, ...] = ()

    @cached_property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Properties with an uncertainty in the file of measurements."""
        found = []
        for side, items in enumerate(self.transducer):
            for name, item in items.items():
                given = {(GAIN, ""): item.gain_uncertainty, (DELAY, ""): item.delay_uncertainty}
                given |= {(MIX, other): sigma for other, sigma in item.mix_uncertainty.items()}
                found += [
                    Nuisance(side, name, kind, sigma, other)
                    for (kind, other), sigma in given.items()
                    if sigma is not None
                ]
        return tuple(found)

    @cached_property
    def grids(self) -> tuple[tuple[Array, tuple[int, ...]], ...]:
        """Each grid of frequencies, Hz, and the numbers of the functions on it."""
        groups: dict[bytes, list[int]] = {}
        for n, item in enumerate(self.function):
            groups.setdefault(np.asarray(item.frequency, dtype=float).tobytes(), []).append(n)
        return tuple((np.frombuffer(grid), tuple(own)) for grid, own in groups.items())

    def names(self, side: int) -> tuple[str, ...]:
        """Names of the sensors (side 0) or the actuators (1)."""
        return tuple(self.transducer[side])

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Numbers of the sensor and the actuator of each function."""
        sensors, actuators = self.names(0), self.names(1)
        return tuple((sensors.index(f.output), actuators.index(f.input)) for f in self.function)

    def by_function(self, grids: list[np.ndarray]) -> list[np.ndarray]:
        """Select the functions from readings (... frequency sensor actuator) on each grid."""
        found: dict[int, np.ndarray] = {}
        for whole, (_, own) in zip(grids, self.grids, strict=True):
            found |= {n: whole[(..., *self.pairs[n])] for n in own}
        return [found[n] for n in range(len(found))]

    def with_transducer(self, side: int, name: str, **change: object) -> Channels:
        """Replace properties of a sensor or an actuator."""
        both = [dict(items) for items in self.transducer]
        both[side][name] = msgspec.structs.replace(both[side][name], **change)
        return replace(self, transducer=(both[0], both[1]))

    def with_exchange(self, side: int, first: str, second: str) -> Channels:
        """Exchange signal and mix of two sensors or two actuators."""
        a, b = self.transducer[side][first], self.transducer[side][second]
        one = self.with_transducer(side, first, signal=b.signal, mix=b.mix)
        return one.with_transducer(side, second, signal=a.signal, mix=a.mix)

    def with_values(self, values: Array) -> Channels:
        """Set gains, delays and mixing to fitted values of the nuisances."""
        made = self
        for one, value in zip(self.nuisances, values.tolist(), strict=True):
            item = made.transducer[one.side][one.channel]
            change: dict[str, object] = {GAIN: item.gain * (1 + value)}
            if one.kind == DELAY:
                change = {DELAY: item.delay + value}
            elif one.kind == MIX:
                change = {MIX: item.mix | {one.other: item.mix.get(one.other, 0.0) + value}}
            made = made.with_transducer(one.side, one.channel, **change)
        return made

    def weights(self, side: int, frequency: Array) -> Complex[np.ndarray, "frequency channel _"]:
        """Weights of the signals in each sensor or actuator."""
        texts = [signal.text for signal in self.signal[side]]
        items = self.transducer[side].values()
        return np.stack([channel_weights(item, texts, frequency) for item in items], 1)

    def combine(
        self, response: Complex[np.ndarray, "*more frequency output input"], frequency: Array
    ) -> Complex[np.ndarray, "*more frequency sensor actuator"]:
        """Compute readings per drive from responses of the signals."""
        return self.weights(0, frequency) @ response @ self.weights(1, frequency).swapaxes(1, 2)

    def differentiate(
        self,
        response: Complex[np.ndarray, "frequency output input"],
        frequency: Array,
        values: Array,
    ) -> Complex[np.ndarray, "nuisance frequency sensor actuator"]:
        """Differentiate readings per drive by the nuisances at these values."""
        rows = []
        for n, one in enumerate(self.nuisances):
            step = STEP * one.sigma * np.eye(len(values))[n]
            above, below = (
                self.with_values(values + move).combine(response, frequency)
                for move in (step, -step)
            )
            rows.append((above - below) / (2 * step[n]))
        size = (len(frequency), len(self.names(0)), len(self.names(1)))
        return np.array(rows, dtype=complex).reshape(-1, *size)


def build(
    measured: Measured, functions: Sequence[MeasuredResponse], system: LinearSystem
) -> Channels:
    """Find the signals of all measured functions in a design.

    Raises
    ------
    InputError
        If a function names no signal of the design and no sensor or actuator of the file.
    """
    # motions of the ground beside the support are not fitted
    known = tuple(name for name in signals.bodies_with_signals(system) if name != GROUND)
    given = [{one.name: one for one in side} for side in (measured.sensor, measured.actuator)]
    bad: dict[Fault, None] = {}
    used: tuple[dict[str, Transducer], dict[str, Transducer]] = ({}, {})
    found: list[dict[str, Signal]] = [{}, {}]

    def parse(side: int, text: str, where: str, also: str = "") -> None:
        try:
            found[side][text] = (signals.parse_output, signals.parse_input)[side](text, known)
        except InputError as error:
            fault = error.faults[0]
            bad[Fault(where, fault.problem, fault.remedy + also, format_value(text))] = None

    for n, item in enumerate(functions, 1):
        for side, (key, name) in enumerate((("output", item.output), ("input", item.input))):
            if name in given[side]:
                used[side][name] = one = given[side][name]
                for text in (one.signal, *one.mix, *one.mix_uncertainty):
                    parse(side, text, f"{TABLES[side]}.{name}")
            else:
                also = f"; or describe the channel by a [[{TABLES[side]}]]"
                if given[side]:
                    also = f"; or name a [[{TABLES[side]}]] ({suggest(name, list(given[side]))})"
                used[side][name] = Transducer(name=name, signal=name)
                parse(side, name, f"transfer_function.{n}.{key}", also)
    if bad:
        raise InputError(list(bad))
    outputs, inputs = (tuple(side.values()) for side in found)
    return Channels(used, (outputs, inputs), tuple(functions))
