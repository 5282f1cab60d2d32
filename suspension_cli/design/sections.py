"""Uniform stretches of wires: sections with their defaults filled in, tapers cut into steps.

A taper is cut into steps of equal length. Each step has the exact properties of its piece of the
cone: the compliances of stretching, bending and twisting (each strained alone), and the mass with
its polar moment. With r going linearly from a to b,

    mean of 1/r^2 = 1/(a b),    mean of 1/r^4 = (a^2 + a b + b^2)/(3 a^3 b^3),

so a step's area is pi a b, its moments of area are those of the radius (mean of 1/r^4)^(-1/4), and
its mass is that of the frustum. The wire's spring constant is thus exact for any number of steps;
the stiffness of bending under tension, which weights the places within a step differently,
converges with the square of the length of a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from suspension_cli.design.wires import Section, Wire, WireSection, WireSet

STEPS = 16
"""Number of steps of a taper for which the design gives none."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of wire.

    Attributes
    ----------
    length : float
        Loaded, m.
    material : str or None
    section : Section or None
        Cross-section of a ribbon.
    radii : tuple of float
        At the upper and lower end of a round stretch, m.
    """

    length: float
    material: str | None
    section: Section | None
    radii: tuple[float, float] = (0.0, 0.0)

    @property
    def area(self) -> float:
        """Area of the cross-section for stretching, m^2."""
        if self.section is not None:
            return self.section.width * self.section.thickness
        return math.pi * self.radii[0] * self.radii[1]

    @property
    def depth(self) -> tuple[float, float]:
        """Size across the wire in the two planes of bending, m.

        Thickness and width, or the diameter with the step's bending compliance.
        """
        if self.section is not None:
            return self.section.thickness, self.section.width
        a, b = self.radii
        diameter = 2 * a if a == b else 2 * (3 * a**3 * b**3 / (a * a + a * b + b * b)) ** 0.25
        return diameter, diameter

    @property
    def moments(self) -> tuple[float, float]:
        """Second moments of area for bending in the two planes, m^4."""
        d, b = self.depth
        if self.section is not None:
            return b * d**3 / 12, d * b**3 / 12
        return math.pi * d**4 / 64, math.pi * d**4 / 64

    @property
    def torsion(self) -> float:
        """Torsion constant J in m^4."""
        if self.section is not None:
            return rectangle_torsion(*self.depth)
        return sum(self.moments)

    @property
    def bulk(self) -> tuple[float, float]:
        """Volume per length (m^2) and its polar moment per length (m^4), for mass and inertia."""
        if self.section is not None:
            return self.area, sum(self.moments)
        a, b = self.radii
        return math.pi * (a * a + a * b + b * b) / 3, math.pi / 10 * sum(
            a**n * b ** (4 - n) for n in range(5)
        )


def area(radius: float | None, section: Section | None) -> float:
    """Compute the cross-section of a uniform wire in m^2."""
    if section is not None:
        return section.width * section.thickness
    assert radius is not None
    return math.pi * radius**2


def thinnest(wire: WireSet | Wire) -> float | None:
    """Find the smallest cross-section of a wire, m^2, where stress is largest; None if unknown."""
    if wire.sections is not None:
        thin = (
            min(piece.radius, key=_real) if isinstance(piece.radius, list) else piece.radius
            for piece in wire.sections
        )
        return min(
            (
                area(radius, piece.section)
                for radius, piece in zip(thin, wire.sections, strict=True)
            ),
            key=_real,
        )
    return None if wire.radius is None and wire.section is None else area(wire.radius, wire.section)


def _real(value: complex) -> float:
    """Key for comparing numbers that may carry complex steps."""
    return value.real


def stretches(wire: WireSet | Wire, length: float) -> list[Stretch]:
    """Divide a wire of a loaded `length` (m) into uniform stretches, from its upper to lower end.

    There are none if the cross-section is not given. Lengths given by the design may miss `length`
    by 1e-6 and are scaled to sum to it.
    """
    if wire.sections is None:
        if wire.radius is None and wire.section is None:
            return []
        return [_uniform(length, wire.material, wire)]
    given = sum(piece.length or 0.0 for piece in wire.sections)
    rest = length - given if any(piece.length is None for piece in wire.sections) else 0.0
    scale = 1.0 if rest.real > 0 else length / given
    return [
        one
        for piece in wire.sections
        for one in _steps(
            piece, scale * (rest if piece.length is None else piece.length), wire.material
        )
    ]


def _steps(piece: WireSection, length: float, material: str | None) -> list[Stretch]:
    """Divide one section of a design into uniform stretches."""
    name = piece.material or material
    if not isinstance(piece.radius, list):
        return [_uniform(length, name, piece)]
    upper, lower = piece.radius
    count = STEPS if piece.steps is None else piece.steps
    radii = [upper + (lower - upper) * n / count for n in range(count + 1)]
    return [Stretch(length / count, name, None, (radii[n], radii[n + 1])) for n in range(count)]


def _uniform(length: float, material: str | None, table: WireSet | Wire | WireSection) -> Stretch:
    radius = 0.0 if table.radius is None or isinstance(table.radius, list) else table.radius
    return Stretch(length, material, table.section, (radius, radius))


def rectangle_torsion(width: float, thickness: float) -> float:
    """Compute St Venant's torsion constant of a rectangle, m^4.

    J = w t^3/3 (1 - 192 t/(pi^5 w) sum over odd n of tanh(n pi w/2t)/n^5) for w >= t (Timoshenko
    and Goodier, Theory of Elasticity, section 109). The sum is 31 zeta(5)/32 minus that of (1 -
    tanh)/n^5, which converges to rounding in a few terms.
    """
    w, t = max(width, thickness), min(width, thickness)
    total = ODD_FIFTH - sum(
        _one_less_tanh(n * math.pi * w / (2 * t)) / n**5 for n in range(1, 16, 2)
    )
    return w * t**3 / 3 * (1 - 192 * t / (math.pi**5 * w) * total)


ODD_FIFTH = 31 * 1.0369277551433699 / 32
"""Sum of 1/n^5 over odd n: 31 zeta(5)/32."""


def _one_less_tanh(x: float) -> float:
    return 2 / (math.exp(2 * x) + 1) if x < 300 else 0.0
