"""Measured quantities of a fit: their values and derivatives at any parameters.

    quantities = look_up(measured.quantity, text, file, "")
    values = evaluate([design], quantities, "beam")
    demand_values(values[0], quantities, "")  # raises InputError

Quantities have no derivatives in closed form: these are central differences, for which the designs
on both sides of all parameters are solved in one batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.design import reader
from suspension_cli.errors import Fault, InputError, format_value, gather
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.quantity import evaluate as evaluate_batch
from suspension_cli.quantities.solved import of_designs

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.design.measured import MeasuredQuantity
    from suspension_cli.design.schema import Design

STEP = 1e-3
"""Step of a difference, relative to a typical change of the parameter: the error of a central
difference is then some 1e-7 of it, that by rounding no larger."""


def look_up(
    measured: Sequence[MeasuredQuantity], text: str, file: str, where: str
) -> tuple[Quantity, ...]:
    """Look up measured quantities of a design (TOML, from a file).

    `where` is the prefix of their keys. Raises `InputError` with all that the design lacks.
    """
    if not measured:
        return ()
    names = names_of(reader.Source(reader.parse(text), text, file))

    def find(pair: tuple[int, MeasuredQuantity]) -> Quantity:
        number, one = pair
        key = f"{where}quantity.{number}.name"
        found = vocabulary.parse(one.name, names, key)
        vocabulary.demand_derivative(found, key)
        return found

    return tuple(gather(find, list(enumerate(measured, 1))))


def evaluate(
    designs: Sequence[Design | None], quantities: Sequence[Quantity], level: str
) -> Float[np.ndarray, "design quantity"]:
    """Evaluate quantities of designs in a model, SI; NaN where one has no value."""
    values = np.full((len(designs), len(quantities)), np.nan)
    for places, batch in of_designs(designs, level, Needs.of(quantities)):
        values[places] = evaluate_batch(quantities, batch)
    return values


def demand_values(
    values: Float[np.ndarray, " quantity"], quantities: Sequence[Quantity], where: str
) -> None:
    """Raise `InputError` with the quantities that have no value."""
    faults = [
        Fault(
            f"{where}quantity.{number}.name",
            f"the design {one.missing}",
            "leave it out, or fit from another start",
            format_value(one.text),
        )
        for number, (one, value) in enumerate(zip(quantities, values, strict=True), 1)
        if not np.isfinite(value)
    ]
    if faults:
        raise InputError(faults)


def differentiate(
    below: Float[np.ndarray, "parameter quantity"],
    above: Float[np.ndarray, "parameter quantity"],
    middle: Float[np.ndarray, " quantity"],
    step: Float[np.ndarray, " parameter"],
) -> Float[np.ndarray, "quantity parameter"]:
    """Differentiate values from those a step below and above each parameter.

    One-sided where a design on one side has no value, 0 where neither has one: that parameter
    cannot change alone.

    >>> one = np.array([[1.0]])
    >>> differentiate(0.9 * one, 1.1 * one, one[0], np.array([0.1]))
    array([[1.]])
    """
    both = (above - below) / (2 * step[:, None])
    up = (above - middle) / step[:, None]
    down = (middle - below) / step[:, None]
    slope = np.where(np.isfinite(both), both, np.where(np.isfinite(up), up, down))
    return np.nan_to_num(slope, posinf=0.0, neginf=0.0).T
