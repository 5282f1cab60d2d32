"""Table `body` of a stage: mass and inertia, given or of a homogeneous shape."""

from __future__ import annotations

import math
from typing import Literal

from suspension_cli.design import tables
from suspension_cli.design.tables import Problems, Table, key
from suspension_cli.design.units import BodySize, Density, Inertia, Mass, Row3

LEAST_INERTIA = 1e-30
"""Smallest moment of inertia, kg m^2: that of a microgram of less than a nanometre."""
THINNEST = 1e-12
"""Smallest ratio of two moments of inertia: that of a rod a millionth as thick as long."""
MOST_MASS = 1e9
"""Largest mass that follows from a density, kg: that of a given mass."""
KEYS = {
    None: (["mass", "inertia"], []),
    "cylinder": (["radius", "length"], ["axis", "inner_radius", "mass", "density"]),
    "box": (["size"], ["mass", "density"]),
}
"""Keys that a body without a shape, and each shape, needs, and others that it takes."""

Rows = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


class Body(Table, frozen=True):
    """A rigid body: mass and inertia, or a homogeneous shape with a mass or a density."""

    mass: Mass | None = None
    inertia: list[Inertia | Row3] | None = key(
        "moments of inertia about x, y, z at the COM, or a full 3x3, kg m^2", count=3
    )
    shape: Literal["cylinder", "box"] | None = key("homogeneous shape, instead of inertia")
    axis: Literal["x", "y", "z"] | None = key("axis of a cylinder")
    radius: BodySize | None = key("radius of a cylinder, m")
    inner_radius: BodySize | None = key("inner radius of a hollow cylinder, m")
    length: BodySize | None = key("length of a cylinder, m")
    size: tuple[BodySize, BodySize, BodySize] | None = key("sides of a box along x, y and z, m")
    density: Density | None = key("density of a shape in kg/m^3, instead of a mass")

    def check(self) -> Problems:
        """Check that a rigid body can have this mass and inertia."""
        import numpy as np

        mass, moments = body_mass(self), np.linalg.eigvalsh(body_inertia(self))
        if not tables.LEAST_MASS <= mass <= MOST_MASS:
            problem = f"the body has {mass:.3g} kg, not {tables.LEAST_MASS:g} to {MOST_MASS:g} kg"
            yield "mass" if self.density is None else "density", problem, "check the sizes, in m"
        elif moments[0] < max(LEAST_INERTIA, THINNEST * moments[-1]):
            key, remedy = "", "check the sizes, in m"
            if self.shape is None:
                key, remedy = "inertia", "give moments in kg m^2, products with the right signs"
            problem = (
                f"has a moment of inertia of {moments[0]:.3g} kg m^2, not positive or too small"
            )
            yield key, f"{problem} beside {moments[-1]:.3g} kg m^2", remedy

    rules = (
        tables.by_kind("shape", KEYS),
        tables.symmetric("inertia", tolerance=1e-12),
        tables.exactly_one("mass", "density", when=lambda body: body.shape is not None),
        tables.ordered("inner_radius", "radius", "give a smaller hole"),
    )


def body_mass(body: Body) -> float:
    """Compute the mass of a body in kg, given or from density and shape."""
    if body.mass is not None:
        return body.mass
    assert body.density is not None
    return body.density * volume(body)


def volume(body: Body) -> float:
    """Compute the volume of a shape in m^3."""
    if body.shape == "box":
        assert body.size is not None
        return body.size[0] * body.size[1] * body.size[2]
    assert body.radius is not None and body.length is not None
    return math.pi * (body.radius**2 - (body.inner_radius or 0.0) ** 2) * body.length


def body_inertia(body: Body) -> Rows:
    """Compute the inertia tensor about the COM in kg m^2, given or of a homogeneous shape.

    A hollow cylinder has m (R^2 + r^2)/2 about its axis and m (3 (R^2 + r^2) + L^2)/12 across it, a
    box m (b^2 + c^2)/12 about the axis that its sides b, c are normal to (any text on mechanics).
    """
    if body.inertia is not None:
        if isinstance(body.inertia[0], list):
            return tuple(tuple(row) for row in body.inertia)  # type: ignore[return-value, arg-type]
        return _diagonal(*body.inertia)  # type: ignore[arg-type]
    mass = body_mass(body)
    if body.shape == "box":
        assert body.size is not None
        a, b, c = (side**2 for side in body.size)
        return _diagonal(mass * (b + c) / 12, mass * (a + c) / 12, mass * (a + b) / 12)
    assert body.radius is not None and body.length is not None
    radii = body.radius**2 + (body.inner_radius or 0.0) ** 2
    along, across = mass * radii / 2, mass * (3 * radii + body.length**2) / 12
    moments = [across, across, across]
    moments["xyz".index(body.axis or "x")] = along
    return _diagonal(*moments)


def _diagonal(a: float, b: float, c: float) -> Rows:
    return ((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c))


def second_moments(body: Body) -> tuple[float, float, float]:
    """Integrate x^2, y^2, z^2 over the mass of a body, kg m^2: (I_y + I_z - I_x)/2 and so on."""
    rows = body_inertia(body)
    moments = [rows[n][n] for n in range(3)]
    x, y, z = (sum(moments) / 2 - moment for moment in moments)
    return x, y, z


def half_sides(body: Body) -> tuple[float, float, float]:
    """Compute half the size of a body along x, y, z, m; else that of the box of its inertia."""
    if body.shape == "box":
        assert body.size is not None
        x, y, z = (side / 2 for side in body.size)
    elif body.shape == "cylinder":
        assert body.radius is not None and body.length is not None
        halves = [body.radius] * 3
        halves["xyz".index(body.axis or "x")] = body.length / 2
        x, y, z = halves
    else:
        mass = body_mass(body)
        x, y, z = (math.sqrt(3 * max(moment, 0.0) / mass) for moment in second_moments(body))
    return x, y, z
