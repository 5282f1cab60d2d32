"""Responses between the points of a grid, for drawing alone: resonances and zeros to their tips."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.linear.response import Response
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Result
    from suspension_cli.linear.system import LinearSystem

STEP = 0.35
"""Largest change of log |H| or of its angle between neighbours."""
NARROWEST = 1e-11
"""Relative distance of neighbours at which the refinement ends: a pole or zero without loss."""
QUARTERS = np.array([0.25, 0.5, 0.75])
"""Where an interval is divided, on a logarithmic scale."""
MOST = 30
"""Largest number of passes."""
MANY = 8
"""Number of responses above which the frequencies of modes alone are added."""


def refine(result: Result) -> Response:
    """Add the frequencies at which resonances and zeros are resolved to a response.

    The values at the added frequencies are those of the result's model, built from its design, so
    that a results file is enough. A design that gives no model any more leaves the response as
    it is.
    """
    data: Response = result.data
    if len(data.frequency) < 8 or data.frequency[0] <= 0 or (np.diff(data.frequency) <= 0).any():
        return data
    try:
        model = result.extra.get("model") or result.choice.model.system(result.design)
        solve, modes = _solver(result, model)
        frequency, value = add_points(
            solve, data.frequency, data.value, modes, few=data.value[0].size <= MANY
        )
    except InputError:
        return data
    return replace(data, frequency=frequency, value=value)


def _solver(result: Result, model: LinearSystem) -> tuple[Callable[[Array], Any], Array]:
    """Return a function of frequencies (f,) in Hz to values (f, o, i), and modes in Hz."""
    data: Response = result.data
    known = signals.bodies_with_signals(model)
    inputs = [signals.parse_input(text, known) for text in data.input]
    outputs = [signals.parse_output(text, known) for text in data.output]
    if data.closed_loop:
        from suspension_cli.analyses.damp import control

        plant = control.build_plant(result.design, model)
        return (lambda at: control.solve_responses(plant, at, inputs, outputs).value), np.empty(0)
    modes = eigenmodes.solve(replace(model, terms=())).frequency
    return (lambda at: response.solve(model, at, inputs, outputs).value), modes


def add_points(
    solve: Callable[[Array], Any], frequency: Array, value: Any, modes: Array, *, few: bool = True
) -> tuple[Array, Any]:
    """Add frequencies until a response changes little between neighbours.

    Parameters
    ----------
    solve : callable
        Values (f, o, i) at frequencies (f,) in Hz.
    frequency : (f,) array
        Hz, ascending, above 0.
    value : (f, o, i) complex array
        Values there.
    modes : (m,) array
        Hz, where resonances are to be looked for.
    few : bool
        Whether to refine; otherwise the modes and points beside them are added.

    Returns
    -------
    frequency : (g,) array
        Hz, with those given.
    value : (g, o, i) complex array

    Examples
    --------
    >>> pole = lambda f: (1 / (1 - f**2 + 1e-5j * f))[:, None, None]
    >>> grid = np.array([0.5, 0.9, 1.2, 2.0])
    >>> _, found = add_points(pole, grid, pole(grid), np.array([1.0]))
    >>> round(float(abs(found).max()))
    100000
    """
    inside = modes[(modes > frequency[0]) & (modes < frequency[-1])]
    beside = inside[:, None] * (1 + np.array([-3e-3, -3e-4, -1e-5, 0.0, 1e-5, 3e-4, 3e-3]))
    frequency, value = _insert(solve, frequency, value, beside.ravel())
    for _ in range(MOST if few else 0):
        flat = value.reshape(len(value), -1)
        size = np.maximum(np.abs(flat), np.finfo(float).tiny)
        turn = np.angle(flat[1:] * flat[:-1].conj() / (size[1:] * size[:-1]))
        change = np.maximum(np.abs(np.diff(np.log(size), axis=0)), np.abs(turn))
        change = np.where((flat[1:] == 0) | (flat[:-1] == 0), 0.0, change).max(1, initial=0.0)
        gap = np.log(frequency[1:] / frequency[:-1])
        wide = np.flatnonzero((change > STEP) & (gap > NARROWEST))
        if not len(wide):
            break
        between = frequency[wide, None] * np.exp(gap[wide, None] * QUARTERS)
        frequency, value = _insert(solve, frequency, value, between.ravel())
    return frequency, value


def _insert(
    solve: Callable[[Array], Any], frequency: Array, value: Any, more: Array
) -> tuple[Array, Any]:
    """Insert the values at more frequencies inside a grid; those without a finite value are not."""
    more = np.setdiff1d(more[(more > frequency[0]) & (more < frequency[-1])], frequency)
    if not len(more):
        return frequency, value
    try:
        found = solve(more)
    except InputError:  # one of them is a pole without loss to the last bit
        more = more * (1 + 3e-13)
        try:
            found = solve(more)
        except InputError:
            return frequency, value
    place = np.searchsorted(frequency, more)
    return np.insert(frequency, place, more), np.insert(value, place, found, axis=0)
