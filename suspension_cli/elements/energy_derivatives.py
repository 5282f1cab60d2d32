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

between rotations, to which the rotation of the arms adds (see `vectors.turning`). A tip has the
rows -R^T of those of the upper translation; as its body rotates by t, -F . (t x R q) adds t . [F] R
q. An element at one point is one whose lower end is fixed in space.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements.configuration import Attached, Configuration, Ends, sums
from suspension_cli.elements.vectors import (
    Matrix,
    Vector,
    cross,
    dot,
    outer,
    symmetric,
    times,
    times_cross,
    transposed,
    turning,
)

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.elements.configuration import Numbers

_THREE = np.arange(3)[:, None]
"""Offsets of the translations (or the rotations) of bodies, one body to a column."""
_SIX = np.arange(6)[:, None]
"""Offsets of all coordinates of bodies, one body to a column."""


@dataclass
class Terms:
    """Derivatives of the energy of elements between two bodies; None where 0."""

    force: Vector | None = None  # F, gradient with respect to the span, N
    upper_torque: Vector | None = None  # gradient with respect to rotations of the bodies with
    lower_torque: Vector | None = None  # the span fixed, N m
    s: Matrix | None = None  # N/m
    x_u: Matrix | None = None  # N
    x_l: Matrix | None = None
    y_uu: Matrix | None = None  # second derivatives by rotations with the span fixed, N m
    y_lu: Matrix | None = None
    y_ll: Matrix | None = None  # of this and y_uu only the symmetric part matters
    turning_force: Vector | None = None  # in place of F where its arms turn, N

    def __post_init__(self) -> None:
        if self.turning_force is None:
            self.turning_force = self.force

    def __add__(self, other: Terms) -> Terms:
        """Sum of the derivatives of two energies of the same elements."""
        names = [item.name for item in fields(self)]
        return Terms(*(_total(getattr(self, name), getattr(other, name)) for name in names))


def _total(*parts: np.ndarray | None) -> np.ndarray | None:
    """Sum of the parts that are not 0."""
    known = [part for part in parts if part is not None]
    return sum(known[1:], known[0]) if known else None


def _of(
    function: Callable[..., np.ndarray], first: np.ndarray | None, *others: Any
) -> np.ndarray | None:
    """A function that is linear in its first argument."""
    return None if first is None else function(first, *others)


class Derivatives:
    """Derivatives of the energy of builds in one pose each, to which each element adds its own.

    The `gradient` is (N + 1, build), N and N m; the last row is for rigid directions of blades. The
    `hessian`, the tangent stiffness (N + 1, N + 1, build), has its lower triangle filled alone, N/m
    and so on, if second derivatives are wanted (`curved`); they may include the `stretching` of
    wires. `linked` are its elements that may differ from 0. `bent` are the force and both torques
    of `Terms` that the bending of wires alone adds; none if none bends.
    """

    def __init__(self, now: Configuration, *, curved: bool = True, stretching: bool = True) -> None:
        size = now.arrays.numbering.size + 1
        count = now.arrays.count
        dtype = np.result_type(now.arrays.dtype, now.shift.dtype)
        self._now = now
        self.curved = curved
        self.stretching = stretching
        self.gradient = np.zeros((size, count), dtype=dtype)
        self.hessian = np.zeros((size, size, count) if curved else (0, 0, count), dtype=dtype)
        self.linked = np.zeros((size, size), dtype=bool)
        self.bent: tuple[Vector, ...] = ()
        self._terms = dict[int, tuple[Attached, Terms]]()

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
        bodies = 6 * (1 + np.arange(block.shape[2]))
        self.hessian[(bodies + first + _THREE)[:, None], bodies + first + _THREE] += block
        self.linked[(bodies + _SIX)[:, None], bodies + _SIX] = True

    def finish(self) -> Derivatives:
        """Sum up what was added."""
        for attached, terms in self._terms.values():
            ends = attached.ends
            rates = (None, None)
            for body, first, own in _gradient(attached, terms):
                (number,), total = sums(body)
                self.gradient[6 * number + first + _THREE] += total @ own
            if self.curved:
                rates = _rates(attached, terms)
                pairs, total = sums(ends.upper, ends.lower, partly=True)
                blocks = _blocks(attached, terms, *rates, total)
                for n, pair in enumerate(pairs.T.tolist()):
                    for row, i, column, j, block in blocks:
                        if min(pair[row], pair[column]) >= 0:
                            first, second = 6 * pair[row] + i, 6 * pair[column] + j
                            self.hessian[first : first + 3, second : second + 3] += block[:, :, n]
                for row, column in (ends[0], ends[0]), (ends[1], ends[1]), (ends[1], ends[0]):
                    (one, other), _ = sums(row, column)
                    self._link(6 * one + _SIX, other)
            if max(ends.blade, default=-1) >= 0:
                self._add_tips(ends, terms, *rates)
        self._terms.clear()
        return self

    def symmetric(
        self, out: Inexact[np.ndarray, "coordinate coordinate build"] | None = None
    ) -> Inexact[np.ndarray, "build coordinate coordinate"]:
        """Tangent stiffness, exactly symmetric; a view, builds first, of `out` if that is given."""
        size = len(self.hessian) - 1
        lower = self.hessian
        result = np.empty((size, size, lower.shape[-1]), lower.dtype) if out is None else out
        for row in range(size):
            result[row, : row + 1] = result[: row + 1, row] = lower[row, : row + 1]
        return np.moveaxis(result, -1, 0)

    def _link(self, rows: np.ndarray, body: np.ndarray) -> None:
        self.linked[rows[..., None, :], 6 * body + _SIX] = True

    def _add_tips(self, ends: Ends, terms: Terms, a: Matrix | None, b: Matrix | None) -> None:
        """Add the derivatives by deflections of the blades at the upper ends.

        All elements at one blade join the same bodies.
        """
        (blade, upper), total = sums(ends.blade, ends.upper)
        (_, lower), _ = sums(ends.blade, ends.lower)
        tips = self._now.arrays.numbering.blade[blade]
        number, axis = np.nonzero(tips < len(self.gradient) - 1)
        tip = tips[number, axis]
        body = upper[number]
        moves = self._now.turn[:, axis, body] + np.eye(3)[:, axis, None]

        def along(matrix: Matrix) -> Vector:
            return times(transposed((total @ matrix)[:, :, number]), moves)

        if terms.force is not None:
            self.gradient[tip] -= dot(moves, (total @ terms.force)[:, number])
        if not self.curved:
            return
        if terms.turning_force is not None:
            pull = (total @ terms.turning_force)[:, number]
            self.hessian[tip, 6 * body + 3 + _THREE] += cross(pull, moves)
        self._link(tip, body)

        if terms.s is None or a is None:
            return
        stiff = along(terms.s)
        self.hessian[tip, 6 * body + _THREE] += stiff
        self.hessian[tip, 6 * body + 3 + _THREE] -= along(a)
        if len(lower):
            self._link(tip, lower[number])
            self.hessian[tip, 6 * lower[number] + _THREE] -= stiff
            self.hessian[tip, 6 * lower[number] + 3 + _THREE] += along(b) if b is not None else 0.0
        one, other = np.nonzero((number[:, None] == number) & (axis[:, None] >= axis))
        self.linked[tip[one], tip[other]] = True
        self.hessian[tip[one], tip[other]] += dot(moves[:, other], stiff[:, one])


def _gradient(attached: Attached, terms: Terms) -> Iterator[tuple[Numbers, int, Vector]]:
    """List the gradients by translations (0) and rotations (3) of the bodies at both ends."""
    sides = (
        (attached.ends.upper, -1.0, attached.upper_arm, terms.upper_torque),
        (attached.ends.lower, 1.0, attached.lower_arm, terms.lower_torque),
    )
    for body, sign, arm, torque in sides:
        if max(body, default=-1) < 0:
            continue
        force = _of(np.multiply, terms.force, sign)
        torque = _total(torque, None if force is None else cross(arm, force))
        yield from ((body, n, own) for n, own in ((0, force), (3, torque)) if own is not None)


def _rates(attached: Attached, terms: Terms) -> tuple[Matrix | None, Matrix | None]:
    """A and B of this module."""
    a, b = (_of(times_cross, terms.s, arm) for arm in (attached.upper_arm, attached.lower_arm))
    return _total(a, terms.x_u), _total(b, _of(np.negative, terms.x_l))


def _blocks(
    attached: Attached,
    terms: Terms,
    a: Matrix | None,
    b: Matrix | None,
    total: Float[np.ndarray, "pair element"],
) -> list[tuple[int, int, int, int, Matrix]]:
    """List the blocks between translations (0) and rotations (3) of the bodies of each pair.

    A block comes with its rows, of the upper (0) or the lower body (1), and its columns likewise.
    What is linear in sums over the elements of a pair (`total`) is computed from these.
    """

    def summed(*parts: Matrix | None) -> Matrix | None:
        return _of(total.__matmul__, _total(*parts))

    def of_rotations(rate: Matrix | None, x: Matrix | None, y: Matrix | None, arm: Vector) -> Any:
        """Sum [w]^T R + X^T [w] + Y = ([w]^T (R + X) + transpose) / 2 + Y, for an arm w."""
        return _of(symmetric, summed(_of(cross, _total(rate, x), arm), y))

    arm = attached.upper_arm
    below = attached.lower_arm
    force = terms.turning_force
    minus = _of(np.negative, terms.x_l)
    s = summed(terms.s)
    rotating_a, rotating_b = summed(a), summed(b)
    turned, turned_below = (_of(turning, summed(_of(outer, force, w))) for w in (arm, below))
    mixed = summed(terms.y_lu, _of(cross, a, -below))
    across = _of(transposed, summed(_of(cross, terms.x_l, arm)))
    minus_a, minus_b = (_of(np.negative, rate) for rate in (rotating_a, rotating_b))
    blocks = [
        (0, 0, 0, 0, s),
        (0, 3, 0, 0, _of(transposed, minus_a)),
        (0, 3, 0, 3, _total(of_rotations(a, terms.x_u, terms.y_uu, arm), _of(np.negative, turned))),
        (1, 0, 0, 0, _of(np.negative, s)),
        (1, 0, 1, 0, s),
        (1, 0, 0, 3, rotating_a),
        (1, 3, 0, 0, _of(transposed, rotating_b)),
        (1, 3, 1, 0, _of(transposed, minus_b)),
        (1, 3, 0, 3, _total(mixed, across)),
        (1, 3, 1, 3, _total(of_rotations(b, minus, terms.y_ll, below), turned_below)),
    ]
    return [(row, i, column, j, own) for row, i, column, j, own in blocks if own is not None]
