"""What acts on loops in time: steps and impulses, motions of the support, noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.linear import signals
from suspension_cli.physics import ground, local_control
from suspension_cli.physics.noise_stream import Stream, make_stream

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.analyses.analysis import Run
    from suspension_cli.design.control import Loop
    from suspension_cli.linear.signals import Signal
    from suspension_cli.physics.ground import Spectrum
    from suspension_cli.physics.local_control import Plant
    from suspension_cli.physics.noise_stream import Density

RISING = 0.4
"""Part of the time before the run in which noise grows from 0: a jump would excite all modes."""


@dataclass(frozen=True)
class Causes:
    """What acts on a run: steps and impulses with their sizes, motions of the support, noise."""

    steps: Sequence[tuple[Signal, float]]
    impulses: Sequence[tuple[Signal, float]]
    motions: dict[str, Spectrum]
    noise: bool
    seed: int

    @staticmethod
    def of(run: Run, known: tuple[str, ...]) -> Causes:
        """Parse what the settings of a run say; raises `InputError`."""
        setting = run.setting
        folder = Path(run.source.file).parent
        return Causes(
            [_parse_push(text, known, "--step") for text in setting["step"]],
            [_parse_push(text, known, "--impulse") for text in setting["impulse"]],
            ground.parse(setting["ground"], (), folder),
            setting["noise"],
            setting["seed"],
        )

    @property
    def forces(self) -> list[Signal]:
        """Forces from outside: of steps, then of impulses."""
        return [signal for signal, _ in (*self.steps, *self.impulses)]

    @property
    def is_random(self) -> bool:
        """Whether anything is drawn."""
        return self.noise or bool(self.motions)


class Inputs:
    """Inputs of `time_domain.Sampled.run`, block by block.

    Noise grows in some samples `before` the run, at a rate in Hz; then the rest acts, too.
    """

    def __init__(self, causes: Causes, plant: Plant, before: int, rate: float) -> None:
        self.causes = causes
        self.before = before
        self.rate = rate
        self.sample = -before
        every = [*_sources(causes, plant)]
        self.streams: list[Stream] = []
        weights = [np.zeros((0, len(causes.motions) + len(plant.channels) + _actuators(plant)))]
        # a seed of its own for each: noise of one sensor more changes no other
        seeds = np.random.SeedSequence(causes.seed).spawn(len(every))
        for (density, weight), seed in zip(every, seeds, strict=True):
            stream = make_stream(density, rate, seed)
            if stream is not None:
                self.streams.append(stream)
                weights.append(weight[None])
        self.weights = np.concatenate(weights)

    def take(self, count: int) -> Float[np.ndarray, "sample input"]:
        """Return the inputs of the next samples."""
        at = np.arange(self.sample, self.sample + count)
        self.sample += count
        steps = [size * (at >= 0) for _, size in self.causes.steps]
        impulses = [size * self.rate * (at == 0) for _, size in self.causes.impulses]
        pushes = np.reshape([*steps, *impulses], (-1, count)).T
        drawn = np.reshape([stream.take(count) for stream in self.streams], (-1, count)).T
        risen = np.clip((at + self.before) / max(RISING * self.before, 1), 0.0, 1.0)
        size = np.sin(np.pi / 2 * risen) ** 2
        return np.concatenate([pushes, (size[:, None] * drawn) @ self.weights], axis=1)


def _sources(causes: Causes, plant: Plant) -> Iterator[tuple[Density, Float[np.ndarray, " input"]]]:
    """Densities of all noise, and the weights with which each enters the random inputs.

    These are motions of the support, then readings of channels, then forces of actuators.
    """
    motions = len(causes.motions)
    channels = len(plant.channels)
    unit = np.eye(motions + channels + _actuators(plant))
    for spectrum, weights in zip(causes.motions.values(), unit, strict=False):
        yield spectrum.at, weights
    if not causes.noise:
        return
    readings = np.hstack([np.eye(channels), plant.reading])
    for sensor, weights in zip(plant.sensors, readings.T, strict=True):
        yield _density_of(local_control.evaluate_noise, sensor), weights @ unit[motions:][:channels]
    actuators = [*plant.osems, *loops_alone(plant)]
    for actuator, weights in zip(actuators, unit[motions + channels :], strict=True):
        yield _density_of(local_control.evaluate_actuator_noise, actuator), weights


def _density_of(evaluate: Callable[..., Float[np.ndarray, " frequency"]], part: object) -> Density:
    return lambda frequency: evaluate(part, frequency)


def loops_alone(plant: Plant) -> list[Loop]:
    """Loops without coils."""
    has_coils = np.abs(plant.driving).sum(0) > 0
    return [plant.loops[n] for n in np.flatnonzero(~has_coils).tolist()]


def _actuators(plant: Plant) -> int:
    return len(plant.osems) + len(loops_alone(plant))


def _parse_push(text: str, known: tuple[str, ...], option: str) -> tuple[Signal, float]:
    """Parse ``upper.force_x=1e-3``: a force or torque on a body, and its size."""
    name, equals, size = text.partition("=")
    remedy = "write for example upper.force_x=1e-3"
    try:
        value = float(size)
    except ValueError:
        value = np.nan
    if not equals or not np.isfinite(value):
        raise InputError.of(option, "gives no size", remedy, format_value(text))
    signal = signals.parse(name.strip(), option, known)
    if not signal.acts:
        raise InputError.of(option, "is not a force or torque", remedy, format_value(text))
    return signal, value
