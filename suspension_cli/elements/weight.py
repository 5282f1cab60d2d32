r"""Weight of bodies, blade tips, wires and bars, in a uniform field or one with a gradient.

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

A bar (a leg of an inverted pendulum, the blades of a filter) follows the formulas of a wire, with
moments of its own.

In a gradient a body with the inertia tensor J has the additional energy -tr(G R S R^T) / 2, with
its second moments of mass S = tr(J)/2 - J and its rotation R (Goldstein, Classical Mechanics,
section 5.8).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements import blade, string
from suspension_cli.elements.geometric_stiffness import add_arms, sum_by
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene.pose import Layout, Pose, nominal_pose, point_jacobian
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact

_TURNS = np.stack([cross_matrix(axis) for axis in np.eye(3)])


def acts(scene: Scene) -> bool:
    """Whether wires have weight, or gravity is a vector or has a gradient."""
    return scene.field is not None or bool(scene.wires.mass.any())


def lift(
    scene: Scene, place: Inexact[np.ndarray, "*batch point 3"]
) -> Inexact[np.ndarray, "*batch point 3"]:
    """Gradient -(g + G r) of the energy per mass at places r from the suspension point, m/s^2."""
    if scene.field is None:
        return np.broadcast_to(np.array([0.0, 0.0, scene.gravity]), place.shape)
    return -(scene.field.vector + place @ scene.field.gradient)


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Energy (...) of all weights relative to the nominal pose, J."""
    bodies, blades, start = scene.bodies, scene.blades, scene.bodies.position
    result = -_potential(scene, bodies.mass, start[..., 1:, :])
    result = result + _potential(scene, bodies.mass, (start + pose.shift)[..., 1:, :])
    if blades.label:
        at = start[..., blades.body, :]
        here = at + pose.shift[..., blades.body, :] + blade.tip_arms(scene, pose)
        result = result - _potential(scene, blades.tip_mass, at + blades.tip)
        result = result + _potential(scene, blades.tip_mass, here)
    if scene.field is not None and not scene.field.is_uniform:
        nominal, now = second_moments(scene), second_moments(scene, pose)
        result = result - np.einsum("ij,...nij->...", scene.field.gradient, now - nominal) / 2
    for line in _lines(scene):
        result = result + _line_potential(scene, line, pose)
        result = result - _line_potential(scene, line, nominal_pose(scene))
    return result


def _potential(scene: Scene, mass: Any, place: Any) -> Any:
    """Energy (...) of point masses (..., k) at places (..., k, 3), J."""
    return (mass * ((lift(scene, 0 * place) + lift(scene, place)) / 2 * place).sum(-1)).sum(-1)


@dataclass(frozen=True)
class _Lines:
    """Massive straight lines between points of two bodies: wires or bars.

    Attributes
    ----------
    body
        Bodies (2, k) of both ends.
    point
        Ends (..., k, 3) of bars in the frames of these bodies; None for wires, whose upper ends may
        be on blades.
    mass
        m_uu, m_ul and m_ll, (..., k, 3).
    """

    body: Any
    point: tuple[Any, Any] | None
    mass: Any

    def arms(self, scene: Scene, pose: Pose) -> tuple[Any, Any]:
        """Vectors (..., k, 3) from the COMs to both ends."""
        if self.point is None:
            now = string.state(scene, pose)
            return now.upper_arm, now.lower_arm
        first, second = (pose.arms(self.body[n], self.point[n]) for n in (0, 1))
        return first, second

    def places(self, scene: Scene, pose: Pose) -> tuple[Any, Any]:
        """Places (..., k, 3) of both ends from the suspension point, m."""
        upper, lower = self.arms(scene, pose)
        place = scene.bodies.position + pose.shift
        return place[..., self.body[0], :] + upper, place[..., self.body[1], :] + lower


def _lines(scene: Scene) -> list[_Lines]:
    wires, bars, found = scene.wires, scene.bars, []
    if wires.mass.any():
        found.append(_Lines((wires.upper, wires.lower), None, wires.mass))
    if bars.label:
        ends = (bars.point[..., 0, :], bars.point[..., 1, :])
        found.append(_Lines((bars.body[:, 0], bars.body[:, 1]), ends, bars.inertia))
    return found


def _line_potential(scene: Scene, line: _Lines, pose: Pose) -> Any:
    """Energy (...) of the weight of wires or bars, J."""
    upper, lower = line.places(scene, pose)
    own, mixed, other = np.moveaxis(line.mass, -1, 0)
    # (1 - s)^2 and s^2 at the ends, s (1 - s) in the product of both: 4 m_ul at the middle
    middle = _potential(scene, 4 * mixed, (upper + lower) / 2)
    return middle + _potential(scene, own - mixed, upper) + _potential(scene, other - mixed, lower)


def second_moments(scene: Scene, pose: Pose | None = None) -> Any:
    """Second moments of mass (..., n, 3, 3) of the bodies in global axes, kg m^2."""
    inertia = scene.bodies.inertia
    trace = np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]
    moments = trace / 2 * np.eye(3) - inertia
    if pose is None:
        return moments
    turn = pose.rotation[..., 1:, :, :]
    return turn @ moments @ np.swapaxes(turn, -1, -2)


def add_derivatives(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    gradient: Inexact[np.ndarray, "*batch coordinate"],
    hessian: Inexact[np.ndarray, "*batch 1+coordinate 1+coordinate"],
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"],
    on_tips: Inexact[np.ndarray, "*batch blade 3"],
) -> None:
    """Add the derivatives of the energy of bodies, wires and bars, in place.

    `equilibrium.energy` describes the arrays. Those of blade tips are added with their blades.
    """
    place, mass = scene.bodies.position + pose.shift, scene.bodies.mass
    slope = None
    if scene.field is not None and not scene.field.is_uniform:
        slope = scene.field.gradient
    force = mass[..., None] * lift(scene, place[..., 1:, :])
    for n in range(1, mass.shape[-1] + 1):
        gradient[..., 6 * n : 6 * n + 3] += force[..., n - 1, :]
        if slope is not None:
            rows = slice(6 * n, 6 * n + 3)
            hessian[..., rows, rows] -= mass[..., n - 1, None, None] * slope
    if slope is not None:
        _add_tides(scene, pose, slope, gradient, hessian)
    for line in _lines(scene):
        _add_line(scene, line, numbering, pose, slope, gradient, hessian, outer, on_tips)


def _add_tides(scene: Scene, pose: Pose, slope: Any, gradient: Any, hessian: Any) -> None:
    """Add the derivatives of the energy -tr(G P) / 2 of extended bodies, P = R S R^T.

    A rotation by the vector t changes P to exp([t]) P exp(-[t]).
    """
    moments = second_moments(scene, pose)
    for n in range(1, moments.shape[-3] + 1):
        own = moments[..., n - 1, :, :]
        for a, one in enumerate(_TURNS):
            gradient[..., 6 * n + 3 + a] -= _contract(slope @ one, own)
            for b, other in enumerate(_TURNS):
                twice = (one @ other + other @ one) / 2
                second = _contract(slope @ twice, own) - np.einsum(
                    "ij,...jk,ki->...", slope @ one, own, other
                )
                hessian[..., 6 * n + 3 + a, 6 * n + 3 + b] -= second


def _contract(left: Any, right: Any) -> Any:
    return np.einsum("ij,...ji->...", left, right)


def _add_line(
    scene: Scene,
    line: _Lines,
    numbering: Layout,
    pose: Pose,
    slope: Any,
    gradient: Any,
    hessian: Any,
    outer: Any,
    on_tips: Any,
) -> None:
    places, (own, mixed, other) = line.places(scene, pose), np.moveaxis(line.mass, -1, 0)
    moments, arms = ((own, mixed), (mixed, other)), line.arms(scene, pose)
    on_blade = scene.wires.blade if line.point is None else None
    jacobians = (
        point_jacobian(numbering, pose, line.body[0], arms[0], on_blade),
        point_jacobian(numbering, pose, line.body[1], arms[1]),
    )
    for end, (body, arm) in enumerate(zip(line.body, arms, strict=True)):
        force: Any = sum(
            moment[..., None] * lift(scene, at)
            for moment, at in zip(moments[end], places, strict=True)
        )
        gradient += (jacobians[end] * force[..., None, :, :]).sum((-2, -1))
        add_arms(outer, body, force, arm)
        if end == 0 and on_blade is not None:
            on_tips += sum_by(on_blade, force, on_tips.shape[-2])
    if slope is not None:
        for end, row in enumerate(moments):
            for against, moment in enumerate(row):
                turned = jacobians[against] @ slope * moment[..., None, :, None]
                hessian[..., :-1, :-1] -= np.einsum("...awi,...bwi->...ab", jacobians[end], turned)


def end_jacobians(
    scene: Scene, numbering: Layout, pose: Pose, now: string.State
) -> tuple[Any, Any]:
    """Derivatives (..., N, w, 3) of the places of the upper and the lower ends of wires."""
    wires = scene.wires
    return (
        point_jacobian(numbering, pose, wires.upper, now.upper_arm, wires.blade),
        point_jacobian(numbering, pose, wires.lower, now.lower_arm),
    )


def wire_inertia(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Mass matrix (..., N, N) of straight wires between their ends."""
    upper, lower = end_jacobians(scene, numbering, pose, string.state(scene, pose))
    own, mixed, other = np.moveaxis(scene.wires.mass, -1, 0)

    def product(left: Any, moment: Any, right: Any) -> Any:
        return np.einsum("...awi,...w,...bwi->...ab", left, moment, right)

    cross = product(upper, mixed, lower)
    return (
        product(upper, own, upper)
        + product(lower, other, lower)
        + cross
        + np.swapaxes(cross, -1, -2)
    )
