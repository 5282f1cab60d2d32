"""Loop gains between the points of a grid, to draw resonances completely."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import control
from suspension_cli.analyses.damp.solve import LocalControl
from suspension_cli.drawing.added_points import add_points
from suspension_cli.errors import InputError

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.analyses.analysis import Result


def refine_gains(
    result: Result,
) -> tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency loop"]]:
    """Add frequencies that resolve resonances to the loop gains of a result.

    Returns frequencies (Hz) and gains of each loop, the others closed, of the result's model.
    """
    damped: LocalControl = result.data
    grid = damped.frequency
    if len(grid) < 8 or grid[0] <= 0 or (np.diff(grid) <= 0).any():
        return grid, damped.gain
    try:
        plant = control.build_plant(result.design, result.choice.model.system(result.design))
        frequency, gain = add_points(
            lambda at: control.compute_loop_gains(plant, at)[:, None],
            grid,
            damped.gain[:, None],
            np.empty(0),
        )
    except InputError:
        return grid, damped.gain
    return frequency, gain[:, 0]
