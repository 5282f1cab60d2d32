"""Solve many small symmetric systems that differ in one parameter (a frequency, a build), body by body.

In a chain or tree each body couples only to the one that it hangs from.  Eliminating from the leaves up leaves small
blocks, done for all P systems at once with the system axis last:

    S_i = D_i - sum over children c of B_c S_c^-1 B_c^T,    r_i = b_i - sum of B_c S_c^-1 r_c,
    x_root = S^-1 r,    x_i = S_i^-1 r_i - S_i^-1 B_i^T x_parent,

with B_c the block between parent (rows) and child.  Transmission from the support to the mirror is thereby a product
of the stages' own transmissions: nothing cancels, so its digits survive however far it falls (block LU of a graded
matrix; Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 13).  Where a part resonates by itself its
S_c is nearly singular, and subtracting a large B_c S_c^-1 B_c^T buries the digits of D_i: those systems are solved densely.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.mechanics.stacks import dense, inverse, multiply

GROWTH = 30.0
"""What a child takes from a diagonal element of D_i, against that element, above which a system is solved densely instead.

A ratio of like to like, so it does not depend on units (a norm over metres and radians would).  So many times the rounding
error of the dense solve is what block elimination may lose.
"""
LIGHT = 8.0
"""The same where what elimination loses is refined afterwards, but for so many right-hand sides that a dense solution is cheaper."""


@dataclass(frozen=True)
class Tree:
    """Coordinates of a block grouped by body, parents before children.

    Attributes
    ----------
    nodes : tuple of (s,) int arrays
        Positions of each node's coordinates in the block.
    parent : tuple of int
        Node above, -1 for a root.
    """

    nodes: tuple[Any, ...]
    parent: tuple[int, ...]

    @cached_property
    def where(self) -> tuple[Any, ...]:
        """The nodes' positions, as slices where they follow each other."""
        return tuple(slice(node[0], node[-1] + 1) if node[-1] - node[0] + 1 == len(node) else node for node in self.nodes)

    @cached_property
    def places(self) -> Any:
        """Where each coordinate is found in the order of the nodes."""
        return np.argsort(np.concatenate(self.nodes))


def tree(owner: list[str], coupled: Any) -> Tree | None:
    """Group coordinates by owner and find the tree that they form; None if they form no tree.

    Parameters
    ----------
    owner : list of str
        The body that each coordinate goes with, parents first.
    coupled : (c, c) bool array
        Non-zero pattern of the systems.
    """
    names = list(dict.fromkeys(owner))
    nodes = [np.array([n for n, name in enumerate(owner) if name == own]) for own in names]
    parent = []
    for n, node in enumerate(nodes):
        above = [m for m in range(n) if coupled[np.ix_(node, nodes[m])].any()]
        if len(above) > 1:
            return None
        parent.append(above[0] if above else -1)
    return Tree(tuple(nodes), tuple(parent))


def solve(matrix: Any, rhs: Any, structure: Tree | None) -> Any:
    """Solve D x = b for many symmetric D.

    Parameters
    ----------
    matrix : (c, c, P) array
        Real or complex symmetric (not Hermitian).
    rhs : (c, k, P) array
    structure : Tree or None
        None: densely.

    Returns
    -------
    (c, k, P) array
    """
    if structure is None:
        return dense(matrix, rhs)
    diagonal = [matrix[np.ix_(node, node)] for node in structure.nodes]
    links = [None if up < 0 else matrix[np.ix_(structure.nodes[up], node)] for node, up in zip(structure.nodes, structure.parent, strict=True)]
    return factored(diagonal, links, structure, GROWTH).solve([rhs[node] for node in structure.nodes])


@dataclass(frozen=True)
class Factors:
    """Many systems after elimination, to be solved for any right-hand sides.

    Attributes
    ----------
    structure : Tree
    own : tuple of (s, s, P) arrays
        Of each node S, its inverse if it has no more than two coordinates (an inverse of more loses digits).
    toward : tuple of (s, s above, P) arrays or None
        S^-1 B^T.
    growth : (P,) array
        So many roundings of the elements of some D_i may be lost; at least 1.
    buried : (b,) int array
        Systems that are solved densely instead.
    whole : (c, c, b) array
        Those, put together.
    """

    structure: Tree
    own: tuple[Any, ...]
    toward: tuple[Any, ...]
    growth: Any
    buried: Any
    whole: Any

    def some(self, which: Any) -> Factors:
        """Some of the systems, some perhaps more than once."""
        own, toward = (tuple(None if part is None else np.take(part, which, axis=-1) for part in parts) for parts in (self.own, self.toward))
        if not len(self.buried):
            return Factors(self.structure, own, toward, self.growth[which], self.buried, self.whole)
        place = np.full(len(self.growth), -1)
        place[self.buried] = np.arange(len(self.buried))
        dense_ones = place[which]
        buried = np.flatnonzero(dense_ones >= 0)
        return Factors(self.structure, own, toward, self.growth[which], buried, self.whole[..., dense_ones[buried]])

    def solve(self, rhs: list[Any]) -> Any:
        """Solutions (c, k, P) for the right-hand sides (s, k, P) of each node; the last axis may be 1."""
        return self.solve_columns([Columns.of(b) for b in rhs], rhs[0].shape[1])

    def solve_columns(self, rhs: list[Columns], count: int) -> Any:
        """The same for those of `count` right-hand sides that are not 0."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a singular part is among the buried
            result = self._by_body(rhs, count)
        if len(self.buried):
            sides = [b.some(self.buried, count) for b in rhs]
            result[..., self.buried] = dense(self.whole, np.concatenate(sides)[self.structure.places])
        return result

    def _by_body(self, rhs: list[Columns], count: int) -> Any:
        parent, where = self.structure.parent, self.structure.where
        right, own = list(rhs), [part.value for part in rhs]
        for n in range(len(rhs) - 1, -1, -1):
            own[n] = _divided(self.own[n], right[n].value)
            if parent[n] >= 0:
                right[parent[n]] = right[parent[n]].less(right[n], np.swapaxes(self.toward[n], 0, 1))
        kind = np.result_type(*self.own, *(part.value for part in rhs), *(part for part in self.toward if part is not None))
        result = np.zeros((len(self.structure.places), count, len(self.growth)), dtype=kind)
        for n, here in enumerate(where):
            if parent[n] >= 0:
                result[here] = np.negative(led := multiply(self.toward[n], result[where[parent[n]]]), out=led)
            if right[n].together is not None:
                result[here, right[n].together] += own[n]
                continue
            for place, column in enumerate(right[n].which):
                result[here, column] += own[n][:, place]
        return result


def factored(diagonal: list[Any], links: list[Any], structure: Tree, limit: float = np.inf, *, buried: Any = None) -> Factors:
    """Eliminate body by body.

    Parameters
    ----------
    diagonal : list of (s, s, P) arrays
        Of each node.
    links : list of (s above, s, P) arrays or None
        Between each node's parent (rows) and the node; the last axis may be 1 where they are constant.
    structure : Tree
    limit : float
        Growth above which a system is to be solved densely.
    buried : (b,) int array, optional
        The systems to be solved densely, if that is known: growth is then not measured.
    """
    count = diagonal[0].shape[-1]
    schur, toward = list(diagonal), list(links)
    growth = np.ones(count)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for n in range(len(diagonal) - 1, -1, -1):
            above, across = structure.parent[n], links[n]
            schur[n] = inverse(schur[n]) if len(schur[n]) <= 2 else schur[n]
            if across is None:
                continue
            toward[n] = _divided(schur[n], np.swapaxes(across, 0, 1))
            schur[above], terms = _less(schur[above], np.swapaxes(toward[n], 0, 1), across)
            for row, taken in enumerate(terms if buried is None else []):
                sizes = [np.abs(term) for term in taken]
                np.maximum(growth, sum(sizes[1:], sizes[0]) / np.abs(diagonal[above][row, row]), out=growth)
    if buried is None:
        buried = np.flatnonzero(~(growth < limit))
        growth[buried] = 1.0
    return Factors(structure, tuple(schur), tuple(toward), growth, buried, whole([part[..., buried] for part in diagonal], _some(links, buried), structure))


def _some(parts: list[Any], which: Any) -> list[Any]:
    """Some of the systems; what is constant stays as it is."""
    return [part if part is None or part.shape[-1] == 1 else part[..., which] for part in parts]


def whole(diagonal: list[Any], links: list[Any], structure: Tree) -> Any:
    """The systems (c, c, P) made of what `factored` takes, put together."""
    size = sum(len(part) for part in diagonal)
    result = np.zeros((size, size, diagonal[0].shape[-1]), dtype=np.result_type(*diagonal, *(link for link in links if link is not None)))
    for node, up, own, across in zip(structure.nodes, structure.parent, diagonal, links, strict=True):
        result[np.ix_(node, node)] = own
        if up >= 0:
            result[np.ix_(structure.nodes[up], node)] = across
            result[np.ix_(node, structure.nodes[up])] = np.swapaxes(across, 0, 1)
    return result


def _divided(own: Any, right: Any) -> Any:
    """S^-1 r of one node from what `Factors` keeps of it."""
    if len(own) <= 2:
        return multiply(own, right) if right.shape[1] else right
    return dense(own, np.broadcast_to(right, (*right.shape[:2], own.shape[-1])))


def _less(matrix: Any, upward: Any, across: Any) -> tuple[Any, list[Any]]:
    """A symmetric D less U B^T, and for each row the terms that are taken from its diagonal."""
    result, taken = np.empty((*matrix.shape[:2], upward.shape[-1]), dtype=np.result_type(matrix, upward)), []
    for row in range(len(matrix)):
        for column in range(row, len(matrix)):
            terms = [upward[row, q] * across[column, q] for q in range(across.shape[1])]
            total = terms[0] if len(terms) == 1 else sum(terms[1:], terms[0])
            np.subtract(matrix[row, column], total, out=result[row, column])
            if column != row:
                result[column, row] = result[row, column]
            else:
                taken.append(terms)
    return result, taken


@dataclass(frozen=True)
class Columns:
    """Right-hand sides of one node, only those that are not 0: (s, columns, P) or (s, columns, 1), and which they are."""

    which: Any
    value: Any

    @staticmethod
    def of(rhs: Any) -> Columns:
        """Those of some (s, k, P) that are not 0."""
        return Columns(np.arange(rhs.shape[1]), rhs).needed()

    @property
    def together(self) -> slice | None:
        """They as a slice, if they follow each other."""
        if not len(self.which):
            return slice(0, 0)
        first, count = int(self.which[0]), len(self.which)
        return slice(first, first + count) if self.which.tolist() == list(range(first, first + count)) else None

    def needed(self) -> Columns:
        """Those that are not 0."""
        if not len(self.which):
            return self
        which = self.value.any((0, 2)).nonzero()[0]
        return self if len(which) == len(self.which) else Columns(self.which[which], self.value[:, which])

    def joined(self, other: Columns) -> Columns:
        """Both, where they have none in common."""
        if not len(other.which):
            return self
        count = max(self.value.shape[-1], other.value.shape[-1])
        values = [np.broadcast_to(part.value, (*part.value.shape[:2], count)) for part in (self, other)]
        return Columns(np.concatenate([self.which, other.which]), np.concatenate(values, axis=1))

    def some(self, systems: Any, count: int) -> Any:
        """All `count` of some systems, (s, count, p)."""
        result = np.zeros((len(self.value), count, len(systems)), dtype=self.value.dtype)
        result[:, self.which] = self.value[..., systems] if self.value.shape[-1] > 1 else self.value
        return result

    def less(self, child: Columns, upward: Any) -> Columns:
        """These, less what a child pushes up."""
        if not len(child.which):
            return self
        pushed = multiply(upward, child.value)
        if self.which is child.which or self.which.tolist() == child.which.tolist():
            return Columns(self.which, self.value - pushed)
        if not len(self.which):
            return Columns(child.which, -pushed)
        which = np.union1d(self.which, child.which)
        value = np.zeros((len(upward), len(which), pushed.shape[-1]), dtype=np.result_type(self.value, pushed))
        value[:, np.searchsorted(which, self.which)] = self.value
        value[:, np.searchsorted(which, child.which)] -= pushed
        return Columns(which, value)
