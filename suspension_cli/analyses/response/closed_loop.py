"""Frequency responses with the loops of the design's local control closed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import control
from suspension_cli.models.choice import Transfer

if TYPE_CHECKING:
    from jaxtyping import Complex

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
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
