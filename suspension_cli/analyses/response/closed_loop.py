"""Frequency responses with the loops of the design's local control closed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import closed_loop_poles, control
from suspension_cli.analyses.damp import solve as damp
from suspension_cli.errors import Fault, InputError
from suspension_cli.models import registry
from suspension_cli.models.choice import Transfer

if TYPE_CHECKING:
    from jaxtyping import Complex

    from suspension_cli.analyses.analysis import Log
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.poles import Poles
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.base import Model
    from suspension_cli.scene.arrays import Array


@dataclass(frozen=True)
class ClosedTransfer(Transfer):
    """Responses of outputs to inputs with all loops of a design closed."""

    design: Design

    def values(
        self, model: LinearSystem, frequency: Array
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Solve for the responses (f, o, i) at frequencies (f,) in Hz."""
        plant, at = control.build_plant(self.design, model), np.asarray(frequency)
        return control.solve_responses(plant, at, self.inputs, self.outputs).value


def find_stable_poles(
    design: Design, model: LinearSystem, kind: Model, allow_unstable: bool, log: Log
) -> Poles:
    """Find the closed-loop poles, on wires without mass.

    Raises `InputError` if a pole grows and that is not allowed.
    """
    massless = registry.BEAM.system(design) if kind.has_wire_mass else model
    found = closed_loop_poles.find(control.build_plant(design, massless))
    if not found.stable:
        where, remedy = damp.describe_growth(found)
        if not allow_unstable:
            problem = f"the closed loop is unstable, so it has no steady response: {where}"
            raise InputError([Fault("control", problem, f"{remedy}, or give --allow-unstable")])
        log.warn(f"the closed loop is unstable: {where}; {remedy}")
    return found
