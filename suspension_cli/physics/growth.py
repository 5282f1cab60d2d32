"""Designs whose motion grows, so that they have no steady state: which mode, why, what to do."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from suspension_cli.design import faults
from suspension_cli.design.checks import find_active
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault
from suspension_cli.linear import batch_modes, damped, eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.models import registry
from suspension_cli.models.base import Model

RAISE = "attach the wires higher above the COM (raise d)"
"""What to do about most unstable equilibria."""


@dataclass(frozen=True)
class Growth:
    """Why motion grows: the cause as a fault without the mode, and the modes with growth rates.

    The rates are those with all dampers, losses and the delay of light. `static` if the static
    stiffness alone makes it grow.
    """

    cause: Fault
    modes: Modes
    static: bool

    @property
    def worst(self) -> str:
        """The mode that grows fastest."""
        return describe(self.modes, int(self.modes.growth_rate.argmax()))

    @property
    def fault(self) -> Fault:
        """The cause with the fastest mode."""
        return dataclasses.replace(self.cause, problem=f"{self.cause.problem}: {self.worst}")


def describe(modes: Modes, number: int) -> str:
    """Describe how a mode grows: ``test x grows at 0.25 1/s``."""
    square = modes.omega_squared[number]
    rate = modes.growth_rate[number]
    omega = np.sqrt(max(square - rate**2, 0.0))
    at = f", oscillating at {omega / (2 * np.pi):.4g} Hz" if square > 0 else ""
    return f"{modes.label[number]} grows at {rate:.4g} 1/s{at}"


def is_statically_stable(solver: Solver) -> bool:
    """Whether no mode grows without dampers, losses and terms in frequency.

    A factorisation of the stiffness tells this of most systems; of others the modes do.
    """
    if batch_modes.is_clearly_stable(solver.system):
        return True
    return not (solver.constant.spectrum.omega_squared < 0).any()


def find_growth(design: Design, kind: Model, system: Solvable) -> Growth | None:
    """Find why the motion of a design grows with its control loops open; None if it does not.

    `system` is its linear system in the model `kind`. Where the equilibrium is stable, only active
    springs, links, dampers and light can make it grow. Poles are those on wires without mass.
    Raises `damped.LostModeError` if they are not known.
    """
    solver = Solver.of(system)
    balances = is_statically_stable(solver)
    if balances and not solver.system.active:
        return None
    without_wire_mass = registry.BEAM.system(design) if kind.has_wire_mass else solver
    found = damped.solve(without_wire_mass)
    if found.stable:
        return None
    if not balances:
        fault = Fault("stage", "the equilibrium is unstable", RAISE)
        dark = replace(design, cavity=[])
        if design.cavity and eigenmodes.solve(kind.system(dark).constant).stable:
            keys = [f"cavity.{one.name}.power" for one in design.cavity]
            problem = "the pressure of the light makes the equilibrium unstable"
            fault = Fault(keys[0], problem, f"lower {', '.join(keys)}, or stiffen this motion")
        return Growth(fault, found, static=True)
    parts = [fault for part, fault in find_active(design, faults.tables(design)) if part.active]
    keys = ", ".join(fault.key for fault in parts)
    less = "less negative" if all("detuning" not in fault.key for fault in parts) else "smaller"
    remedy = f"make {keys} {less}, or damp this motion more"
    problem = "an active element makes the motion grow, so there is no steady state"
    return Growth(Fault(parts[0].key, problem, remedy), found, static=False)
