"""Elimination body by body where bodies have no more than two coordinates and constant links: few steps on many numbers each.

The same as `mechanics.elimination`, for when a call of numpy costs as much as the thousand numbers that it works on.  What the Schur
complement of a node is made of,

    S = K + i omega C - omega^2 M - sum over children c of B_c S_c^-1 B_c^T,

are constants times powers of omega and times the elements of the children's inverses.  With these as the rows of one table S is a single
product with a matrix of the model, and its inverse fills rows of the parent's part of the table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics.elimination import Tree
from suspension_cli.mechanics.stacks import dense

TRIANGLE = ((0, 0), (0, 1), (1, 1))
"""Elements of a symmetric matrix that are worked on, and in the table; of an inverse the second with its sign turned."""


@dataclass(frozen=True)
class Plan:
    """What of a block's elimination does not depend on frequency.

    Attributes
    ----------
    structure : Tree
    element : tuple of (e, t) arrays
        Of each node, elements of S against the rows of its part of the table: powers of omega, then the children's inverses.
    part, inverse : tuple of slice
        Where in the table that part is, and where the inverse goes.
    push, pull : tuple of (s above, s), (s, s above) arrays or None
        -B and -B^T.
    support, carried : (k, c, 6) arrays
        What pulls towards the support, against each power (`condensed.Block`).
    damped : bool
        Whether the powers are 1, omega and omega^2, or only 1 and omega^2.
    height : int
        Rows of the table.
    kind : numpy type
        float or complex.
    """

    structure: Tree
    element: tuple[Any, ...]
    part: tuple[slice, ...]
    inverse: tuple[slice, ...]
    push: tuple[Any, ...]
    pull: tuple[Any, ...]
    support: Any
    carried: Any
    damped: bool
    height: int
    kind: Any

    def powers(self, omega: Array) -> Any:
        """Powers of omega (k, f)."""
        result = np.empty((3 if self.damped else 2, len(omega)))
        result[0] = 1.0
        if self.damped:
            result[1] = omega
        np.multiply(omega, omega, out=result[-1])
        return result


def plan(structure: Tree, own: Any, link: Any, support: Any, carried: Any) -> Plan | None:
    """The plan of a block made of `condensed.Piece`s; None if it has larger nodes, or links that depend on frequency."""
    count, nodes, parent = len(structure.nodes), structure.nodes, structure.parent
    if any(len(node) > 2 for node in nodes) or np.concatenate(nodes).tolist() != list(range(len(structure.places))):
        return None
    if any(piece is not None and (piece.moving or piece.resisting) for piece in link):
        return None
    every = [*own, *support, *carried]
    damped = any(piece.resisting for piece in every)
    kind = np.result_type(complex if damped else float, *(piece.stiffness for piece in [*every, *(piece for piece in link if piece is not None)]))

    def powered(piece: Any) -> Any:
        parts = [piece.stiffness, 1j * piece.damping, -piece.mass] if damped else [piece.stiffness, -piece.mass]
        return np.array(parts).astype(kind)

    element, part, inverse, height = [], [], [slice(0)] * count, 0
    for n in range(count):
        start, columns = height, [np.array([powered(own[n])[:, i, j] for i, j in _triangle(len(nodes[n]))])]
        height += columns[0].shape[1]
        for child in (c for c in range(count) if parent[c] == n):
            columns.append(_taken(link[child].stiffness, len(nodes[n])))
            inverse[child] = slice(height, height + columns[-1].shape[1])
            height = inverse[child].stop
        part.append(slice(start, height))
        element.append(np.concatenate(columns, axis=1).astype(kind))
    for n in (n for n in range(count) if parent[n] < 0):
        inverse[n] = slice(height, height + len(element[n]))
        height = inverse[n].stop
    push = tuple(None if piece is None else -piece.stiffness.astype(kind) for piece in link)
    pull = tuple(None if one is None else np.ascontiguousarray(one.T) for one in push)
    held, left = (np.concatenate([powered(piece) for piece in pieces], axis=1) for pieces in (support, carried))
    return Plan(structure, tuple(element), tuple(part), tuple(inverse), push, pull, held, left, damped, height, kind)


def _triangle(size: int) -> Any:
    return TRIANGLE if size == 2 else TRIANGLE[:1]


def _taken(link: Any, size: int) -> Any:
    """Elements of -B X B^T against those of X as they are in the table."""
    b = link
    if b.shape[1] == 1:
        return np.array([[-b[i, 0] * b[j, 0]] for i, j in _triangle(size)])
    return np.array([[-b[i, 0] * b[j, 0], b[i, 0] * b[j, 1] + b[i, 1] * b[j, 0], -b[i, 1] * b[j, 1]] for i, j in _triangle(size)])


@dataclass(frozen=True)
class Packed:
    """Many systems after elimination.

    Attributes
    ----------
    plan : Plan
    table : (height, P) array
    buried : (b,) int array
        Systems that are solved densely instead.
    whole : (c, c, b) array
        Those, put together.
    """

    plan: Plan
    table: Any
    buried: Any
    whole: Any

    def some(self, which: Any) -> Packed:
        """Some of the systems, some perhaps more than once."""
        table = self.table.take(which, axis=1)
        if not len(self.buried):
            return Packed(self.plan, table, self.buried, self.whole)
        place = np.full(self.table.shape[1], -1)
        place[self.buried] = np.arange(len(self.buried))
        dense_ones = place[which]
        buried = np.flatnonzero(dense_ones >= 0)
        return Packed(self.plan, table, buried, self.whole[..., dense_ones[buried]])

    def solve(self, moves: Any, pushed: Any, *, carried: bool) -> Any:
        """Coordinates (c, i, P) for support motions (6, i) and forces (c, i)."""
        share = (self.plan.carried if carried else self.plan.support) @ -moves  # (k, c, i)
        share[0] += pushed
        powers = self.table[: len(share)]  # every part begins with them
        result = np.empty((*share.shape[1:], powers.shape[1]), dtype=self.plan.kind)
        acting, varying = (some.any(0).T.tolist() for some in (share, share[1:]))
        for i, (acts, varies) in enumerate(zip(acting, varying, strict=True)):
            right = [
                (share[:, here, i].T @ powers if any(varies[here]) else share[0, here, i, None]) if any(acts[here]) else None
                for here in self.plan.structure.where
            ]
            self._into(result[:, i], right)
        return result

    def corrected(self, right: Any) -> Any:
        """Coordinates (c, P) for right sides (c, P), one a system."""
        result = np.empty(right.shape, dtype=self.plan.kind)
        self._into(result, [right[here] for here in self.plan.structure.where])
        return result

    def _into(self, result: Any, given: list[Any]) -> None:
        """Fill in coordinates (c, P) for right sides (s, P) or (s, 1) of each node, None for nothing."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a singular part is among the buried
            self._by_body(result, list(given))
        if len(self.buried):
            right = np.zeros((len(result), len(self.buried)), dtype=self.plan.kind)
            for here, part in zip(self.plan.structure.where, given, strict=True):
                if part is not None:
                    right[here] = part[:, self.buried] if part.shape[1] > 1 else part
            result[:, self.buried] = dense(self.whole, right[:, None])[:, 0]

    def _by_body(self, result: Any, right: list[Any]) -> None:
        given = self.plan
        parent, where = given.structure.parent, given.structure.where
        inverse = [self.table[rows] for rows in given.inverse]
        for n in range(len(right) - 1, 0, -1):
            here, up = right[n], parent[n]
            if here is None or up < 0:
                continue
            led = given.push[n] @ _divided(inverse[n], here, np.empty((len(here), result.shape[1]), dtype=given.kind))
            right[up] = led if right[up] is None else np.add(led, right[up], out=led)
        for n, (here, up) in enumerate(zip(right, parent, strict=True)):
            side = here
            if up >= 0:
                side = given.pull[n] @ result[where[up]]
                if here is not None:
                    side += here
            if side is None:
                result[where[n]] = 0.0
            else:
                _divided(inverse[n], side, result[where[n]])


def factored(given: Plan, omega: Array, buried: Any, whole: Any) -> Packed:
    """Eliminate body by body at frequencies (f,); `buried` are those that are to be solved densely, `whole` (c, c, b) those systems."""
    powers = given.powers(omega)
    table = np.empty((given.height, len(omega)), dtype=given.kind)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for n in range(len(given.element) - 1, -1, -1):
            part, inverse = table[given.part[n]], table[given.inverse[n]]
            part[: len(powers)] = powers
            schur = given.element[n] @ part
            if len(schur) == 1:
                np.divide(1.0, schur, out=inverse)
                continue
            over = schur[0] * schur[2]
            over -= schur[1] * schur[1]
            np.multiply(schur[::-1], np.divide(1.0, over, out=over), out=inverse)
    return Packed(given, table, buried, whole)


def _divided(inverse: Any, right: Any, out: Any) -> Any:
    """S^-1 r of one node."""
    if len(inverse) == 1:
        return np.multiply(inverse, right, out=out)
    np.multiply(inverse[::2], right, out=out)
    out -= inverse[1] * right[::-1]
    return out
