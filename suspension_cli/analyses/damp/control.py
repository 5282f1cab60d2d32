"""Closed-loop responses of local control.

Each loop applies u = -H(f) (y + n) with its sensor's motion y and noise n. A sensor with
``reference = "support"`` measures motion relative to the support structure, taken as rigid up to
the sensor; its actuator pushes against this structure. Closed-loop responses follow from the
open-loop ones, which are solved directly: x = G_e e + G_u u, u = -(1 + H G_yu)^-1 H (G_ye e + n).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import osems
from suspension_cli.conventions import SUPPORT
from suspension_cli.design.schema import Design, Loop
from suspension_cli.design.sensors import SENSORS, NoiseSpectrum, Osem
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import response, signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

BESIDE = (0.0, 1e-15, -1e-15, 3e-15, -3e-15, 1e-14, -1e-14)
"""Relative steps, tried in turn, from a frequency where the response is infinite."""


@dataclass(frozen=True)
class Plant:
    """A model with the sensors and actuators of its loops.

    Attributes
    ----------
    sensed, pushed
        Sensed motions and actuator forces as linear forms in the coordinates.
    reading, driving
        Readings of loops from those of OSEMs, and forces of their coils from those of loops.
    """

    model: LinearSystem
    loops: Sequence[Loop]
    sensor: list[Signal]
    actuator: list[Signal]
    sensed: Float[np.ndarray, "loop coordinate"]
    pushed: Float[np.ndarray, "loop coordinate"]
    osems: Sequence[Osem]
    reading: Float[np.ndarray, "loop osem"]
    driving: Float[np.ndarray, "osem loop"]

    @property
    def parts(self) -> list[Loop | Osem]:
        """What has a sensor and an actuator with noise; loops of stages with OSEMs have none."""
        return [*self.loops, *self.osems]

    @property
    def coils(self) -> Float[np.ndarray, "osem coordinate"]:
        """Linear forms of the motions along OSEMs, and of the forces of their coils."""
        result = np.zeros((len(self.osems), self.model.size))
        for row, osem in zip(result, self.osems, strict=True):
            for n, part in enumerate(osem.vector):
                end = Signal(osem.name, osem.stage, n, osem.at, acts=True)
                row += part * signals.linear_form(_relate(end, osem), self.model)
        return result

    @cached_property
    def dampers(self) -> Float[np.ndarray, " loop"]:
        """Coefficients that damp strongly what each actuator moves, N s/m or N m s/rad."""
        size = (self.pushed[:, 6:] ** 2).sum(1)
        stiffness, mass = (
            np.einsum("li,ij,lj->l", self.pushed[:, 6:], part[6:, 6:], self.pushed[:, 6:]) / size
            for part in (np.real(self.model.stiffness), self.model.mass)
        )
        return np.sqrt(np.abs(stiffness * mass)) / size

    @cached_property
    def damped(self) -> LinearSystem:
        """The model with these dampers."""
        more = (self.pushed.T * self.dampers) @ self.pushed
        return replace(self.model, damping=self.model.damping + more)

    def with_loops(self, keep: list[int]) -> Plant:
        """Select loops by number."""
        return Plant(
            self.model,
            [self.loops[n] for n in keep],
            [self.sensor[n] for n in keep],
            [self.actuator[n] for n in keep],
            self.sensed[keep],
            self.pushed[keep],
            self.osems,
            self.reading[keep],
            self.driving[:, keep],
        )


def demand_loops(design: Design) -> None:
    """Raise `InputError` if a design has no loops."""
    if design.control is None:
        remedy = "add [[control.loop]] with sensor, actuator and damper or gain"
        raise InputError([Fault("control", "missing", remedy)])


def build_plant(design: Design, model: LinearSystem) -> Plant:
    """Build the plant of a design's loops, if it has any, on its model.

    Raises `InputError` if a sensor or actuator names no signal of the model.
    """
    known = signals.bodies_with_signals(model)
    loops = design.control.loop if design.control is not None else ()
    given = design.control.osem if design.control is not None else ()
    sensors = [parse_sensor(loop, model.body, known) for loop in loops]
    actuators = [parse_actuator(loop, known) for loop in loops]
    sensed, pushed = (
        np.array(
            [
                signals.linear_form(_relate(signal, loop), model)
                for signal, loop in zip(some, loops, strict=True)
            ]
        ).reshape(-1, model.size)
        for some in (sensors, actuators)
    )
    reading, driving = (
        np.reshape([*map(partial(osems.weigh, given), loops, some)], (len(loops), len(given)))
        for some in (sensors, actuators)
    )
    return Plant(model, loops, sensors, actuators, sensed, pushed, given, reading, driving.T)


def _relate(signal: Signal, loop: Loop | Osem) -> Signal:
    """Relate a signal to the reference of its loop or OSEM."""
    to_support = loop.reference == "support" and not signal.against
    return replace(signal, against=SUPPORT) if to_support else signal


def parse_sensor(loop: Loop, stages: tuple[str, ...], known: tuple[str, ...]) -> Signal:
    """Parse the sensor of a loop; `InputError` if it is not a motion of a stage."""
    key = f"control.loop.{loop.name}.sensor"
    sensor = signals.parse(loop.sensor, key, known)
    if sensor.acts or sensor.body not in stages:
        problem, remedy = "is not a motion of a stage", "write for example upper.x"
        raise InputError([Fault(key, problem, remedy, format_value(loop.sensor))])
    return sensor


def parse_actuator(loop: Loop, known: tuple[str, ...]) -> Signal:
    """Parse the actuator of a loop; `InputError` if it is not a force or torque."""
    key = f"control.loop.{loop.name}.actuator"
    actuator = signals.parse(loop.actuator, key, known)
    if not actuator.acts:
        problem, remedy = "is not a force or torque", "write for example upper.force_x"
        raise InputError([Fault(key, problem, remedy, format_value(loop.actuator))])
    return actuator


def evaluate_filter(
    loop: Loop, frequency: Inexact[np.ndarray, "*frequency"] | complex
) -> Complex[np.ndarray, "*frequency"]:
    """Evaluate H of a loop (filter, sensor, delay) at frequencies in Hz; N/m or N m/rad."""
    f = np.asarray(frequency)
    return loop.controller_and_sensor.at(f) * np.exp(-2j * np.pi * loop.delay * f)


def evaluate_noise(
    part: Loop | Osem, frequency: Float[np.ndarray, " frequency"]
) -> Float[np.ndarray, " frequency"]:
    """Evaluate the sensor noise of a loop or OSEM, as motion, at frequencies in Hz.

    It is flat, or flat with power rising as 1/f below a corner, or interpolated on logarithmic
    axes.
    """
    noise, frequency = part.sensor_noise, np.asarray(frequency, dtype=float)
    noise = SENSORS.get(getattr(part, "sensor", ""), noise)
    if not isinstance(noise, NoiseSpectrum):
        return np.full(frequency.shape, noise)
    with np.errstate(divide="ignore"):
        if noise.frequency is not None:
            curve = np.interp(np.log(frequency), np.log(noise.frequency), np.log(noise.asd))
            return np.exp(curve)
        return np.asarray(noise.asd) * np.sqrt(1 + (noise.corner or 0.0) / frequency)


@dataclass(frozen=True)
class ClosedLoopResponse:
    """Closed-loop responses, and noise at the outputs.

    Attributes
    ----------
    value
        Outputs over external inputs.
    noise, actuator_noise
        Amplitude spectral densities at each output from the noise of the sensor and actuator of
        each of `Plant.parts`, m/sqrt(Hz) or rad/sqrt(Hz); of coils N/sqrt(Hz).
    """

    value: Complex[np.ndarray, "frequency output input"]
    noise: Float[np.ndarray, "frequency output part"]
    actuator_noise: Float[np.ndarray, "frequency output part"]


def solve_responses(
    plant: Plant,
    frequency: Float[np.ndarray, " frequency"],
    inputs: list[Signal],
    outputs: list[Signal],
    *,
    drives: bool = False,
) -> ClosedLoopResponse:
    """Solve for closed-loop responses, and noise at the outputs.

    Parameters
    ----------
    frequency
        Hz.
    inputs, outputs
        External drives (i) and observed motions (o).
    drives
        Whether the forces that the loops demand of the coils of OSEMs are further outputs.
    """
    model, count, coils = plant.damped, len(plant.loops), len(plant.osems)
    observed = np.array([signals.linear_form(s, model) for s in outputs]).reshape(-1, model.size)
    rows = np.concatenate([observed, plant.sensed, plant.pushed])
    given = np.array([signals.linear_form(s, model) for s in inputs]).reshape(-1, model.size)
    acts = [*(s.acts for s in inputs), *([True] * (coils + count))]
    ground = [*(s.is_ground for s in inputs), *([False] * (coils + count))]
    omega = 2 * np.pi * frequency
    driven = np.concatenate([given, plant.coils, plant.pushed])
    g, _ = response.transfer(model, omega, driven, acts, rows, ground=ground)
    i, o, one = len(inputs) + coils, len(outputs), np.eye(count)
    seen = o + count if drives else o
    h, dampers = evaluate_filters(plant, frequency), 1j * omega[:, None] * plant.dampers
    feedback = np.concatenate([h[:, :, None] * one, -dampers[:, :, None] * one], axis=-1)
    # forces e at the actuators become (1 + F G_qu)^-1 e
    pushed = np.linalg.solve(
        np.swapaxes(one + feedback @ g[:, o:, i:], -1, -2), np.swapaxes(g[:, :seen, i:], -1, -2)
    )
    pushed = np.swapaxes(pushed, -1, -2)
    value = g[:, :seen, :i] - pushed @ (feedback @ g[:, o:, :i])
    weights = np.hstack([one, plant.reading])
    read = -(pushed * h[:, None]) @ weights
    shaken = np.concatenate([pushed, value[:, :, i - coils :]], axis=2)
    value = value[:, :, : i - coils]
    if drives:  # the loops read the noise of sensors itself, too
        read[:, o:] += weights
        every, forced = (value, read, shaken), -plant.driving * h[:, None]
        value, read, shaken = (np.hstack([x[:, :o], forced @ x[:, o:]]) for x in every)
    noises = [evaluate_noise(part, frequency) for part in plant.parts]
    densities = np.array(noises).reshape(len(noises), len(frequency)).T
    forces = np.array([part.actuator_noise for part in plant.parts])
    return ClosedLoopResponse(value, np.abs(read) * densities[:, None], np.abs(shaken) * forces)


def compute_loop_gains(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop"]:
    """Compute the gain of each loop, broken at its actuator with the others closed.

    It is -1 at a closed-loop pole on the imaginary axis. Frequencies are in Hz; at a resonance
    without loss the gain is taken beside it. With S = (1 + H G)^-1 it is (S H G)_kk / S_kk.
    """
    gain = compute_open_loop(plant, frequency)
    one = np.broadcast_to(np.eye(gain.shape[-1]), gain.shape)
    both = np.linalg.solve(one + gain, np.concatenate([gain, one], axis=-1))
    closed, sensitivity = (np.einsum("fkk->fk", part) for part in np.split(both, 2, axis=-1))
    return closed / sensitivity


def compute_sensitivity(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop loop"]:
    """Compute the sensitivity S = (1 + H G)^-1 from disturbances at actuators to total forces."""
    return np.linalg.inv(np.eye(len(plant.loops)) + compute_open_loop(plant, frequency))


def compute_open_loop(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop loop"]:
    """Compute H G at frequencies in Hz, beside resonances without loss."""
    count = len(plant.loops)
    result = np.full((len(frequency), count, count), np.nan, dtype=complex)
    left = np.arange(len(frequency))
    with np.errstate(all="ignore"):
        for beside in BESIDE:
            at = frequency[left] * (1 + beside)
            g, _ = response.transfer(
                plant.model,
                2 * np.pi * at,
                plant.pushed,
                [True] * count,
                plant.sensed,
                finite=False,
            )
            known = np.isfinite(g).all((1, 2))
            result[left[known]] = evaluate_filters(plant, at[known])[:, :, None] * g[known]
            left = left[~known]
            if not len(left):
                break
    return result


def evaluate_filters(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Inexact[np.ndarray, "frequency loop"]:
    """Evaluate H of all loops at frequencies in Hz."""
    found = [evaluate_filter(loop, frequency) for loop in plant.loops]
    return np.array(found).reshape(len(plant.loops), len(frequency)).T
