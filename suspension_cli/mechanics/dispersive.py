"""Blocks of a model whose stiffness depends on frequency, ready to be solved at any frequency.

The same elimination body by body as for constant matrices (`mechanics.elimination`); tips of blades without mass stay in, as their wires' and
their own loss depend on frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array, Index
from suspension_cli.mechanics import elimination
from suspension_cli.mechanics.dispersion import Evaluated, Term
from suspension_cli.mechanics.model import LinearModel


@dataclass(frozen=True)
class DispersiveBlock:
    """One block of a model.

    Attributes
    ----------
    keep : (c,) int array
        Coordinates of the model, parents before children.
    constant, damping, mass : (c, 6 + c) arrays
        Towards the support's coordinates and the block's own: K (complex if lossy), C, M.
    terms : tuple of Term
        For the support's coordinates and the block's own.
    tree : Tree
        The coordinates by body.
    """

    keep: Index
    constant: Any
    damping: Any
    mass: Any
    terms: tuple[Term, ...]
    tree: elimination.Tree

    @cached_property
    def _dispersive(self) -> tuple[Any, Any, list[Any], Any]:
        """Rows and columns of the elements that depend on frequency, which functions each term gives them, and how much of each."""
        every = [term.matrices[:, 6:] for term in self.terms]
        used = [np.flatnonzero(matrices.any((1, 2))) for matrices in every]
        stacked = np.concatenate([np.zeros((0, *self.mass.shape)), *(matrices[which] for matrices, which in zip(every, used, strict=True))])
        rows, columns = np.nonzero(stacked.any(0))
        return rows, columns, used, stacked[:, rows, columns].T

    def at(self, omega: Array, *, lossy: bool = True) -> EvaluatedBlock:
        """The block at frequencies (f,), rad/s; complex to differentiate by them."""
        return EvaluatedBlock(self, omega, [term.at(omega, lossy=lossy) for term in self.terms], lossy)

    def pulled(self, moves: Any) -> bool:
        """Whether motions of the support (6, i) drive this block."""
        matrices = [self.constant, self.damping, self.mass, *(matrix for term in self.terms for matrix in term.matrices[:, 6:])]
        return any((np.abs(matrix[:, :6]) @ np.abs(moves)).any() for matrix in matrices)

    def whole(self, omega: Array, now: list[Evaluated], *, lossy: bool) -> Any:
        """K + i omega C - omega^2 M and all terms: (c, 6 + c, f)."""
        rows, columns, used, weights = self._dispersive
        functions = [term.functions(which) for term, which in zip(now, used, strict=True) if len(which)]
        constant = self.constant if lossy else self.constant.real
        damped = lossy and self.damping.any()
        kind = np.result_type(constant, omega, complex if damped else float, *functions)
        result = np.empty((*constant.shape, len(omega)), dtype=kind)
        result[:] = constant[..., None]
        for r, c in np.argwhere(self.mass):
            result[r, c] -= self.mass[r, c] * omega**2
        if damped:
            for r, c in np.argwhere(self.damping):
                result[r, c] += 1j * self.damping[r, c] * omega
        if functions:
            result[rows, columns] += _product(weights, np.concatenate(functions))
        return result


@dataclass(frozen=True)
class EvaluatedBlock:
    """A block at given frequencies."""

    block: DispersiveBlock
    omega: Array
    terms: list[Evaluated]
    lossy: bool

    @cached_property
    def matrix(self) -> Any:
        """Dynamic stiffness (c, 6 + c, f) towards the support's coordinates and the block's own."""
        return self.block.whole(self.omega, self.terms, lossy=self.lossy)

    def solve(self, moves: Any, forces: Any) -> Any:
        """Coordinates (c, i, f) for motions of the support (6, i) and forces on the block's coordinates (c, i)."""
        right = np.broadcast_to(forces[..., None], (*forces.shape, len(self.omega)))
        if moves.any():
            right = right - np.einsum("csf,si->cif", self.matrix[:, :6], moves)
        tree = self.block.tree
        return elimination.solve(self.matrix[:, 6:], right, tree if len(tree.nodes) > 1 else None)


def _product(weights: Any, functions: Any) -> Any:
    """weights @ functions, real times real where functions are complex too."""
    if not np.iscomplexobj(functions):
        return weights @ functions
    flat = np.ascontiguousarray(functions).view(float)
    return (weights @ flat).view(complex)


def blocks(model: LinearModel) -> list[DispersiveBlock]:
    """All blocks of a model with terms."""
    if "dispersive" not in model.prepared:
        model.prepared["dispersive"] = [_block(model, group) for group in model.blocks]
    return model.prepared["dispersive"]


def _block(model: LinearModel, group: Index) -> DispersiveBlock:
    owner = [model.coordinate[n].split(".", 1)[0] for n in group]
    rank = [-1 if name == "frame" else model.body.index(name) for name in owner]
    order = np.argsort(rank, kind="stable")
    keep = group[order]
    both = np.concatenate([np.arange(6), keep])
    full = model.stiffness if model.lossy is None else model.lossy
    terms = tuple(term.within(both) for term in model.terms)
    terms = tuple(term for term in terms if term.matrices[:, 6:, 6:].any() or term.matrices[:, 6:, :6].any())
    coupled = np.zeros((len(keep),) * 2, dtype=bool)
    for matrix in (model.mass, full, model.damping):
        coupled |= matrix[np.ix_(keep, keep)] != 0
    for term in terms:
        coupled |= (term.matrices[:, 6:, 6:] != 0).any(0)
    tree = elimination.tree([owner[n] for n in order], coupled) or elimination.Tree((np.arange(len(keep)),), (-1,))
    rows = np.ix_(keep, both)
    return DispersiveBlock(keep, full[rows], model.damping[rows], model.mass[rows], terms, tree)
