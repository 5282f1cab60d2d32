r"""Weight and inertia of bodies, blade tips, wires and bars, in a field uniform or with a gradient.

At a place r from the suspension point the acceleration is g + G r with a symmetric G, so a point
mass m has the energy -m (g . r + r . G r / 2).

A wire with weight is taken as straight: at the fraction s of its length from the upper end it is at
(1 - s) r_u + s r_l. Its mass enters by the moments

    m_uu = integral of (1 - s)^2 dm,  m_ul = integral of s (1 - s) dm,  m_ll = integral of s^2 dm,

m/3, m/6 and m/3 for a uniform wire. By the lever rule the masses m_uu + m_ul and m_ul + m_ll weigh
on the upper and the lower end. The kinetic energy is half of m_uu v_u^2 + 2 m_ul v_u . v_l + m_ll
v_l^2 (any text on finite elements). With these masses at the ends it is half of that of two points,
less m_ul (v_l - v_u)^2 / 2; so is the energy in a gradient. The tension of the wire is a mean along
it: the pull on the body above is larger, that on the body below smaller, by these weights. Sag is
neglected; its effect is of second order in weight over tension W/T: a static string of tension T(s)
has the transverse stiffness 1 / integral ds / T(s), below that of a straight wire by the fraction
(W/T)^2 / 12.

A bar (a leg of an inverted pendulum, the blades of a filter) is rigid and follows the formulas of a
wire, with moments of its own; spin about its axis is neglected.

In a gradient a body with the inertia tensor J has the additional energy -tr(G R S R^T) / 2, with
its second moments of mass S = tr(J)/2 - J and its rotation R (Goldstein, Classical Mechanics,
section 5.8). A further rotation by t changes P = R S R^T to exp([t]) P exp(-[t]). With M = -P G and
F = -G, and as [a] [b] = b a^T - a . b and tr(F [a] P [b]) = -sum of (b x u) . F (a x u) over the
P = sum of u u^T, the derivatives by t at t = 0 are

    (M_yz - M_zy, M_zx - M_xz, M_xy - M_yx)   and
    3 (M + M^T) / 2 + tr(P) tr(F) - 2 tr(M) - tr(F) P - tr(P) F.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import Attached, Configuration, Ends, SceneArrays
from suspension_cli.elements.derivatives import Derivatives, Terms
from suspension_cli.elements.element import Element
from suspension_cli.elements.vectors import (
    Matrix,
    Scalar,
    Vector,
    dot,
    plus_unit,
    product,
    symmetric,
    times,
    trace,
    transposed,
    unit,
)
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def lift(scene: Scene, place: Vector) -> Vector:
    """Gradient -(g + G r) of the energy per mass at places r from the suspension point, m/s^2."""
    vector, slope = _lift(scene), _slope(scene)
    vector = vector.reshape(3, *(1,) * (place.ndim - 1))
    if slope is None:
        return np.broadcast_to(vector, place.shape)
    return vector + np.tensordot(slope, place, 1)


def _lift(scene: Scene) -> Inexact[np.ndarray, " 3"]:
    """Gradient -g of the energy per mass at the suspension point."""
    return np.array([0.0, 0.0, scene.gravity]) if scene.field is None else -scene.field.vector


def _slope(scene: Scene) -> Inexact[np.ndarray, "3 3"] | None:
    """Second derivative -G of the energy per mass, 1/s^2; None in a uniform field."""
    return None if scene.field is None or scene.field.is_uniform else -scene.field.gradient


@dataclass(frozen=True)
class PointMasses:
    """Masses at points of bodies or at tips of blades.

    Attributes
    ----------
    ends
        Their bodies and blades.
    point
        In the frames of the bodies, m.
    mass
        kg.
    """

    ends: Ends
    point: Vector
    mass: Scalar

    def attached(self, now: Configuration) -> Attached:
        """The points in a pose."""
        arm, _ = now.arms(self.ends.upper, self.point, self.ends.blade)
        return Attached(self.ends, arm, arm)

    def places(self, now: Configuration) -> Vector:
        """Places from the suspension point, m."""
        return now.place[:, list(self.ends.upper)] + self.attached(now).upper_arm


@dataclass(frozen=True)
class MassLines:
    """What straight lines of mass have beyond the masses at their ends.

    Attributes
    ----------
    ends
        Bodies and blades.
    points
        Both ends in the frames of the bodies, m.
    mixed
        m_ul, kg.
    """

    ends: Ends
    points: tuple[Vector, Vector]
    mixed: Scalar

    def attached(self, now: Configuration) -> Attached:
        """The lines in a pose."""
        upper, _ = now.arms(self.ends.upper, self.points[0], self.ends.blade)
        return Attached(self.ends, upper, now.arms(self.ends.lower, self.points[1])[0])


def masses(arrays: SceneArrays) -> tuple[list[PointMasses], list[MassLines]]:
    """List all masses but those of the bodies."""
    blades, wires, bars = arrays.blades, arrays.wires, arrays.bars
    points: list[PointMasses] = []
    lines: list[MassLines] = []
    if blades.tip_mass.any():
        ends = Ends.of(blades.body, blade=np.arange(len(blades.label)))
        points.append(PointMasses(ends, blades.tip, blades.tip_mass))
    if wires.mass.any():
        ends = Ends.of(wires.upper, wires.lower, wires.blade)
        lines.append(MassLines(ends, (wires.upper_point, wires.lower_point), wires.mass[1]))
        points.append(
            PointMasses(
                Ends.of(wires.upper, blade=wires.blade),
                wires.upper_point,
                wires.mass[0] + wires.mass[1],
            )
        )
        own = wires.mass[1] + wires.mass[2]
        points.append(PointMasses(Ends.of(wires.lower), wires.lower_point, own))
    if bars.label:
        first, second = bars.body.T
        lines.append(MassLines(Ends.of(first, second), tuple(bars.point), bars.inertia[1]))
        for body, point, own in zip((first, second), bars.point, bars.inertia[::2], strict=True):
            points.append(PointMasses(Ends.of(body), point, own + bars.inertia[1]))
    return points, lines


def energy(now: Configuration) -> Inexact[np.ndarray, " build"]:
    """Energy of all weights relative to the nominal pose, J."""
    scene, position = now.arrays.scene, now.arrays.bodies.position
    slope, mass = _slope(scene), now.arrays.bodies.mass

    def work(mass: Scalar, start: Vector, change: Vector) -> Scalar:
        # exact for an energy of second order
        return (mass * dot(lift(scene, start + change / 2), change)).sum(0)

    result: Scalar = work(mass, position[:, 1:], now.shift[:, 1:])
    points, lines = masses(now.arrays)
    for group in points:
        start, change = _place(now, group.ends.upper, group.point, group.ends.blade)
        result = result + work(group.mass, start, change)
    if slope is not None:
        form = slope[:, :, None, None]
        for group in lines:
            upper, up = _place(now, group.ends.upper, group.points[0], group.ends.blade)
            lower, low = _place(now, group.ends.lower, group.points[1])
            change = low - up
            mean = lower - upper + change / 2
            result = result - (group.mixed * dot(times(form, mean), change)).sum(0)
        change = _second_moments(now) - _second_moments(now, turned=False)
        result = result + (form * change).sum((0, 1, 2)) / 2
    return result


def _place(
    now: Configuration, body: tuple[int, ...], point: Vector, blade: tuple[int, ...] | None = None
) -> tuple[Vector, Vector]:
    """Nominal places of points of bodies, and their displacements."""
    _, moved = now.arms(body, point, blade)
    return now.arrays.bodies.position[:, list(body)] + point, now.shift[:, list(body)] + moved


def _second_moments(now: Configuration, *, turned: bool = True) -> Matrix:
    """Second moments of mass of the bodies in global axes, kg m^2."""
    inertia = now.arrays.bodies.inertia
    moments = unit(trace(inertia) / 2) - inertia
    return _turned(now, moments) if turned else moments


def _turned(now: Configuration, tensor: Matrix) -> Matrix:
    """Tensors (3, 3, body, build) of the bodies in global axes."""
    turn = now.turn[:, :, 1:] + np.eye(3)[:, :, None, None]
    return product(product(turn, tensor), transposed(turn))


def add_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all weights."""
    scene, mass = now.arrays.scene, now.arrays.bodies.mass
    slope, bodies = _slope(scene), len(now.arrays.bodies.name) + 1
    rows = derivatives.gradient[: 6 * bodies].reshape(bodies, 6, -1).swapaxes(0, 1)
    rows[:3, 1:] += mass * lift(scene, now.place[:, 1:])
    points, lines = masses(now.arrays)
    form = None if slope is None else slope[:, :, None, None]
    for group in points:
        attached = group.attached(now)
        place = group.places(now)
        s = None if form is None else form * group.mass
        # the span ends at the point
        derivatives.add(attached, Terms(-group.mass * lift(scene, place), s=s))
    if form is None or slope is None:
        return
    for group in lines:
        attached = group.attached(now)
        upper = now.place[:, list(group.ends.upper)] + attached.upper_arm
        span = now.place[:, list(group.ends.lower)] + attached.lower_arm - upper
        s = -group.mixed * form
        derivatives.add(attached, Terms(times(s, span), s=s))
    moments = _second_moments(now)
    m, total = product(moments, form), np.trace(slope)
    rows[3, 1:] += m[1, 2] - m[2, 1]
    rows[4, 1:] += m[2, 0] - m[0, 2]
    rows[5, 1:] += m[0, 1] - m[1, 0]
    if derivatives.curved:
        curvature = 3 * symmetric(m) - total * moments - trace(moments) * form
        derivatives.add_body_block(0, form * mass)
        derivatives.add_body_block(3, plus_unit(curvature, trace(moments) * total - 2 * trace(m)))


def add_mass(now: Configuration, derivatives: Derivatives) -> None:
    """Add the mass matrix of the bodies as they are turned, tips of blades, wires and bars."""
    derivatives.add_body_block(0, unit(now.arrays.bodies.mass))
    derivatives.add_body_block(3, _turned(now, now.arrays.bodies.inertia))
    points, lines = masses(now.arrays)
    for group in points:
        derivatives.add(group.attached(now), Terms(s=unit(group.mass)))
    for group in lines:
        derivatives.add(group.attached(now), Terms(s=unit(-group.mixed)))


ELEMENT = Element(energy, add_derivatives, add_mass=add_mass)
