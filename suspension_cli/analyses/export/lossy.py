"""The lossy system of the fewest states that the responses of an export need."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from suspension_cli.analyses.export import closed_poles
from suspension_cli.analyses.export.relaxation import Candidates, check_size, list_candidates
from suspension_cli.analyses.export.solve import (
    GRID,
    Ends,
    Exact,
    Exported,
    Opened,
    Orders,
    error_of_q,
    measure,
    modes_within,
    solve_exactly,
)
from suspension_cli.analyses.export.state_choice import Wanted, choose_states, correct, pose
from suspension_cli.errors import InputError
from suspension_cli.linear import damped
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.solver import Solver
from suspension_cli.linear.statespace import Poles, StateSpace
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

SAMPLES = 200
"""Number of frequencies of the band at which states with losses are chosen."""
SHIFT = 1e-4
"""Relative error of the frequency of a mode that counts as much as one of a response by `accuracy`,
if it is more than that share of the mode's width."""
MARGIN = 0.5
"""Error at the frequencies where states are chosen, over that which is allowed."""
GROWTH = 1.05
"""Ratio of the numbers of states of systems that are compared with the direct solution."""


@dataclass(frozen=True)
class _Search:
    """Systems of ever more states, and what they are compared with.

    Attributes
    ----------
    exact
        Responses of the direct solution.
    modes
        With all losses, of the suspension without loops.
    poles
        With the loops closed, those of the complete equations; else None.
    band
        Hz.
    accuracy
        Largest error of a response; of a Q twice that.
    """

    exact: Exact
    modes: Modes
    poles: Poles | None
    band: tuple[float, float]
    accuracy: float

    def measure(self, system: StateSpace) -> Exported:
        """Compare responses and Q, and with the loops closed their poles."""
        made = measure(system, self.exact, self.band, self.accuracy, zpk=False, narrow=False)
        if self.poles is None:
            return replace(made, q_error=error_of_q(system, self.modes, self.band))
        compared = closed_poles.compare(system, self.poles)
        return replace(made, q_error=compared.q_error(self.band), poles=compared)

    def is_sound(self, system: StateSpace) -> bool:
        """Whether a closed loop grows only if the complete one does."""
        return self.poles is None or closed_poles.agree_in_stability(system, self.poles)

    def is_enough(self, made: Exported) -> bool:
        """Whether the errors are as small as they are to be."""
        return max(made.worst, (made.q_error or 0.0) / 2) <= self.accuracy


def build_lossy(
    model: LinearSystem,
    ends: Ends,
    band: tuple[float, float],
    accuracy: float,
    *,
    order: int | None = None,
    zpk: bool = False,
    poles: Poles | None = None,
) -> Exported:
    """Build the system with losses, and with the mass of wires that the `model` has.

    States are added until responses off resonance have errors up to `accuracy` and Q up to twice
    that, in the band (Hz). If none suffices, or with the largest `order` given, it is the system of
    the smallest sum of the former and half of the latter. With the loops closed, `poles` are those
    of the complete equations. Raises `InputError` if the bodies need more states than `order`, or
    if the closed loops of no system are stable as the complete ones are.
    """
    check_size(model, band)
    solver = Solver(model)
    modes = damped.solve(solver)
    exact = solve_exactly(solver, np.geomspace(*band, GRID), ends)
    search = _Search(exact, modes, poles, band, accuracy)
    candidates = list_candidates(model, band)
    steps = _choose_steps(solver, candidates, modes, ends, band, accuracy)
    tried = list[Exported]()
    unsound: StateSpace | None = None
    smallest = 0
    for system in _build_steps(candidates, steps, ends, order):
        smallest = smallest or len(system.state)
        if order is not None and len(system.state) > order:
            break
        if not search.is_sound(system):
            unsound = system
            continue
        made = search.measure(system)
        if not tried or _total_error(made) < min(map(_total_error, tried)):
            tried.append(made)
        if order is None and search.is_enough(made):
            break
    if not tried:
        if unsound is not None and poles is not None:
            remedy = "lower --accuracy" if order is None else "raise --order"
            closed_poles.demand_same_stability(unsound, poles, f"{remedy}, or widen --band")
        what = "bodies" if poles is None else "bodies and filters"
        problem = f"is less than the {smallest} states of the {what} in these responses"
        raise InputError.of("--order", problem, "raise it, or take fewer signals", f"{order}")
    best = tried[-1]
    if zpk:
        measured = measure(best.system, exact, band, accuracy, zpk=True, narrow=False)
        best = replace(measured, q_error=best.q_error, poles=best.poles)
    orders = Orders(
        states=np.array([len(one.system.state) for one in tried]),
        worst=np.array([one.worst for one in tried]),
        q_error=np.array([one.q_error or 0.0 for one in tried]),
    )
    return replace(best, orders=orders)


def _total_error(made: Exported) -> float:
    """Sum of the largest error of a response and half of that of a Q."""
    return made.worst + (made.q_error or 0.0) / 2


def _build_steps(
    candidates: Candidates, steps: list[list[Array]], ends: Ends, order: int | None
) -> Iterator[StateSpace]:
    """Build the systems of some steps, each with `GROWTH` times the states of the one before."""
    last = 0
    fixed: int | None = None
    for number, strengths in enumerate(steps):
        added = candidates.count_states(strengths)
        if fixed is not None:
            if order is not None and fixed + added > order:
                return
            if number < len(steps) - 1 and fixed + added < GROWTH * last:
                continue
        system = ends.build(candidates.build(strengths))
        last = len(system.state)
        fixed = last - added
        yield system


def _choose_steps(
    solver: Solver,
    candidates: Candidates,
    modes: Modes,
    ends: Ends,
    band: tuple[float, float],
    accuracy: float,
) -> list[list[Array]]:
    """Choose strengths of candidates step by step, corrected once for what is not linear.

    Errors are relative to responses across the band, but near zeros to those beside them.
    """
    from scipy.ndimage import maximum_filter1d

    model = solver.system
    frequency = np.geomspace(*band, SAMPLES)
    inputs, outputs = ends.pairs(solver)
    # without loops: all that passes through the mechanics
    mechanics = Opened(inputs, outputs)
    exact = solve_exactly(solver, frequency, mechanics)
    some = modes_within(modes, band)
    q = modes.q[some]
    omega = 2 * np.pi * modes.frequency[some]
    pole = omega * (1j * np.sqrt(np.maximum(1 - 1 / (4 * q**2), 0.0)) - 1 / (2 * q))
    wanted = Wanted(
        inputs=inputs,
        outputs=outputs,
        frequency=frequency,
        size=maximum_filter1d(exact.size, 3, axis=0),
        pole=pole,
        shape=np.linalg.solve(model.basis, np.pad(modes.shape[some], ((0, 0), (6, 0))).T).T,
        in_quadrature=np.minimum(accuracy / (q * SHIFT), 1.0),
    )
    groups = pose(solver, candidates, wanted)
    enough = MARGIN * accuracy
    best = candidates.stable(choose_states(groups, enough))[-1]
    system = mechanics.build(candidates.build(best))
    size = np.where(wanted.size > 0, wanted.size, np.inf)
    error = (system.at(frequency) - exact.value) / size
    if not len(system.a):
        return [best]
    found = np.linalg.eigvals(system.a)
    nearest = found[np.abs(found - pole[:, None]).argmin(1)]
    groups = correct(groups, best, error, (nearest**2 - pole**2) / wanted.width)
    return candidates.stable(choose_states(groups, enough))
