"""Temperatures of bodies, from the heat that wires and links conduct."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from suspension_cli.design import heat_flow
from suspension_cli.design.locked_stages import as_in_file
from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.solver import Solver

START = "temperature of "


@dataclass(frozen=True)
class Temperature(Quantity):
    """Temperature of a body of a design with `[heat]`, K."""

    body: str

    steady: ClassVar[bool] = False
    slow: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    missing = "no temperature of it carries the heat away"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Solve for the flow of heat of each design."""
        return solved.each(self._find)

    def _find(self, solver: Solver, design: Design) -> float:
        del solver
        flow = heat_flow.solve(as_in_file(design))
        return math.nan if flow is None else flow.temperature[self.body]


def parse(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``temperature of test``."""
    if not text.startswith(START):
        return None
    flow = heat_flow.solve(as_in_file(names.design))
    if flow is None:
        remedy = "give [heat], from which temperatures follow"
        raise InputError.of(option, "has no value without [heat]", remedy, format_value(text))
    body = text.removeprefix(START)
    if body not in flow.temperature:
        remedy = suggest(body, list(flow.temperature))
        raise InputError.of(option, "names no body that conducts heat", remedy, format_value(text))
    return Temperature(text, "K", body)


KINDS = (
    Kind(
        "temperature of STAGE",
        "temperature of test",
        "K",
        "temperature that follows from the heat which wires and links conduct",
        parse,
    ),
)
