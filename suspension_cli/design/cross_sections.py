"""Cross-sections of wires: the properties that each has, and the round and the rectangular one.

Nothing else depends on the shape. Bending in plane 0 moves the wire along the thickness of a ribbon
(its soft plane), in plane 1 along its width.

**Surface loss.**  A layer at the surface is lossier than the bulk. It adds phi_bulk d_s mu S/V to
the loss angle phi_bulk of the bulk, where the dissipation depth d_s is a property of the finish and

    mu S/V = (integral of e^2 over the surface) / (integral of e^2 over the volume)

for the strain e of the deformation (Gretarsson and Harry, Rev. Sci. Instrum. 70, 4081 (1999)). The
methods `..._ratio` give it for each deformation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from suspension_cli.design.tables import Table, doc
from suspension_cli.design.units import WireSize

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Inexact

    Spectrum = Inexact[np.ndarray, "*frequency"]
    Frequencies = Spectrum | complex
    """Angular frequencies or phases: real, or complex for the analytic continuation."""


class CrossSection:
    """Cross-section of a wire; sizes in m.

    Attributes
    ----------
    key
        Key in the tables of wires.
    wire
        The wire that has it, for messages.
    form
        How to give it, for messages.
    round
        Whether it is the same in all directions across the wire.
    order
        Order n of its thermoelastic relaxation, see `relaxation`.
    """

    __slots__ = ()
    key: ClassVar[str]
    wire: ClassVar[str]
    form: ClassVar[str]
    round: ClassVar[bool] = False
    order = 0.5

    @classmethod
    def read(cls, value: Any) -> Self:
        """Make a cross-section from the value of its key."""
        return value

    @property
    def area(self) -> float:
        """Area for stretching, m^2."""
        raise NotImplementedError

    @property
    def least_area(self) -> float:
        """Smallest area along the wire, m^2, where stress is largest."""
        return self.area

    @property
    def depth(self) -> tuple[float, float]:
        """Size across the wire in the two planes of bending, m."""
        raise NotImplementedError

    @property
    def moments(self) -> tuple[float, float]:
        """Second moments of area for bending in the two planes, m^4."""
        raise NotImplementedError

    @property
    def torsion(self) -> float:
        """Torsion constant J, m^4."""
        raise NotImplementedError

    @property
    def polar_area(self) -> float:
        """Polar second moment of area over area, I_p/A in m^2, by which tension resists torsion."""
        raise NotImplementedError

    @property
    def bulk(self) -> tuple[float, float]:
        """Volume per length (m^2) and its polar moment per length (m^4), for mass and inertia."""
        return self.area, sum(self.moments)

    def bending_ratio(self, plane: int) -> float:
        """mu S/V of bending in one plane, 1/m.

        e ~ y, the distance from the neutral line. Of a ribbon with the depth d in the plane and the
        breadth b: two faces b (d/2)^2 each and two edges d^3/12 each, over b d^3/12: 6/d + 2/b. Of
        a round wire (pi r^3)/(pi r^4/4) = 8/d, the same for b = d.
        """
        return 6 / self.depth[plane] + 2 / self.depth[1 - plane]

    @property
    def stretching_ratio(self) -> float:
        """mu S/V of stretching, 1/m: circumference over area, as the strain is uniform."""
        return 2 / self.depth[0] + 2 / self.depth[1]

    @property
    def twisting_ratio(self) -> float:
        """mu S/V of twisting, 1/m."""
        raise NotImplementedError

    def relaxation(self, phase: Frequencies) -> Spectrum:
        """Thermoelastic loss angle of bending in a plane over its strength Delta.

        Parameters
        ----------
        phase
            w h^2/D, with h half the `depth` in the plane and D the diffusivity; complex for the
            analytic continuation.
        """
        from suspension_cli.design.relaxation import relaxation  # numpy

        return relaxation(phase, self.order)

    def drag(self, normal: float, along: float) -> tuple[float, float, float, float]:
        """Drag of a thin gas per length of wire.

        Parameters
        ----------
        normal, along
            Of a surface that moves along its normal or slides, per area and velocity, N s/m^3.

        Returns
        -------
        first, second, along, turning : float
            Of motion in the two planes of bending and along the wire, N s/m^2, and of rotation
            about its axis, N s.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Round(CrossSection):
    """Round cross-section, uniform or tapered linearly along a cone.

    A taper is cut into steps of equal length. Each step has the exact properties of its piece of
    the cone: the compliances of stretching, bending and twisting (each strained alone), and the
    mass with its polar moment. With r going linearly from a to b,

        mean of 1/r^2 = 1/(a b),    mean of 1/r^4 = (a^2 + a b + b^2)/(3 a^3 b^3),

    so a step's area is pi a b, its moments of area are those of the radius (mean of 1/r^4)^(-1/4),
    and its mass is that of the frustum. The spring constant is thus exact for any number of steps;
    the stiffness of bending under tension, which weights the places within a step differently,
    converges with the square of the step.

    Attributes
    ----------
    upper, lower
        Radius at the two ends, m.
    """

    key: ClassVar[str] = "radius"
    wire: ClassVar[str] = "a round wire"
    form: ClassVar[str] = "radius (one, or [upper, lower] of a taper)"
    round: ClassVar[bool] = True
    order = 1.0

    upper: float
    lower: float

    @classmethod
    def read(cls, value: float | list[float]) -> Self:
        """Make a cross-section from one radius, or from two of a taper, m."""
        return cls(*(value if isinstance(value, list) else (value, value)))

    def steps(self, count: int) -> list[Round]:
        """Cut a taper into steps of equal length, from the upper end."""
        radii = [self.upper + (self.lower - self.upper) * n / count for n in range(count + 1)]
        return [Round(radii[n], radii[n + 1]) for n in range(count)]

    @property
    def area(self) -> float:
        """Area pi a b of the mean compliance, m^2."""
        return math.pi * self.upper * self.lower

    @property
    def least_area(self) -> float:
        """Area at the thinner end, m^2."""
        return math.pi * min(self.upper, self.lower) ** 2

    @property
    def depth(self) -> tuple[float, float]:
        """Diameter with the bending compliance of the wire, m."""
        a, b = self.upper, self.lower
        diameter = 2 * a if a == b else 2 * (3 * a**3 * b**3 / (a * a + a * b + b * b)) ** 0.25
        return diameter, diameter

    @property
    def moments(self) -> tuple[float, float]:
        """pi d^4/64 in both planes, m^4, of the `depth` d."""
        moment = math.pi * self.depth[0] ** 4 / 64
        return moment, moment

    @property
    def torsion(self) -> float:
        """pi d^4/32, m^4."""
        return sum(self.moments)

    @property
    def polar_area(self) -> float:
        """d^2/8, m^2."""
        return self.depth[0] ** 2 / 8

    @property
    def bulk(self) -> tuple[float, float]:
        """Means of pi r^2 (m^2) and pi r^4/2 (m^4)."""
        a, b = self.upper, self.lower
        return math.pi * (a * a + a * b + b * b) / 3, math.pi / 10 * sum(
            a**n * b ** (4 - n) for n in range(5)
        )

    @property
    def twisting_ratio(self) -> float:
        """mu S/V of twisting, 1/m: e ~ r', so (2 pi r^3)/(pi r^4/2) = 4/r."""
        return 8 / self.depth[0]

    def drag(self, normal: float, along: float) -> tuple[float, float, float, float]:
        """Drag per length: half of the circumference pi d counts as normal, half as tangential."""
        d = self.depth[0]
        across = math.pi / 2 * d * (normal + along)
        return across, across, math.pi * d * along, math.pi / 4 * d**3 * along


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
        # tanh^2 = 1 - sech^2, and the sum of 1/n^4 over odd n is pi^4/96
        sech2 = sum(4 * e / ((1 + e) ** 2 * n**4) for n, e in _decays(w / t))
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
    total = ODD_FIFTH - sum(2 * e / ((1 + e) * n**5) for n, e in _decays(w / t))
    return w * t**3 / 3 * (1 - 192 * t / (math.pi**5 * w) * total)


ODD_FIFTH = 31 * 1.0369277551433699 / 32
"""Sum of 1/n^5 over odd n: 31 zeta(5)/32."""


def _decays(ratio: float) -> list[tuple[int, float]]:
    """List odd n and exp(-2 x), x = n pi w/2t: 1 - tanh x and sech^2 x in small numbers."""
    return [(n, math.exp(-n * math.pi * ratio)) for n in range(1, 16, 2)]
