"""Labels that measured modes may have got from each other: the exchange of two that mends a fit.

Every pair of labels of one experiment is judged by chi^2 at the start and at the end of the fit, without a search; the best few are fitted anew.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from suspension_cli.analysis import search
from suspension_cli.analysis.search import Problem
from suspension_cli.design.measured import Measured, Mode
from suspension_cli.design.scene import Array
from suspension_cli.errors import InputError

TRIED = 3
"""Exchanges that are fitted anew."""
MENDS = 0.1
"""Share of chi^2 to which an exchange must bring it down to be worth naming."""


@dataclass(frozen=True)
class Exchange:
    """Two labels of measured modes that fit better the other way round.

    Attributes
    ----------
    experiment : int
        From 0.
    labels : pair of str
    chi_squared : float
        Of the fit with these labels exchanged.
    """

    experiment: int
    labels: tuple[str, str]
    chi_squared: float


def best(problem: Problem, measured: Measured, texts: Sequence[str], files: Sequence[str], level: str, end: Array, chi_squared: float) -> Exchange | None:
    """The exchange of two labels with which the fit is best; None if none mends it.

    Parameters
    ----------
    problem : Problem
    measured : Measured
    texts, files : sequence of str
        Designs as TOML, and their files.
    level : str
    end : (p,) array
        The numbers of the fit.
    chi_squared : float
        Of the fit.
    """
    candidates = sorted(_candidates(problem, measured, end), key=lambda item: item[0])
    found = []
    for _, experiment, first, second in candidates[:TRIED]:
        changed = _exchanged(measured, experiment, first, second)
        try:
            again = search.problem(texts, changed, files, level)
            _, reached = search.least_squares(again, again.start)
        except InputError:
            continue
        names = [str(measured.modes[experiment][n].label) for n in (first, second)]
        found.append(Exchange(experiment, (names[0], names[1]), reached))
    mended = min(found, key=lambda item: item.chi_squared, default=None)
    return mended if mended is not None and mended.chi_squared < MENDS * chi_squared else None


def _candidates(problem: Problem, measured: Measured, end: Array) -> list[tuple[float, int, int, int]]:
    """What each exchange does to chi^2, at the start or at the end: (change, experiment, first mode, second mode)."""
    found = []
    for e, (item, own) in enumerate(zip(problem.experiment, problem.shared.T, strict=True)):
        named = [n for n, mode in enumerate(measured.modes[e]) if mode.label is not None]
        computed = [item.measured(x[own])[0] for x in (problem.start, end)]
        seen, sigma = item.frequency, item.uncertainty
        for i, j in itertools.combinations(named, 2):
            changes = [
                sum(((f[here] - seen[there]) / sigma[there]) ** 2 - ((f[here] - seen[here]) / sigma[here]) ** 2 for here, there in ((i, j), (j, i)))
                for f in computed
            ]
            found.append((float(min(changes)), e, i, j))
    return found


def _exchanged(measured: Measured, experiment: int, first: int, second: int) -> Measured:
    """The measurements with the labels of two modes of one experiment exchanged."""
    modes: list[Mode] = list(measured.modes[experiment])
    for here, there in ((first, second), (second, first)):
        modes[here] = msgspec.structs.replace(modes[here], label=measured.modes[experiment][there].label)
    if measured.experiment is None:
        return msgspec.structs.replace(measured, mode=modes)
    experiments = list(measured.experiment)
    experiments[experiment] = msgspec.structs.replace(experiments[experiment], mode=modes)
    return msgspec.structs.replace(measured, experiment=experiments)
