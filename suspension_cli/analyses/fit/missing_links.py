"""Links and cables that a design lacks, as explanations of a misfit.

The stiffness of a link between two bodies changes the stiffness of the suspension in a way that no
number of the design does. Pairs of bodies are ranked by the decrease of chi^2 to first order, with
all unknowns of the fit fitted too; links between the best are fitted.
"""

from __future__ import annotations

import contextlib
import itertools
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit import start
from suspension_cli.analyses.fit.experiment import Experiment
from suspension_cli.analyses.fit.explanations import MissingLink
from suspension_cli.analyses.fit.least_squares import covariance
from suspension_cli.analyses.fit.solution import ROUGH, Solution, best_of
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import reader
from suspension_cli.design.measured import Free
from suspension_cli.errors import InputError

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

Pair = tuple[str, str]

APART = 2
"""Most stages by which the ends of a link differ, unless one is on the support."""
FITTED = 2
"""Pairs of bodies for which links are fitted."""
STIFF = (1e6,) * 3 + (1e4,) * 3
"""Standard deviations of priors around 0, N/m and N m/rad: so wide that they only set the scale."""
TRIED = (0.0, *(10 ** (n / 2) for n in range(8)))
"""Stiffnesses along x, y and z, N/m, from which a link is fitted: the best of these."""
SHOWN = 3.0
"""Standard deviations from which a stiffness is reported."""
EXPLAINS = 0.5
"""Least part of the excess of chi^2 that a link must remove."""


def find(found: Solution, excess: float) -> tuple[MissingLink, ...]:
    """Find links that would explain a misfit, whose chi^2 is too large by `excess`, best first."""
    ends = []
    for pair in _ranked(found)[:FITTED]:
        try:
            link, chi_squared = _fit(found, pair)
        except (InputError, np.linalg.LinAlgError):
            continue
        if any(link) and found.chi_squared - chi_squared > max(EXPLAINS * excess, SHOWN**2):
            ends.append(MissingLink(pair, link, chi_squared))
    return tuple(sorted(ends, key=lambda one: one.chi_squared))


def _pairs(one: Experiment) -> list[Pair]:
    """List the pairs of bodies between which a link is likely."""
    bodies = [SUPPORT, *one.nominal.system.body]
    places = itertools.combinations(range(len(bodies)), 2)
    near = [(i, j) for i, j in places if i == 0 or j - i <= APART]
    # a link with the support begins with the stage
    return [(bodies[j], bodies[i]) if i == 0 else (bodies[i], bodies[j]) for i, j in near]


def _with_links(
    found: Solution, pairs: Sequence[Pair], names: Sequence[str] | None = None
) -> Solution:
    """Add links without stiffness to the design, which is free.

    `names` are the other free numbers, as they are; all those of the fit if None.
    """
    problem = found.problem
    one = found.problem.experiment[0]
    raw = tomllib.loads(one.text)
    free = [*problem.free]
    if names is not None:
        free = [item for item in free if item.name in names]
    taken = {str(item.get("name")) for item in raw.get("link", [])}
    for n, pair in enumerate(pairs, 1):
        name = f"missing-{n}"
        while name in taken:
            name += "x"
        link = {"name": name, "between": [*pair], "stiffness": [0.0] * 6}
        raw.setdefault("link", []).append(link)
        free += [
            Free(name=f"link.{name}.stiffness.{k}", prior=0.0, uncertainty=size, lower=0.0)
            for k, size in enumerate(STIFF, 1)
        ]
    start_of = dict(zip(one.free, problem.base, strict=True))
    base = np.array([start_of.get(item.name, 0.0) for item in free])
    text = reader.write_toml(raw, one.text)
    inside = replace(one, text=text, free=tuple(item.name for item in free), start=base, rates=None)
    shared = np.ones((len(free), 1), dtype=bool)
    return found.carry(replace(problem, experiment=[inside], free=free, shared=shared, base=base))


def _ranked(found: Solution) -> list[Pair]:
    """Rank pairs of bodies by the decrease of chi^2 to first order with a link between them."""
    pairs = _pairs(found.problem.experiment[0])
    wide = _with_links(found, pairs)
    slope = wide.problem.jacobian(wide.z)
    off = wide.problem.residual(wide.z)
    scale = wide.problem.unknowns.scale
    first = found.problem.count
    links = np.zeros(len(wide.z), dtype=bool)
    links[first : wide.problem.count] = True
    basis = np.linalg.qr(slope[:, ~links] * scale[~links])[0]
    rows = slope[:, links]
    size = np.sqrt((rows**2).sum(0))
    rows = rows - basis @ (basis.T @ rows)
    live = (rows**2).sum(0) > 1e-12 * size**2
    gains = []
    for n in range(len(pairs)):
        own = slice(6 * n, 6 * n + 6)
        mine = rows[:, own][:, live[own]]
        direction = np.linalg.qr(mine / np.sqrt((mine**2).sum(0)))[0]
        gains.append(float(((direction.T @ off) ** 2).sum()))
    order = np.argsort(gains)[::-1]
    return [pairs[n] for n in order if gains[n] > SHOWN**2]


def _fit(found: Solution, pair: Pair) -> tuple[tuple[float, ...], float]:
    """Fit with a link between two bodies; return its stiffness and chi^2.

    From the design as given with the link alone fitted first, else from the end of the fit.
    """
    whole = _with_links(found, [pair])
    alone = _with_links(found, [pair], ())
    alone = replace(alone, z=_nearest(alone)).refine()
    values = dict(zip(found.problem.unknowns.name, found.problem.unknowns.start, strict=True))
    values |= dict(zip(alone.problem.unknowns.name, alone.z, strict=True))
    end = whole.descend(whole.carry(whole.problem, values).z, **ROUGH)
    if end.misfit:
        end = best_of([end, whole.descend(whole.z, **ROUGH)])
    return _stiffness(end), end.chi_squared


def _nearest(alone: Solution) -> Array:
    """Choose the stiffness along all axes with which the resonances agree best with measured ones.

    A stiff link moves resonances by more than their distances.
    """
    tries = []
    for size in TRIED:
        z = alone.z.copy()
        z[:3] = size
        with contextlib.suppress(InputError):
            tries.append((start.mismatch(alone.problem, z), size))
    z = alone.z.copy()
    z[:3] = min(tries)[1] if tries else 0.0
    return z


def _stiffness(end: Solution) -> tuple[float, ...]:
    """Stiffness of the last link of a design, 0 where it is not clear of its uncertainty."""
    problem = end.problem
    last = slice(problem.count - len(DOFS), problem.count)
    spread = np.diag(covariance(problem, end.z, problem.jacobian(end.z)))[last]
    with np.errstate(invalid="ignore"):
        clear = end.z[last] > SHOWN * np.sqrt(spread)
    return tuple(
        float(value) if seen else 0.0 for value, seen in zip(end.z[last], clear, strict=True)
    )
