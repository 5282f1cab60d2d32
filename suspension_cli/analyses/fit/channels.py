"""Readings of sensors per drive of actuators, with nuisance parameters.

A sensor reads g exp(-i omega tau) (signal + sum of m_j other_j). An actuator exerts the same
combination of forces per unit of drive. With the responses H of the signals, the readings per drive
are P = S H A, where S and A are the matrices of sensors and actuators.
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
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.analyses.fit.array_types import Frequencies

TABLES = ("sensor", "actuator")
"""Their tables in files of measurements."""
GAIN, DELAY, MIX = "gain", "delay", "mix"


@dataclass(frozen=True)
class Nuisance:
    """One unknown property of a sensor or an actuator, 0 at its nominal value.

    Attributes
    ----------
    side
        0 for a sensor, 1 for an actuator.
    kind
        ``"gain"`` (relative), ``"delay"`` (s) or ``"mix"`` (amount of `other`).
    sigma
        Standard deviation of the prior around 0.
    other
        A signal in the channel beside its own.
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
                if item.gain_uncertainty is not None:
                    found.append(Nuisance(side, name, GAIN, item.gain_uncertainty))
                if item.delay_uncertainty is not None:
                    found.append(Nuisance(side, name, DELAY, item.delay_uncertainty))
                found += [
                    Nuisance(side, name, MIX, sigma, other)
                    for other, sigma in item.mix_uncertainty.items()
                ]
        return tuple(found)

    @cached_property
    def grids(self) -> tuple[tuple[Array, tuple[int, ...]], ...]:
        """Each grid of frequencies, Hz, and the numbers of the functions on it."""
        groups: dict[bytes, list[int]] = {}
        for n, item in enumerate(self.function):
            groups.setdefault(np.asarray(item.frequency, dtype=float).tobytes(), []).append(n)
        return tuple(
            (np.asarray(self.function[own[0]].frequency, dtype=float), tuple(own))
            for own in groups.values()
        )

    def names(self, side: int) -> tuple[str, ...]:
        """Names of the sensors (side 0) or the actuators (1)."""
        return tuple(self.transducer[side])

    def pair(self, n: int) -> tuple[int, int]:
        """Numbers of the sensor and the actuator of a function."""
        item = self.function[n]
        return self.names(0).index(item.output), self.names(1).index(item.input)

    def with_transducer(self, side: int, name: str, **change: object) -> Channels:
        """Replace properties of a sensor or an actuator."""
        both = [dict(items) for items in self.transducer]
        both[side][name] = msgspec.structs.replace(both[side][name], **change)
        return replace(self, transducer=(both[0], both[1]))

    def with_exchange(self, side: int, first: str, second: str) -> Channels:
        """Exchange signal and mix of two sensors or two actuators."""
        items = self.transducer[side]
        a, b = items[first], items[second]
        one = self.with_transducer(side, first, signal=b.signal, mix=b.mix)
        return one.with_transducer(side, second, signal=a.signal, mix=a.mix)

    def matrices(
        self, omega: Frequencies, values: dict[Nuisance, float]
    ) -> tuple[
        tuple[Float[np.ndarray, "sensor output"], Complex[np.ndarray, "sensor frequency"]],
        tuple[Float[np.ndarray, "actuator input"], Complex[np.ndarray, "actuator frequency"]],
    ]:
        """Compute the signals in each channel and its factor, for sensors and actuators."""
        found = []
        for side, items in enumerate(self.transducer):
            texts = [signal.text for signal in self.signal[side]]
            content = np.zeros((len(items), len(texts)))
            factor = np.empty((len(items), len(omega)), dtype=complex)
            for row, (name, item) in enumerate(items.items()):
                content[row, texts.index(item.signal)] += 1.0
                for other, amount in item.mix.items():
                    content[row, texts.index(other)] += amount
                factor[row] = item.gain * np.exp(-1j * omega * item.delay)
                for nuisance, value in values.items():
                    if (nuisance.side, nuisance.channel) == (side, name):
                        if nuisance.kind == GAIN:
                            factor[row] *= 1 + value
                        elif nuisance.kind == DELAY:
                            factor[row] *= np.exp(-1j * omega * value)
                        else:
                            content[row, texts.index(nuisance.other)] += value
            found.append((content, factor))
        return found[0], found[1]

    def combine(
        self,
        response: Complex[np.ndarray, "frequency output input"],
        omega: Frequencies,
        values: dict[Nuisance, float],
    ) -> Complex[np.ndarray, "frequency sensor actuator"]:
        """Compute readings per drive from responses of the signals."""
        (sensors, read), (actuators, drive) = self.matrices(omega, values)
        inner = response
        if not _plain(sensors):
            inner = sensors @ inner
        if not _plain(actuators):
            inner = inner @ actuators.T
        return inner * read.T[:, :, None] * drive.T[:, None, :]

    def differentiate(
        self,
        response: Complex[np.ndarray, "frequency output input"],
        omega: Frequencies,
        values: dict[Nuisance, float],
        nuisance: Nuisance,
    ) -> Complex[np.ndarray, "frequency sensor actuator"]:
        """Differentiate readings per drive by a nuisance parameter."""
        (sensors, read), (actuators, drive) = self.matrices(omega, values)
        side, row = nuisance.side, self.names(nuisance.side).index(nuisance.channel)
        own = (slice(None), row) if side == 0 else (slice(None), slice(None), row)
        result = np.zeros((len(omega), len(sensors), len(actuators)), dtype=complex)
        if nuisance.kind == MIX:
            place = [signal.text for signal in self.signal[side]].index(nuisance.other)
            if side == 0:
                part = response[:, place] @ actuators.T
            else:
                part = response[:, :, place] @ sensors.T
            both = read.T[:, :, None] * drive.T[:, None, :]
            result[own] = part * both[own]
            return result
        whole = self.combine(response, omega, values)[own]
        if nuisance.kind == GAIN:
            result[own] = whole / (1 + values.get(nuisance, 0.0))
        else:
            result[own] = -1j * omega[:, None] * whole
        return result


def _plain(content: Float[np.ndarray, "channel signal"]) -> bool:
    """Whether every channel is one signal, in the order of the signals."""
    return content.shape[0] == content.shape[1] and bool((content == np.eye(len(content))).all())


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
    given = (
        {item.name: item for item in measured.sensor},
        {item.name: item for item in measured.actuator},
    )
    bad: dict[Fault, None] = {}
    used: list[dict[str, Transducer]] = [{}, {}]
    found: list[dict[str, Signal]] = [{}, {}]

    for n, item in enumerate(functions, 1):
        for side, (key, name) in enumerate((("output", item.output), ("input", item.input))):
            also = f"; or describe the channel by a [[{TABLES[side]}]]"
            if given[side]:
                also = f"; or name a [[{TABLES[side]}]] ({suggest(name, list(given[side]))})"
            if name in given[side]:
                used[side][name] = given[side][name]
            elif _parse(side, name, known, bad, f"transfer_function.{n}.{key}", also) is not None:
                used[side][name] = Transducer(name=name, signal=name)
    for side, items in enumerate(used):
        for name, item in items.items():
            for text in (item.signal, *item.mix, *item.mix_uncertainty):
                signal = _parse(side, text, known, bad, f"{TABLES[side]}.{name}")
                if signal is not None:
                    found[side][text] = signal
    if bad:
        raise InputError(list(bad))
    outputs, inputs = (tuple(side.values()) for side in found)
    return Channels((used[0], used[1]), (outputs, inputs), tuple(functions))


def _parse(
    side: int,
    text: str,
    known: tuple[str, ...],
    bad: dict[Fault, None],
    where: str,
    also: str = "",
) -> Signal | None:
    """Parse a signal; if it is none, add a fault to `bad`."""
    try:
        return (signals.parse_output, signals.parse_input)[side](text, known)
    except InputError as error:
        fault = error.faults[0]
        bad[Fault(where, fault.problem, fault.remedy + also, format_value(text))] = None
        return None
