"""Round cross-section, uniform or tapered linearly along a cone.

A taper is cut into steps of equal length. Each step has the exact properties of its piece of the
cone: the compliances of stretching, bending and twisting (each strained alone), and the mass with
its polar moment. With r going linearly from a to b,

    mean of 1/r^2 = 1/(a b),    mean of 1/r^4 = (a^2 + a b + b^2)/(3 a^3 b^3),

so a step's area is pi a b, its moments of area are those of the radius (mean of 1/r^4)^(-1/4), and
its mass is that of the frustum. The spring constant is thus exact for any number of steps; the
stiffness of bending under tension, which weights the places within a step differently, converges
with the square of the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Self

from suspension_cli.design.cross_sections.shape import CrossSection


@dataclass(frozen=True)
class Round(CrossSection):
    """Round cross-section.

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
