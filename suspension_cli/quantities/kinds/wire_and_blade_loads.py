"""What wires and blades carry: tension, stress, stress over strength, and sag of blades.

The formulas are those of `physics.statics`, for a whole batch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.physics import statics
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved
from suspension_cli.scene.scene import select_scenes

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.physics.loads import BladeLoad, WireLoad

What = Literal["tension", "stress", "stress fraction", "sag"]
UNITS: dict[What, str] = {"tension": "N", "stress": "Pa", "stress fraction": "1", "sag": "m"}


@dataclass(frozen=True)
class Load(Quantity):
    """The largest tension, stress or sag of some wires or blades, by number."""

    what: What
    part: Literal["wire", "blade"]
    numbers: tuple[int, ...]

    steady: ClassVar[bool] = False
    analytic: ClassVar[bool] = True
    missing = "does not hang on taut wires"

    @property
    def bounds(self) -> tuple[float, float]:
        """A wire can only pull; a blade may be bent either way."""
        return (0.0 if self.part == "wire" else -math.inf, math.inf)

    @property
    def function_count(self) -> int:
        """One of each part: the largest of several is not analytic where another is largest."""
        return len(self.numbers)

    def functions(self, solved: Solved) -> Float[np.ndarray, "design part"]:
        """Those of all parts."""
        found = solved.on_strings(self._of_parts)
        return np.broadcast_to(found.reshape(solved.count, -1), (solved.count, len(self.numbers)))

    def of_functions(
        self, functions: Inexact[np.ndarray, "design part"]
    ) -> Float[np.ndarray, " design"]:
        """The largest of the parts."""
        return np.real(functions).max(-1)

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read the largest of the parts in each design."""
        return self.of_functions(self.functions(solved))

    def _of_parts(self, solved: Solved) -> Float[np.ndarray, "design part"]:
        shape = solved.count, len(self.numbers)
        if self.what == "tension":
            tension = solved.equilibrium.tension[..., list(self.numbers)]
            return np.broadcast_to(tension, shape).astype(float)
        result = np.full(shape, np.nan)
        list_loads = statics.wire_loads if self.part == "wire" else statics.blade_loads
        for n in np.flatnonzero(solved.hangs).tolist():
            scene = select_scenes(solved.scene, n)
            balanced = solved.equilibrium.select(n)
            loads = list(list_loads(solved.designs[n], scene, balanced))
            for k, place in enumerate(self.numbers):
                value = VALUES[self.what](loads[place])
                result[n, k] = np.nan if value is None else value
        return result


VALUES: dict[What, Callable[[WireLoad | BladeLoad], float | None]] = {
    "stress": lambda load: load.stress,
    "stress fraction": lambda load: load.fraction,
    "sag": lambda load: getattr(load, "sag", None),
}


def parse(what: What, text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``tension test.1``, ``stress test blade``, ``sag of upper blades`` and the like."""
    target = text.removeprefix(f"{what} ").removeprefix("of ")
    if not text.startswith(f"{what} ") or target.startswith("fraction "):
        return None
    part, numbers = _find_parts(target, names, text, option)
    wanted = {"tension": "wire", "sag": "blade"}.get(what, part)
    if part != wanted:
        problem = f"is a quantity of {wanted}s"
        raise InputError.of(option, problem, f"name {wanted}s", format_value(text))
    found = Load(text, UNITS[what], what, part, numbers)
    _demand_known(found, names, option)
    return found


def _find_parts(
    target: str, names: Names, text: str, option: str
) -> tuple[Literal["wire", "blade"], tuple[int, ...]]:
    """Find the wires or blades that ``test.1``, ``test wires`` or ``test blade`` names."""
    wires = list(names.system.wire)
    blades = names.blades
    if target in wires:
        return "wire", (wires.index(target),)
    if target in blades:
        return "blade", (blades.index(target),)
    stage, _, kind = target.rpartition(" ")
    every = {"wire": wires, "wires": wires, "blade": blades, "blades": blades}.get(kind, [])
    some = tuple(n for n, label in enumerate(every) if label.rpartition(".")[0] == stage)
    if some:
        return "blade" if kind.startswith("blade") else "wire", some
    stages = dict.fromkeys(label.rpartition(".")[0] for label in wires)
    known = [*wires, *blades, *(f"{stage} wires" for stage in stages)]
    known += [f"{stage} blades" for stage in dict.fromkeys(b.rpartition(".")[0] for b in blades)]
    remedy = suggest(target, known)
    raise InputError.of(option, "names no wire or blade", remedy, format_value(text))


def _demand_known(quantity: Load, names: Names, option: str) -> None:
    """Raise `InputError` if the design does not give what a stress follows from."""
    if quantity.what == "tension":
        return
    loads = names.statics.wires if quantity.part == "wire" else names.statics.blades
    for number in quantity.numbers:
        if VALUES[quantity.what](loads[number]) is None:
            needed = "cross-section" if quantity.part == "wire" else "geometry"
            missing = needed if loads[number].stress is None else "tensile_strength"
            problem = f"is not known: {loads[number].label} has no {missing}"
            remedy = f"give its {missing}"
            raise InputError.of(option, problem, remedy, format_value(quantity.text))


KINDS = (
    Kind(
        "tension WIRE, tension STAGE wires",
        "tension test.1",
        "N",
        "tension of a wire, or the largest of a stage",
        partial(parse, "tension"),
    ),
    Kind(
        "stress WIRE, stress STAGE wires|blades",
        "stress test.1",
        "Pa",
        "largest stress of a wire or blade, or of all of a stage",
        partial(parse, "stress"),
    ),
    Kind(
        "stress fraction WIRE, stress fraction STAGE wires|blades",
        "stress fraction test.1",
        "1",
        "stress over tensile strength",
        partial(parse, "stress fraction"),
    ),
    Kind(
        "sag of BLADE, sag of STAGE blades",
        "sag of upper blades",
        "m",
        "deflection of a blade's tip under its load",
        partial(parse, "sag"),
    ),
)
