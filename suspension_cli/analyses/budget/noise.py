"""Noise of a suspension with its loops closed, by cause, at any frequency.

Ground, sensors and actuators act through closed-loop responses. The thermal forces F of the lossy
parts do too: with u = -H S x at the actuators P,

    (Z + P H S) x = F,    S_FF = (4 k T / omega) Im(Z)

(Callen and Welton, Phys. Rev. 83, 34 (1951)): loops change the motion of the suspension, not the
thermal forces of its parts, and have none of their own. The power spectral density of r . x is

    y^H S_FF y    with    (Z + S^T H P^T) y = r,

the motion under a force on r with sensors and actuators exchanged. It is a sum of squares over all
lossy parts, without cancellation. By the matrix inversion lemma, with the open-loop motions
g_r = Z^-1 r and g_S = Z^-1 S^T,

    y = g_r - g_S H q,    (1 + P^T g_S H) q = P^T g_r.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analyses.budget.ground import Motion
from suspension_cli.analyses.damp import control
from suspension_cli.analyses.damp.control import Plant
from suspension_cli.analyses.thermal.solve import compute_dissipation
from suspension_cli.conventions import BOLTZMANN, GROUND, SUPPORT
from suspension_cli.linear import signals
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.signals import Signal
from suspension_cli.scene.arrays import Array

CHUNK = 512
"""Frequencies evaluated at once."""
THERMAL = "thermal"
"""Name of thermal noise among the causes."""


@dataclass(frozen=True)
class Noises:
    """Causes that move a suspension with or without loops.

    `motion` is that of the support by coordinate. `temperature` (K) is that of dampers and of the
    support's loss; None leaves thermal noise out.
    """

    plant: Plant
    output: list[Signal]
    motion: dict[str, Motion]
    temperature: float | None

    @property
    def cause(self) -> tuple[str, ...]:
        """Names of the causes (c)."""
        loops = self.plant.loops
        return (
            *(f"ground.{dof}" for dof in self.motion),
            *(f"sensor.{loop.name}" for loop in loops if loop.sensor_noise),
            *(f"actuator.{loop.name}" for loop in loops if loop.actuator_noise),
            *([THERMAL] if self.temperature is not None else []),
        )

    @property
    def source(self) -> tuple[str, ...]:
        """Name of the model or file of each cause (c); "" for those in the design."""
        names = [motion.name for motion in self.motion.values()]
        return (*names, *[""] * (len(self.cause) - len(names)))

    def density(self, frequency: Array) -> Array:
        """Compute power spectral densities (o, c, f), m^2/Hz or rad^2/Hz, at frequencies in Hz."""
        plant = self.plant
        known = signals.bodies_with_signals(plant.model)
        inputs = [signals.parse_input(f"{SUPPORT}.{dof}", known) for dof in self.motion]
        beside = [] if plant.model.ground is None else self.motion
        inputs += [signals.parse_input(f"{GROUND}.{dof}", known) for dof in beside]
        found = control.solve_responses(plant, frequency, inputs, self.output)
        value, count = found.value[..., : len(self.motion)], len(self.motion)
        if beside:  # the ground under the support and beside it moves as one
            value = value + found.value[..., count:]
        ground = [motion.density(frequency) for motion in self.motion.values()]
        moved = np.abs(value) * np.array(ground).reshape(-1, len(frequency)).T[:, None]
        sensing = [n for n, loop in enumerate(plant.loops) if loop.sensor_noise]
        pushing = [n for n, loop in enumerate(plant.loops) if loop.actuator_noise]
        parts = [moved, found.noise[..., sensing], found.actuator_noise[..., pushing]]
        powers = np.moveaxis(np.concatenate(parts, axis=2) ** 2, 0, -1)
        if self.temperature is None:
            return powers
        rows = np.array([signals.linear_form(signal, plant.model) for signal in self.output])
        warm = compute_thermal(plant, frequency, rows, self.temperature)
        return np.concatenate([powers, warm[:, None]], axis=1)


def compute_thermal(plant: Plant, frequency: Array, rows: Array, temperature: float) -> Array:
    """Thermal noise (o, f) of linear forms (o, N) in the coordinates, loops closed; unit^2/Hz.

    The support is at rest. `temperature` (K) is that of dampers and of the support's loss; other
    sources have their own.
    """
    omega, count = 2 * np.pi * np.asarray(frequency), len(rows)
    forms = np.concatenate([rows, plant.sensed])
    filters = control.evaluate_filters(plant, frequency)
    pencil = Pencil.of(plant.model)
    result = np.zeros((count, len(omega)))
    for start in range(0, len(omega), CHUNK):
        now = slice(start, start + CHUNK)
        h = filters[now]
        solved: list[tuple[Any, Any]] = []
        pushed = np.zeros((len(h), len(plant.loops), len(forms)), dtype=complex)
        there = pencil.at(omega[now])
        for block in pencil.blocks:
            forces = forms[:, block.keep].T
            if not forces.any():
                continue
            here, own = block.at(there), np.eye(len(block.keep))
            motion = here.respond(own, np.zeros((6, len(forms))), forces)
            pushed += np.einsum("lc,cif->fli", plant.pushed[:, block.keep], motion)
            solved.append((here, motion))
        feedback = np.eye(len(plant.loops)) + pushed[:, :, count:] * h[:, None, :]
        q = h[:, :, None] * np.linalg.solve(feedback, pushed[:, :, :count])
        for here, motion in solved:
            moved = motion[:, :count] - np.einsum("clf,flo->cof", motion[:, count:], q)
            for n in range(count):
                lost = compute_dissipation(here, moved[:, n], temperature)
                for (_, warmth), power in lost.items():
                    result[n, now] += 4 * BOLTZMANN * warmth * power / omega[now]
    return result
