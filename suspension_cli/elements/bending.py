"""Energy, forces and stiffness of wires against bending and twisting, in any pose.

>>> import suspension_cli as sus
>>> from suspension_cli.equilibrium import clamps, nominal
>>> design = sus.example("geo-silica-triple").design
>>> scene = replace(nominal.expand(design), fibres=clamps.compose(design))
>>> float(with_bending(scene).flex.twist[-1].round(6))  # N m/rad, of the last fibre
4.7e-05

A wire leaves its clamps along directions fixed in its two bodies. Relative to its chord e (the unit
vector between its ends) it has slopes a at the upper and b at the lower end in each principal plane
p, and a twist phi. Beyond the energy of a taut string a beam under its tension stores

    E = sum over p of (S_uu a_p^2 + 2 S_ul a_p b_p + S_ll b_p^2) / 2 + kappa phi^2 / 2,
    a_p = -e . n_p (upper body),   b_p = -e . n_p (lower body),
    phi = (n_1' . m_2 - n_2' . m_1) / 2 (the sine of the twist; m: upper, n': lower body),

to second order in the slopes, with S the static stiffness of `elements.tensioned_beam` against
rotation of its ends (the chord fixed) and n_p the unit vectors of the planes, fixed in the bodies
across the clamps. A common rotation changes none of the three. If the clamps point along the chord,
all slopes vanish at rest and only products of first derivatives count; else also the second
derivatives, times the moments:

    d(a)  = -(n - (n.e) e) . dr / L - e . dn,
    d2(a) = dr . (e n_+ + n_+ e + (e.n) P) . dr / L^2 - 2 dr . P . dn / L - e . d2(n),

with r the span, L its length, P = 1 - e e, n_+ = P n, and dn, d2(n) the changes of a vector in a
rotation (see `vectors.turning`). S is taken at the tension in equilibrium: its change
with stretching is of third order.

A string has no bending stiffness, but a design may give its torsional stiffness (`torsion`): it
adds kappa phi^2 / 2 alone, with planes across its line in the nominal pose.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import (
    Configuration,
    batch_first,
    builds_last,
)
from suspension_cli.elements.element import Element
from suspension_cli.elements.energy_derivatives import Derivatives, Terms
from suspension_cli.elements.resting import resistance_of_wires, with_planes
from suspension_cli.elements.vectors import (
    Matrix,
    Scalar,
    Vector,
    cross,
    cross_matrix,
    dot,
    outer,
    plus_unit,
    times,
)
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


SLACK = 7.5
"""S over the length times dS/dT of a uniform wire without tension, where S_uu = 4 EI / L + 2 T L /
15 to first order (`resting.uniform_stiffness`)."""


def with_bending(
    scene: Scene,
    tension: Inexact[np.ndarray, "*batch wire"] | None = None,
    length: Inexact[np.ndarray, "*batch wire"] | None = None,
) -> Scene:
    """Fill `flex` of a scene with `fibres`: its wires bend and twist.

    `tension` (N) and `length` (m) are those at which the stiffness is taken; nominal by default.
    """
    scene = with_planes(scene) if scene.flex is None else scene
    fibres = scene.fibres
    flex = scene.flex
    wires = scene.wires
    batch = scene.batch
    assert fibres is not None and flex is not None
    length = wires.length if length is None else length
    tension = wires.tension if tension is None else tension
    numbers = (
        builds_last(np.broadcast_to(value, (*batch, len(wires.label))), 1, batch)
        for value in (length, tension, wires.torsion)
    )
    bend, twist = (batch_first(own, batch) for own in resistance_of_wires(fibres.wire, *numbers))
    return replace(scene, flex=replace(flex, bend=bend, twist=twist))


def _normals(now: Configuration) -> tuple[Vector, Vector]:
    """Unit vectors (3, plane, wire, build) of the planes at the upper and lower ends."""
    flex = now.flex
    wires = now.wires
    assert flex is not None
    upper, lower = (
        n + times(now.turn_of(body)[:, :, None], n)
        for body, n in (
            (wires.ends.upper, flex.upper.swapaxes(0, 1)),
            (wires.ends.lower, flex.lower.swapaxes(0, 1)),
        )
    )
    return upper, lower


def _twist(upper: Vector, lower: Vector) -> tuple[Scalar, Vector]:
    """Sine of the twist, and its derivative by a rotation of the lower body."""
    u_1, u_2 = upper.swapaxes(0, 1)
    l_1, l_2 = lower.swapaxes(0, 1)
    return (dot(l_1, u_2) - dot(l_2, u_1)) / 2, (cross(l_1, u_2) - cross(l_2, u_1)) / 2


def add_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of bending and twisting."""
    flex = now.flex
    if flex is None or not now.arrays.wires.label:
        return
    upper, lower = _normals(now)
    terms = _twisting(flex.twist, upper, lower, curved=derivatives.curved)
    if flex.bend is not None:
        bent = _bending(now, flex.bend, upper, lower, curved=derivatives.curved)
        forces = (bent.force, bent.upper_torque, bent.lower_torque)
        derivatives.bent = tuple(part for part in forces if part is not None)
        terms = terms + bent
    derivatives.add(now.wires, terms)


def _bending(
    now: Configuration, bend: np.ndarray, upper: Vector, lower: Vector, *, curved: bool
) -> Terms:
    """Derivatives of the energy of bending in both planes."""
    e = now.wires.direction
    length = now.wires.length
    s_uu, s_ul, s_ll = bend.swapaxes(0, 1)
    along = e[:, None]
    # slopes of both ends in each plane, and the moments that they take
    a = -dot(along, upper)
    b = -dot(along, lower)
    m_u = s_uu * a + s_ul * b
    m_l = s_ul * a + s_ll * b
    # summed over the planes, as vectors along the normals
    moment_u = (m_u * upper).sum(1)
    moment_l = (m_l * lower).sum(1)
    both = moment_u + moment_l
    pulled = dot(e, both)
    across = both - pulled * e
    force = -across / length
    torque_u = cross(e, moment_u)
    torque_l = cross(e, moment_l)
    if not curved:
        return Terms(force, torque_u, torque_l)
    # a slope changes by -f . dr / L + c . t, with the rotation t of its body
    f_u = upper + a * along
    f_l = lower + b * along
    c_u = cross(along, upper)
    c_l = cross(along, lower)
    # and so the moments by -on . dr / L
    on_u = s_uu * f_u + s_ul * f_l
    on_l = s_ul * f_u + s_ll * f_l
    bent = _outer_sum(f_u, on_u) + _outer_sum(f_l, on_l)
    bent += outer(e, across - pulled * e) + outer(across, e)
    over = 1 / length
    return Terms(
        force,
        torque_u,
        torque_l,
        s=plus_unit(bent, pulled) * over**2,
        x_u=(cross_matrix(moment_u) - outer(e, torque_u) - _outer_sum(on_u, c_u)) * over,
        x_l=(cross_matrix(moment_l) - outer(e, torque_l) - _outer_sum(on_l, c_l)) * over,
        y_uu=plus_unit(_outer_sum(s_uu * c_u, c_u) - outer(e, moment_u), dot(e, moment_u)),
        y_lu=_outer_sum(s_ul * c_l, c_u),
        y_ll=plus_unit(_outer_sum(s_ll * c_l, c_l) - outer(e, moment_l), dot(e, moment_l)),
    )


def _outer_sum(a: Vector, b: Vector) -> Matrix:
    """Sum over both planes of products a b^T."""
    return outer(a[:, 0], b[:, 0]) + outer(a[:, 1], b[:, 1])


def _twisting(stiffness: Scalar, upper: Vector, lower: Vector, *, curved: bool) -> Terms:
    """Derivatives of the energy of twisting."""
    twist, row = _twist(upper, lower)
    torque = stiffness * twist
    if not curved:
        return Terms(None, -torque * row, torque * row)
    u_1, u_2 = upper.swapaxes(0, 1)
    l_1, l_2 = lower.swapaxes(0, 1)
    half = torque / 2
    # the sine has the second derivatives u_2 l_1 - u_1 l_2
    turned = outer(stiffness * row, row) + outer(half * u_2, l_1) - outer(half * u_1, l_2)
    turned = plus_unit(turned, -torque * twist)
    return Terms(None, -torque * row, torque * row, y_uu=turned, y_lu=-turned, y_ll=turned)


def add_growth(
    now: Configuration,
    bent: tuple[Vector, ...],
    tension: Scalar,
    derivatives: Derivatives,
) -> None:
    """Add, to the gradient alone, the change of the forces `bent` as wires get another tension (N).

    S of a long wire grows as sqrt(T), and that of a short one by 2 L / 15 per tension: in both
    limits as the square root of 2 T + `SLACK` S / L, between them by up to 22 % more.
    """
    flex = now.flex
    assert flex is not None and flex.bend is not None and now.tension is not None
    of_slack = SLACK * flex.bend[0, 0] / now.wires.length
    before, after = (2 * np.maximum(own, 0.0) + of_slack for own in (now.tension, tension))
    growth = np.sqrt(after / before) - 1
    derivatives.add(now.wires, Terms(*(growth * part for part in bent)))


def add_loss(now: Configuration, derivatives: Derivatives) -> None:
    """Add the imaginary part of the stiffness against twisting of wires."""
    flex = now.flex
    loss = now.arrays.wires.loss
    if flex is not None and loss.any():
        _, row = _twist(*_normals(now))
        own = outer(flex.twist * loss[:, None] * row, row)
        derivatives.add(now.wires, Terms(y_uu=own, y_lu=-own, y_ll=own))


ELEMENT = Element(add_derivatives, add_loss=add_loss)
