r"""Weight and inertia of bodies, blade tips, wires and bars, in a field uniform or with a gradient.

>>> import suspension_cli as sus
>>> from suspension_cli.equilibrium import energy, nominal
>>> from suspension_cli.scene.pose import layout, nominal_pose
>>> scene = nominal.expand(sus.example("double").design)
>>> pose = nominal_pose(scene)
>>> gradient, _ = energy.gradient_and_stiffness(scene, layout(scene), pose, [ELEMENT])
>>> gradient.reshape(3, 6)[1:, 2].round(2)  # weights of the two bodies, N
array([29.43, 26.49])

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

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import Attached, Configuration, Ends, SceneArrays
from suspension_cli.elements.element import Element
from suspension_cli.elements.energy_derivatives import Derivatives, Terms
from suspension_cli.elements.vectors import (
    Matrix,
    Scalar,
    Vector,
    plus_unit,
    product,
    symmetric,
    times,
    transposed,
    unit,
)
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def lift(scene: Scene, place: Vector) -> Vector:
    """Gradient -(g + G r) of the energy per mass at places r from the suspension point, m/s^2."""
    vector = np.array([0.0, 0.0, scene.gravity])
    slope = _slope(scene)
    if scene.field is not None:
        vector = -scene.field.vector
    vector = vector.reshape(3, *(1,) * (place.ndim - 1))
    if slope is None:
        return np.broadcast_to(vector, place.shape)
    return vector + np.tensordot(slope, place, 1)


def _slope(scene: Scene) -> Inexact[np.ndarray, "3 3"] | None:
    """Second derivative -G of the energy per mass, 1/s^2; None in a uniform field."""
    return None if scene.field is None or scene.field.is_uniform else -scene.field.gradient


@dataclass(frozen=True)
class Masses:
    """Masses at points of bodies or at tips of blades; or what lines of mass have beyond these.

    The latter, between points of two bodies, act on the difference of the places of their ends, as
    points do on a place, with the mass -m_ul.
    """

    ends: Ends  # without lower bodies for points
    points: tuple[Vector, ...]  # of one or both ends, in the frames of the bodies, m
    mass: Scalar  # kg

    def attached(self, now: Configuration) -> Attached:
        """Their ends in a pose."""
        arm, _ = now.arms(self.ends.upper, self.points[0], self.ends.blade)
        lower = arm if len(self.points) == 1 else now.arms(self.ends.lower, self.points[1])[0]
        return Attached(self.ends, arm, lower)

    def places(self, now: Configuration) -> Vector:
        """Places of points from the suspension point, or spans of lines, m."""
        attached = self.attached(now)
        upper = now.place[:, list(self.ends.upper)] + attached.upper_arm
        if len(self.points) == 1:
            return upper
        return upper - now.place[:, list(self.ends.lower)] - attached.lower_arm


def masses(arrays: SceneArrays) -> tuple[list[Masses], list[Masses]]:
    """List all masses but those of the bodies: at points, and of lines."""
    blades = arrays.blades
    wires = arrays.wires
    bars = arrays.bars
    points: list[Masses] = []
    lines: list[Masses] = []

    def add_lines(ends: Ends, upper: Vector, lower: Vector, moments: Vector) -> None:
        first, mixed, second = moments
        lines.append(Masses(ends, (upper, lower), -mixed))
        free = (-1,) * len(ends.upper)
        points.append(Masses(Ends(ends.upper, free, ends.blade), (upper,), first + mixed))
        points.append(Masses(Ends(ends.lower, free, free), (lower,), mixed + second))

    if blades.tip_mass.any():
        ends = Ends.of(blades.body, blade=np.arange(len(blades.label)))
        points.append(Masses(ends, (blades.tip,), blades.tip_mass))
    if wires.mass.any():
        ends = Ends.of(wires.upper, wires.lower, wires.blade)
        add_lines(ends, wires.upper_point, wires.lower_point, wires.mass)
    if bars.label:
        add_lines(Ends.of(*bars.body.T), bars.point[0], bars.point[1], bars.inertia)
    return points, lines


def _second_moments(now: Configuration) -> Matrix:
    """Second moments of mass of the bodies in their own axes, kg m^2."""
    inertia = now.arrays.bodies.inertia
    return unit(np.trace(inertia) / 2) - inertia


def _turned(now: Configuration, tensor: Matrix) -> Matrix:
    """Tensors (3, 3, body, build) of the bodies in global axes."""
    turn = now.turn[:, :, 1:] + np.eye(3)[:, :, None, None]
    return product(product(turn, tensor), transposed(turn))


def add_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all weights."""
    scene = now.arrays.scene
    mass = now.arrays.bodies.mass
    slope = _slope(scene)
    bodies = len(now.arrays.bodies.name) + 1
    form = None if slope is None else slope[:, :, None, None]
    rows = derivatives.gradient[: 6 * bodies].reshape(bodies, 6, -1).swapaxes(0, 1)
    rows[:3, 1:] += mass * lift(scene, now.place[:, 1:])
    points, lines = masses(now.arrays)
    for group in points:
        # the span ends at the point
        force = -group.mass * lift(scene, group.places(now))
        s = None if form is None else form * group.mass
        derivatives.add(group.attached(now), Terms(force, s=s))
    if form is None or slope is None:
        return
    for group in lines:
        force = -group.mass * times(form, group.places(now))
        derivatives.add(group.attached(now), Terms(force, s=form * group.mass))
    moments = _turned(now, _second_moments(now))
    m = product(moments, form)
    total = np.trace(slope)
    rows[3:, 1:] += np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])
    if derivatives.curved:
        curvature = 3 * symmetric(m) - total * moments - np.trace(moments) * form
        derivatives.add_body_block(0, form * mass)
        derivatives.add_body_block(
            3, plus_unit(curvature, np.trace(moments) * total - 2 * np.trace(m))
        )


def add_mass(now: Configuration, derivatives: Derivatives) -> None:
    """Add the mass matrix of the bodies as they are turned, tips of blades, wires and bars."""
    derivatives.add_body_block(0, unit(now.arrays.bodies.mass))
    derivatives.add_body_block(3, _turned(now, now.arrays.bodies.inertia))
    for group in itertools.chain(*masses(now.arrays)):
        derivatives.add(group.attached(now), Terms(s=unit(group.mass)))


ELEMENT = Element(add_derivatives, add_mass=add_mass)
