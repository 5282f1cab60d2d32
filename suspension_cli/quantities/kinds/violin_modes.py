"""Violin modes of wires, in the model in which wires have mass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.physics import wire_modes
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.design.schema import Design


@dataclass(frozen=True)
class ViolinMode(Quantity):
    """Lowest violin mode of some order, Hz, of the wires of a stage, or without one of all."""

    stage: str
    order: int

    wire_mass: ClassVar[bool] = True
    slow: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    missing = "has no such violin mode"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Search each design with wire mass."""
        return solved.in_model(registry.VIOLIN.name, lambda massive: massive.each(self._find))

    def _find(self, solver: Solver, design: Design) -> float:
        del design
        return wire_modes.lowest_violin_mode(solver, self.stage, self.order)


def parse(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``test violin 1`` and ``lowest violin``."""
    if text == "lowest violin":
        _demand_mass(names, text, option)
        return ViolinMode(text, "Hz", "", 1)
    stage, _, order = text.partition(" violin ")
    if not order:
        return None
    hung = list(dict.fromkeys(label.rpartition(".")[0] for label in names.system.wire))
    if stage not in hung:
        problem = "names no stage with wires"
        raise InputError.of(option, problem, suggest(stage, hung), format_value(text))
    if not (order.isascii() and order.isdigit() and 1 <= int(order) <= 100):
        remedy = f"write {stage} violin 1"
        raise InputError.of(option, "has no order from 1 to 100", remedy, format_value(text))
    _demand_mass(names, text, option)
    return ViolinMode(text, "Hz", stage, int(order))


def _demand_mass(names: Names, text: str, option: str) -> None:
    if why := registry.VIOLIN.unsuitable(names.design):
        problem = f"is not known: {why}"
        remedy = "give the material and the radius or section of its wires"
        raise InputError.of(option, problem, remedy, format_value(text))


KINDS = (
    Kind(
        "STAGE violin ORDER, lowest violin",
        "test violin 1",
        "Hz",
        "lowest violin mode of some order of the wires of a stage, or of all wires",
        parse,
    ),
)
