"""Loss angles of wires and blades against frequency, and the drag of a thin gas.

>>> across, along = surface_drag(Gas(pressure=1e-5, temperature=293.0))
>>> round(1e9 * across, 2), round(1e9 * along, 2)  # of a square metre, nN s/m
(48.3, 13.53)

Loss angles are sums over the mechanisms of `design.materials`, finite at zero frequency. `omega` is
in rad/s, not negative, or complex (of a damped mode).

The gas is so thin that its molecules do not collide with each other. They leave a surface in random
directions (diffuse reflection, at the temperature of the gas). m is the mass of a molecule, n their
number per volume, p = n k T the pressure, f the Maxwell distribution of one component of velocity
with variance s^2 = k T/m; j = n s/sqrt(2 pi) molecules hit a surface at rest per area and time.

*Tangential motion.*  Each molecule that arrives lacks the velocity of the surface: the drag per
area and velocity is c = m j = p sqrt(m/(2 pi k T)).

*Normal motion,* with velocity u into the gas. Molecules arrive with w > 0 against the surface and
transfer m n times the integral of w^2 f(u - w), whose slope in u at rest is 2 m j = 2 c. As many
leave, with the mean momentum m s sqrt(pi/2) each, and their number grows with u by n/2:
m s sqrt(pi/2) n/2 = (pi/2) c. The sum is c (2 + pi/2).

A cube of side a thus has the drag a^2 c (8 + pi) = p a^2 sqrt(32 m/(pi k T)) (1 + pi/8) of
Cavalleri et al., Phys. Lett. A 374, 3365 (2010). The gas is free all around: squeezed films between
near surfaces damp more.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import BOLTZMANN
from suspension_cli.design.bodies import Body
from suspension_cli.design.cross_sections import plate
from suspension_cli.design.schema import Gas
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import BladeLoss, Section

if TYPE_CHECKING:
    from jaxtyping import Inexact

    Omega = Inexact[np.ndarray, "*#frequency"] | complex
    Angle = Inexact[np.ndarray, "*frequency"]


def bending_angle(
    section: Section,
    plane: int,
    omega: Omega,
    tension: Inexact[np.ndarray, "*#frequency"] | complex,
    temperature: float,
) -> Angle:
    """Loss angle of the bending of a wire at a temperature (K), rad.

    `plane` is 0 or 1, as in `section.rigidity`; the tension (N) sets the static strain for the
    thermoelastic loss.
    """
    result = 0.0 * np.asarray(omega)
    for own in section.losses:
        angle = own.bending(section.shape, plane, omega, temperature)
        if (coefficient := own.coefficient(section.shape.area, temperature)) is not None:
            free, slope = coefficient
            angle = angle * (free - slope * np.asarray(tension)) ** 2
        result = result + angle
    return result


def bending_causes(
    section: Section, plane: int, omega: Omega, temperature: float
) -> dict[str, Angle]:
    """Loss angles of bending, rad, of the mechanisms that are listed under their own causes."""
    return {
        own.cause: own.bending(section.shape, plane, omega, temperature)
        for own in section.losses
        if own.cause
    }


def stretching_angle(section: Section, omega: Omega) -> Angle:
    """Loss angle of the stretching of a wire, rad."""
    zero = 0.0 * np.asarray(omega)
    return sum((own.stretching(section.shape, omega) for own in section.losses), zero)


def twisting_angle(section: Section, omega: Omega) -> Angle:
    """Loss angle of the twisting of a wire, rad."""
    zero = 0.0 * np.asarray(omega)
    return sum((own.twisting(section.shape, omega) for own in section.losses), zero)


def blade_angle(blade: BladeLoss, omega: Omega) -> Angle:
    """Loss angle of the bending of a blade or of the wires of a link, rad.

    The static stress averages to zero across the thickness, so the tension does not enter.
    """
    if blade.losses is None:
        return blade.angle + 0.0 * np.asarray(omega)
    shape = blade.shape or plate(blade.thickness)
    result = 0.0 * np.asarray(omega)
    for own in blade.losses:
        angle = own.bending(shape, 0, omega, blade.temperature)
        coefficient = own.coefficient(1.0, blade.temperature)
        result = result + (angle if coefficient is None else angle * coefficient[0] ** 2)
    return result


def surface_drag(gas: Gas) -> tuple[float, float]:
    """Drag per area and velocity of a surface in normal and in tangential motion, N s/m^3."""
    assert gas.temperature is not None
    along = gas.pressure * math.sqrt(gas.molecule / (2 * math.pi * BOLTZMANN * gas.temperature))
    return (2 + math.pi / 2) * along, along


def body_damping(body: Body, gas: Gas) -> Array | None:
    """Damping matrix (6, 6) of a body at its COM, N s/m and N m s; None without a surface.

    For a box, a cylinder or a sphere, centred at the COM; the wall of a hole counts as free
    surface. A body of which only the surface area is known is taken as a sphere.
    """
    drag = surface_drag(gas)
    if body.shape is None:
        return None if body.surface_area is None else np.diag(_sphere(body.surface_area, *drag))
    if body.shape == "sphere":
        assert body.radius is not None
        return np.diag(_sphere(4 * math.pi * body.radius**2, *drag))
    if body.shape == "box":
        assert body.size is not None
        return np.diag(_box(body.size, *drag))
    assert body.radius is not None and body.length is not None
    axis = "xyz".index(body.axis or "x")
    push, push_along, turn, turn_along = _cylinder(
        body.radius, body.inner_radius or 0.0, body.length, *drag
    )
    values = [push] * 3 + [turn] * 3  # across the axis
    values[axis] = push_along
    values[3 + axis] = turn_along
    return np.diag(values)


def _sphere(area: float, normal: float, along: float) -> list[float]:
    """Diagonal elements of a sphere of a surface area S.

    The square of the normal component of a unit velocity has the mean 1/3: S (normal + 2 along)/3,
    which is pi R^2 n m v (4/3) (1 + pi/8) with the mean velocity v of the molecules (Epstein, Phys.
    Rev. 23, 710 (1924)). It is the mean over all directions for any convex body of this surface. In
    a rotation all slides, with the mean square 2 R^2/3.
    """
    push = area * (normal + 2 * along) / 3
    turn = area * along * area / (6 * math.pi)
    return [push] * 3 + [turn] * 3


def _box(size: tuple[float, float, float], normal: float, along: float) -> list[float]:
    """Diagonal elements of a box.

    In a rotation about x, the point (x, y, z) moves with (0, -z, y): faces across x slide, with the
    mean of y^2 + z^2 = (b^2 + c^2)/12; faces across y move along their normal with mean square
    c^2/12 and slide with (b/2)^2; likewise, cyclically, for the others.
    """
    result: list[float] = [0.0] * 6
    for axis in range(3):
        a, b, c = (size[(axis + n) % 3] for n in range(3))
        result[axis] = 2 * b * c * normal + 2 * a * (b + c) * along
        ends = 2 * b * c * along * (b * b + c * c) / 12
        result[3 + axis] = (
            ends
            + 2 * a * c * (normal * c * c / 12 + along * b * b / 4)
            + 2 * a * b * (normal * b * b / 12 + along * c * c / 4)
        )
    return result


def _cylinder(
    radius: float, hole: float, length: float, normal: float, along: float
) -> tuple[float, float, float, float]:
    """Drag of a cylinder moving across and along its axis, and turning across and about its axis.

    With the axis z, a rotation about y moves the point (x, y, z) with (z, 0, -x). An end moves
    along its normal with x, whose square integrates to pi (R^4 - r^4)/4, and slides with L/2. On
    the wall at azimuth f the normal velocity is z cos f; the square of the tangential velocity is
    z^2 sin^2 f + R^2 cos^2 f.
    """
    end = math.pi * (radius**2 - hole**2)
    fourth = math.pi * (radius**4 - hole**4)
    walls = [r for r in (radius, hole) if r > 0]
    push = 2 * end * along + sum(math.pi * r * length * (normal + along) for r in walls)
    push_along = 2 * end * normal + sum(2 * math.pi * r * length * along for r in walls)
    wall_turn = sum(
        math.pi * r * length * ((normal + along) * length**2 / 12 + along * r * r) for r in walls
    )
    turn = fourth / 2 * normal + end * length**2 / 2 * along + wall_turn
    turn_along = fourth * along + sum(2 * math.pi * r**3 * length * along for r in walls)
    return push, push_along, turn, turn_along
