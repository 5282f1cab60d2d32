"""Thermal noise between the points of a grid, for drawing: resonances to their tips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.analyses.thermal.solve import Thermal
from suspension_cli.drawing.added_points import add_points
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.analyses.analysis import Result
    from suspension_cli.scene.arrays import Array

STEP = 0.6
"""Largest change of the logarithm of the sum between neighbours, with the points added."""


def refine(result: Result) -> list[Thermal]:
    """Add the frequencies at which resonances of bodies and wires are resolved.

    The values there are those of the result's model, built from its design.
    """
    noises: list[Thermal] = result.data
    grid = noises[0].frequency
    if len(grid) < 8 or grid[0] <= 0 or (np.diff(grid) <= 0).any():
        return noises
    try:
        model = result.choice.model.system(result.design)
        motions = [thermal.parse_motion(model, noise.output, noise.tilt) for noise in noises]
        names = list(dict.fromkeys(name for noise in noises for name in noise.source))

        def solve(at: Array) -> Float[np.ndarray, "frequency motion source"]:
            warmth = result.design.constants.temperature
            found = thermal.solve_all(model, at, motions, warmth)
            return np.stack([_columns(noise, names) for noise in found], axis=1)

        known = np.stack([_columns(noise, names) for noise in noises], axis=1)
        modes = eigenmodes.solve(model.constant).frequency
        frequency, value = add_points(solve, grid, known, modes, step=STEP, sums=True)
    except InputError:
        return noises
    return [
        replace(
            noise,
            frequency=frequency,
            density=np.stack([value[:, n, names.index(name)] ** 2 for name in noise.source]),
        )
        for n, noise in enumerate(noises)
    ]


def _columns(noise: Thermal, names: Sequence[str]) -> Float[np.ndarray, "frequency source"]:
    """Amplitudes (f, s) of sources by name; 0 for those that do not contribute."""
    parts = noise.parts
    nothing = np.zeros(len(noise.frequency))
    return np.stack([parts.get(name, nothing) for name in names], axis=1)
