"""Noise of a suspension with its loops closed, by cause, at any frequency; its narrow peaks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.budget.spectrum import Spectrum
from suspension_cli.analyses.damp import control
from suspension_cli.analyses.damp.control import Plant
from suspension_cli.analyses.modes import wire_modes
from suspension_cli.analyses.thermal.solve import Feedback, compute_densities
from suspension_cli.conventions import GROUND, SUPPORT
from suspension_cli.linear import signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex

MOST = 2000
"""Most wire modes whose widths are computed."""
THERMAL = "thermal"
"""Name of thermal noise among the causes."""


@dataclass(frozen=True)
class Noises:
    """Causes that move a suspension with or without loops.

    `motion` is that of the support by coordinate. `temperature` (K) is that of dampers and of the
    support's loss; None leaves thermal noise out. Densities are those of one suspension times
    `mirrors`, the number of equal, independent ones.
    """

    plant: Plant
    output: list[Signal]
    motion: dict[str, Spectrum]
    temperature: float | None
    mirrors: float = 1.0

    @property
    def cause(self) -> tuple[str, ...]:
        """Names of the causes (c)."""
        sensing, pushing = self._noisy
        return (
            *(f"ground.{dof}" for dof in self.motion),
            *(f"sensor.{self.plant.parts[n].name}" for n in sensing),
            *(f"actuator.{self.plant.parts[n].name}" for n in pushing),
            *([THERMAL] if self.temperature is not None else []),
        )

    @property
    def source(self) -> tuple[str, ...]:
        """Name of the model or file of each cause (c); "" for those in the design."""
        names = [motion.name for motion in self.motion.values()]
        return (*names, *[""] * (len(self.cause) - len(names)))

    @property
    def _noisy(self) -> tuple[list[int], list[int]]:
        """Numbers of the sensors and actuators with noise."""
        parts, at = [*enumerate(self.plant.parts)], np.ones(1)
        sensing = [n for n, part in parts if control.evaluate_noise(part, at).any()]
        return sensing, [n for n, part in parts if part.actuator_noise]

    def density(self, frequency: Array) -> Array:
        """Compute power spectral densities (o, c, f), m^2/Hz or rad^2/Hz, at frequencies in Hz.

        Behind those of the outputs are those of the forces that loops demand of coils, N^2/Hz.
        """
        plant = self.plant
        known = signals.bodies_with_signals(plant.model)
        inputs = [signals.parse_input(f"{SUPPORT}.{dof}", known) for dof in self.motion]
        beside = [] if plant.model.ground is None else self.motion
        inputs += [signals.parse_input(f"{GROUND}.{dof}", known) for dof in beside]
        found = control.solve_responses(plant, frequency, inputs, self.output, drives=True)
        value, count = found.value[..., : len(self.motion)], len(self.motion)
        if beside:  # the ground under the support and beside it moves as one
            value = value + found.value[..., count:]
        ground = [motion.at(frequency) for motion in self.motion.values()]
        moved = np.abs(value) * np.array(ground).reshape(-1, len(frequency)).T[:, None]
        sensing, pushing = self._noisy
        parts = [moved, found.noise[..., sensing], found.actuator_noise[..., pushing]]
        powers = np.moveaxis(np.concatenate(parts, axis=2) ** 2, 0, -1)
        if self.temperature is not None:
            warm = compute_thermal(plant, frequency, self.output, self.temperature)
            powers = np.concatenate([powers, warm[:, None]], axis=1)
        powers[: len(self.output)] *= self.mirrors
        return powers


def compute_thermal(
    plant: Plant, frequency: Array, outputs: list[Signal], temperature: float
) -> Array:
    """Thermal noise (o, f) of motions, then of the forces of coils, loops closed; unit^2/Hz."""
    rows = np.array([signals.linear_form(signal, plant.model) for signal in outputs])
    h, weights = control.evaluate_filters(plant, frequency), None
    if plant.osems:
        count, coils = len(rows), len(plant.osems)
        rows = np.concatenate([rows, plant.sensed])
        weights = np.zeros((len(frequency), count + coils, len(rows)), dtype=complex)
        weights[:, range(count), range(count)] = 1.0
        weights[:, count:, count:] = -plant.driving * h[:, None]
    loops = Feedback(plant.sensed, plant.pushed, h)
    parts = compute_densities(plant.model, frequency, rows, temperature, loops, weights)
    return np.array([sum(one.values(), np.zeros(len(frequency))) for one in parts])


def find_wire_modes(model: LinearSystem, highest: float) -> Complex[np.ndarray, " pole"]:
    """Poles (rad/s) of modes up to a frequency in Hz, of a model with wire mass."""
    if not 0 < wire_modes.count_modes(model, highest) <= MOST:
        return np.zeros(0, dtype=complex)
    found = wire_modes.solve(model, highest)
    return -found.decay_rate + 1j * np.sqrt(np.maximum(found.omega_squared, 0.0))
