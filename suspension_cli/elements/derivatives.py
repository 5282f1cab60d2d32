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

from suspension_cli.elements.configuration import Attached, Configuration, Sums
from suspension_cli.elements.vectors import (
    Matrix,
    Vector,
    cross,
    dot,
    times,
    times_cross,
    transposed,
    turning,
)

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int


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
        names = [item.name for item in fields(self) if item.name != "turning_force"]
        total = {name: _sum(getattr(self, name), getattr(other, name)) for name in names}
        turning_force = None
        if self.turning_force is not None or other.turning_force is not None:
            turning_force = _sum(self._turning_force, other._turning_force)
        return Terms(**total, turning_force=turning_force)

    @property
    def _turning_force(self) -> Vector | None:
        return self.force if self.turning_force is None else self.turning_force


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
    gradient
        (N + 1, build), N and N m; the last row is for rigid directions of blades.
    hessian
        Tangent stiffness (N + 1, N + 1, build), N/m, N and N m; only the lower triangle is filled.
    linked
        Elements of the tangent stiffness (N + 1, N + 1) that may differ from 0.
    """

    def __init__(self, now: Configuration, *, curved: bool = True, stretching: bool = True) -> None:
        arrays = now.arrays
        size, count = arrays.numbering.size + 1, arrays.count
        dtype = np.result_type(arrays.dtype, now.shift.dtype)
        self._now, self.curved, self.stretching = now, curved, stretching
        self.gradient = np.zeros((size, count), dtype=dtype)
        self.hessian = np.zeros((size, size, count) if curved else (0, 0, count), dtype=dtype)
        self.linked = np.zeros((size, size), dtype=bool)
        # with the forces of the pose, and with those for the geometric stiffness
        self._on_tips = np.zeros((2, 3, len(arrays.blades.label), count), dtype=dtype)
        self._pulls, self._terms = False, dict[int, tuple[Attached, Terms]]()

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
        bodies = 1 + np.arange(block.shape[2])
        self._add_blocks(6 * bodies + first, 6 * bodies + first, block)
        self._link(bodies, bodies)

    def finish(self) -> Derivatives:
        """Sum up what was added."""
        for attached, terms in self._terms.values():
            self._add_gradient(attached, terms)
            if self.curved:
                self._add_hessian(attached, terms)
        if self._pulls:
            self._add_tips()
        self._terms.clear()
        self._on_tips[:], self._pulls = 0.0, False
        return self

    def symmetric(
        self, out: Inexact[np.ndarray, "coordinate coordinate build"] | None = None
    ) -> Inexact[np.ndarray, "build coordinate coordinate"]:
        """Tangent stiffness, exactly symmetric; a view, builds first, of `out` if that is given."""
        size, lower = len(self.hessian) - 1, self.hessian
        result = np.empty((size, size, lower.shape[-1]), lower.dtype) if out is None else out
        for row in range(size):
            result[row, : row + 1] = result[: row + 1, row] = lower[row, : row + 1]
        return np.moveaxis(result, -1, 0)

    def _add_blocks(
        self,
        rows: Int[np.ndarray, " group"],
        columns: Int[np.ndarray, " group"],
        blocks: Inexact[np.ndarray, "3 3 group #build"],
    ) -> None:
        """Add matrices to blocks of the tangent stiffness, from these rows and columns on."""
        self.hessian[(rows + _THREE)[:, None], columns + _THREE] += blocks

    def _link(self, row: Int[np.ndarray, " group"], column: Int[np.ndarray, " group"]) -> None:
        self.linked[(6 * row + _SIX)[:, None], 6 * column + _SIX] = True

    def _add_gradient(self, attached: Attached, terms: Terms) -> None:
        force, sums = terms.force, attached.ends.sums()
        sides = [(sums.upper.upper, sums.upper.sum, -1.0, attached.upper_arm, terms.upper_torque)]
        if attached.ends.is_joined:
            sides.append(
                (sums.lower.lower, sums.lower.sum, 1.0, attached.lower_arm, terms.lower_torque)
            )
        for body, total, sign, arm, torque in sides:
            if force is not None:
                self.gradient[6 * body + _THREE] += (sign * total) @ force
            torque = _sum(torque, None if force is None else sign * cross(arm, force))
            if torque is not None:
                self.gradient[6 * body + 3 + _THREE] += total @ torque
        if force is not None and len(sums.blade.blade):
            self._on_tips[0][:, sums.blade.blade] -= sums.blade.sum @ force
            force = terms.turning_force if terms.turning_force is not None else force
            self._on_tips[1][:, sums.blade.blade] -= sums.blade.sum @ force
            self._pulls = True

    def _add_hessian(self, attached: Attached, terms: Terms) -> None:
        ends, s = attached.ends, terms.s
        force = terms.turning_force if terms.turning_force is not None else terms.force
        a, sums = attached.upper_arm, ends.sums()
        to_u = _sum(None if s is None else times_cross(s, a), terms.x_u)
        own = _sum(terms.y_uu, None if to_u is None else cross(to_u, a))
        own = _sum(own, None if force is None else -turning(force, a))
        own = _sum(own, None if terms.x_u is None else times_cross(transposed(terms.x_u), a))
        u, total = 6 * sums.upper.upper, sums.upper.sum
        self._link(sums.upper.upper, sums.upper.upper)
        if s is not None:
            self._add_blocks(u, u, total @ s)
        if to_u is not None:
            self._add_blocks(u + 3, u, -transposed(total @ to_u))
        if own is not None:
            self._add_blocks(u + 3, u + 3, total @ own)
        to_l = self._add_joined(attached, terms, to_u, force) if ends.is_joined else None
        if s is not None and to_u is not None and len(sums.blade.blade):
            self._add_tip_rows(sums, s, to_u, to_l)

    def _add_joined(
        self, attached: Attached, terms: Terms, to_u: Matrix | None, force: Vector | None
    ) -> Matrix | None:
        """Add the blocks of the lower bodies; also B."""
        a, b, s, sums = attached.upper_arm, attached.lower_arm, terms.s, attached.ends.sums()
        less = None if terms.x_l is None else -terms.x_l
        to_l = _sum(None if s is None else times_cross(s, b), less)
        mixed = _sum(terms.y_lu, None if to_u is None else -cross(to_u, b))
        own = _sum(terms.y_ll, None if to_l is None else cross(to_l, b))
        own = _sum(own, None if force is None else turning(force, b))
        if less is not None:
            mixed = _sum(mixed, -times_cross(transposed(less), a))
            own = _sum(own, times_cross(transposed(less), b))
        l, total = 6 * sums.lower.lower, sums.lower.sum
        u, below, pair = 6 * sums.both.upper, 6 * sums.both.lower, sums.both.sum
        self._link(sums.lower.lower, sums.lower.lower)
        self._link(sums.both.lower, sums.both.upper)
        if s is not None:
            self._add_blocks(below, u, -(pair @ s))
            self._add_blocks(l, l, total @ s)
        if to_u is not None:
            self._add_blocks(below, u + 3, pair @ to_u)
        if to_l is not None:
            self._add_blocks(below + 3, u, transposed(pair @ to_l))
            self._add_blocks(l + 3, l, -transposed(total @ to_l))
        if mixed is not None:
            self._add_blocks(below + 3, u + 3, pair @ mixed)
        if own is not None:
            self._add_blocks(l + 3, l + 3, total @ own)
        return to_l

    def _add_tip_rows(self, sums: Sums, s: Matrix, to_u: Matrix, to_l: Matrix | None) -> None:
        """Add the derivatives by deflections of the blades at the upper ends."""
        tips = self._now.arrays.numbering.blade[sums.blade.blade]
        number, axis = np.nonzero(tips < len(self.hessian) - 1)
        tip, total = tips[number, axis], sums.blade.sum
        moves = self._moves(sums.blade.upper[number], axis)
        stiff = times((total @ s)[:, :, number], moves)
        rows, u, l = tip[None], 6 * sums.blade.upper[number], 6 * sums.blade.lower[number]
        columns = u + _THREE
        self.hessian[rows, columns] += stiff
        self.hessian[rows, columns + 3] -= times(transposed((total @ to_u)[:, :, number]), moves)
        self.linked[rows, u + _SIX] = True
        if to_l is not None:
            columns = l + _THREE
            self.hessian[rows, columns] -= stiff
            on_l = times(transposed((total @ to_l)[:, :, number]), moves)
            self.hessian[rows, columns + 3] += on_l
            self.linked[rows, l + _SIX] = True
        one, other = np.nonzero((number[:, None] == number) & (axis[:, None] >= axis))
        self.hessian[tip[one], tip[other]] += dot(moves[:, other], stiff[:, one])
        self.linked[tip[one], tip[other]] = True

    def _moves(self, body: Int[np.ndarray, " tip"], axis: Int[np.ndarray, " tip"]) -> Vector:
        """Directions in which tips move."""
        return self._now.turn[:, axis, body] + np.eye(3)[:, axis, None]

    def _add_tips(self) -> None:
        """Add the derivatives of the forces on tips of blades by their deflections.

        The gradient F at a tip, deflected by q, adds F . (t x R q) = -t . [F] R q as its body
        rotates by t.
        """
        tips, bodies = self._now.arrays.numbering.blade, self._now.arrays.blades.body
        number, axis = np.nonzero(tips < len(self.gradient) - 1)
        if len(number):
            tip, body, (pulled, turned) = (
                tips[number, axis],
                bodies[number],
                self._on_tips[:, :, number],
            )
            moves = self._moves(body, axis)
            self.gradient[tip] += dot(moves, pulled)
            if self.curved:
                columns = 6 * body + 3 + _THREE
                self.hessian[tip[None], columns] += cross(moves, turned)
                self.linked[tip[None], columns] = True


_THREE, _SIX = np.arange(3)[:, None], np.arange(6)[:, None]
"""Offsets of the coordinates of bodies, one body to a column."""
