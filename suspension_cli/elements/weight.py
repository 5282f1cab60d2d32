r"""Weight and inertia of bodies, blade tips, wires and bars, in a field uniform or with a gradient.

At a place r from the suspension point the acceleration is g + G r with a symmetric G, so a point
mass m has the energy -m (g . r + r . G r / 2).

A wire with weight is taken as straight: at the fraction s of its length from the upper end it is at
(1 - s) r_u + s r_l. Its mass enters by the moments

    m_uu = integral of (1 - s)^2 dm,  m_ul = integral of s (1 - s) dm,  m_ll = integral of s^2 dm,

m/3, m/6 and m/3 for a uniform wire. By the lever rule the masses m_uu + m_ul and m_ul + m_ll weigh
on the upper and the lower end. The kinetic energy is half of m_uu v_u^2 + 2 m_ul v_u . v_l + m_ll
v_l^2 (any text on finite elements). The tension of the wire is a mean along it: the pull on the
body above is larger, that on the body below smaller, by these weights. Sag is neglected; its effect
is of second order in weight over tension W/T: a static string of tension T(s) has the transverse
stiffness 1 / integral ds / T(s), below that of a straight wire by the fraction (W/T)^2 / 12.

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

from suspension_cli.elements import string
from suspension_cli.elements.element import Derivatives, Element
from suspension_cli.elements.geometric_stiffness import torques, unit_trace
from suspension_cli.scene.pose import Layout, Pose, nominal_pose, point_jacobian
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int


def lift(
    scene: Scene, place: Inexact[np.ndarray, "*batch point 3"]
) -> Inexact[np.ndarray, "*batch point 3"]:
    """Gradient -(g + G r) of the energy per mass at places r from the suspension point, m/s^2."""
    if scene.field is None:
        return np.broadcast_to(np.array([0.0, 0.0, scene.gravity]), place.shape)
    return -(scene.field.vector + place @ scene.field.gradient)


def _slope(scene: Scene) -> Inexact[np.ndarray, "3 3"] | None:
    """Second derivative -G of the energy per mass, 1/s^2; None in a uniform field."""
    return None if scene.field is None or scene.field.is_uniform else -scene.field.gradient


@dataclass(frozen=True)
class Masses:
    """Point masses on bodies or blade tips, or straight lines of mass between two such points.

    Attributes
    ----------
    body
        Bodies of the one or two points.
    point
        The points in the frames of these bodies, m.
    blade
        Blades whose tips carry the points (-1 for a point without); None for none.
    moment
        The mass, or rows (m_uu, m_ul) and (m_ul, m_ll), kg.
    """

    body: tuple[Int[np.ndarray, " point"], ...]
    point: tuple[Inexact[np.ndarray, "... point 3"], ...]
    blade: tuple[Int[np.ndarray, " point"] | None, ...]
    moment: tuple[tuple[Inexact[np.ndarray, "... point"], ...], ...]

    def arms(self, pose: Pose) -> list[Inexact[np.ndarray, "*batch point 3"]]:
        """Vectors from the COM of its body to each point."""
        return [
            pose.arms(body, own if blade is None else own + string.tip_deflection(blade, pose))
            for body, own, blade in zip(self.body, self.point, self.blade, strict=True)
        ]

    def places(self, scene: Scene, pose: Pose) -> list[Inexact[np.ndarray, "*batch point 3"]]:
        """Places of the points from the suspension point, m."""
        place = scene.bodies.position + pose.shift
        return [
            place[..., body, :] + arm for body, arm in zip(self.body, self.arms(pose), strict=True)
        ]

    def forces(
        self, scene: Scene, places: list[Inexact[np.ndarray, "*batch point 3"]]
    ) -> list[Inexact[np.ndarray, "*batch point 3"]]:
        """Gradients of the energy with respect to the points, N."""
        lifts = [lift(scene, place) for place in places]
        return [
            sum((m[..., None] * own for m, own in zip(row, lifts, strict=True)), np.zeros(3))
            for row in self.moment
        ]

    def quadratic(
        self, numbering: Layout, pose: Pose, form: Inexact[np.ndarray, "3 3"]
    ) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
        """Sum of m_ij J_i F J_j^T, with the Jacobians J of the points and a form F."""
        jacobians = [
            point_jacobian(numbering, pose, *each)
            for each in zip(self.body, self.arms(pose), self.blade, strict=True)
        ]
        result = np.zeros((numbering.size, numbering.size))
        for row, jacobian in zip(self.moment, jacobians, strict=True):
            mixed = sum(m[..., None, :, None] * own for m, own in zip(row, jacobians, strict=True))
            left, right = (part.reshape(*part.shape[:-2], -1) for part in (mixed @ form, jacobian))
            result = result + left @ np.swapaxes(right, -1, -2)
        return result


def masses(scene: Scene) -> list[Masses]:
    """List all masses but those of the bodies."""
    blades, wires, bars, found = scene.blades, scene.wires, scene.bars, []
    if blades.tip_mass.any():
        every = np.arange(len(blades.label))
        found.append(Masses((blades.body,), (blades.tip,), (every,), ((blades.tip_mass,),)))
    if wires.mass.any():
        ends = (wires.upper_point, wires.lower_point)
        moments = _moments(wires.mass)
        found.append(Masses((wires.upper, wires.lower), ends, (wires.blade, None), moments))
    if bars.label:
        ends = (bars.point[..., 0, :], bars.point[..., 1, :])
        found.append(Masses(tuple(bars.body.T), ends, (None, None), _moments(bars.inertia)))
    return found


def _moments(
    mass: Inexact[np.ndarray, "... point 3"],
) -> tuple[tuple[Inexact[np.ndarray, "... point"], ...], ...]:
    own, mixed, other = np.moveaxis(mass, -1, 0)
    return (own, mixed), (mixed, other)


def _bodies(scene: Scene) -> Masses:
    mass = scene.bodies.mass
    every = np.arange(1, mass.shape[-1] + 1)
    return Masses((every,), (np.zeros((len(every), 3)),), (None,), ((mass,),))


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Energy (...) of all weights relative to the nominal pose, J."""
    result = np.zeros(scene.batch)
    for group in (_bodies(scene), *masses(scene)):
        start, now = group.places(scene, nominal_pose(scene)), group.places(scene, pose)
        # exact for an energy of second order
        forces = group.forces(scene, [(a + b) / 2 for a, b in zip(start, now, strict=True)])
        for force, a, b in zip(forces, start, now, strict=True):
            result = result + (force * (b - a)).sum((-2, -1))
    slope = _slope(scene)
    if slope is not None:
        change = second_moments(scene, pose) - second_moments(scene)
        result = result + np.einsum("ij,...nij->...", slope, change) / 2
    return result


def second_moments(
    scene: Scene, pose: Pose | None = None
) -> Inexact[np.ndarray, "*batch body 3 3"]:
    """Second moments of mass of the bodies in global axes, kg m^2."""
    inertia = scene.bodies.inertia
    moments = unit_trace(inertia) / 2 - inertia
    if pose is None:
        return moments
    turn = pose.rotation[..., 1:, :, :]
    return turn @ moments @ np.swapaxes(turn, -1, -2)


def add_derivatives(scene: Scene, numbering: Layout, pose: Pose, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all weights."""
    mass, slope = scene.bodies.mass, _slope(scene)
    rows = 6 * np.arange(1, mass.shape[-1] + 1)[:, None] + np.arange(3)
    place = (scene.bodies.position + pose.shift)[..., 1:, :]
    derivatives.gradient[..., rows] += mass[..., None] * lift(scene, place)
    for group in masses(scene):
        forces = group.forces(scene, group.places(scene, pose))
        points = zip(group.body, forces, group.arms(pose), group.blade, strict=True)
        for body, force, arm, blade in points:
            derivatives.add_forces(body, force, arm, blade)
        if slope is not None:
            derivatives.hessian[..., :-1, :-1] += group.quadratic(numbering, pose, slope)
    if slope is None:
        return
    moments, turning = second_moments(scene, pose), rows + 3
    m = moments @ slope
    curvature = 3 * (m + np.swapaxes(m, -1, -2)) / 2 - 2 * unit_trace(m) - np.trace(slope) * moments
    curvature = curvature + unit_trace(moments) @ (np.trace(slope) * np.eye(3) - slope)
    derivatives.gradient[..., turning] -= torques(m)
    derivatives.hessian[..., turning[:, :, None], turning[:, None, :]] += curvature
    derivatives.hessian[..., rows[:, :, None], rows[:, None, :]] += mass[..., None, None] * slope


def mass_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Mass matrix (..., N, N) of the bodies as they are turned, tips of blades, wires and bars."""
    result = np.zeros((*scene.batch, numbering.size, numbering.size))
    rows = 6 * np.arange(1, scene.bodies.mass.shape[-1] + 1)[:, None] + np.arange(3)
    result[..., rows, rows] = scene.bodies.mass[..., None]
    turn = pose.rotation[..., 1:, :, :]
    turned = turn @ scene.bodies.inertia @ np.swapaxes(turn, -1, -2)
    result[..., rows[:, :, None] + 3, rows[:, None, :] + 3] = turned
    for group in masses(scene):
        result = result + group.quadratic(numbering, pose, np.eye(3))
    return result


ELEMENT = Element(energy, add_derivatives, mass=mass_matrix, compiled=True)
