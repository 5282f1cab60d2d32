"""Measured transfer functions, and their prediction from the responses of a model.

A sensor reads g exp(-2 pi i f tau) (signal + sum of m_j other_j); an actuator exerts the same
combination of forces per unit of drive. With the responses H of the signals of a design, the
readings per drive are S H A^T, where S and A have the weights of the signals in sensors and
actuators. Transducers are applied to the model, not to the measured data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import msgspec
import numpy as np

from suspension_cli.design.measured import Measured, Transducer
from suspension_cli.files.declared import in_unit
from suspension_cli.files.documents import Layout

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

Side = dict[str, Transducer]
"""Sensors, or actuators, by name."""
TABLES = ("sensor", "actuator")
"""Their tables in files of measurements."""
GAIN = "gain"
DELAY = "delay"
MIX = "mix"
OSEM = "osem."
"""Before the name of an OSEM of the design: its sensor as an output, its coil as an input."""
STEP = 1e-3
"""Step of derivatives by a property of a channel, standard deviations of its prior."""


@dataclass(frozen=True)
class MeasuredResponse:
    """A measured transfer function with its uncertainty, at ascending frequencies.

    `input` and `output` are signals of the design (``"upper.force_x"``, ``"upper.x"``), or actuator
    and sensor of the file of measurements; "" if unknown (a bare CSV). `value` is output over input
    in the unit `unit`: "m/N" once all calibration is applied. `uncertainty` is the standard
    deviation of real and imaginary part, NaN where unknown; `coherence`, from 0 to 1, is NaN where
    not measured. `file` is where it was read, for errors.
    """

    in_json: ClassVar = Layout(
        only="name file input output unit frequency value uncertainty coherence",
        names={"value": "real imag"},
    )
    name: str
    input: str
    output: str
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    value: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    uncertainty: Float[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    coherence: Float[np.ndarray, " frequency"]
    unit: str = ""
    file: str = ""


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
    """Sensors and actuators of measured functions, by name, and their signals of the design.

    A signal that is measured directly has a transducer of its own name.
    """

    transducer: tuple[Side, Side] = ({}, {})
    signal: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    function: tuple[MeasuredResponse, ...] = ()

    @staticmethod
    def of(measured: Measured, functions: Sequence[MeasuredResponse]) -> Channels:
        """List the sensors and actuators of measured functions, and their signals.

        >>> osem = Transducer(name="osem", signal="upper.x", mix={"upper.yaw": 0.1})
        >>> one = MeasuredResponse("a", "upper.force_x", "osem", *4 * (np.ones(1),))
        >>> Channels.of(Measured(sensor=[osem]), [one]).signal
        (('upper.x', 'upper.yaw'), ('upper.force_x',))
        """

        def used(names: list[str], among: list[Transducer]) -> Side:
            return {name: find_transducer(name, among) for name in names}

        def signals(side: Side) -> tuple[str, ...]:
            return tuple(dict.fromkeys(text for item in side.values() for text in item.signals))

        sensors = used([one.output for one in functions], measured.sensor)
        actuators = used([one.input for one in functions], measured.actuator)
        names = signals(sensors), signals(actuators)
        return Channels((sensors, actuators), names, tuple(functions))

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
    def grids(self) -> tuple[tuple[np.ndarray, tuple[int, ...]], ...]:
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
        sensors = self.names(0)
        actuators = self.names(1)
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
        a = self.transducer[side][first]
        b = self.transducer[side][second]
        one = self.with_transducer(side, first, signal=b.signal, mix=b.mix)
        return one.with_transducer(side, second, signal=a.signal, mix=a.mix)

    def with_values(self, values: np.ndarray) -> Channels:
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

    def weights(
        self, side: int, frequency: np.ndarray
    ) -> Complex[np.ndarray, "frequency channel _"]:
        """Weights of the signals in each sensor or actuator, at frequencies in Hz.

        >>> osem = Transducer(name="osem", signal="upper.x", gain=2.0, mix={"upper.y": 0.01})
        >>> channels = Channels(({"osem": osem}, {}), (("upper.x", "upper.y"), ()))
        >>> channels.weights(0, np.ones(1)).real.tolist()
        [[[2.0, 0.02]]]
        """
        size = (len(frequency), len(self.transducer[side]), len(self.signal[side]))
        result = np.zeros(size, dtype=complex)
        for n, item in enumerate(self.transducer[side].values()):
            factor = item.gain * np.exp(-2j * np.pi * np.asarray(frequency) * item.delay)
            for name, amount in ((item.signal, 1.0), *item.mix.items()):
                result[:, n, self.signal[side].index(name)] += factor * amount
        return result

    def combine(
        self, response: Complex[np.ndarray, "*more frequency output input"], frequency: np.ndarray
    ) -> Complex[np.ndarray, "*more frequency sensor actuator"]:
        """Compute readings per drive from responses of the signals."""
        return self.weights(0, frequency) @ response @ self.weights(1, frequency).swapaxes(1, 2)

    def differentiate(
        self,
        response: Complex[np.ndarray, "frequency output input"],
        frequency: np.ndarray,
        values: np.ndarray,
    ) -> Complex[np.ndarray, "nuisance frequency sensor actuator"]:
        """Differentiate readings per drive by the nuisances at these values."""
        size = (len(frequency), len(self.names(0)), len(self.names(1)))
        result = np.zeros((len(values), *size), dtype=complex)
        for n, one in enumerate(self.nuisances):
            move = STEP * one.sigma * np.eye(len(values))[n]
            above = self.with_values(values + move).combine(response, frequency)
            below = self.with_values(values - move).combine(response, frequency)
            result[n] = (above - below) / (2 * move[n])
        return result


def find_transducer(name: str, among: Sequence[Transducer]) -> Transducer:
    """Find a transducer by name; a signal of the design is its own, of gain 1."""
    return next((one for one in among if one.name == name), Transducer(name="signal", signal=name))
