"""Poles of a suspension with its loops closed, where spectra have narrow peaks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import closed_loop_poles, control
from suspension_cli.analyses.damp.control import Plant
from suspension_cli.analyses.modes import wire_modes
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex

    from suspension_cli.design.schema import Design

MOST = 2000
"""Most wire modes whose widths are computed."""


def build_plant(design: Design, model: LinearSystem) -> Plant:
    """Build the plant of a design with or without loops."""
    if design.control is not None:
        return control.build_plant(design, model)
    none = np.zeros((0, model.size))
    return Plant(model, (), [], [], none, none)


def find_stable_poles(design: Design, model: LinearSystem) -> Complex[np.ndarray, " pole"]:
    """Find the closed-loop poles (rad/s) of a model without wire mass, as `damp` does.

    Raises
    ------
    InputError
        If one grows, as no motion is stationary then.
    """
    found = closed_loop_poles.find(build_plant(design, model))
    if found.stable:
        return found.value
    worst = int(found.growth_rate.argmax())
    problem = (
        f"makes the closed loop unstable: a pole at {found.frequency[worst]:.5g} Hz in"
        f" {found.state[worst]} grows at {found.growth_rate[worst]:.4g} 1/s, and its motion has no"
        " spectrum"
    )
    remedy = (
        "check the sign of the loops that drive it, or lower their gain or phase lag there"
        " (pendsus damp)"
    )
    raise InputError([Fault("control", problem, remedy)])


def find_wire_modes(model: LinearSystem, highest: float) -> Complex[np.ndarray, " pole"]:
    """Poles (rad/s) of modes up to a frequency in Hz, of a model with wire mass."""
    if not 0 < wire_modes.count_modes(model, highest) <= MOST:
        return np.zeros(0, dtype=complex)
    found = wire_modes.solve(model, highest)
    return -found.decay_rate + 1j * np.sqrt(np.maximum(found.omega_squared, 0.0))
