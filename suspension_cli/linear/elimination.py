"""Body-by-body elimination of many small symmetric systems at once.

In a chain or tree each body couples only to the one that it hangs from. Elimination from the leaves
up needs small blocks alone, for all P systems at once with the system axis last:

    S_i = D_i - sum over children c of B_c S_c^-1 B_c^T,    r_i = b_i - sum of B_c S_c^-1 r_c,
    x_root = S^-1 r,    x_i = S_i^-1 r_i - S_i^-1 B_i^T x_parent,

with B_c the block between parent (rows) and child. The transmission from support to mirror is
thereby a product of the transmissions of the stages: nothing cancels, so it keeps its relative
accuracy however small it is (block LU of a graded matrix; Higham, Accuracy and Stability of
Numerical Algorithms, 2nd ed., chapter 13). Where a part resonates alone its S_c is nearly singular,
and subtracting a large B_c S_c^-1 B_c^T loses the digits of D_i: those systems are solved densely
with pivoting, or refined (`block_response`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.linear.small_matrices import dense, inverse, multiply

GROWTH = 30.0
"""Largest diagonal ratio of B_c S_c^-1 B_c^T to D_i; systems above it are solved with pivoting.

Elements of one unit are compared, so the ratio does not depend on units (a norm over metres and
radians would). Block elimination may lose this many rounding errors of the dense solve.
"""


@dataclass(frozen=True)
class Tree:
    """Coordinates of a block grouped by body, parents before children.

    Attributes
    ----------
    nodes : tuple of (s,) int arrays
        Positions of each node's coordinates in the block.
    parent : tuple of int
        Number of the node above, -1 for a root.
    """

    nodes: tuple[Any, ...]
    parent: tuple[int, ...]

    @cached_property
    def where(self) -> tuple[Any, ...]:
        """Positions of each node's coordinates, as slices where they are consecutive."""
        return tuple(
            slice(node[0], node[-1] + 1) if node[-1] - node[0] + 1 == len(node) else node
            for node in self.nodes
        )

    @cached_property
    def places(self) -> Any:
        """Position of each coordinate in the order of the nodes."""
        return np.argsort(np.concatenate(self.nodes))


def tree(owner: list[str], coupled: Any) -> Tree | None:
    """Group coordinates by body and find the tree that they form; None if they form no tree.

    Parameters
    ----------
    owner : list of str
        The body that each coordinate belongs to, parents first.
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
        None: solve densely.

    Returns
    -------
    (c, k, P) array
    """
    if structure is None:
        return dense(matrix, rhs)
    diagonal = [matrix[np.ix_(node, node)] for node in structure.nodes]
    links = [
        None if up < 0 else matrix[np.ix_(structure.nodes[up], node)]
        for node, up in zip(structure.nodes, structure.parent, strict=True)
    ]
    return factor(diagonal, links, structure, GROWTH).solve([rhs[node] for node in structure.nodes])


@dataclass(frozen=True)
class Factors:
    """Eliminated systems, solvable for any right-hand sides.

    Attributes
    ----------
    structure : Tree
    own : tuple of (s, s, P) arrays
        S of each node; its inverse if the node has no more than two coordinates (that of a larger
        matrix loses digits).
    transmission : tuple of (s, s above, P) arrays or None
        S^-1 B^T.
    count : int
        P.
    pivoted : (b,) int array
        Systems that are solved with pivoting instead.
    matrices : (c, c, b) array
        Matrices of these.
    """

    structure: Tree
    own: tuple[Any, ...]
    transmission: tuple[Any, ...]
    count: int
    pivoted: Any
    matrices: Any

    def solve(self, rhs: list[Any]) -> Any:
        """Solve for the right-hand sides (s, k, P) or (s, k, 1) of each node: (c, k, P)."""
        return self.solve_columns([Columns.of(b) for b in rhs], rhs[0].shape[1])

    def solve_columns(self, rhs: list[Columns], count: int) -> Any:
        """Solve for `count` right-hand sides, given those that are not 0: (c, count, P)."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            result = self._substitute(rhs, count)
        if len(self.pivoted):
            sides = [b.expand(self.pivoted, count) for b in rhs]
            result[..., self.pivoted] = dense(
                self.matrices, np.concatenate(sides)[self.structure.places]
            )
        return result

    def _substitute(self, rhs: list[Columns], count: int) -> Any:
        parent, where = self.structure.parent, self.structure.where
        right, own = list(rhs), [part.value for part in rhs]
        for n in range(len(rhs) - 1, -1, -1):
            own[n] = _solve_node(self.own[n], right[n].value)
            if parent[n] >= 0:
                right[parent[n]] = right[parent[n]].subtract(
                    right[n], np.swapaxes(self.transmission[n], 0, 1)
                )
        dtype = np.result_type(
            *self.own,
            *(part.value for part in rhs),
            *(part for part in self.transmission if part is not None),
        )
        result = np.zeros((len(self.structure.places), count, self.count), dtype=dtype)
        for n, here in enumerate(where):
            if parent[n] >= 0:
                result[here] = np.negative(
                    transmitted := multiply(self.transmission[n], result[where[parent[n]]]),
                    out=transmitted,
                )
            if right[n].as_slice is not None:
                result[here, right[n].as_slice] += own[n]
                continue
            for position, column in enumerate(right[n].number):
                result[here, column] += own[n][:, position]
        return result


def factor(
    diagonal: list[Any],
    links: list[Any],
    structure: Tree,
    limit: float = np.inf,
) -> Factors:
    """Eliminate systems body by body.

    Parameters
    ----------
    diagonal : list of (s, s, P) arrays
        Matrix of each node.
    links : list of (s above, s, P) arrays or None
        Between each node's parent (rows) and the node; (s above, s, 1) where constant.
    structure : Tree
    limit : float
        Largest ratio of what is subtracted from a diagonal element to that element, see `GROWTH`;
        systems above it are solved with pivoting. Without a limit, singular parts give infinite or
        NaN solutions.
    """
    count = diagonal[0].shape[-1]
    complement, transmission = list(diagonal), list(links)
    growth = np.zeros(count)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for n in range(len(diagonal) - 1, -1, -1):
            above, across = structure.parent[n], links[n]
            complement[n] = inverse(complement[n]) if len(complement[n]) <= 2 else complement[n]
            if across is None:
                continue
            transmission[n] = _solve_node(complement[n], np.swapaxes(across, 0, 1))
            complement[above], terms = _subtract(
                complement[above], np.swapaxes(transmission[n], 0, 1), across
            )
            for row, taken in enumerate(terms if limit < np.inf else []):
                sizes = [np.abs(term) for term in taken]
                np.maximum(
                    growth, sum(sizes[1:], sizes[0]) / np.abs(diagonal[above][row, row]), out=growth
                )
    pivoted = np.flatnonzero(~(growth < limit))
    return Factors(
        structure,
        tuple(complement),
        tuple(transmission),
        count,
        pivoted,
        assemble([part[..., pivoted] for part in diagonal], _select(links, pivoted), structure)
        if len(pivoted)
        else np.zeros((0, 0, 0)),
    )


def _select(parts: list[Any], systems: Any) -> list[Any]:
    """Select systems; constant matrices (last axis 1) stay as they are."""
    return [part if part is None or part.shape[-1] == 1 else part[..., systems] for part in parts]


def assemble(diagonal: list[Any], links: list[Any], structure: Tree) -> Any:
    """Assemble matrices (c, c, P) from the parts that `factor` takes."""
    size = sum(len(part) for part in diagonal)
    result = np.zeros(
        (size, size, diagonal[0].shape[-1]),
        dtype=np.result_type(*diagonal, *(link for link in links if link is not None)),
    )
    for node, up, own, across in zip(
        structure.nodes, structure.parent, diagonal, links, strict=True
    ):
        result[np.ix_(node, node)] = own
        if up >= 0:
            result[np.ix_(structure.nodes[up], node)] = across
            result[np.ix_(node, structure.nodes[up])] = np.swapaxes(across, 0, 1)
    return result


def _solve_node(own: Any, right: Any) -> Any:
    """Solve S x = r for one node, S as in `Factors`."""
    if len(own) <= 2:
        return multiply(own, right) if right.shape[1] else right
    return dense(own, np.broadcast_to(right, (*right.shape[:2], own.shape[-1])))


def _subtract(matrix: Any, upward: Any, across: Any) -> tuple[Any, list[Any]]:
    """Subtract U B^T from a symmetric D; also return the terms subtracted from each diagonal."""
    result, diagonal_terms = (
        np.empty((*matrix.shape[:2], upward.shape[-1]), dtype=np.result_type(matrix, upward)),
        [],
    )
    for row in range(len(matrix)):
        for column in range(row, len(matrix)):
            terms = [upward[row, q] * across[column, q] for q in range(across.shape[1])]
            total = terms[0] if len(terms) == 1 else sum(terms[1:], terms[0])
            np.subtract(matrix[row, column], total, out=result[row, column])
            if column != row:
                result[column, row] = result[row, column]
            else:
                diagonal_terms.append(terms)
    return result, diagonal_terms


@dataclass(frozen=True)
class Columns:
    """Right-hand sides of one node that are not 0.

    Attributes
    ----------
    number : (k,) int array
        Column of each in all right-hand sides.
    value : (s, k, P) or (s, k, 1) array
    """

    number: Any
    value: Any

    @staticmethod
    def of(rhs: Any) -> Columns:
        """Select the right-hand sides of (s, k, P) that are not 0."""
        return Columns(np.arange(rhs.shape[1]), rhs).drop_zeros()

    @property
    def as_slice(self) -> slice | None:
        """The numbers as a slice, None if they are not consecutive."""
        if not len(self.number):
            return slice(0, 0)
        first, count = int(self.number[0]), len(self.number)
        return (
            slice(first, first + count)
            if self.number.tolist() == list(range(first, first + count))
            else None
        )

    def drop_zeros(self) -> Columns:
        """Drop the right-hand sides that are 0."""
        if not len(self.number):
            return self
        number = self.value.any((0, 2)).nonzero()[0]
        return (
            self
            if len(number) == len(self.number)
            else Columns(self.number[number], self.value[:, number])
        )

    def join(self, other: Columns) -> Columns:
        """Join with others, of different numbers."""
        if not len(other.number):
            return self
        count = max(self.value.shape[-1], other.value.shape[-1])
        values = [
            np.broadcast_to(part.value, (*part.value.shape[:2], count)) for part in (self, other)
        ]
        return Columns(np.concatenate([self.number, other.number]), np.concatenate(values, axis=1))

    def expand(self, systems: Any, count: int) -> Any:
        """Expand to all `count` right-hand sides (s, count, p) of some systems."""
        result = np.zeros((len(self.value), count, len(systems)), dtype=self.value.dtype)
        result[:, self.number] = (
            self.value[..., systems] if self.value.shape[-1] > 1 else self.value
        )
        return result

    def subtract(self, child: Columns, upward: Any) -> Columns:
        """Subtract the forces that a child transmits to its parent by `upward` (s above, s, P)."""
        if not len(child.number):
            return self
        pushed = multiply(upward, child.value)
        if self.number is child.number or self.number.tolist() == child.number.tolist():
            return Columns(self.number, self.value - pushed)
        if not len(self.number):
            return Columns(child.number, -pushed)
        number = np.union1d(self.number, child.number)
        value = np.zeros(
            (len(upward), len(number), pushed.shape[-1]), dtype=np.result_type(self.value, pushed)
        )
        value[:, np.searchsorted(number, self.number)] = self.value
        value[:, np.searchsorted(number, child.number)] -= pushed
        return Columns(number, value)
