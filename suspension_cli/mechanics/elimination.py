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

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

GROWTH = 30.0
"""What a child takes from a diagonal element of D_i, against that element, above which a system is solved densely instead.

A ratio of like to like, so it does not depend on units (a norm over metres and radians would).  So many times the rounding
error of the dense solve is what block elimination may lose.
"""


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
    return solve_nodes(diagonal, links, [rhs[node] for node in structure.nodes], structure)


def solve_nodes(diagonal: list[Any], links: list[Any], rhs: list[Any], structure: Tree) -> Any:
    """The same from the pieces of D that are not 0.

    Parameters
    ----------
    diagonal : list of (s, s, P) arrays
        Of each node.
    links : list of (s above, s, P) arrays or None
        Between each node's parent (rows) and the node; the last axis may be 1 where they are constant.
    rhs : list of (s, k, P) arrays
        The last axis may be 1.
    structure : Tree

    Returns
    -------
    (c, k, P) array
    """
    if len(diagonal) == 1:
        return dense(diagonal[0], np.broadcast_to(rhs[0], (*rhs[0].shape[:2], diagonal[0].shape[-1])))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a singular part: not finite, hence doubtful
        result, growth = _by_body(diagonal, links, rhs, structure)
    doubtful = ~(growth < GROWTH) | ~np.isfinite(result[0]).all(0) | ~np.isfinite(result[-1]).all(0)
    if doubtful.any():
        result[..., doubtful] = _densely(diagonal, links, rhs, structure, doubtful)
    return result


def _densely(diagonal: list[Any], links: list[Any], rhs: list[Any], structure: Tree, which: Any) -> Any:
    """Some of the systems, put together and solved densely."""
    size, count = sum(len(part) for part in diagonal), int(which.sum())
    whole = np.zeros((size, size, count), dtype=np.result_type(*diagonal, *(link for link in links if link is not None)))
    right = np.zeros((size, rhs[0].shape[1], count), dtype=np.result_type(*rhs))

    def some(values: Any) -> Any:
        return values[..., which] if values.shape[-1] == len(which) else values

    for node, up, own, link, b in zip(structure.nodes, structure.parent, diagonal, links, rhs, strict=True):
        whole[np.ix_(node, node)] = some(own)
        right[node] = some(b)
        if up >= 0:
            whole[np.ix_(structure.nodes[up], node)] = some(link)
            whole[np.ix_(node, structure.nodes[up])] = np.swapaxes(some(link), 0, 1)
    return dense(whole, right)


def dense(matrix: Any, rhs: Any) -> Any:
    """Solve by LU with partial pivoting, one system at a time (LAPACK); what is singular to the last bit gives no finite number."""
    if len(matrix) <= 2:
        with np.errstate(divide="ignore", invalid="ignore"):
            return multiply(inverse(matrix), rhs)
    return _stacked(np.linalg.solve, matrix, rhs)


def _stacked(function: Callable[..., Any], matrix: Any, *rhs: Any) -> Any:
    """A function of stacks (P, ., .) on arrays (., ., P); NaN for a matrix that is singular to the last bit, where LAPACK gives up on all."""
    stack, right = np.moveaxis(matrix, -1, 0), [np.moveaxis(part, -1, 0) for part in rhs]
    try:
        result = function(stack, *right)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(stack)[0] == 0
        result = function(np.where(singular[:, None, None], np.nan, stack), *right)
    return np.moveaxis(result, 0, -1)


def _by_body(diagonal: list[Any], links: list[Any], rhs: list[Any], structure: Tree) -> tuple[Any, Any]:
    nodes, parent = structure.nodes, structure.parent
    schur = list(diagonal)
    right = [_Columns.of(b) for b in rhs]
    toward: list[Any] = [None] * len(nodes)
    own: list[Any] = [None] * len(nodes)
    growth = np.zeros(diagonal[0].shape[-1])
    for n in range(len(nodes) - 1, -1, -1):
        above, across = parent[n], links[n]
        toward[n], own[n] = _divided(schur[n], across, right[n].value)
        if above < 0:
            continue
        upward = np.swapaxes(toward[n], 0, 1)
        schur[above], taken = _less(schur[above], upward, across)
        for row, part in enumerate(taken):
            np.maximum(growth, part / np.abs(diagonal[above][row, row]), out=growth)
        right[above] = right[above].less(right[n], upward)
    size = sum(len(node) for node in nodes)
    kind = np.result_type(*diagonal, *rhs, *(link for link in links if link is not None))
    result = np.zeros((size, rhs[0].shape[1], len(growth)), dtype=kind)
    for n, node in enumerate(nodes):
        where = slice(node[0], node[-1] + 1) if node[-1] - node[0] + 1 == len(node) else node
        if parent[n] >= 0:
            result[where] = -multiply(toward[n], result[nodes[parent[n]]])
        for place, column in enumerate(right[n].which):
            result[where, column] += own[n][:, place]
    return result, growth


def _divided(matrix: Any, across: Any, right: Any) -> tuple[Any, Any]:
    """S^-1 B^T and S^-1 r of one node: by the inverse of up to two coordinates, by LAPACK of more (an inverse loses digits)."""
    if len(matrix) <= 2:
        inverted = inverse(matrix)
        toward = None if across is None else multiply(inverted, np.swapaxes(across, 0, 1))
        return toward, multiply(inverted, right) if right.shape[1] else right
    count = matrix.shape[-1]
    sides = [np.broadcast_to(side, (*side.shape[:2], count)) for side in ((() if across is None else (np.swapaxes(across, 0, 1),)) + (right,))]
    found = _stacked(np.linalg.solve, matrix, np.concatenate(sides, axis=1))
    width = 0 if across is None else len(across)
    return found[:, :width], found[:, width:]


def _less(matrix: Any, upward: Any, across: Any) -> tuple[Any, list[Any]]:
    """A symmetric D less U B^T, and for each row the sizes of what is taken from its diagonal, summed."""
    result, taken = np.empty((*matrix.shape[:2], upward.shape[-1]), dtype=np.result_type(matrix, upward)), []
    for row in range(len(matrix)):
        for column in range(row, len(matrix)):
            terms = [upward[row, q] * across[column, q] for q in range(across.shape[1])]
            total = terms[0] if len(terms) == 1 else sum(terms[1:], terms[0])
            np.subtract(matrix[row, column], total, out=result[row, column])
            if column != row:
                result[column, row] = result[row, column]
            else:
                sizes = [np.abs(term) for term in terms]
                taken.append(sum(sizes[1:], sizes[0]))
    return result, taken


@dataclass(frozen=True)
class _Columns:
    """Right-hand sides of one node, only those that are not 0: (s, columns, P), and which they are."""

    which: Any
    value: Any

    @staticmethod
    def of(rhs: Any) -> _Columns:
        which = np.flatnonzero(rhs.any((0, 2)))
        return _Columns(which, rhs[:, which])

    def less(self, child: _Columns, upward: Any) -> _Columns:
        """These, less what a child pushes up."""
        if not len(child.which):
            return self
        pushed = multiply(upward, child.value)
        which = np.union1d(self.which, child.which)
        value = np.zeros((len(upward), len(which), pushed.shape[-1]), dtype=np.result_type(self.value, pushed))
        value[:, np.searchsorted(which, self.which)] = self.value
        value[:, np.searchsorted(which, child.which)] -= pushed
        return _Columns(which, value)


def multiply(a: Any, b: Any) -> Any:
    """Matrix products (p, r, P) of (p, q, P) and (q, r, P), system by system."""
    if a.shape[1] > 3:
        return np.einsum("pqf,qrf->prf", a, b)
    result = a[:, 0, None] * b[None, 0]
    for q in range(1, a.shape[1]):
        result += a[:, q, None] * b[None, q]
    return result


def inverse(matrix: Any) -> Any:
    """Inverses (s, s, P) of symmetric matrices, in closed form for s of 1 and 2."""
    if len(matrix) == 1:
        return 1.0 / matrix
    if len(matrix) == 2:
        a, b, d = matrix[0, 0], matrix[0, 1], matrix[1, 1]
        over = 1.0 / (a * d - b * b)
        result = np.empty(matrix.shape, dtype=over.dtype)
        np.multiply(d, over, out=result[0, 0])
        np.multiply(a, over, out=result[1, 1])
        np.multiply(b, -over, out=result[0, 1])
        result[1, 0] = result[0, 1]
        return result
    return _stacked(np.linalg.inv, matrix)
