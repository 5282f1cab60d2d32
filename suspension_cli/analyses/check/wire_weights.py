"""Weight of wires: sag, softening, and the error of straight wires."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from suspension_cli.analyses.check.columns import Column
from suspension_cli.analyses.check.statics import Statics, list_wire_tables
from suspension_cli.design.derive import gravity_strength, wire_line_densities
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand

NOTED = 4e-3
"""Weight over tension above which `check` notes that a design leaves it out; frequencies of
pendulums change by up to a quarter of it."""


@dataclass(frozen=True)
class WireWeights:
    """Weight of the wires of a design.

    Attributes
    ----------
    included : bool
        Whether the design includes it.
    total : float
        N.
    ratio, wire : float, str
        Largest weight over tension, and its wire.
    sag : float
        Largest distance of a wire from the straight line between its ends, m: w l / (8 T) for the
        part w of its weight across it (Irvine, Cable Structures, MIT Press (1981), section 1.2).
    error : float
        Error of the stiffness of straight wires: across, (W/T)^2 / 12, or along them, the largest
        decrease of a wire's stiffness k by its sag, w^2 k l / (12 T^3), over k (Ernst, Der
        Bauingenieur 40, 52 (1965)).
    """

    included: bool
    wire: str
    total: Annotated[float, Column("total_n")]
    ratio: Annotated[float, Column("largest_over_tension")]
    sag: Annotated[float, Column("sag_m")]
    error: Annotated[float, Column("error")]

    @property
    def line(self) -> str:
        """Describe the weight in a line; "" if it is left out and small."""
        if not self.included:
            if self.ratio < NOTED:
                return ""
            return (
                f"wires weigh up to {100 * self.ratio:.2g} % of their tension ({self.wire});"
                " constants.wire_weight = true includes this"
            )
        sag = f"largest sag {1e3 * self.sag:.3g} mm"
        return (
            f"wires weigh {self.total:.4g} N, up to {100 * self.ratio:.2g} % of their tension"
            f" ({self.wire}); {sag}; the error by straight wires is {100 * self.error:.1g} %"
        )


def solve(design: Design, statics: Statics) -> WireWeights | None:
    """Compute the weight of the wires; None where no density is known."""
    wires, gravity = expand(design).wires, gravity_strength(design)
    total = ratio = sag = softening = 0.0
    worst = ""
    tables = [table for stage in design.stage for table in list_wire_tables(stage)]
    for n, (table, load) in enumerate(zip(tables, statics.wires, strict=True)):
        length = float(wires.length[n])
        pieces = wire_line_densities(design, table, length)
        weight = gravity * sum(piece * density for piece, density in pieces)
        total += weight
        if weight / load.tension > ratio:
            ratio, worst = weight / load.tension, load.label
        across = weight * math.hypot(*wires.span[n, :2].tolist()) / length
        sag = max(sag, across * length / (8 * load.tension))
        stiffness = float(wires.stiffness[n]) * length
        softening = max(softening, across**2 * stiffness / (12 * load.tension**3))
    if not total:
        return None
    error = max(ratio**2 / 12, softening)
    included = design.constants.wire_weight
    return WireWeights(included, worst, total=total, ratio=ratio, sag=sag, error=error)
