"""Energy, force and stiffness of linear springs between two bodies (flexures, cables), and blades.

>>> delta = np.array([0.1, 0.0, 0.0]).reshape(3, 1, 1)
>>> lean, rates = _lean(delta, np.array([[1.0]]))  # of a leg of 1 m whose top is displaced by 0.1 m
>>> float(lean[0, 0, 0].round(6)), float(np.arctan(0.1).round(6))  # by this angle, in rad
(0.099669, 0.099669)

A spring joins a point of the lower body to the coincident point of the upper body in the nominal
pose. Its strain (delta, phi) is in the frame of the upper body, so it does not depend on the
observer's frame: delta is the displacement of the lower point, phi = vee(skew(Q)) of the relative
rotation Q = R_u^T R_l (the axis of Q times the sine of its angle: the rotation vector, but for
terms of third order). A spring stores s K s / 2 - preload . s for the strain s. Its damping acts on
the rate of delta and on the relative angular velocity, both in the frame of the upper body. In the
strain of the flexures of a leg its lean replaces delta, and the tilt (-Q_yz, Q_xz) of the z axis of
the lower body the first two components of phi, which turn with the yaw.

Below, r is the vector from the upper COM to the lower point, w that from the lower COM to it. A
step x, t of both bodies in displacement and rotation gives, with E = exp(-[t_u]) exp([t_l]),

    delta = R_u^T (exp(-[t_u]) (r - w + x_l - x_u + exp([t_l]) w)) - a,      Q = R_u^T E R_l,

with the point a in the frame of the upper body; expanding the exponentials gives the derivatives.

**Lean.** The leg of an inverted pendulum stands along z with the length L. With its top displaced
by delta it points along p = (x, y, z) = delta + (0, 0, L): it leans by the angle atan(sqrt(q) / z),
q = x^2 + y^2, towards (x, y). Its flexures resist this angle. The components of the angle times L,

    g = L f (x, y),   f = A(q / z^2) / z,   A(t) = atan(sqrt(t)) / sqrt(t) = 1 - t/3 + t^2/5 - ...,

are the displacement for small angles. With A' = (1 / (1 + t) - A) / (2 t) and its derivative, and
with n = z^2 + q,

    f_q = A' / z^3,   f_qq = A'' / z^5,   f_z = -1 / n,   f_qz = 1 / n^2,   f_zz = 2 z / n^2.

**Blades.** A tip moves along one to three axes of the body that carries the blade. At a deflection
q from the nominal, loaded position the blade pulls its tip with load - k q, so it stores
-load . q + k q^2 / 2; a tip mass adds weight and inertia. Husman et al. (2000), section 3b: "the
cantilever positions are included as additional state variables".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import polynomial

from suspension_cli.elements.configuration import (
    Attached,
    Configuration,
    Ends,
)
from suspension_cli.elements.element import Element
from suspension_cli.elements.energy_derivatives import Derivatives, Terms
from suspension_cli.elements.vectors import (
    Matrix,
    Scalar,
    Vector,
    cross_matrix,
    outer,
    plus_unit,
    product,
    symmetric,
    times,
    transposed,
    unit,
)

if TYPE_CHECKING:
    from jaxtyping import Inexact


_A = (-1.0) ** np.arange(15) / (2 * np.arange(15) + 1)
SERIES = np.array([np.pad(polynomial.polyder(_A, m), (0, m)) for m in range(3)])
"""Coefficients of A, A' and A'' in powers of t."""
SMALL = 0.05
"""Largest t for the series; above it differences in A'' lose at most four digits."""
_ACROSS = np.array([1.0, 1.0, 0.0])[:, None, None]
"""Components of a vector (3, leg, build) across a leg."""


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
    # displacement of the lower point, seen from the upper body
    to_upper = transposed(upper)
    above = springs.upper_point[:, which]
    below = springs.lower_point[:, which]
    arm, moved = now.arms(ends.lower, below)
    shift = now.shift[:, list(ends.lower)] - now.shift[:, list(ends.upper)]
    reach = above + (shift + moved)
    delta = times(to_upper, reach) - above
    # rotation between the bodies, and the sine of its angle about its axis
    q = product(to_upper, lower)
    phi = np.array([q[2, 1] - q[1, 2], q[0, 2] - q[2, 0], q[1, 0] - q[0, 1]]) / 2
    spin = product((unit(np.trace(q)) - q) / 2, to_upper)
    strain = delta
    rates = None
    if legs is not None:
        strain, rates = _lean(delta, legs)
        # the tilt of the lower body's z axis in place of the first two components
        tilts = product(to_upper, cross_matrix(lower[:, 2]))
        phi[0] = -q[1, 2]
        phi[1] = q[0, 2]
        spin[0] = tilts[1]
        spin[1] = -tilts[0]
    attached = Attached(ends, reach, arm)
    return _Strains(which, legs, attached, upper, lower, delta, (strain, phi), rates, spin)


def _lean_factor(delta: Vector, length: Scalar) -> tuple[Scalar, Vector, Matrix]:
    """L f with its gradient and Hessian by delta."""
    x = delta[0]
    y = delta[1]
    z = length + delta[2]
    q = x * x + y * y
    n = z * z + q
    a, first, second = _arctan_ratio(q / (z * z))
    f_q = length * first / z**3
    f_qq = length * second / z**5
    f_z = -length / n
    f_qz = length / n**2
    f_zz = 2 * length * z / n**2
    xx = 2 * f_q + 4 * f_qq * x * x
    xy = 4 * f_qq * x * y
    yy = 2 * f_q + 4 * f_qq * y * y
    xz = 2 * x * f_qz
    yz = 2 * y * f_qz
    curve = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, f_zz]])
    return length * a / z, np.array([2 * f_q * x, 2 * f_q * y, f_z]), curve


def _lean(delta: Vector, length: Scalar) -> tuple[Vector, Matrix]:
    """Lean of legs (g, delta_z), m, with its derivatives by delta (output, input)."""
    f, slope, _ = _lean_factor(delta, length)
    across = delta * _ACROSS
    rates = outer(across, slope)
    rates[0, 0] += f
    rates[1, 1] += f
    rates[2, 2] += 1.0
    lean = f * across
    lean[2] = delta[2]
    return lean, rates


def _lean_curvature(delta: Vector, length: Scalar, pull: Vector) -> Matrix:
    """Second derivatives of the lean by delta, times the gradient `pull` of the energy by it."""
    _, slope, curve = _lean_factor(delta, length)
    flat = pull * _ACROSS
    return (flat * delta).sum(0) * curve + outer(flat, slope) + outer(slope, flat)


def _arctan_ratio(t: Scalar) -> list[Scalar]:
    """Return A(t), A'(t) and A''(t)."""
    small = np.abs(t) < SMALL
    far = np.where(small, 1.0, t)
    near = np.where(small, t, 0.0)
    a = np.arctan(np.sqrt(far)) / np.sqrt(far)
    first = (1 / (1 + far) - a) / (2 * far)
    closed = a, first, -(1 / (1 + far) ** 2 + 3 * first) / (2 * far)
    return [
        np.where(small, polynomial.polyval(near, row), value)
        for row, value in zip(SERIES, closed, strict=True)
    ]


def _blocks(
    form: Inexact[np.ndarray, "6 6 spring build"],
) -> tuple[Matrix, Matrix, Matrix]:
    """Blocks of forms in the strain: of the displacement, mixed, and of the rotation."""
    return form[:3, :3], form[:3, 3:], form[3:, 3:]


def _pull(now: Configuration, one: _Strains) -> tuple[Vector, Vector]:
    """Gradient of the energy with respect to the strain."""
    springs = now.arrays.springs
    delta, phi = one.strain
    straight, mixed, turns = _blocks(springs.stiffness[:, :, one.which])
    preload = springs.preload[:, one.which]
    pull = times(straight, delta) + times(mixed, phi) - preload[:3]
    return pull, times(transposed(mixed), delta) + times(turns, phi) - preload[3:]


def add_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all springs."""
    for one in _strains(now):
        pull, twist = _pull(now, one)
        along = pull if one.rates is None else times(transposed(one.rates), pull)
        force = times(one.upper, along)
        torque = times(transposed(one.spin), twist)
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
    skew = cross_matrix(twist)
    s = None
    if one.legs is not None:
        curve = _lean_curvature(one.delta, one.legs, pull)
        s = product(product(one.upper, curve), transposed(one.upper))
        skew[0, 0] = skew[1, 1] = skew[2, 0] = skew[2, 1] = 0.0
        skew[0, 2] = 2 * twist[1]
        skew[1, 2] = -2 * twist[0]
    g = product(product(one.upper, skew), transposed(one.lower))
    own = plus_unit(symmetric(g) / 2, -np.trace(g) / 2)
    # a force fixed in the upper body turns with it
    x_u = -cross_matrix(force)
    return Terms(s=s, x_u=x_u, y_uu=own, y_lu=plus_unit(-g / 2, np.trace(g) / 2), y_ll=own)


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


ELEMENT = Element(add_derivatives, add_damping=add_damping, add_loss=add_loss)


def add_blade_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all blades."""
    blades = now.arrays.blades
    axes = now.arrays.blades.axes.T
    if not blades.label:
        return
    rows = now.arrays.numbering.blade.T[axes]
    derivatives.gradient[rows] += (blades.stiffness * now.deflection - blades.load)[axes]
    if derivatives.curved:
        derivatives.add_diagonal(rows, blades.stiffness[axes])


def add_blade_loss(now: Configuration, derivatives: Derivatives) -> None:
    """Add the imaginary part of the stiffness of all blades."""
    blades = now.arrays.blades
    axes = now.arrays.blades.axes.T
    if blades.loss.any():
        rows = now.arrays.numbering.blade.T[axes]
        derivatives.add_diagonal(rows, (blades.stiffness * blades.loss[:, None])[axes])


BLADES = Element(add_blade_derivatives, add_loss=add_blade_loss)
