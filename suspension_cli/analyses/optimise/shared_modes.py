"""Modes that quantities of goals mean in a design: their numbers, and which share a motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from suspension_cli.quantities.kinds.mode_shapes import Difference, Distance, TopFraction
from suspension_cli.quantities.kinds.modes import FrequencyOfMode
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved


def number_of_mode(quantity: Quantity, solved: Solved) -> int:
    """Number, from 0, of the mode of which a quantity of the first design is.

    -1 if it is no frequency and no energy of a mode.
    """
    if isinstance(quantity, FrequencyOfMode):
        return int(quantity.number(solved)[0])
    if isinstance(quantity, TopFraction):
        return int(quantity.mode.number(solved)[0])
    return -1


def describe_shared(quantity: Quantity, solved: Solved) -> Iterator[str]:
    """Say which modes share the motions of a quantity in the first design, or that none has it."""
    for mode in _modes_of(quantity):
        content = mode.content(solved)
        if content is None:
            continue
        if mode.number(solved)[0] < 0:
            yield f"no mode is {mode.text} in this design"
            continue
        weight = mode.weights(solved, smooth=False)[0]
        together = np.flatnonzero(weight > 0)
        if len(together) < 2:
            continue
        order = together[np.argsort(-content[0, together], kind="stable")]
        hertz = " and ".join(f"{solved.frequency[0, number]:.5g}" for number in order)
        parts = " and ".join(f"{100 * content[0, number]:.0f}" for number in order)
        count = "two" if len(order) == 2 else str(len(order))
        yield (
            f"{count} modes share {mode.text} in this design: {hertz} Hz, with {parts} % of their"
            " kinetic energy in it; of these, limits take the one that violates them more"
        )


def _modes_of(quantity: Quantity) -> list[FrequencyOfMode]:
    if isinstance(quantity, FrequencyOfMode):
        return [quantity]
    if isinstance(quantity, TopFraction):
        return [quantity.mode]
    if isinstance(quantity, Distance | Difference):
        return [quantity.first, quantity.second]
    return []
