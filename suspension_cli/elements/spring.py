"""Energy, force and stiffness of linear springs between two bodies: flexures, cables.

A spring joins a point of the lower body to the coincident point of the upper body in the nominal
pose. Its strain (delta, phi) is in the frame of the upper body, so it does not depend on the
observer's frame: delta is the displacement of the lower point, phi = vee(skew(Q)) of the relative
rotation Q = R_u^T R_l (the axis of Q times the sine of its angle: the rotation vector, but for
terms of third order). A spring stores s K s / 2 - preload . s for the strain s. Its damping acts on
the rate of delta and on the relative angular velocity, both in the frame of the upper body. In the
strain of the flexures of a leg its lean replaces delta, see `lean`, and the tilt (-Q_yz, Q_xz) of
the z axis of the lower body the first two components of phi, which turn with the yaw.

Below, r is the vector from the upper COM to the lower point, w that from the lower COM to it. A
step x, t of both bodies in displacement and rotation gives, with E = exp(-[t_u]) exp([t_l]),

    delta = R_u^T (exp(-[t_u]) (r - w + x_l - x_u + exp([t_l]) w)) - a,      Q = R_u^T E R_l,

with the point a in the frame of the upper body; expanding the exponentials gives the derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import lean
from suspension_cli.elements.configuration import (
    Attached,
    Configuration,
    Ends,
)
from suspension_cli.elements.derivatives import Derivatives, Terms
from suspension_cli.elements.element import Element
from suspension_cli.elements.vectors import (
    Matrix,
    Scalar,
    Vector,
    cross_matrix,
    dot,
    plus_unit,
    product,
    symmetric,
    times,
    trace,
    transposed,
    unit,
)

if TYPE_CHECKING:
    from jaxtyping import Inexact


@dataclass(frozen=True)
class _Strains:
    """Strains of springs, or of flexures of legs, in a pose."""

    which: list[int]  # their numbers
    legs: Scalar | None  # their lengths, m; None for springs
    attached: Attached
    upper: Matrix  # rotations of the bodies
    lower: Matrix
    delta: Vector  # in the frame of the upper body, m
    strain: tuple[Vector, Vector]  # delta (or the lean), m, and phi, rad
    rates: Matrix | None  # derivatives of the lean by delta; None for springs
    spin: Matrix  # derivatives of phi by a rotation of the lower body


def _strains(now: Configuration) -> Iterator[_Strains]:
    """Strains of all springs, and of all legs."""
    length = now.arrays.springs.leg
    is_leg = (length != 0).any(-1)
    for legs in (False, True):
        if len(which := np.flatnonzero(is_leg == legs).tolist()):
            yield _strains_of(now, which, length[which] if legs else None)


def _strains_of(now: Configuration, which: list[int], legs: Scalar | None) -> _Strains:
    springs = now.arrays.springs
    ends = Ends.of(springs.upper[which], springs.lower[which])
    upper, lower = (
        now.turn[:, :, list(body)] + np.eye(3)[:, :, None, None]
        for body in (ends.upper, ends.lower)
    )
    to_upper = transposed(upper)
    above, below = springs.upper_point[:, which], springs.lower_point[:, which]
    arm, moved = now.arms(ends.lower, below)
    shift = now.shift[:, list(ends.lower)] - now.shift[:, list(ends.upper)]
    reach = above + (shift + moved)
    delta = times(to_upper, reach) - above
    q, rates = product(to_upper, lower), None
    phi = np.array([q[2, 1] - q[1, 2], q[0, 2] - q[2, 0], q[1, 0] - q[0, 1]]) / 2
    spin = product((unit(trace(q)) - q) / 2, to_upper)
    strain = delta
    if legs is not None:
        strain, rates = lean.angle(delta, legs)
        tilts = product(to_upper, cross_matrix(lower[:, 2]))
        phi[0], phi[1] = -q[1, 2], q[0, 2]
        spin[0], spin[1] = tilts[1], -tilts[0]
    attached = Attached(ends, reach, arm)
    return _Strains(which, legs, attached, upper, lower, delta, (strain, phi), rates, spin)


def _blocks(
    form: Inexact[np.ndarray, "6 6 spring build"],
) -> tuple[Matrix, Matrix, Matrix]:
    """Blocks of forms in the strain: of the displacement, mixed, and of the rotation."""
    return form[:3, :3], form[:3, 3:], form[3:, 3:]


def _pull(now: Configuration, one: _Strains, preload: float) -> tuple[Vector, Vector]:
    """Gradient of the energy with respect to the strain, with a fraction of the preload."""
    springs = now.arrays.springs
    straight, mixed, turns = _blocks(springs.stiffness[:, :, one.which])
    force, torque = (
        preload * springs.preload[:3, one.which],
        preload * springs.preload[3:, one.which],
    )
    delta, phi = one.strain
    pull = times(straight, delta) + times(mixed, phi) - force
    return pull, times(transposed(mixed), delta) + times(turns, phi) - torque


def energy(now: Configuration) -> Inexact[np.ndarray, " build"]:
    """Elastic energy of all springs relative to the nominal pose, J."""
    result: Scalar = np.zeros(now.arrays.count)
    for one in _strains(now):
        pull, twist = _pull(now, one, 2.0)
        result = result + (dot(pull, one.strain[0]) + dot(twist, one.strain[1])).sum(0) / 2
    return result


def add_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all springs."""
    for one in _strains(now):
        pull, twist = _pull(now, one, 1.0)
        along = pull if one.rates is None else times(transposed(one.rates), pull)
        force, torque = times(one.upper, along), times(transposed(one.spin), twist)
        terms = Terms(force, -torque, torque)
        if derivatives.curved:
            form = now.arrays.springs.stiffness[:, :, one.which]
            terms = terms + _form(one, form) + _curvature(one, force, pull, twist)
        derivatives.add(one.attached, terms)


def _form(
    one: _Strains, form: Inexact[np.ndarray, "6 6 spring build"], *, rate: bool = False
) -> Terms:
    """Second derivatives of a form in the strain, or with `rate` in that of motion.

    The latter is the change of delta and the rotation from one body to the other, R_u^T (t_l -
    t_u).
    """
    straight, mixed, turns = _blocks(form)
    to_upper = transposed(one.upper)
    spin = to_upper if rate else one.spin
    rates = to_upper if rate or one.rates is None else product(one.rates, to_upper)
    s = product(product(transposed(rates), straight), rates)
    c = product(product(transposed(rates), mixed), spin)
    turned = product(product(transposed(spin), turns), spin)
    return Terms(s=s, x_u=-c, x_l=c, y_uu=turned, y_lu=-turned, y_ll=turned)


def _curvature(one: _Strains, force: Vector, pull: Vector, twist: Vector) -> Terms:
    """Second derivatives of the strain times its pull."""
    skew, s = cross_matrix(twist), None
    if one.legs is not None:
        curve = lean.curvature(one.delta, one.legs, pull)
        s = product(product(one.upper, curve), transposed(one.upper))
        skew[0, 0] = skew[1, 1] = skew[2, 0] = skew[2, 1] = 0.0
        skew[0, 2], skew[1, 2] = 2 * twist[1], -2 * twist[0]
    g = product(product(one.upper, skew), transposed(one.lower))
    own = plus_unit(symmetric(g) / 2, -trace(g) / 2)
    # a force fixed in the upper body turns with it
    x_u = -cross_matrix(force)
    return Terms(s=s, x_u=x_u, y_uu=own, y_lu=plus_unit(-g / 2, trace(g) / 2), y_ll=own)


def add_damping(now: Configuration, derivatives: Derivatives) -> None:
    """Add the viscous damping of all springs."""
    if now.arrays.springs.damping.any():
        for one in _strains(now):
            form = now.arrays.springs.damping[:, :, one.which]
            derivatives.add(one.attached, _form(one, form, rate=True))


def add_loss(now: Configuration, derivatives: Derivatives) -> None:
    """Add the imaginary part of the stiffness of all springs."""
    springs = now.arrays.springs
    add_forms(now, derivatives, springs.stiffness * springs.loss[:, None])


def add_forms(
    now: Configuration, derivatives: Derivatives, form: Inexact[np.ndarray, "6 6 spring build"]
) -> None:
    """Add forms in the strains of the springs."""
    if form.any():
        for one in _strains(now):
            derivatives.add(one.attached, _form(one, form[:, :, one.which]))


ELEMENT = Element(energy, add_derivatives, add_damping=add_damping, add_loss=add_loss)
