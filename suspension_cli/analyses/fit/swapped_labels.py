"""Search for two labels of measured modes whose exchange removes a misfit.

Pairs of labels of one experiment are ranked by chi^2 at the start and at the end of the fit; the
best few are fitted again.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from suspension_cli.analyses.fit import search
from suspension_cli.analyses.fit.search import Problem
from suspension_cli.design.measured import Measured, Mode
from suspension_cli.errors import InputError

if TYPE_CHECKING:
    from suspension_cli.analyses.fit.array_types import Numbers

MAX_REFITS = 3
"""Most exchanges that are fitted again."""
WORTH_REPORTING = 0.1
"""Fraction of chi^2 below which an exchange is reported."""


@dataclass(frozen=True)
class Exchange:
    """Two labels of an experiment (from 0) that fit better exchanged, and chi^2 of that fit."""

    experiment: int
    labels: tuple[str, str]
    chi_squared: float


def find_exchange(
    problem: Problem,
    measured: Measured,
    texts: Sequence[str],
    files: Sequence[str],
    level: str,
    end: Numbers,
    chi_squared: float,
) -> Exchange | None:
    """Find the exchange of two labels that reduces chi^2 most; None if none does enough.

    `end` and `chi_squared` are those of the fit.
    """
    candidates = sorted(_candidates(problem, measured, end), key=lambda item: item[0])
    found = []
    for _, experiment, first, second in candidates[:MAX_REFITS]:
        changed = _exchange(measured, experiment, first, second)
        try:
            again = search.build_problem(texts, changed, files, level)
            _, reached = search.least_squares(again, again.start)
        except InputError:
            continue
        names = [str(measured.modes[experiment][n].label) for n in (first, second)]
        found.append(Exchange(experiment, (names[0], names[1]), reached))
    best = min(found, key=lambda item: item.chi_squared, default=None)
    return best if best and best.chi_squared < WORTH_REPORTING * chi_squared else None


def _candidates(
    problem: Problem, measured: Measured, end: Numbers
) -> list[tuple[float, int, int, int]]:
    """Estimate the change of chi^2 by each exchange: (change, experiment, first mode, second mode).

    It is the smaller of those at the start and at the end of the fit.
    """
    found = []
    for e, (item, own) in enumerate(zip(problem.experiment, problem.shared.T, strict=True)):
        named = [n for n, mode in enumerate(measured.modes[e]) if mode.label is not None]
        computed = [item.predict(x[own])[0] for x in (problem.start, end)]
        measured_hz, sigma = item.frequency, item.uncertainty
        for i, j in itertools.combinations(named, 2):
            changes = [
                sum(
                    ((f[here] - measured_hz[there]) / sigma[there]) ** 2
                    - ((f[here] - measured_hz[here]) / sigma[here]) ** 2
                    for here, there in ((i, j), (j, i))
                )
                for f in computed
            ]
            found.append((float(min(changes)), e, i, j))
    return found


def _exchange(measured: Measured, experiment: int, first: int, second: int) -> Measured:
    """Exchange the labels of two measured modes of one experiment."""
    modes: list[Mode] = list(measured.modes[experiment])
    for here, there in ((first, second), (second, first)):
        modes[here] = msgspec.structs.replace(
            modes[here], label=measured.modes[experiment][there].label
        )
    if measured.experiment is None:
        return msgspec.structs.replace(measured, mode=modes)
    experiments = list(measured.experiment)
    experiments[experiment] = msgspec.structs.replace(experiments[experiment], mode=modes)
    return msgspec.structs.replace(measured, experiment=experiments)
