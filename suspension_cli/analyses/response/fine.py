"""Responses between the points of a grid, for drawing: resonances and zeros to their tips."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.drawing.added_points import add_points
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.linear.response import Response
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Result
    from suspension_cli.drawing.added_points import Solve
    from suspension_cli.linear.system import LinearSystem

MANY = 8
"""Number of responses above which the frequencies of modes alone are added."""


def refine(result: Result) -> Response:
    """Add the frequencies at which resonances and zeros are resolved to a response.

    Values there are those of the result's model, built from its design, so that a results file is
    enough. If that fails, the response stays as it is.
    """
    data: Response = result.data
    if len(data.frequency) < 8 or data.frequency[0] <= 0 or (np.diff(data.frequency) <= 0).any():
        return data
    try:
        model = result.linear_system or result.choice.model.system(result.design)
        solve, modes = _solver(result, model)
        few = data.value[0].size <= MANY
        frequency, value = add_points(solve, data.frequency, data.value, modes, few=few)
    except InputError:
        return data
    return replace(data, frequency=frequency, value=value)


def _solver(result: Result, model: LinearSystem) -> tuple[Solve, Array]:
    """A function of frequencies (f,) in Hz to values (f, o, i), and modes in Hz."""
    data: Response = result.data
    known = signals.bodies_with_signals(model)
    inputs = [signals.parse_input(text, known) for text in data.input]
    outputs = [signals.parse_output(text, known) for text in data.output]
    if data.closed_loop:
        from suspension_cli.analyses.damp import control

        plant = control.build_plant(result.design, model)
        return (lambda at: control.solve_responses(plant, at, inputs, outputs).value), np.empty(0)
    modes = eigenmodes.solve(model.constant).frequency
    return (lambda at: response.solve(model, at, inputs, outputs).value), modes
