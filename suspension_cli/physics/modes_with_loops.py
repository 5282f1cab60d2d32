"""Modes of a suspension with all losses, dampers and loops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.linear import (
    damped,
    mode_content,
    statespace,
)
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.statespace import Poles
from suspension_cli.linear.system import LinearSystem
from suspension_cli.physics import local_control
from suspension_cli.physics.closed_loop import find_poles

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class DampedModes:
    """Modes of the suspension with all losses, dampers and loops, ascending in frequency.

    Attributes
    ----------
    frequency
        Hz; 0 of a mode that does not oscillate.
    q
        abs(s) / (-2 Re s); infinite without decay.
    decay_rate
        Of the amplitude, 1/s; negative of a mode that grows.
    dilution
        Total energy over the energy in lossy elements; NaN with loops, and where not known.
    fraction
        Fraction of the kinetic energy in each motion (`Modes.place`).
    """

    frequency: Float[np.ndarray, " mode"]
    q: Float[np.ndarray, " mode"]
    decay_rate: Float[np.ndarray, " mode"]
    dilution: Float[np.ndarray, " mode"]
    fraction: Float[np.ndarray, "mode place"]

    @staticmethod
    def of_poles(
        value: Complex[np.ndarray, " mode"],
        motion: Complex[np.ndarray, "mode coordinate"],
        model: LinearSystem,
    ) -> DampedModes:
        """Modes of poles with loops (rad/s), and the motions in each."""
        oscillates = np.imag(value) > 0
        unknown = np.full(len(value), np.nan)
        q = np.where(oscillates, Poles(value, ("",) * len(value)).q, 0.0)
        frequency = np.where(oscillates, np.abs(value) / (2 * np.pi), 0.0)
        fraction = np.concatenate(mode_content.energy_fractions(model, motion), axis=1)
        return DampedModes(frequency, q, -np.real(value), unknown, fraction)


def solve_modes(system: Solvable, design: Design) -> DampedModes:
    """Solve for the modes of a design's bodies, on wires without mass, with its loops closed.

    Poles of filters, in which mostly these move, are no modes.
    """
    solver = Solver.of(system)
    model = solver.system
    if design.control is None or not design.control.loop:
        found = damped.solve(solver)
        frequency = np.nan_to_num(found.frequency)
        decay = np.where(found.growth_rate > 0, -found.growth_rate, found.decay_rate)
        return DampedModes(frequency, found.q, decay, found.dilution, found.fractions)
    poles = find_poles(local_control.build_plant(design, solver))
    assert poles.motion is not None
    bodily = np.array([not statespace.is_of_filter(name) for name in poles.state], dtype=bool)
    # without states of light
    return DampedModes.of_poles(poles.value[bodily], poles.motion[bodily][:, : model.size], model)
