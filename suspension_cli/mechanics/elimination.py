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

GROWTH = 10.0
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
    if structure is None or len(structure.nodes) < 2:
        return dense(matrix, rhs)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a singular part: not finite, hence doubtful
        result, growth = _by_body(matrix, rhs, structure)
    doubtful = ~(growth < GROWTH) | ~np.isfinite(result).all((0, 1))
    if doubtful.any():
        result[..., doubtful] = dense(matrix[..., doubtful], rhs[..., doubtful])
    return result


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


def _by_body(matrix: Any, rhs: Any, structure: Tree) -> tuple[Any, Any]:
    nodes, parent = structure.nodes, structure.parent
    schur = [matrix[np.ix_(node, node)] for node in nodes]
    right: list[Any] = [rhs[node] if rhs[node].any() else None for node in nodes]
    upward: list[Any] = [None] * len(nodes)
    inverted: list[Any] = [None] * len(nodes)
    growth = np.zeros(matrix.shape[-1])
    for n in range(len(nodes) - 1, -1, -1):
        inverted[n] = inverse(schur[n])
        above = parent[n]
        if above >= 0:
            across = matrix[np.ix_(nodes[above], nodes[n])]
            upward[n] = multiply(across, inverted[n])
            taken, own = np.abs(upward[n] * across).sum(1), np.abs(matrix[nodes[above], nodes[above]])
            growth = np.maximum(growth, (taken / own).max(0))
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
    return _stacked(np.linalg.inv, matrix)
