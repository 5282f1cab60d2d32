"""Gradient and tangent stiffness of builds, summed over their elements.

An element between points of two bodies, the attachments, has a span d from the upper to the lower
one. It changes with translations x and small rotations t of the upper and the lower body, whose
attachments have the arms a and b, and with the deflection q of a blade tip on a body turned by R:

    dd = x_l - x_u + [a] t_u - [b] t_l - R q,   [a] v = a x v.

With the force F on the span (the gradient of the energy with respect to it),
dF = S dd + X_u t_u + X_l t_l (a string has no X), and with

    A = S [a] + X_u,   B = S [b] - X_l,   dF = S (x_l - x_u - R q) + A t_u - B t_l,

all blocks of the stiffness follow: S between translations, A and B between these and rotations,
and from the change of the torques [a]^T F and -[b]^T F (and of those that bending and twisting
exert, with second derivatives Y)

    [a]^T A + X_u^T [a] + Y_uu,  -[b]^T A + X_l^T [a] + Y_lu,  [b]^T B - X_l^T [b] + Y_ll

between rotations, to which the rotation of the arms adds (see `vectors.turning`). An element at one
point is one whose lower end is fixed in space.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import Attached, Configuration, Ends
from suspension_cli.elements.vectors import (
    Matrix,
    Scalar,
    Vector,
    cross,
    dot,
    times,
    times_cross,
    transposed,
    turning,
)

if TYPE_CHECKING:
    from jaxtyping import Inexact


@dataclass(frozen=True)
class Terms:
    """Derivatives of the energy of elements between two bodies; None where 0.

    Attributes
    ----------
    force
        F, gradient with respect to the span, N.
    upper_torque, lower_torque
        Gradient with respect to rotations of the bodies with the span fixed, N m.
    s, x_u, x_l
        S (N/m), X_u and X_l (N) of dF = S dd + X_u t_u + X_l t_l.
    y_uu, y_lu, y_ll
        Second derivatives by the rotations with the span fixed (rows first), N m.
    turning_force
        Force in place of F where its arms turn, N.
    """

    force: Vector | None = None
    upper_torque: Vector | None = None
    lower_torque: Vector | None = None
    s: Matrix | None = None
    x_u: Matrix | None = None
    x_l: Matrix | None = None
    y_uu: Matrix | None = None
    y_lu: Matrix | None = None
    y_ll: Matrix | None = None
    turning_force: Vector | None = None

    def __add__(self, other: Terms) -> Terms:
        """Sum of the derivatives of two energies of the same elements."""
        pairs = ((getattr(self, item.name), getattr(other, item.name)) for item in fields(self))
        return Terms(*(_sum(a, b) for a, b in pairs))


def _sum(a: np.ndarray | None, b: np.ndarray | None) -> np.ndarray | None:
    if a is None or b is None:
        return a if b is None else b
    return a + b


class Derivatives:
    """Derivatives of the energy of builds in one pose each, to which each element adds its own.

    Attributes
    ----------
    curved
        Whether second derivatives are wanted.
    stretching
        Whether these include the stretching of wires.
    tension
        Of the wires for their geometric stiffness, N; None for that in the pose.
    gradient
        (N + 1, build), N and N m; the last row is for rigid directions of blades.
    hessian
        Tangent stiffness (N + 1, N + 1, build), N/m, N and N m; only the lower triangle is filled.
    linked
        Elements of the tangent stiffness (N + 1, N + 1) that may differ from 0.
    """

    def __init__(
        self,
        now: Configuration,
        *,
        curved: bool = True,
        stretching: bool = True,
        tension: Scalar | None = None,
    ) -> None:
        arrays = now.arrays
        size, count = arrays.numbering.size + 1, arrays.count
        dtype = np.result_type(arrays.dtype, now.shift.dtype)
        self._now, self.curved, self.stretching, self.tension = now, curved, stretching, tension
        self.gradient = np.zeros((size, count), dtype=dtype)
        self.hessian = np.zeros((size, size, count) if curved else (0, 0, count), dtype=dtype)
        self.linked = np.zeros((size, size), dtype=bool)
        self._on_tips = np.zeros((3, len(arrays.blades.label), count), dtype=dtype)
        self._terms: dict[int, tuple[Attached, Terms]] = {}

    def add(self, attached: Attached, terms: Terms) -> None:
        """Add the derivatives of the energy of elements between two bodies."""
        _, own = self._terms.get(id(attached), (attached, Terms()))
        self._terms[id(attached)] = attached, own + terms

    def add_diagonal(self, rows: np.ndarray, values: Inexact[np.ndarray, " row #build"]) -> None:
        """Add to the diagonal of the tangent stiffness."""
        self.hessian[rows, rows] += values
        self.linked[rows, rows] = True

    def add_body_block(self, first: int, block: Matrix) -> None:
        """Add a symmetric matrix (3, 3, body, build) to that of all bodies.

        `first` is 0 for their translations, 3 for rotations.
        """
        for body in range(block.shape[2]):
            self._add_block(6 * body + 6 + first, 6 * body + 6 + first, block[:, :, body])
            self._link(body + 1, body + 1)

    def finish(self) -> Derivatives:
        """Sum up what was added."""
        for attached, terms in self._terms.values():
            self._add_gradient(attached, terms)
            if self.curved:
                self._add_hessian(attached, terms)
        self._add_tips()
        self._terms.clear()
        self._on_tips[:] = 0.0
        return self

    def symmetric(self) -> Inexact[np.ndarray, "build coordinate coordinate"]:
        """Tangent stiffness with the builds first, exactly symmetric."""
        size, lower = len(self.hessian) - 1, self.hessian
        result = np.empty((lower.shape[-1], size, size), dtype=lower.dtype)
        for row in range(size):
            values = lower[row, : row + 1].T
            result[:, row, : row + 1], result[:, : row + 1, row] = values, values
        return result

    def _add_block(
        self,
        row: int,
        column: int,
        block: Matrix | None,
        sign: float = 1.0,
        *,
        across: bool = False,
    ) -> None:
        """Add a matrix (`across`: its transpose) times a sign."""
        if block is not None:
            place = self.hessian[row : row + 3, column : column + 3]
            block = transposed(block) if across else block
            (np.add if sign > 0 else np.subtract)(place, block, out=place)

    def _link(self, row: int, column: int) -> None:
        self.linked[6 * row : 6 * row + 6, 6 * column : 6 * column + 6] = True

    def _add_gradient(self, attached: Attached, terms: Terms) -> None:
        force, ends, low = terms.force, attached.ends, None
        joined = max(ends.lower) >= 0
        up = _sum(terms.upper_torque, None if force is None else cross(force, attached.upper_arm))
        if joined:
            turned = None if force is None else cross(attached.lower_arm, force)
            low = _sum(terms.lower_torque, turned)
        for u, l, which in ends.pairs():
            for row, part, sign in ((u, force, -1.0), (u, up, 1.0), (l, force, 1.0), (l, low, 1.0)):
                if part is not None and row >= 0:
                    first = 6 * row + (0 if part is force else 3)
                    self.gradient[first : first + 3] += sign * part[:, which].sum(1)
        if force is not None:
            for n, blade in enumerate(ends.blade):
                if blade >= 0:
                    self._on_tips[:, blade] -= force[:, n]

    def _add_hessian(self, attached: Attached, terms: Terms) -> None:
        ends, s = attached.ends, terms.s
        force = terms.force if terms.turning_force is None else terms.turning_force
        a, b, joined = attached.upper_arm, attached.lower_arm, max(ends.lower) >= 0
        to_u = _sum(None if s is None else times_cross(s, a), terms.x_u)
        uu = _sum(terms.y_uu, None if to_u is None else cross(to_u, a))
        uu = _sum(uu, None if force is None else -turning(force, a))
        uu = _sum(uu, None if terms.x_u is None else times_cross(transposed(terms.x_u), a))
        to_l = lu = ll = None
        if joined:
            less = None if terms.x_l is None else -terms.x_l
            to_l = _sum(None if s is None else times_cross(s, b), less)
            lu = _sum(terms.y_lu, None if to_u is None else -cross(to_u, b))
            lu = _sum(lu, None if less is None else -times_cross(transposed(less), a))
            ll = _sum(terms.y_ll, None if to_l is None else cross(to_l, b))
            ll = _sum(ll, None if force is None else turning(force, b))
            ll = _sum(ll, None if less is None else times_cross(transposed(less), b))
        for u, l, which in ends.pairs():
            x_u, t_u, x_l, t_l = 6 * u, 6 * u + 3, 6 * l, 6 * l + 3
            straight, on_u, on_l, own, mixed, other = (
                None if part is None else part[:, :, which].sum(2)
                for part in (s, to_u, to_l, uu, lu, ll)
            )
            self._add_block(x_u, x_u, straight)
            self._add_block(t_u, x_u, on_u, -1.0, across=True)
            self._add_block(t_u, t_u, own)
            self._link(u, u)
            if joined:
                self._add_block(x_l, x_u, straight, -1.0)
                self._add_block(x_l, t_u, on_u)
                self._add_block(x_l, x_l, straight)
                self._add_block(t_l, x_u, on_l, across=True)
                self._add_block(t_l, x_l, on_l, -1.0, across=True)
                self._add_block(t_l, t_u, mixed)
                self._add_block(t_l, t_l, other)
                self._link(l, u)
                self._link(l, l)
        if s is not None:
            assert to_u is not None
            self._add_tip_rows(ends, s, to_u, to_l)

    def _add_tip_rows(self, ends: Ends, s: Matrix, to_u: Matrix, to_l: Matrix | None) -> None:
        """Add the derivatives by deflections of the blades at the upper ends."""
        hung = [n for n, blade in enumerate(ends.blade) if blade >= 0]
        tips = self._now.arrays.numbering.blade[[ends.blade[n] for n in hung]]
        upper = [ends.upper[n] for n in hung]
        size = self._now.arrays.numbering.size
        for axis in range(3):
            moving = np.flatnonzero(tips[:, axis] < size) if hung else []
            if not len(moving):
                continue
            own, body = [hung[n] for n in moving], [upper[n] for n in moving]
            turned = self._now.turn[:, :, body] + np.eye(3)[:, :, None, None]
            stiff = times(s[:, :, own], turned[:, axis])
            on_u = times(transposed(to_u[:, :, own]), turned[:, axis])
            on_l = None if to_l is None else times(transposed(to_l[:, :, own]), turned[:, axis])
            for n, wire in enumerate(own):
                u, l, tip = ends.upper[wire], ends.lower[wire], tips[moving[n]]
                row = self.hessian[tip[axis]]
                row[6 * u : 6 * u + 3] += stiff[:, n]
                row[6 * u + 3 : 6 * u + 6] -= on_u[:, n]
                self.linked[tip[axis], 6 * u : 6 * u + 6] = True
                if on_l is not None:
                    row[6 * l : 6 * l + 3] -= stiff[:, n]
                    row[6 * l + 3 : 6 * l + 6] += on_l[:, n]
                    self.linked[tip[axis], 6 * l : 6 * l + 6] = True
                for other in range(axis + 1):
                    row[tip[other]] += dot(turned[:, other, n], stiff[:, n])
                    self.linked[tip[axis], tip[other]] = tip[other] < size

    def _add_tips(self) -> None:
        """Add the derivatives of the forces on tips of blades by their deflections.

        The gradient F at a tip, deflected by q, adds F . (t x R q) = -t . [F] R q as its body
        rotates by t.
        """
        now, blades, size = self._now, self._now.arrays.blades, len(self.gradient) - 1
        for n, (body, tips) in enumerate(
            zip(blades.body.tolist(), now.arrays.numbering.blade.tolist(), strict=True)
        ):
            pulled = self._on_tips[:, n]
            for axis, tip in enumerate(tips):
                if tip < size:
                    moves = now.turn[:, axis, body] + np.eye(3)[:, axis, None]
                    self.gradient[tip] += dot(moves, pulled)
                    if self.curved:
                        turn = slice(6 * body + 3, 6 * body + 6)
                        self.hessian[tip, turn] += cross(moves, pulled)
                        self.linked[tip, turn] = True
