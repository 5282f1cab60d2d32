"""Solve many small symmetric systems that differ in one parameter (a frequency, a build), body by body.

In a chain or tree each body couples only to the one that it hangs from.  Eliminating from the leaves up leaves small
blocks, done for all P systems at once with the system axis last:

    S_i = D_i - sum over children c of B_c S_c^-1 B_c^T,    r_i = b_i - sum of B_c S_c^-1 r_c,
    x_root = S^-1 r,    x_i = S_i^-1 r_i - S_i^-1 B_i^T x_parent,

with B_c the block between parent (rows) and child.  Transmission from the support to the mirror is thereby a product
of the stages' own transmissions: nothing cancels, so its digits survive however far it falls (block LU of a graded
matrix; Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 13).  Where an S_i is nearly singular (a
part resonates by itself) block elimination without pivoting could lose digits: those systems are solved densely.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

GROWTH = 1e4
"""Norm of S_i^-1 times that of D_i above which a system is solved densely instead."""


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
    if structure is None or len(structure.nodes) < 2:
        return dense(matrix, rhs)
    result, growth = _by_body(matrix, rhs, structure)
    doubtful = ~(growth < GROWTH)
    if doubtful.any():
        result[..., doubtful] = dense(matrix[..., doubtful], rhs[..., doubtful])
    return result


def dense(matrix: Any, rhs: Any) -> Any:
    """Solve by LU with partial pivoting, one system at a time (LAPACK)."""
    if len(matrix) <= 2:
        return multiply(inverse(matrix), rhs)
    return np.moveaxis(np.linalg.solve(np.moveaxis(matrix, -1, 0), np.moveaxis(rhs, -1, 0)), 0, -1)


def _by_body(matrix: Any, rhs: Any, structure: Tree) -> tuple[Any, Any]:
    nodes, parent = structure.nodes, structure.parent
    schur = [matrix[np.ix_(node, node)] for node in nodes]
    right: list[Any] = [rhs[node] if rhs[node].any() else None for node in nodes]
    upward: list[Any] = [None] * len(nodes)
    inverted: list[Any] = [None] * len(nodes)
    growth = np.zeros(matrix.shape[-1])
    for n in range(len(nodes) - 1, -1, -1):
        inverted[n] = inverse(schur[n])
        growth = np.maximum(growth, _norm(inverted[n]) * _norm(matrix[np.ix_(nodes[n], nodes[n])]))
        above = parent[n]
        if above >= 0:
            across = matrix[np.ix_(nodes[above], nodes[n])]
            upward[n] = multiply(across, inverted[n])
            schur[above] = schur[above] - multiply(upward[n], np.swapaxes(across, 0, 1))
            if right[n] is not None:
                pushed = multiply(upward[n], right[n])
                right[above] = -pushed if right[above] is None else right[above] - pushed
    result = np.zeros(rhs.shape, dtype=np.result_type(matrix, rhs))
    for n, node in enumerate(nodes):
        own = 0.0 if right[n] is None else multiply(inverted[n], right[n])
        if parent[n] >= 0:
            own = own - multiply(np.swapaxes(upward[n], 0, 1), result[nodes[parent[n]]])
        result[node] = own
    return result, growth


def _norm(matrix: Any) -> Any:
    """Largest absolute row sum, (P,)."""
    return np.abs(matrix).sum(1).max(0)


def multiply(a: Any, b: Any) -> Any:
    """Matrix products (p, r, P) of (p, q, P) and (q, r, P), system by system."""
    if a.shape[1] > 3:
        return np.einsum("pqf,qrf->prf", a, b)
    result = a[:, 0, None] * b[None, 0]
    for q in range(1, a.shape[1]):
        result += a[:, q, None] * b[None, q]
    return result


def inverse(matrix: Any) -> Any:
    """Inverses (s, s, P), in closed form for s of 1 and 2."""
    if len(matrix) == 1:
        return 1.0 / matrix
    if len(matrix) == 2:
        (a, b), (c, d) = matrix
        determinant = a * d - b * c
        return np.stack([np.stack([d, -b]), np.stack([-c, a])]) / determinant
    return np.moveaxis(np.linalg.inv(np.moveaxis(matrix, -1, 0)), 0, -1)
