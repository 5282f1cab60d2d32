"""A quantity: a scalar result of a design, with a name, a unit and one way to compute it.

Quantities are computed for batches of balanced designs (`solved.Solved`), so that a sweep, a
tolerance analysis and an optimisation read the same numbers. What several of them need is computed
once: each says what it `needs`, and the needs of all quantities of a run are merged.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.models import registry
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.design.schema import Design


@dataclass(frozen=True)
class Quantity(ABC):
    """A scalar result of a design.

    Attributes
    ----------
    text
        Its name, as printed: ``thermal test.x:10``.
    unit
        SI unit; ``1`` for a number.
    signed
        Whether its sign means something (a static rotation); a limit is then one of the magnitude.
    missing
        Why a design with an equilibrium may have no value.
    steady
        Whether it describes a steady state, which a design whose motion grows does not have.
    bends
        Whether it needs wires that bend, as losses act there.
    wire_mass
        Whether wires must have mass.
    largest
        Value that stands for an infinite one in a search for a design.
    vanishes
        Whether it is 0 in some designs and positive on both sides of them, like the distance of
        modes that cross.
    zero
        Why it is exactly 0, where it is.
    undamped
        Whether it is of undamped modes, which are those of wires without mass.
    slow
        Whether it is computed design by design, which takes some 0.05 to 0.5 s each.
    analytic
        Whether it follows from `functions` that are analytic in the numbers of a design.
    within
        Least and largest value, SI, that any design can have.
    jumps
        Whether it jumps between values, so that it has no derivative.
    of_loops
        Whether it depends on loops of local control.
    negligible
        Size below which errors of maps are relative to this size: smaller values are rounding
        errors.
    """

    text: str
    unit: str

    signed: ClassVar[bool] = False
    missing: ClassVar[str] = "has no value"
    steady: ClassVar[bool] = True
    bends: ClassVar[bool] = False
    wire_mass: ClassVar[bool] = False
    largest: ClassVar[float] = math.inf
    vanishes: ClassVar[bool] = False
    zero: ClassVar[str] = "by symmetry"
    undamped: ClassVar[bool] = False
    slow: ClassVar[bool] = False
    analytic: ClassVar[bool] = False
    within: ClassVar[tuple[float, float]] = (-math.inf, math.inf)
    jumps: ClassVar[bool] = False
    of_loops: ClassVar[bool] = False
    negligible: ClassVar[float] = 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest value, SI, that it can have."""
        return self.within

    @property
    def function_count(self) -> int:
        """Number of its `functions`."""
        return 1

    def functions(self, solved: Solved) -> Inexact[np.ndarray, "design function"]:
        """Analytic functions of the numbers of a design from which it follows, if `analytic`."""
        return self.read(solved)[:, None]

    def of_functions(
        self, functions: Inexact[np.ndarray, "design function"]
    ) -> Inexact[np.ndarray, " design"]:
        """Values as those of `read`, from those of its `functions`."""
        return functions[:, 0]

    @property
    def needs(self) -> Needs:
        """What must be solved for it, beside the equilibrium."""
        return Needs()

    @abstractmethod
    def read(self, solved: Solved) -> Inexact[np.ndarray, " design"]:
        """Read the values of a batch, SI; NaN where a design has none.

        Complex values count by their magnitude.
        """

    def change(self, old: Solved, new: Solved) -> Float[np.ndarray, " design"]:
        """Change of the values of a batch from one model to a more complete one.

        Relative to the `scale`; NaN where a design has none in either model, infinite where it has
        one in only one of them, or a finite one.
        """
        before = self.values(old)
        after = self.values(new)
        with np.errstate(invalid="ignore", divide="ignore"):
            relative = np.abs(after - before) / self.scale(new, after)
        relative = np.where(after == before, 0.0, relative)
        return np.where(np.isnan(before) != np.isnan(after), np.inf, relative)

    def scale(self, solved: Solved, values: Float[np.ndarray, " design"]) -> float:
        """Size to which changes of the `values` of a batch are relative: the largest finite one."""
        del solved
        return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))

    def ends(
        self, solved: Solved, *, smooth: bool
    ) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, " design"]]:
        """Smallest and largest value of a batch that the name may mean, for limits on either side.

        Both are the value, except where two modes share the motion that names one. If `smooth`, as
        a search needs it, the other mode gains influence gradually. A search may cross designs
        without a steady state: their values are formal ones, and a mode that grows has minus its
        growth rate over 2 pi for a frequency. NaN where a design has no equilibrium.
        """
        del smooth
        found = self.read(solved)
        size = np.abs(found) if np.iscomplexobj(found) else found
        value = np.where(solved.hangs, np.minimum(size, self.largest), np.nan)
        return value, value

    def level(self, wanted: str, design: Design) -> str:
        """Name of the model in which it is computed of a design if a model is wanted."""
        if self.wire_mass:
            return registry.VIOLIN.name
        may_bend = self.bends and not registry.BEAM.unsuitable(design)
        if may_bend and not registry.by_name(wanted).bends_wires:
            return registry.BEAM.name
        return wanted

    def values(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Values of a batch, SI; NaN where a design has none, or no equilibrium."""
        found = self.read(solved)
        size = np.abs(found) if np.iscomplexobj(found) else found
        valid = solved.is_steady if self.steady else solved.hangs
        return np.where(valid, size, np.nan)


def evaluate(
    quantities: Sequence[Quantity], solved: Solved
) -> Float[np.ndarray, "design quantity"]:
    """Evaluate quantities of a batch, SI; NaN where a design has none."""
    columns = [quantity.values(solved) for quantity in quantities]
    return np.stack(columns, axis=1) if columns else np.zeros((solved.count, 0))
