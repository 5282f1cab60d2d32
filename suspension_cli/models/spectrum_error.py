"""Error of a response or noise against frequency, from one model to a more complete one.

It is the largest relative change at the requested frequencies. Where a resonance or a zero shifts a
little the change has no bound, which says nothing about the shift. So frequencies within 5 % of a
mode of the bodies, in either model, are not compared: a shift of a resonance by the fraction delta
counts as 20 delta. The least magnitude to which a change is relative is a tenth of those 5 % below
and above (their geometric mean), so that a shift of a zero by delta counts as 200 delta.

The more complete model is solved at a few of the frequencies alone, evenly, beside modes and where
the simple model has a zero or a peak; then at more of them beside those of the largest changes and
where it has zeros itself. Where wires with mass may resonate, it is solved at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.wire_term import WireTerm
from suspension_cli.scene.arrays import Array, Index

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
"""Largest number of frequencies, evenly among those requested, that are considered."""
EVENLY = 24
"""Number of compared frequencies that are spread evenly over these."""
LARGEST = 4
"""Number of compared frequencies with the largest changes beside which more are added."""
AROUND = 9
"""Number of those added between two neighbours."""
BELOW_VIOLINS = 0.9
"""Fraction of the lowest mode of wires below which none of them can resonate."""
ROUNDS = 2
"""How often these are added: a zero of the more complete model is narrow."""
TOGETHER = 32
"""Number of frequencies, in the order of their changes, whose surroundings are computed at once."""


class SpectrumError(NamedTuple):
    """Largest relative error, its frequency in Hz, and its place in the other axes."""

    value: float
    frequency: float
    place: tuple[int, ...]


def largest_error(
    frequency: Float[np.ndarray, " frequency"],
    simple: Solvable,
    refined: Solvable,
    solve: Solve,
) -> SpectrumError:
    """Compute the largest relative error of a model at the requested frequencies (Hz).

    They are the frequencies of a response or noise; `refined` is the more complete model.
    """
    quick = Solver.of(simple)
    complete = Solver.of(refined)
    modes = _modes(quick, complete)
    at = _away_from(modes, frequency)
    at = at[np.linspace(0, len(at) - 1, min(MOST, len(at))).astype(int)]
    old = solve(quick, at)

    def compare(some: Index) -> tuple[Array, Array]:
        """Values of the refined model at some of the frequencies, and bounds on the changes."""
        new = solve(complete, at[some])
        change = _relative(np.abs(old[some] - new), np.abs(new))
        return new, change.reshape(len(some), -1).max(1)

    chosen = _choose(at, modes, old)
    if has_wire_mass(complete.system):
        violins = np.flatnonzero(at > BELOW_VIOLINS * first_violin(complete.system))
        chosen = np.union1d(chosen, violins)
    new, bound = compare(chosen)  # magnitudes beside a zero can only reduce these bounds
    for _ in range(ROUNDS):
        more = _between(chosen, bound, new) if len(chosen) > 1 else chosen[:0]
        if not len(more):
            break
        added, its_bound = compare(more)
        place = np.searchsorted(chosen, more)
        chosen = np.insert(chosen, place, more)
        new = np.insert(new, place, added, axis=0)
        bound = np.insert(bound, place, its_bound)
    at = at[chosen]
    old = old[chosen]
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


def _choose(
    at: Float[np.ndarray, " frequency"],
    modes: Float[np.ndarray, " mode"],
    value: Inexact[np.ndarray, "frequency ..."],
) -> Index:
    """Number the frequencies to compare: evenly, beside modes, at extremes of the simple model."""
    last = len(at) - 1
    even = np.linspace(0, last, min(EVENLY, len(at))).astype(int)
    above = np.searchsorted(at, modes)
    beside = np.concatenate([above - 1, above]).clip(0, last)
    size = np.abs(value).reshape(len(at), -1)
    middle = size[1:-1]
    least = (middle <= size[:-2]) & (middle <= size[2:])
    most = (middle >= size[:-2]) & (middle >= size[2:])
    extreme = 1 + np.flatnonzero(((least | most) & (middle > 0)).any(1))
    return np.unique(np.concatenate([even, beside, extreme]))


def _between(
    chosen: Index, bound: Float[np.ndarray, " chosen"], new: Inexact[np.ndarray, "chosen ..."]
) -> Index:
    """Number more frequencies beside those of the largest changes, and around zeros.

    Between two frequencies where the refined model has opposite signs it has a zero.
    """
    largest = np.argsort(-bound)[:LARGEST]
    signs = np.real(new[1:] * np.conj(new[:-1])).reshape(len(new) - 1, -1)
    zero = np.flatnonzero((signs < 0).any(1))
    start = np.concatenate([largest - 1, largest, zero]).clip(0, len(chosen) - 2)
    gap = chosen[start + 1] - chosen[start]
    fraction = np.arange(1, AROUND + 1) / (AROUND + 1)
    between = chosen[start, None] + gap[:, None] * fraction
    return np.setdiff1d(between.astype(int), chosen)


def _modes(*models: Solvable) -> Float[np.ndarray, " mode"]:
    """Frequencies (Hz) of the bodies' modes in several models."""
    every = np.concatenate([Solver.of(model).constant.modes.frequency for model in models])
    return every[np.isfinite(every) & (every > 0)]


def _away_from(
    modes: Float[np.ndarray, " mode"], frequency: Float[np.ndarray, " frequency"]
) -> Float[np.ndarray, " away"]:
    """Frequencies (Hz, ascending) that are near none of the modes; all if there are none."""
    grid = np.unique(np.asarray(frequency, dtype=float))
    away = grid[(np.abs(grid[:, None] / modes - 1) > NEAR).all(1)]
    return away if len(away) else grid


def away_from_modes(
    frequency: Float[np.ndarray, " frequency"], *models: Solvable
) -> Float[np.ndarray, " away"]:
    """Frequencies (Hz, ascending) away from the bodies' modes in all models; all if none is."""
    return _away_from(_modes(*models), frequency)


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
