"""Thermal noise of motions, and the thermal force or torque that would cause it.

The force noise on a coordinate follows from its motion and its susceptibility chi = x / F by the
fluctuation-dissipation theorem: S_F = S_x / abs(chi)^2 (Saulson, Phys. Rev. D 42, 2437 (1990)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.conventions import SUPPORT
from suspension_cli.errors import InputError, format_value
from suspension_cli.linear import response, signals
from suspension_cli.linear.signals import FORCES, Signal, linear_form
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.responses import parse_numbers, write_number
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.design.schema import Design

SYNTAX = "write thermal MOTION:FREQUENCY, in Hz: thermal test.x:10"


@dataclass(frozen=True)
class ThermalNoise(Quantity):
    """Amplitude spectral density of the thermal motion of a coordinate at a frequency in Hz."""

    motion: Signal
    frequency: float

    bends: ClassVar[bool] = True
    slow: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    zero = "without loss, or by symmetry"
    missing = "has no steady state, or a resonance without loss there"

    @property
    def needs(self) -> Needs:
        """The motion at its frequency."""
        return Needs(warm_motions=(self.motion,), warm_frequency=(self.frequency,))

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read the density of each design."""
        return solved.with_bending(lambda bent: bent.thermal(self.motion, self.frequency))


class ForceNoise(ThermalNoise):
    """Amplitude spectral density of the thermal force or torque on a body at a frequency in Hz.

    The `motion` is that along which the force acts.
    """

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Divide the thermal motion by the motion per force."""
        return solved.with_bending(self._read_bent)

    def _read_bent(self, solved: Solved) -> Float[np.ndarray, " design"]:
        moved = solved.thermal(self.motion, self.frequency)
        return moved / solved.each(self._susceptibility)

    def _susceptibility(self, solver: Solver, design: Design) -> float:
        del design
        row = linear_form(self.motion, solver.system)[None]
        omega = np.array([2 * np.pi * self.frequency])
        value, _ = response.transfer(solver, omega, row, [True], row)
        return float(np.abs(value[0, 0, 0]))


def demand_losses(names: Names, text: str, option: str) -> None:
    """Raise `InputError` if a design does not say where along its wires losses act."""
    if why := registry.BEAM.unsuitable(names.design):
        remedy = "give its material and radius or section, for its loss"
        raise InputError.of(option, f"is not known: {why}", remedy, format_value(text))


def parse(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``thermal test.x:10``."""
    if not text.startswith("thermal "):
        return None
    given = parse_numbers(text.removeprefix("thermal "), 1)
    if given is None or not 0 < given[1][0] < 1e9:
        raise InputError.of(option, "has no frequency", SYNTAX, format_value(text))
    written, [frequency] = given
    motion = signals.parse_output(written, names.signals, option)
    if motion.body == SUPPORT:
        remedy = "name a stage, for example test.x"
        raise InputError.of(option, "is at rest", remedy, format_value(text))
    demand_losses(names, text, option)
    unit = f"{motion.unit}/Hz^0.5"
    name = f"thermal {written}:{write_number(frequency)}"
    return ThermalNoise(name, unit, motion, frequency)


def parse_force(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``force noise test.torque_yaw:1e-3``."""
    if not text.startswith("force noise "):
        return None
    given = parse_numbers(text.removeprefix("force noise "), 1)
    if given is None or not 0 < given[1][0] < 1e9:
        remedy = "write force noise FORCE:FREQUENCY, in Hz: force noise test.torque_yaw:1e-3"
        raise InputError.of(option, "has no frequency", remedy, format_value(text))
    written, [frequency] = given
    force = signals.parse(written, option, names.signals)
    if not force.acts:
        remedy = f"write {force.body}.{FORCES[force.dof]}"
        raise InputError.of(option, "is no force or torque", remedy, format_value(text))
    demand_losses(names, text, option)
    unit = f"{force.unit}/Hz^0.5"
    motion = Signal(force.text, force.body, force.dof, force.point, acts=False)
    name = f"force noise {written}:{write_number(frequency)}"
    return ForceNoise(name, unit, motion, frequency)


KINDS = (
    Kind(
        "thermal MOTION:FREQUENCY",
        "thermal test.x:10",
        "m/Hz^0.5, rad/Hz^0.5",
        "thermal noise of a motion at a frequency in Hz",
        parse,
    ),
    Kind(
        "force noise FORCE:FREQUENCY",
        "force noise test.torque_yaw:1e-3",
        "N/Hz^0.5, N m/Hz^0.5",
        "thermal force or torque on a body at a frequency in Hz",
        parse_force,
    ),
)
