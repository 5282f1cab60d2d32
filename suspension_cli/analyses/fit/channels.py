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

    transducer: tuple[dict[str, Transducer], dict[str, Transducer]]
    signal: tuple[tuple[Signal, ...], tuple[Signal, ...]]
    function: tuple[MeasuredResponse, ...]

    @cached_property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Properties with an uncertainty in the file of measurements."""
        found = []
        for side, items in enumerate(self.transducer):
            for name, item in items.items():
                for kind in (GAIN, DELAY):
                    sigma = getattr(item, f"{kind}_uncertainty")
                    found += [Nuisance(side, name, kind, sigma)] if sigma is not None else []
                mixed = item.mix_uncertainty.items()
                found += [Nuisance(side, name, MIX, sigma, other) for other, sigma in mixed]
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

    def with_values(self, values: dict[Nuisance, float]) -> Channels:
        """Set gains, delays and mixing to fitted values."""
        made = self
        for one, value in values.items():
            item = made.transducer[one.side][one.channel]
            if one.kind == GAIN:
                change: dict[str, object] = {GAIN: item.gain * (1 + value)}
            elif one.kind == DELAY:
                change = {DELAY: item.delay + value}
            else:
                change = {MIX: item.mix | {one.other: item.mix.get(one.other, 0.0) + value}}
            made = made.with_transducer(one.side, one.channel, **change)
        return made

    def weights(self, side: int, frequency: Array) -> Complex[np.ndarray, "frequency channel _"]:
        """Weights of the signals in each sensor or actuator."""
        key = (side, frequency.tobytes())
        if key not in self._weights:
            texts = [signal.text for signal in self.signal[side]]
            items = self.transducer[side].values()
            rows = [channel_weights(item, texts, frequency) for item in items]
            self._weights[key] = np.stack(rows, 1)
        return self._weights[key]

    @cached_property
    def _weights(self) -> dict[tuple[int, bytes], np.ndarray]:
        return {}

    def combine(
        self, response: Complex[np.ndarray, "frequency output input"], frequency: Array
    ) -> Complex[np.ndarray, "frequency sensor actuator"]:
        """Compute readings per drive from responses of the signals."""
        return self.weights(0, frequency) @ response @ self.weights(1, frequency).swapaxes(1, 2)

    def differentiate(
        self,
        response: Complex[np.ndarray, "frequency output input"],
        frequency: Array,
        by: Nuisance,
        value: float,
    ) -> Complex[np.ndarray, "frequency sensor actuator"]:
        """Differentiate readings per drive by a property, which has this value in `self`."""
        changed = self
        if by.kind == MIX:
            changed = self.with_transducer(by.side, by.channel, signal=by.other, mix={})
        result = changed.combine(response, frequency)
        others = [n for n, name in enumerate(self.names(by.side)) if name != by.channel]
        np.moveaxis(result, 1 + by.side, 0)[others] = 0.0
        if by.kind == DELAY:
            return -2j * np.pi * frequency[:, None, None] * result
        return result / (1 + value) if by.kind == GAIN else result


NO_CHANNELS = Channels(({}, {}), ((), ()), ())


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
    used: list[dict[str, Transducer]] = [{}, {}]
    found: list[dict[str, Signal]] = [{}, {}]

    def parse(side: int, text: str, where: str, also: str = "") -> bool:
        try:
            parsed = (signals.parse_output, signals.parse_input)[side](text, known)
        except InputError as error:
            fault = error.faults[0]
            bad[Fault(where, fault.problem, fault.remedy + also, format_value(text))] = None
            return False
        found[side][text] = parsed
        return True

    for n, item in enumerate(functions, 1):
        for side, (key, name) in enumerate((("output", item.output), ("input", item.input))):
            also = f"; or describe the channel by a [[{TABLES[side]}]]"
            if given[side]:
                also = f"; or name a [[{TABLES[side]}]] ({suggest(name, list(given[side]))})"
            if name in given[side]:
                used[side][name] = given[side][name]
            elif parse(side, name, f"transfer_function.{n}.{key}", also):
                used[side][name] = Transducer(name=name, signal=name)
    for side, items in enumerate(used):
        for name, item in items.items():
            for text in (item.signal, *item.mix, *item.mix_uncertainty):
                parse(side, text, f"{TABLES[side]}.{name}")
    if bad:
        raise InputError(list(bad))
    outputs, inputs = (tuple(side.values()) for side in found)
    return Channels((used[0], used[1]), (outputs, inputs), tuple(functions))
