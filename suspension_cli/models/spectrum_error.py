"""Error of a response or noise against frequency, from one model to a more complete one.

It is the largest relative change at the requested frequencies. Where a resonance or a zero shifts a
little the change has no bound, which says nothing about the shift. So frequencies within 5 % of a
mode of the bodies, in either model, are not compared: a shift of a resonance by the fraction delta
counts as 20 delta. The least magnitude to which a change is relative is a tenth of those 5 % below
and above (their geometric mean), so that a shift of a zero by delta counts as 200 delta.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.linear import eigenmodes
from suspension_cli.linear.solver import Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.wire_term import WireTerm
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    Solve = Callable[[Solver, Array], Inexact[np.ndarray, "frequency ..."]]
    """From the solver of a linear system and frequencies in Hz to values there."""

NEAR = 0.05
"""Relative distance from a mode within which models are not compared, and that of the magnitudes
with which one at a zero is compared."""
AT_ZERO = 0.1
"""Least magnitude to which a change is relative, over the magnitudes at that distance."""
MOST = 2000
"""Largest number of compared frequencies, evenly among those requested."""
TOGETHER = 32
"""Number of frequencies, in the order of their changes, whose surroundings are computed at once."""


class SpectrumError(NamedTuple):
    """Largest relative error, its frequency in Hz, and its place in the other axes."""

    value: float
    frequency: float
    place: tuple[int, ...]


def largest_error(
    frequency: Float[np.ndarray, " frequency"],
    simple: LinearSystem,
    refined: LinearSystem,
    solve: Solve,
) -> SpectrumError:
    """Compute the largest relative error of a model at the requested frequencies (Hz).

    They are the frequencies of a response or noise; `refined` is the more complete model.
    """
    complete = Solver(refined)
    at = away_from_modes(frequency, simple, refined)
    at = at[np.linspace(0, len(at) - 1, min(MOST, len(at))).astype(int)]
    old = solve(Solver(simple), at)
    new = solve(complete, at)
    change = _relative(np.abs(old - new), np.abs(new))
    bound = change.reshape(len(at), -1).max(1)  # what magnitudes beside a zero can only reduce
    order = np.argsort(-bound, kind="stable")
    found = SpectrumError(-1.0, math.nan, ())
    for start in range(0, len(at), TOGETHER):
        some = order[start : start + TOGETHER]
        if bound[some[0]] <= found.value:
            break
        low = np.abs(solve(complete, at[some] / (1 + NEAR)))
        high = np.abs(solve(complete, at[some] * (1 + NEAR)))
        least = AT_ZERO * np.sqrt(low) * np.sqrt(high)
        error = _relative(np.abs(old - new)[some], np.maximum(np.abs(new)[some], least))
        top = np.unravel_index(int(np.argmax(error)), error.shape)
        if error[top] > found.value:
            place = tuple(int(n) for n in top[1:])
            found = SpectrumError(float(error[top]), float(at[some[top[0]]]), place)
    return found


def _relative(
    change: Float[np.ndarray, "frequency ..."], size: Float[np.ndarray, "frequency ..."]
) -> Float[np.ndarray, "frequency ..."]:
    """Relative changes; 0 where nothing changes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(change == 0, 0.0, change / size)


def away_from_modes(
    frequency: Float[np.ndarray, " frequency"], *models: LinearSystem
) -> Float[np.ndarray, " away"]:
    """Frequencies (Hz, ascending) away from the bodies' modes in all models; all if none is."""
    grid = np.unique(np.asarray(frequency, dtype=float))
    modes = np.concatenate([eigenmodes.solve(model.constant).frequency for model in models])
    modes = modes[np.isfinite(modes) & (modes > 0)]
    away = grid[(np.abs(grid[:, None] / modes - 1) > NEAR).all(1)]
    return away if len(away) else grid


def first_violin(model: LinearSystem) -> float:
    """Lowest first violin mode, Hz, of all wires as strings: sqrt(T / (m l)) / 2."""
    result = math.inf
    for term in model.terms:
        if isinstance(term, WireTerm):
            sections = term.strand.fibre.sections
            mass = sum(s.mass * s.length for s in sections)
            length = sum(s.length for s in sections)
            result = min(result, math.sqrt(float(term.strand.tension) / (mass * length)) / 2)
    return result


def has_wire_mass(model: LinearSystem) -> bool:
    """Whether wires have mass, so that modes include violin modes."""
    return any(isinstance(term, WireTerm) and term.strand.massive for term in model.terms)
