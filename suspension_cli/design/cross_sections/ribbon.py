"""Rectangular cross-section of a ribbon."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from suspension_cli.design.cross_sections.shape import CrossSection
from suspension_cli.design.tables import Table, doc
from suspension_cli.design.units import WireSize


class Ribbon(Table, CrossSection, frozen=True):
    """A ribbon's rectangular cross-section: width along y, thickness along x."""

    key: ClassVar[str] = "section"
    wire: ClassVar[str] = "a ribbon"
    form: ClassVar[str] = "section { width, thickness }"

    width: Annotated[WireSize, doc("width along y, m")]
    thickness: Annotated[WireSize, doc("thickness along x, m")]

    @property
    def area(self) -> float:
        """w t, m^2."""
        return self.width * self.thickness

    @property
    def depth(self) -> tuple[float, float]:
        """Thickness and width, m."""
        return self.thickness, self.width

    @property
    def moments(self) -> tuple[float, float]:
        """w t^3/12 and t w^3/12, m^4."""
        d, b = self.depth
        return b * d**3 / 12, d * b**3 / 12

    @property
    def torsion(self) -> float:
        """St Venant's constant, m^4."""
        return rectangle_torsion(*self.depth)

    @property
    def polar_area(self) -> float:
        """(w^2 + t^2)/12, m^2."""
        return (self.thickness**2 + self.width**2) / 12

    @property
    def twisting_ratio(self) -> float:
        """mu S/V of twisting, 1/m.

        For w >= t: the shear is the gradient of Prandtl's function f (f_xx + f_yy = -2, f = 0 on
        the boundary), whose square integrates to J over the area. On the two short edges together
        the series of St Venant's problem gives S = 64 t^3/pi^4 times the sum over odd n of
        tanh^2(n pi w/2t)/n^4. For the long edges (L) Rellich's identity, here: the integral of
        (x.n) f_n^2 along the boundary is 4 J, gives w S/2 + t L/2 = 4 J. The ratio (S + L)/J tends
        to 6/t for a thin ribbon.
        """
        w, t = max(self.depth), min(self.depth)
        # tanh^2 = 1 - sech^2: the sum of 1/n^4 over odd n is pi^4/96, the rest decays as
        # exp(-n pi w/t)
        sech2 = sum(
            math.cosh(min(n * math.pi * w / (2 * t), 300.0)) ** -2 / n**4 for n in range(1, 16, 2)
        )
        short = 64 * t**3 / math.pi**4 * (math.pi**4 / 96 - sech2)
        constant = rectangle_torsion(w, t)
        return (short + (8 * constant - w * short) / t) / constant

    def drag(self, normal: float, along: float) -> tuple[float, float, float, float]:
        """Drag per length of two faces and two edges."""
        t, w = self.depth
        turning = normal * (w**3 + t**3) / 6 + along * w * t * (w + t) / 2
        across = 2 * (w * normal + t * along), 2 * (t * normal + w * along)
        return *across, 2 * (w + t) * along, turning


def rectangle_torsion(width: float, thickness: float) -> float:
    """Compute St Venant's torsion constant of a rectangle, m^4.

    J = w t^3/3 (1 - 192 t/(pi^5 w) sum over odd n of tanh(n pi w/2t)/n^5) for w >= t (Timoshenko
    and Goodier, Theory of Elasticity, section 109). The sum is 31 zeta(5)/32 minus that of (1 -
    tanh)/n^5, which converges to rounding in a few terms.
    """
    t, w = sorted((width, thickness))
    total = ODD_FIFTH - sum(
        _one_less_tanh(n * math.pi * w / (2 * t)) / n**5 for n in range(1, 16, 2)
    )
    return w * t**3 / 3 * (1 - 192 * t / (math.pi**5 * w) * total)


ODD_FIFTH = 31 * 1.0369277551433699 / 32
"""Sum of 1/n^5 over odd n: 31 zeta(5)/32."""


def _one_less_tanh(x: float) -> float:
    return 0.0 if x >= 300 else 2 / (math.exp(2 * x) + 1)
