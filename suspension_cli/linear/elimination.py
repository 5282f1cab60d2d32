"""Body-by-body elimination of many small symmetric systems at once.

In a chain or tree each body couples only to the one that it hangs from. Elimination from the leaves
up needs small blocks alone, for all P systems at once with the system axis last:

    S_i = D_i - sum over children c of B_c S_c^-1 B_c^T,    r_i = b_i - sum of B_c S_c^-1 r_c,
    x_root = S^-1 r,    x_i = S_i^-1 r_i - S_i^-1 B_i^T x_parent,

with B_c the block between parent (rows) and child. The transmission from support to mirror is
thereby a product of the transmissions of the stages: nothing cancels, so it keeps its relative
accuracy however small it is (block LU of a graded matrix; Higham, Accuracy and Stability of
Numerical Algorithms, 2nd ed., chapter 13). Where a part resonates alone its S_c is nearly singular,
and subtracting a large B_c S_c^-1 B_c^T loses the digits of D_i, as small pivots within a node do.
The residual gives a correction, which restores these digits (ibid., chapter 12) or, where it is
large, shows that the system needs pivoting: `solve` here, `block_response` with more digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.linear.small_matrices import dense, inverse, multiply

if TYPE_CHECKING:
    from jaxtyping import Bool, Inexact, Int

LARGE = 1e-8
"""Relative correction of a coordinate above which a system is solved with pivoting; the correction
of a smaller one has half its digits."""


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

    nodes: tuple[Int[np.ndarray, " _"], ...]
    parent: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return sum(len(node) for node in self.nodes)

    @cached_property
    def where(self) -> tuple[slice | Int[np.ndarray, " _"], ...]:
        """Positions of each node's coordinates, as slices where they are consecutive."""
        return tuple(
            slice(node[0], node[-1] + 1) if node[-1] - node[0] + 1 == len(node) else node
            for node in self.nodes
        )


def tree(owner: list[str], coupled: Bool[np.ndarray, "coordinate coordinate"]) -> Tree | None:
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


def solve(
    matrix: Inexact[np.ndarray, "coordinate coordinate system"],
    rhs: Inexact[np.ndarray, "coordinate input system"],
    structure: Tree | None,
) -> Inexact[np.ndarray, "coordinate input system"]:
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
    return solve_by_body(diagonal, links, rhs, structure)


def solve_by_body(
    diagonal: list[Inexact[np.ndarray, "_ _ system"]],
    links: list[Any],
    rhs: Inexact[np.ndarray, "coordinate input system"],
    structure: Tree,
) -> Inexact[np.ndarray, "coordinate input system"]:
    """Solve D x = b (c, k, P) for many symmetric D, given by the parts that `factor` takes."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factors = factor(diagonal, links, structure)
        result = factors.solve(rhs)
        correction = factors.solve(_residual(diagonal, links, structure, rhs, result))
        large = ~(np.abs(correction) <= LARGE * np.abs(result)).all((0, 1))
        result += correction
    if large.any():
        some = [part[..., large] for part in diagonal]
        across = [None if part is None else part[..., large] for part in links]
        result[..., large] = dense(assemble(some, across, structure), rhs[..., large])
    return result


def _residual(
    diagonal: list[Inexact[np.ndarray, "_ _ _"]],
    links: list[Any],
    structure: Tree,
    rhs: Inexact[np.ndarray, "coordinate input system"],
    solution: Inexact[np.ndarray, "coordinate input system"],
) -> Inexact[np.ndarray, "coordinate input system"]:
    """Compute b - D x (c, k, P) in doubles."""
    result = np.array(rhs, dtype=solution.dtype)
    parts = [solution[where] for where in structure.where]
    for n, (where, up) in enumerate(zip(structure.where, structure.parent, strict=True)):
        result[where] -= multiply(diagonal[n], parts[n])
        if up >= 0:
            result[where] -= multiply(np.swapaxes(links[n], 0, 1), parts[up])
            result[structure.where[up]] -= multiply(links[n], parts[n])
    return result


@dataclass(frozen=True)
class Factors:
    """Eliminated systems, solvable for any right-hand sides.

    Attributes
    ----------
    structure : Tree
    own : tuple of (s, s, P) arrays
        S^-1 of each node.
    transmission : tuple of (s, s above, P) arrays or None
        S^-1 B^T.
    """

    structure: Tree
    own: tuple[Inexact[np.ndarray, "_ _ system"], ...]
    transmission: tuple[Any, ...]

    def select(self, which: Bool[np.ndarray, " system"] | Int[np.ndarray, " some"]) -> Factors:
        """Select systems."""
        return Factors(
            self.structure,
            tuple(part[..., which] for part in self.own),
            tuple(None if part is None else part[..., which] for part in self.transmission),
        )

    def solve(
        self, rhs: Inexact[np.ndarray, "coordinate input system"]
    ) -> Inexact[np.ndarray, "coordinate input system"]:
        """Solve for right-hand sides (c, k, P)."""
        return self.solve_columns(
            [Columns(np.arange(rhs.shape[1]), rhs[where]) for where in self.structure.where],
            rhs.shape[1],
        )

    def solve_columns(
        self, rhs: list[Columns], count: int
    ) -> Inexact[np.ndarray, "coordinate count system"]:
        """Solve for `count` right-hand sides, given those that are not 0: (c, count, P)."""
        parent, where = self.structure.parent, self.structure.where
        right, own = list(rhs), [part.value for part in rhs]
        for n in range(len(rhs) - 1, -1, -1):
            own[n] = multiply(self.own[n], right[n].value)
            if parent[n] >= 0:
                right[parent[n]] = right[parent[n]].subtract(
                    right[n], np.swapaxes(self.transmission[n], 0, 1)
                )
        dtype = np.result_type(
            *self.own,
            *(part.value for part in rhs),
            *(part for part in self.transmission if part is not None),
        )
        result = np.zeros((sum(map(len, own)), count, self.own[0].shape[-1]), dtype=dtype)
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
    diagonal: list[Inexact[np.ndarray, "_ _ _"]],
    links: list[Any],
    structure: Tree,
) -> Factors:
    """Eliminate systems body by body; singular parts give infinite or NaN solutions.

    Parameters
    ----------
    diagonal : list of (s, s, P) arrays
        Matrix of each node.
    links : list of (s above, s, P) arrays or None
        Between each node's parent (rows) and the node; (s above, s, 1) where constant.
    structure : Tree
    """
    own, transmission = list(diagonal), list(links)
    for n in range(len(diagonal) - 1, -1, -1):
        above, across = structure.parent[n], links[n]
        own[n] = inverse(own[n])
        if across is not None:
            transmission[n] = multiply(own[n], np.swapaxes(across, 0, 1))
            own[above] = own[above] - multiply(across, transmission[n])
    return Factors(structure, tuple(own), tuple(transmission))


def assemble(
    diagonal: list[Inexact[np.ndarray, "_ _ _"]],
    links: list[Any],
    structure: Tree,
) -> Inexact[np.ndarray, "coordinate coordinate system"]:
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


@dataclass(frozen=True)
class Columns:
    """Right-hand sides of one node that are not 0.

    Attributes
    ----------
    number : (k,) int array
        Column of each in all right-hand sides.
    value : (s, k, P) or (s, k, 1) array
    """

    number: Int[np.ndarray, " column"]
    value: Inexact[np.ndarray, "own column _"]

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
        number = np.flatnonzero(np.any(self.value, axis=(0, 2)))
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

    def subtract(self, child: Columns, upward: Inexact[np.ndarray, "above own _"]) -> Columns:
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
