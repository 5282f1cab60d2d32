"""Rigid bodies: tables of a body and its parts; their mass, centre of mass, inertia and size.

A body of parts has an origin of its own, from which the places of the parts and all attachments on
it are. Of any other body the origin is the centre of mass (COM).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

from suspension_cli.design import key_rules, units
from suspension_cli.design.typed_tables import Problems, Table, given, key

LEAST_INERTIA = 1e-30
"""Smallest moment of inertia, kg m^2: that of a microgram of less than a nanometre."""
THINNEST = 1e-12
"""Smallest ratio of two moments of inertia: that of a rod a millionth as thick as long."""
MOST_MASS = 1e9
"""Largest mass that follows from a density, kg: that of a given mass."""
SHAPES: dict[object, tuple[list[str], list[str]]] = {
    "cylinder": (["radius", "length"], ["axis", "inner_radius", "mass", "density", "inertia"]),
    "box": (["size"], ["mass", "density", "inertia"]),
    "sphere": (["radius"], ["mass", "density", "inertia"]),
}
"""Keys that each shape needs, and others that it takes."""
OF_BODY = SHAPES | {None: (["mass", "inertia"], ["surface_area"])}
OF_PART = SHAPES | {None: (["mass"], ["inertia"])}
"""The same of a body and of a part, with those without a shape."""

Rows = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
Point = tuple[float, float, float]


class Solid(Table, frozen=True):
    """Mass and inertia, or a homogeneous shape with a mass or a density."""

    mass: units.Mass | None = None
    inertia: list[units.Inertia | units.Row3] | None = key(
        "moments of inertia about x, y, z at the COM, or a full 3x3, kg m^2",
        count=3,
    )
    shape: Literal["cylinder", "box", "sphere"] | None = key(
        "homogeneous shape; beside inertia, for the drag of [gas] and drawings alone"
    )
    axis: Literal["x", "y", "z"] | None = key("axis of a cylinder")
    radius: units.BodySize | None = key("radius of a cylinder or sphere, m")
    inner_radius: units.BodySize | None = key("inner radius of a hollow cylinder, m")
    length: units.BodySize | None = key("length of a cylinder, m")
    size: tuple[units.BodySize, units.BodySize, units.BodySize] | None = key(
        "sides of a box along x, y and z, m"
    )
    density: units.Density | None = key("density of a shape in kg/m^3, instead of a mass")

    rules = (
        key_rules.symmetric("inertia", tolerance=1e-12),
        key_rules.exactly_one("mass", "density", when=lambda solid: solid.shape is not None),
        key_rules.ordered("inner_radius", "radius", "give a smaller hole"),
    )


class BodyPart(Solid, frozen=True):
    """A part of a body: a homogeneous shape, or a mass at a point."""

    at: units.Vector = key("its COM, from the origin of the body, m", (0.0, 0.0, 0.0))

    rules = (key_rules.by_kind("shape", OF_PART),)


class Body(Solid, frozen=True):
    """A rigid body: mass and inertia, a homogeneous shape, or several parts."""

    surface_area: units.SurfaceArea | None = key(
        "area of the whole surface in m^2, for the drag of [gas]"
    )
    parts: list[BodyPart] = key(
        "shapes and point masses, whose origin is that of all attachments",
        [],
    )

    rules = (key_rules.by_kind("shape", OF_BODY, when=lambda body: not body.parts),)

    def check(self) -> Problems:
        """Check that a rigid body can have this mass and inertia."""
        import numpy as np

        beside = given(self, *(name for name in Solid.__struct_fields__)) if self.parts else []
        for name in beside:
            yield name, "conflicts with parts, from which it follows", "move it into a part"
        if beside or any(part.faults() for part in self.parts):
            return
        mass = body_mass(self)
        moments = np.linalg.eigvalsh(body_inertia(self))
        if not key_rules.LEAST_MASS <= mass <= MOST_MASS:
            problem = (
                f"the body has {mass:.3g} kg, not {key_rules.LEAST_MASS:g} to {MOST_MASS:g} kg"
            )
            where = "parts" if self.parts else "mass"
            yield where if self.density is None else "density", problem, "check the sizes, in m"
        elif moments[0] < max(LEAST_INERTIA, THINNEST * moments[-1]):
            where = ""
            remedy = "check the sizes, in m"
            if self.parts:
                where = "parts"
                remedy = "give sizes to parts that are points on one line"
            elif self.shape is None:
                where = "inertia"
                remedy = "give moments in kg m^2, products with the right signs"
            problem = (
                f"has a moment of inertia of {moments[0]:.3g} kg m^2, not positive or too small"
            )
            yield where, f"{problem} beside {moments[-1]:.3g} kg m^2", remedy


def has_surface(body: Body) -> bool:
    """Whether the surface of a body is known, on which gas exerts its drag."""
    return body.shape is not None or body.surface_area is not None


def body_mass(body: Any) -> float:
    """Compute the mass of a body or part in kg, given or from density and shape."""
    if parts := _parts(body):
        return sum(map(body_mass, parts))
    if body.mass is not None:
        return body.mass
    assert body.density is not None
    return body.density * volume(body)


def _parts(body: Any) -> Sequence[BodyPart]:
    return getattr(body, "parts", ())


def centre_of_mass(body: Body) -> Point:
    """Compute the COM of a body from its origin, m; 0 unless it has parts."""
    if not body.parts:
        return (0.0, 0.0, 0.0)
    mass = body_mass(body)
    x, y, z = (sum(body_mass(part) * part.at[n] for part in body.parts) / mass for n in range(3))
    return x, y, z


def volume(body: Any) -> float:
    """Compute the volume of a shape in m^3."""
    if body.shape == "box":
        return math.prod(body.size)
    if body.shape == "sphere":
        return 4 / 3 * math.pi * body.radius**3
    return math.pi * (body.radius**2 - (body.inner_radius or 0.0) ** 2) * body.length


def body_inertia(body: Any) -> Rows:
    """Compute the inertia tensor about the COM in kg m^2: given, of a shape, or of all parts.

    A hollow cylinder has m (R^2 + r^2)/2 about its axis and m (3 (R^2 + r^2) + L^2)/12 across it, a
    box m (b^2 + c^2)/12 about the axis that its sides b, c are normal to, a sphere 2 m R^2/5. A
    part whose COM is at r from that of the body adds m (r^2 - r r^T) to its own (Steiner's theorem;
    any text on mechanics).
    """
    if _parts(body):
        return _inertia_of_parts(body)
    mass: float = body_mass(body)
    moments: Any = body.inertia
    if moments is not None and isinstance(moments[0], list):
        return (*moments[0],), (*moments[1],), (*moments[2],)
    if moments is not None:
        pass  # a shape beside them is for its surface
    elif body.shape == "box":
        a, b, c = (side**2 for side in body.size)
        moments = [mass * (b + c) / 12, mass * (a + c) / 12, mass * (a + b) / 12]
    elif body.shape == "cylinder":
        radii = body.radius**2 + (body.inner_radius or 0.0) ** 2
        moments = [mass * (3 * radii + body.length**2) / 12] * 3
        moments["xyz".index(body.axis or "x")] = mass * radii / 2
    elif body.shape == "sphere":
        moments = [0.4 * mass * body.radius**2] * 3
    else:
        moments = [0.0] * 3  # a point mass
    a, b, c = moments
    return ((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c))


def _inertia_of_parts(body: Body) -> Rows:
    """Sum the inertia tensors of the parts about the COM of the body, kg m^2."""
    centre = centre_of_mass(body)
    rows = [[0.0] * 3 for _ in range(3)]
    for part in body.parts:
        mass = body_mass(part)
        own = body_inertia(part)
        arm = [place - middle for place, middle in zip(part.at, centre, strict=True)]
        square = sum(one**2 for one in arm)
        for i in range(3):
            for j in range(3):
                rows[i][j] += own[i][j] + mass * (square * (i == j) - arm[i] * arm[j])
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a, b, c), (d, e, f), (g, h, i)


def second_moments(body: Any) -> tuple[float, float, float]:
    """Integrate x^2, y^2, z^2 over the mass of a body, kg m^2: (I_y + I_z - I_x)/2 and so on."""
    rows = body_inertia(body)
    half = (rows[0][0] + rows[1][1] + rows[2][2]) / 2
    return half - rows[0][0], half - rows[1][1], half - rows[2][2]


def half_sides(body: Any) -> list[float]:
    """Compute half the size of a body along x, y, z, m; else that of the box of its inertia.

    Of a body of parts, the largest distance from its origin.
    """
    if parts := _parts(body):
        sides = [(part.at, [0.0] * 3 if _is_point(part) else half_sides(part)) for part in parts]
        return [max(abs(at[n]) + half[n] for at, half in sides) for n in range(3)]
    if body.shape == "box":
        return [side / 2 for side in body.size]
    if body.shape == "cylinder":
        halves = [body.radius] * 3
        halves["xyz".index(body.axis or "x")] = body.length / 2
        return halves
    if body.shape == "sphere":
        return [body.radius] * 3
    mass = body_mass(body)
    return [math.sqrt(3 * max(moment, 0.0) / mass) for moment in second_moments(body)]


def _is_point(part: BodyPart) -> bool:
    return part.shape is None and part.inertia is None
