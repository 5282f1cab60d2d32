"""What a sweep computes at each point: quantities by name, and modes followed by their shapes.

In a sweep ``5`` and ``modes`` are modes of the design as drawn, each followed from point to point
by its shape, so that its line is continuous. All other names mean in each design what they mean
anywhere else (`quantities.vocabulary`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import gather
from suspension_cli.grids import parse_place
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_bodies
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.kinds.modes import ALL, Frequency, FrequencyOfMode
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved
from suspension_cli.studies.job import nominal_system

if TYPE_CHECKING:
    from jaxtyping import Int


@dataclass(frozen=True)
class ModeAsDrawn(FrequencyOfMode):
    """Frequency, Hz, of what one mode of the design as drawn becomes.

    Over a grid it is followed from point to point (`solve.follow`). In a design alone it is the
    mode whose shape is most similar to the one as drawn.

    Attributes
    ----------
    place
        Number of the mode in the design as drawn, from 0 in ascending order.
    drawn
        That design, as TOML.
    numbered_in
        Name of the model whose modes are numbered.
    """

    place: int
    drawn: str = field(repr=False)
    numbered_in: str

    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """Number of the mode of most similar shape in each design."""
        return _pair(solved, self.drawn, self.numbered_in)[:, self.place]


@lru_cache(maxsize=4)  # all modes of a batch are paired at once, two models in turn
def _pair(solved: Solved, drawn: str, level: str) -> Int[np.ndarray, "design mode"]:
    """Numbers of the modes that those of a design as drawn become in each of some designs."""
    nominal = find_modes(drawn, level)
    result = np.full((solved.count, len(nominal.omega_squared)), -1)
    for n in np.flatnonzero(solved.hangs).tolist():
        solver = solved.solver(n)
        result[n] = pair_bodies(nominal, solver.constant.modes, solver.system)
    return result


@lru_cache(maxsize=8)
def find_modes(drawn: str, level: str) -> Modes:
    """Modes of a design, given as TOML, in a model."""
    return eigenmodes.solve(nominal_system(drawn, level))


def find_results(
    texts: Sequence[str], names: Names, drawn: str, level: str
) -> tuple[Quantity, ...]:
    """Look up results by name; all modes if there are none.

    `drawn` is the design as TOML, `level` the model whose modes are numbered. Raises `InputError`
    with all names that the design lacks.
    """
    labels = find_modes(drawn, level).numbered_label
    every = [ModeAsDrawn(label, "Hz", n, drawn, level) for n, label in enumerate(labels)]

    def find(text: str) -> Sequence[Quantity]:
        plain = text.strip()
        if plain == ALL:
            return every
        place = parse_place(plain, len(every))
        return vocabulary.parse(plain, names) if place is None else [every[place]]

    found = [one for some in gather(find, list(texts) or [ALL]) for one in some]
    by_label = {one.text for one in found if isinstance(one, Frequency)}
    distinct = [_rename(one, by_label) for one in found]
    return tuple(dict.fromkeys(distinct))


def _rename(quantity: Quantity, by_label: set[str]) -> Quantity:
    """Tell a mode that is followed from the one that is asked for by the same label."""
    if isinstance(quantity, ModeAsDrawn) and quantity.text in by_label:
        return replace(quantity, text=f"{quantity.text} (mode {quantity.place + 1})")
    return quantity
