"""Derivatives of any quantity with respect to numbers of a design, with their errors::

    found = differentiate(quantities, design, numbers, "beam")
    found.value, found.error  # (number, quantity)

Central differences of steps h, h/4, h/16 are extrapolated to h = 0: with D(h) = f' + a h^2 + b h^4,

    D_1(h) = (16 D(h) - D(4 h)) / 15,    D_2(h) = (256 D_1(h) - D_1(4 h)) / 255

(Richardson, Phil. Trans. R. Soc. A 226, 299 (1927)). Of all of these the one is taken that differs
least from those it was made of, and this difference is its error (Ridders, Adv. Eng. Softw. 4, 75
(1982)): small steps suffer from rounding, and from the tolerance of searches and integrals, large
ones from curvature.

Frequencies of undamped modes and responses have derivatives without such errors
(`studies.derivatives`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity, evaluate
from suspension_cli.quantities.solved import of_designs
from suspension_cli.studies.derivatives import size_of_changes
from suspension_cli.studies.parameters import Parameter, shifted
from suspension_cli.studies.variants import TOGETHER

if TYPE_CHECKING:
    from jaxtyping import Float

LARGEST = 4e-3
"""Largest step, relative to a number or to the size of a change that matters."""
RATIO = 4.0
"""Ratio of one step to the next smaller one."""
STEPS = 3
"""Number of steps."""


@dataclass(frozen=True)
class Slopes:
    """Derivatives, and their errors; unit of the quantity over that of the number.

    NaN where neighbours of the design do not have the quantity.
    """

    value: Float[np.ndarray, "number quantity"]
    error: Float[np.ndarray, "number quantity"]


def differentiate(
    quantities: Sequence[Quantity],
    design: Design,
    numbers: Sequence[Parameter],
    level: str,
    *,
    allow_unstable: bool = False,
) -> Slopes:
    """Differentiate quantities of a design by some numbers, in a model by its name."""
    sizes = np.array([size_of_changes(design, one) for one in numbers])
    steps = LARGEST * sizes[:, None] / RATIO ** np.arange(STEPS)
    designs = [
        shifted(design, one.name, sign * step)
        for one, own in zip(numbers, steps.tolist(), strict=True)
        for step in own
        for sign in (1, -1)
    ]
    values = np.full((len(designs), len(quantities)), np.nan)
    needs = Needs.of(quantities)
    for start in range(0, len(designs), TOGETHER):
        some = designs[start : start + TOGETHER]
        for places, batch in of_designs(some, level, needs, allow_unstable=allow_unstable):
            values[start + places] = evaluate(quantities, batch)
    sides = values.reshape(len(numbers), STEPS, 2, len(quantities))
    with np.errstate(invalid="ignore"):  # of infinite values
        central = (sides[:, :, 0] - sides[:, :, 1]) / (2 * steps[..., None])
    return Slopes(*extrapolate(np.moveaxis(central, 1, 0)))


def extrapolate(
    central: Float[np.ndarray, "step ..."],
) -> tuple[Float[np.ndarray, ...], Float[np.ndarray, ...]]:
    """Extrapolate central differences, the largest step first, to a step of 0; with the errors.

    >>> steps = 0.1 / RATIO ** np.arange(3)
    >>> value, error = extrapolate((np.sin(1 + steps) - np.sin(1 - steps)) / (2 * steps))
    >>> bool(abs(value - np.cos(1)) < error < 1e-6)
    True
    """
    best = np.array(central[-1])
    error = np.full(best.shape, np.inf)
    before = [central[0]]
    for difference in central[1:]:
        row = [difference]
        for order, old in enumerate(before, 1):
            factor = RATIO ** (2 * order)
            new = (factor * row[-1] - old) / (factor - 1)
            apart = np.fmax(np.abs(new - row[-1]), np.abs(new - old))
            better = apart < error
            best = np.where(better, new, best)
            error = np.where(better, apart, error)
            row.append(new)
        before = row
    return best, np.where(np.isnan(best), np.nan, error)
