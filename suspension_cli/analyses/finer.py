"""Results between the points of a frequency grid, for drawing: resonances and zeros to their tips.

Values there are those of a result's model, built from its design, so that a results file is enough.
If that fails, or the grid is short, results stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.drawing.added_points import add_points
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes, response, signals

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

    from suspension_cli.analyses.analysis import Result
    from suspension_cli.analyses.thermal.solve import Thermal
    from suspension_cli.drawing.added_points import Solve
    from suspension_cli.linear.response import Response
    from suspension_cli.scene.arrays import Array

MANY = 8
"""Number of responses above which the frequencies of modes alone are added."""
NO_MODES = np.empty(0)
SHORTEST = 8
"""Number of points below which a grid is that of a question, not of a curve."""


def refine_response(result: Result) -> Response:
    """Add the frequencies that resolve resonances and zeros to a response."""
    data: Response = result.data

    def build() -> tuple[Solve, Array]:
        model = result.linear_system or result.choice.model.system(result.design)
        known = signals.bodies_with_signals(model)
        inputs = [signals.parse_input(text, known) for text in data.input]
        outputs = [signals.parse_output(text, known) for text in data.output]
        if data.closed_loop:
            from suspension_cli.analyses.damp import control

            plant = control.build_plant(result.design, model)
            return (lambda at: control.solve_responses(plant, at, inputs, outputs).value), NO_MODES
        modes = eigenmodes.solve(model.constant).frequency
        return (lambda at: response.solve(model, at, inputs, outputs).value), modes

    few = data.value[0].size <= MANY
    frequency, value = _refine(build, data.frequency, data.value, few=few)
    return replace(data, frequency=frequency, value=value)


def refine_noises(result: Result) -> list[Thermal]:
    """Add the frequencies that resolve resonances of bodies and wires to thermal noises."""
    from suspension_cli.analyses.thermal import solve as thermal

    noises: list[Thermal] = result.data
    names = list(dict.fromkeys(name for noise in noises for name in noise.source))

    def amplitudes(noises: list[Thermal]) -> Float[np.ndarray, "frequency motion source"]:
        nothing = np.zeros(len(noises[0].frequency))
        parts = [[noise.parts.get(name, nothing) for name in names] for noise in noises]
        return np.moveaxis(np.array(parts), -1, 0)

    def build() -> tuple[Solve, Array]:
        model = result.choice.model.system(result.design)
        motions = [thermal.parse_motion(model, noise.output, noise.tilt) for noise in noises]
        warmth = result.design.constants.temperature
        modes = eigenmodes.solve(model.constant).frequency
        return (lambda at: amplitudes(thermal.solve_all(model, at, motions, warmth))), modes

    frequency, value = _refine(build, noises[0].frequency, amplitudes(noises), sums=True)
    return [
        replace(
            noise,
            frequency=frequency,
            density=np.stack([value[:, n, names.index(name)] ** 2 for name in noise.source]),
        )
        for n, noise in enumerate(noises)
    ]


def refine_gains(
    result: Result,
) -> tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency loop"]]:
    """Add the frequencies that resolve resonances to loop gains, the other loops closed."""
    from suspension_cli.analyses.damp import control

    def build() -> tuple[Solve, Array]:
        plant = control.build_plant(result.design, result.choice.model.system(result.design))
        return (lambda at: control.compute_loop_gains(plant, at)[:, None]), NO_MODES

    frequency, gain = _refine(build, result.data.frequency, result.data.gain[:, None])
    return frequency, gain[:, 0]


def _refine(
    build: Callable[[], tuple[Solve, Array]],
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, "frequency output input"],
    *,
    few: bool = True,
    sums: bool = False,
) -> tuple[Float[np.ndarray, " finer"], Inexact[np.ndarray, "finer output input"]]:
    """Add points to values; `build` makes the function that solves for them, and lists modes."""
    if len(frequency) < SHORTEST or frequency[0] <= 0 or (np.diff(frequency) <= 0).any():
        return frequency, value
    try:
        solve, modes = build()
        return add_points(solve, frequency, value, modes, few=few, sums=sums)
    except InputError:
        return frequency, value
