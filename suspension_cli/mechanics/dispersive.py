"""Blocks of a model whose stiffness depends on frequency, ready to be solved at any frequency.

The same elimination body by body as for constant matrices (`mechanics.elimination`).  Tips of blades without mass stay in, as their wires' and
their own loss depend on frequency, and the tensions of wires are coordinates too, so that a stiff wire takes no digits from a soft blade
(`mechanics.stretching`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array, Index
from suspension_cli.mechanics import elimination
from suspension_cli.mechanics.dispersion import Evaluated, EvaluatedWires, Term, WireTerm
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.stretching import distinct
from suspension_cli.mechanics.twofold import Twofold


@dataclass(frozen=True)
class Tensions:
    """Tensions of the wires of one kind as coordinates p: a wire whose ends are moved evenly by U_s and oddly by U_a is pulled by

        F_aa (U_a + F_sa / F_aa U_s) = s p.

    Attributes
    ----------
    number : int
        Which of the block's terms these wires are.
    odd, even : (r, 6 + c) arrays
        s times U_a and U_s of every wire, with the support's coordinates and the block's own; wires that move alike in the block are one.
    count : (r,) array
        How many they are.
    scale : float
        s, N/m: of the size of what is soft.
    """

    number: int
    odd: Any
    even: Any
    count: Any
    scale: float

    def rows(self, now: EvaluatedWires) -> tuple[Any, Any]:
        """The equations of the tensions at some frequencies: (r, 6 + c, f) towards the other coordinates, (r, f) towards themselves."""
        _, mixed, odd = now.stretching
        across = self.odd[..., None] + self.even[..., None] * (mixed / odd) if mixed.any() else self.odd[..., None]
        return across, -(self.scale**2) / (self.count[:, None] * odd)


@dataclass(frozen=True)
class DispersiveBlock:
    """One block of a model.

    Attributes
    ----------
    keep : (c,) int array
        Coordinates of the model, parents before children.
    constant, damping, mass : (c, 6 + c) arrays
        Towards the support's coordinates and the block's own: K without the stretching of wires (complex if lossy), C, M.
    terms : tuple of Term
        For the support's coordinates and the block's own.
    tensions : tuple of Tensions
        Further coordinates, after all others: t in all.
    tree : Tree
        The coordinates by body.
    """

    keep: Index
    constant: Any
    damping: Any
    mass: Any
    terms: tuple[Term, ...]
    tensions: tuple[Tensions, ...]
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
        matrices += [part for each in self.tensions for part in (each.odd, each.even)]
        return any((np.abs(matrix[:, :6]) @ np.abs(moves)).any() for matrix in matrices)

    def whole(self, omega: Array, now: list[Evaluated], *, lossy: bool) -> Any:
        """K + i omega C - omega^2 M and all terms, then the tensions of wires: (c + t, 6 + c + t, f)."""
        own = self._without_tensions(omega, now, lossy=lossy)
        parts: list[tuple[Any, Any]] = []
        for each in self.tensions:
            evaluated = now[each.number]
            assert isinstance(evaluated, EvaluatedWires)
            parts.append(each.rows(evaluated))
        count, more = len(own), sum(len(diagonal) for _, diagonal in parts)
        result = np.zeros((count + more, 6 + count + more, len(omega)), dtype=np.result_type(own, *(diagonal for _, diagonal in parts)))
        result[:count, : 6 + count] = own
        place = count
        for across, diagonal in parts:
            rows = np.arange(place, place + len(diagonal))
            result[rows, : 6 + count] = across
            result[:count, 6 + rows] = np.swapaxes(across[:, 6:], 0, 1)
            result[rows, 6 + rows] = diagonal
            place += len(diagonal)
        return result

    def _without_tensions(self, omega: Array, now: list[Evaluated], *, lossy: bool) -> Any:
        """All but the stretching of wires: (c, 6 + c, f)."""
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
        """Dynamic stiffness (c + t, 6 + c + t, f) towards the support's coordinates, the block's own and the tensions."""
        return self.block.whole(self.omega, self.terms, lossy=self.lossy)

    def solve(self, moves: Any, forces: Any) -> Any:
        """Coordinates (c, i, f) for motions of the support (6, i) and forces on the block's coordinates (c, i)."""
        count = len(forces)
        forces = np.concatenate([forces, np.zeros((len(self.matrix) - count, forces.shape[1]))])
        right = np.broadcast_to(forces[..., None], (*forces.shape, len(self.omega)))
        if moves.any():
            right = right - np.einsum("csf,si->cif", self.matrix[:, :6], moves)
        tree = self.block.tree
        return elimination.solve(self.matrix[:, 6:], right, tree if len(tree.nodes) > 1 else None)[:count]


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
    terms = tuple(term.within(both) for term in model.terms)
    terms = tuple(term for term in terms if isinstance(term, WireTerm) or term.matrices[:, 6:, 6:].any() or term.matrices[:, 6:, :6].any())
    tensions = tuple(found for n, term in enumerate(terms) if isinstance(term, WireTerm) and len((found := _tensions(n, term)).count))
    full = soft(model)
    coupled = np.zeros((len(keep),) * 2, dtype=bool)
    for matrix in (model.mass, full, model.damping):
        coupled |= matrix[np.ix_(keep, keep)] != 0
    for term in terms:
        coupled |= (term.matrices[:, 6:, 6:] != 0).any(0)
    pulled = np.concatenate([np.zeros((0, len(keep)), dtype=bool), *((each.odd[:, 6:] != 0) | (each.even[:, 6:] != 0) for each in tensions)])
    coupled = np.block([[coupled, pulled.T], [pulled, np.eye(len(pulled), dtype=bool)]])
    stages = [terms[each.number].stage for each in tensions for _ in each.count]  # pyright: ignore[reportAttributeAccessIssue]
    tree = elimination.tree([*(owner[n] for n in order), *stages], coupled) or elimination.Tree((np.arange(len(coupled)),), (-1,))
    rows = np.ix_(keep, both)
    return DispersiveBlock(keep, full[rows], model.damping[rows], model.mass[rows], terms, tensions, tree)


def _tensions(number: int, term: WireTerm) -> Tensions:
    forms = np.where(np.append(term.allowed[6:, :6].any(0), np.ones(len(term.allowed) - 6, dtype=bool)), term.forms["stretch"], 0.0)
    rows, members = distinct(np.concatenate([forms[:, 1], forms[:, 0]], axis=1))
    width = forms.shape[-1]
    held = rows[:, 6:width].any(1) | rows[:, width + 6 :].any(1)
    scale = float(term.strand.tension) / sum(section.length for section in term.strand.fibre.sections)
    count = np.array([len(group) for group in members], dtype=float)
    return Tensions(number, scale * rows[held, :width], scale * rows[held, width:], count[held], scale)


def soft(model: LinearModel) -> Any:
    """The stiffness (N, N) of a model without the stretching of wires that are among its terms, complex if lossy."""
    if "soft" not in model.prepared:
        full = model.stiffness if model.lossy is None else model.lossy
        if model.stretched is not None and any(isinstance(term, WireTerm) for term in model.terms):
            low = np.zeros_like(model.stiffness) if model.low is None else model.low.real
            rest = model.stretched.added(Twofold(model.stiffness, low), -model.stretched.stiffness)
            full = rest.value if model.lossy is None else rest.value + 1j * full.imag
        model.prepared["soft"] = full
    return model.prepared["soft"]


def sizes(diagonal: Any, across: Any, first: int | None = None) -> Any:
    """Scales (f, c + t) of coordinates in which a matrix has elements of at most about 1.

    Parameters
    ----------
    diagonal : (f, c + t) array
        A coordinate without stiffness has scale 1.
    across : (f, t, c) array
        Sizes of what joins the tensions to the other coordinates.
    first : int, optional
        How many of these the scales of the tensions are taken from: the others may have next to no stiffness but by them.
    """
    count = across.shape[-1]
    result = np.sqrt(np.abs(diagonal))
    result = np.where(result == 0, 1.0, result)
    if across.shape[1]:
        pull = (across[..., :first] / result[:, None, :count][..., :first]).max(-1, initial=0.0)
        result[:, count:] = np.maximum(np.sqrt(np.abs(diagonal[:, count:])), pull)
        result[:, :count] = np.maximum(result[:, :count], (across / result[:, count:, None]).max(1))
    return result
