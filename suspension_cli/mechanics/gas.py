"""Drag of a gas so thin that its molecules meet the suspension, not each other.

Molecules that leave a surface have forgotten where they came from (diffuse reflection, at the gas's temperature).
m is a molecule's mass, n their number a volume, p = n k T the pressure, f the Maxwell distribution of one component of velocity with
variance s^2 = k T/m; at rest j = n s/sqrt(2 pi) molecules meet a unit of area in a unit of time.

*Along itself.*  Each molecule that arrives lacks the surface's velocity: c = m j = p sqrt(m/(2 pi k T)) a unit of area and velocity.

*Along its normal,* with u into the gas.  Molecules arrive with w > 0 against the surface and hand over m n times the integral of
w^2 f(u - w), whose slope in u at rest is 2 m j = 2 c.  As many leave, with the mean momentum m s sqrt(pi/2) each, and their
number grows with u by n/2: m s sqrt(pi/2) n/2 = (pi/2) c.  Together c (2 + pi/2).

A cube of side a thus has the drag a^2 c (8 + pi) = p a^2 sqrt(32 m/(pi k T)) (1 + pi/8) of Cavalleri et al., Phys. Lett. A 374,
3365 (2010).  There the gas is free all round: squeezed films between near surfaces damp more.
"""

from __future__ import annotations

import math

import numpy as np

from suspension_cli.conventions import BOLTZMANN
from suspension_cli.design.fibres import Gas, Section
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Body


def surface_drag(gas: Gas) -> tuple[float, float]:
    """Force a unit of area and velocity on a surface that moves along its normal, and along itself, N s/m^3."""
    along = gas.pressure * math.sqrt(gas.molecule / (2 * math.pi * BOLTZMANN * gas.temperature))
    return (2 + math.pi / 2) * along, along


def wire_drag(section: Section, gas: Gas) -> tuple[float, float, float, float]:
    """Drag per length of a wire that moves across itself in its first and in its second plane and along itself, N s/m^2, and turns about itself, N s.

    Round: half of the surface's pi d counts as normal, half as tangential.  Ribbon: two faces and two edges.
    """
    normal, along = surface_drag(gas)
    if section.round:
        d = section.depth[0]
        across = math.pi / 2 * d * (normal + along)
        return across, across, math.pi * d * along, math.pi / 4 * d**3 * along
    t, w = section.depth
    turning = normal * (w**3 + t**3) / 6 + along * w * t * (w + t) / 2
    return 2 * (w * normal + t * along), 2 * (t * normal + w * along), 2 * (w + t) * along, turning


def body_damping(body: Body, gas: Gas) -> Array | None:
    """Damping matrix (6, 6) of a body at the COM of its shape, N s/m, N s and N m s; None if it has no shape.

    Parameters
    ----------
    body : Body
        A box or a cylinder; the wall of a hole counts as free surface.
    gas : Gas
    """
    if body.shape is None:
        return None
    drag = surface_drag(gas)
    if body.shape == "box":
        assert body.size is not None
        return np.diag(_box(body.size, *drag))
    assert body.radius is not None and body.length is not None
    axis = "xyz".index(body.axis or "x")
    push, push_along, turn, turn_along = _cylinder(body.radius, body.inner_radius or 0.0, body.length, *drag)
    values = [push] * 3 + [turn] * 3
    values[axis], values[3 + axis] = push_along, turn_along
    return np.diag(values)


def _box(size: tuple[float, float, float], normal: float, along: float) -> list[float]:
    """Of a box, the six diagonal elements.

    Turning about x, the point (x, y, z) moves with (0, -z, y): faces across x slide, with the mean of y^2 + z^2 = (b^2 + c^2)/12;
    faces across y move along their normal with mean square c^2/12 and slide with (b/2)^2; and so on round.
    """
    found: list[float] = [0.0] * 6
    for axis in range(3):
        b, c = size[(axis + 1) % 3], size[(axis + 2) % 3]
        a = size[axis]
        found[axis] = 2 * b * c * normal + 2 * a * (b + c) * along
        ends = 2 * b * c * along * (b * b + c * c) / 12
        found[3 + axis] = ends + 2 * a * c * (normal * c * c / 12 + along * b * b / 4) + 2 * a * b * (normal * b * b / 12 + along * c * c / 4)
    return found


def _cylinder(radius: float, hole: float, length: float, normal: float, along: float) -> tuple[float, float, float, float]:
    """Of a cylinder, pushing it across and along its axis and turning it across and about its axis.

    With the axis z, turning about y moves the point (x, y, z) with (z, 0, -x).  An end moves along its normal with x, which
    integrates to pi (R^4 - r^4)/4, and slides with L/2.  On the wall at azimuth f the normal velocity is z cos f, the rest
    z^2 sin^2 f + R^2 cos^2 f is sliding.
    """
    end = math.pi * (radius**2 - hole**2)
    fourth = math.pi * (radius**4 - hole**4)
    walls = [r for r in (radius, hole) if r > 0]
    push = 2 * end * along + sum(math.pi * r * length * (normal + along) for r in walls)
    push_along = 2 * end * normal + sum(2 * math.pi * r * length * along for r in walls)
    wall_turn = sum(math.pi * r * length * ((normal + along) * length**2 / 12 + along * r * r) for r in walls)
    turn = fourth / 2 * normal + end * length**2 / 2 * along + wall_turn
    turn_along = fourth * along + sum(2 * math.pi * r**3 * length * along for r in walls)
    return push, push_along, turn, turn_along
