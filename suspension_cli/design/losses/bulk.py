"""Loss of the bulk of a material, and of its surface.

The loss angle of the bulk is a constant, or a table: linear in log f and log angle, constant beyond
its ends, at the real part of a complex frequency. The surface adds d_s mu S/V times that angle (see
`cross_sections.shape`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from suspension_cli.design import demand, units
from suspension_cli.design.losses.mechanism import Mechanism
from suspension_cli.design.tables import Problems, Table, doc, key

if TYPE_CHECKING:
    from suspension_cli.design.cross_sections.shape import CrossSection, Frequencies, Spectrum


class LossTable(Table, frozen=True):
    """Loss angle by frequency: interpolated linearly in the logarithms, constant outside."""

    frequency: list[units.Frequency] = key(
        "ascending frequencies in Hz", min_length=1, max_length=10000
    )
    angle: list[units.PositiveLossAngle] = key(
        "loss angle in rad at each of the frequencies", min_length=1, max_length=10000
    )

    rules = (demand.same_length("angle", "frequency"), demand.ascending("frequency"))


@dataclass(frozen=True)
class Bulk(Mechanism):
    """Loss of bulk and surface.

    Attributes
    ----------
    angle
        Constant loss angle of the bulk, rad.
    table
        Frequencies (Hz, ascending) and loss angles of the bulk (rad), instead of `angle`.
    surface_depth
        Dissipation depth d_s of the surface, m.
    """

    name: ClassVar[str] = "bulk"
    uniform: ClassVar[bool] = True
    keys: ClassVar[dict[str, Any]] = {
        "angle": Annotated[units.LossAngle, doc("constant loss angle of the bulk in rad")],
        "table": Annotated[
            LossTable,
            doc(
                "loss angle of the bulk by frequency, instead of a constant one:"
                " interpolated linearly in the logarithms"
            ),
        ],
        "surface_depth": Annotated[
            units.Separation,
            doc(
                "dissipation depth of the surface in m; default 0, or that of the built-in"
                " material unless the design gives another loss of the bulk"
            ),
        ],
    }

    angle: float
    table: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    surface_depth: float = 0.0

    @classmethod
    def merge(cls, own: Any, built_in: Any) -> dict[str, object]:
        """Merge the design's losses of bulk and surface with the built-in ones.

        A surface depth is relative to the loss angle of the bulk, so the built-in depth is dropped
        if the design gives a bulk loss.
        """
        angle = getattr(own.loss, "angle", None)
        angle = own.loss_angle if angle is None else angle
        table = getattr(own.loss, "table", None)
        depth = getattr(own.loss, "surface_depth", None)
        if angle is None and table is None and built_in.loss is not None:
            table, angle = built_in.loss.table, built_in.loss.angle
            depth = built_in.loss.surface_depth if depth is None else depth
        return {"angle": angle, "table": table, "surface_depth": depth}

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check that one loss of the bulk is given."""
        loss = own.loss
        if loss is None:
            return
        if loss.angle is not None and own.loss_angle is not None:
            problem = "conflicts with loss_angle, which is short for it"
            yield "loss.angle", problem, "keep one of the two"
        if loss.surface_depth and material.loss.angle is None and material.loss.table is None:
            problem = "has no effect without a loss of the bulk, to which it is relative"
            yield "loss.surface_depth", problem, "give angle or table too"
        if loss.table is not None and (own.loss_angle is not None or loss.angle is not None):
            yield "loss.table", "conflicts with a constant loss angle", "keep one of the two"

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants; None for a material without bulk loss."""
        del wire
        loss = material.loss
        if loss.table is not None:
            table = (tuple(loss.table.frequency), tuple(loss.table.angle))
            return cls(loss.angle or 0.0, table, loss.surface_depth or 0.0)
        return cls(loss.angle, None, loss.surface_depth or 0.0) if loss.angle else None

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle of bending in one plane, rad."""
        del temperature
        return self._at(omega, shape.bending_ratio(plane))

    def stretching(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of stretching, rad."""
        return self._at(omega, shape.stretching_ratio)

    def twisting(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of twisting, rad."""
        return self._at(omega, shape.twisting_ratio)

    def _at(self, omega: Frequencies, ratio: float) -> Spectrum:
        """Loss angle of bulk and surface for mu S/V = `ratio` in 1/m."""
        import numpy as np

        surface = 1 + self.surface_depth * ratio
        if self.table is None:
            return (self.angle + 0.0 * np.asarray(omega)) * surface
        frequency, angle = self.table
        inside = np.clip(np.real(omega) / (2 * math.pi), frequency[0], frequency[-1])
        return np.exp(np.interp(np.log(inside), np.log(frequency), np.log(angle))) * surface
