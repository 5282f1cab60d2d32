"""Which parameters, and which of their combinations, the data of a fit determine.

It follows from the Jacobian J of the weighted residuals at the end of the fit.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.experiment import TYPICAL
from suspension_cli.analyses.fit.least_squares import data_rows
from suspension_cli.analyses.fit.printed_parameters import change_unit, short
from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.analyses.fit.result import Fitted

if TYPE_CHECKING:
    from jaxtyping import Bool

    from suspension_cli.scene.arrays import Array

WEAK = 10.0
"""Factor on the typical changes of parameters, to weaken their priors."""
KNOWN, UNKNOWN = 0.3, 0.8
"""Standard deviation over that of the prior, or over the value if there is none, below which a
parameter is determined by the data, and above which it is not."""
TOGETHER = 0.2
"""Standard deviation of a combination over the smallest of its members' below which only the
combination is determined."""
POWERS = np.array([1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 4.0, -4.0])
"""Exponents in a product of which only the product is determined."""


def describe(problem: Problem, slope: Array, fitted: Fitted) -> tuple[str, ...]:
    """Say which parameters the data determine without priors, one statement per line."""
    p = problem.count
    # of parameters without prior: the value that was found
    without = np.isinf(fitted.prior_sigma)
    typical = problem.unknowns.scale[:p]
    size = np.where(fitted.value != 0, np.abs(fitted.value), typical / TYPICAL)
    scale: Array = np.where(without, size, typical)
    rows = data_rows(problem, slope) * scale
    spread = np.linalg.inv(rows.T @ rows + np.eye(p) / WEAK**2)
    sigma = np.sqrt(np.diag(spread))
    names = [short(name) for name in fitted.parameters]
    units = [change_unit(*item) for item in zip(fitted.name, fitted.value.tolist(), strict=True)]
    lengths = [unit == "mm" for unit, _ in units]
    covariance = spread * np.outer(scale, scale)
    lines, taken = combinations(names, lengths, fitted.value, covariance, sigma > KNOWN)
    said: dict[str, list[str]] = {
        "determined: ": [],
        "hardly determined: ": [],
        "not determined by these data, so their values are from priors or the design: ": [],
    }
    good, poor, no = said.values()
    for n in (n for n in range(p) if n not in taken):
        unit, factor = units[n]
        known = f"{names[n]} (to {sigma[n] * scale[n] * factor:.2g} {unit})"
        if sigma[n] >= UNKNOWN:
            no.append(names[n])
        else:
            (good if sigma[n] <= KNOWN else poor).append(known)
    first, *others = (head + ", ".join(some) if some else "" for head, some in said.items())
    return tuple(line for line in (first, *lines, *others) if line)


def combinations(
    names: list[str],
    lengths: list[bool],
    value: Array,
    spread: Array,
    uncertain: Bool[np.ndarray, " parameter"],
) -> tuple[list[str], set[int]]:
    """Find combinations of two or three parameters of which only the combination is determined.

    Sums of lengths, or products of powers; `spread` is the covariance of the parameters. The
    coefficients are those of the smallest principal axis of the members' covariance, rounded.
    Returns a sentence about each combination, and all members.
    """
    found = []
    left = np.flatnonzero(uncertain).tolist()
    for some in itertools.chain(*(itertools.combinations(left, size) for size in (2, 3))):
        group = [*some]
        summed = all(lengths[n] for n in some)
        if not summed and (value[group] <= 0).any():
            continue
        unit = np.ones(len(group)) if summed else value[group]
        own = spread[np.ix_(group, group)] / np.outer(unit, unit)
        axis = np.linalg.eigh(own)[1][:, 0]
        simple = POWERS[: 2 if summed else len(POWERS)]
        off = np.abs((axis / (axis[0] or 1.0))[:, None] / simple - 1)
        weight = simple[off.argmin(1)]
        error = float(np.sqrt(max(weight @ own @ weight, 0.0)))
        relative = error / float(np.abs(weight).max() * np.sqrt(np.diag(own)).min())
        if relative < TOGETHER:
            line = _describe_combination([names[n] for n in group], weight, error, summed)
            found.append((len(group), relative, {*group}, line))
    lines = list[str]()
    taken = set[int]()
    for _, _, members, line in sorted(found, key=lambda item: item[:2]):
        if not taken & members:
            taken |= members
            lines.append(line)
    return lines, taken


def _describe_combination(names: list[str], weight: Array, error: float, summed: bool) -> str:
    """Say that only a sum of lengths, or a product of powers, is known."""
    below = (weight < 0).any()
    if summed and len(names) == 2:
        what = f"{'difference' if below else 'sum'} of {names[0]} and {names[1]}"
    elif summed:
        terms = zip(weight, names, strict=True)
        what = "sum " + " ".join(f"{'+' if w > 0 else '-'} {name}" for w, name in terms)[2:]
    else:
        powers = zip(np.abs(weight), names, strict=True)
        parts = np.array([name if size == 1 else f"{name}^{size:g}" for size, name in powers])
        kind = "ratio" if below and len(names) == 2 else "product"
        what = " / ".join([f"{kind} {' x '.join(parts[weight > 0])}", *parts[weight < 0]])
    size = f"{1e3 * error:.2g} mm" if summed else f"{100 * error:.2g} %"
    return f"only the {what} is known (to {size})"
