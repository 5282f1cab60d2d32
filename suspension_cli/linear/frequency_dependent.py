"""Blocks of a linear system whose stiffness depends on frequency, solvable at any frequency.

They are eliminated body by body, as constant matrices are (`elimination`). Massless blade tips
remain coordinates, as the losses of blades and wires depend on frequency. The tensions of wires are
coordinates too, so that a stiff wire costs a soft blade no digits (`stretching`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import FRAME
from suspension_cli.linear import elimination
from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.linear.frequency_terms import (
    Evaluated,
    EvaluatedWires,
    Term,
    WireTerm,
    multiply_real,
)
from suspension_cli.linear.stretching import distinct
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int


@dataclass(frozen=True)
class Tensions:
    """Tensions of the wires of one kind as coordinates p.

    Even motion U_s and odd motion U_a of the ends of a wire cause the tension

        F_aa (U_a + F_sa / F_aa U_s) = s p.

    Attributes
    ----------
    number
        Index of these wires among the block's terms.
    odd, even
        s times U_a and U_s of each wire per coordinate of support and block; wires that move alike
        are one row.
    count
        Number of wires per row.
    scale
        s, N/m: tension over length, a typical soft stiffness.
    """

    number: int
    odd: Float[np.ndarray, "row coordinate"]
    even: Float[np.ndarray, "row coordinate"]
    count: Float[np.ndarray, " row"]
    scale: float

    def rows(
        self, now: EvaluatedWires
    ) -> tuple[Inexact[np.ndarray, "row coordinate frequency"], Inexact[np.ndarray, "row _"]]:
        """Rows of the tensions at f frequencies: (r, 6 + c, f) off and (r, f) on the diagonal."""
        _, mixed, odd = now.stretching
        across = (
            self.odd[..., None] + self.even[..., None] * (mixed / odd)
            if mixed.any()
            else self.odd[..., None]
        )
        return across, -(self.scale**2) / (self.count[:, None] * odd)


@dataclass(frozen=True)
class FrequencyDependentBlock:
    """One block of a linear system whose stiffness depends on frequency.

    Attributes
    ----------
    keep
        Coordinates of the system, parents before children.
    constant, damping, mass
        K without the stretching of wires (complex if lossy), C and M, towards the support's
        coordinates and the block's own.
    terms
        In these coordinates.
    tensions
        t further coordinates, after all others.
    pattern
        Order of elimination of the coordinates and tensions.
    """

    keep: Int[np.ndarray, " own"]
    constant: Inexact[np.ndarray, "own 6+own"]
    damping: Float[np.ndarray, "own 6+own"]
    mass: Float[np.ndarray, "own 6+own"]
    terms: tuple[Term, ...]
    tensions: tuple[Tensions, ...]
    pattern: elimination.Pattern

    @cached_property
    def towards_support(self) -> Elements:
        """Elements (c + t, 6) towards the support."""
        return self._elements(*np.indices((self.pattern.size, 6)).reshape(2, -1))

    @cached_property
    def whole(self) -> Elements:
        """All elements (c + t, 6 + c + t)."""
        return self._elements(
            *np.indices((self.pattern.size, 6 + self.pattern.size)).reshape(2, -1)
        )

    @cached_property
    def in_order(self) -> Elements:
        """Elements on and above the diagonal in their order of elimination."""
        return self._elements(self.pattern.row, self.pattern.column + 6)

    def _elements(
        self, row: Int[np.ndarray, " element"], column: Int[np.ndarray, " element"]
    ) -> Elements:
        count = len(self.keep)
        place = np.flatnonzero((row < count) & (column < 6 + count))
        at = row[place], column[place]
        weights = [
            part[at][None]
            for part in (np.real(self.constant), np.imag(self.constant), self.damping, -self.mass)
        ]
        used = []
        for term in self.terms:
            matrices = term.matrices[:, 6:]
            used.append(np.flatnonzero(matrices.any((1, 2))))
            weights.append(matrices[used[-1]][:, *at])
        stacked = np.concatenate(weights)
        nonzero = stacked.any(0)
        tensions, start = [], count
        for each in self.tensions:
            own, other = row - start, column - 6 - start
            is_row, is_column = ((n >= 0) & (n < len(each.count)) for n in (own, other))
            diagonal = np.flatnonzero(is_row & (own == other))
            across = np.flatnonzero(is_row & (column < 6 + count))
            number, coordinate = own[across], column[across]
            mirrored = np.flatnonzero(is_column & (row < count))
            across = np.append(across, mirrored)
            number = np.append(number, other[mirrored])
            coordinate = np.append(coordinate, 6 + row[mirrored])
            some = (each.odd != 0)[number, coordinate] | (each.even != 0)[number, coordinate]
            tensions.append((diagonal, own[diagonal], across[some], number[some], coordinate[some]))
            start += len(each.count)
        return Elements(
            self, len(row), place[nonzero], tuple(used), stacked[:, nonzero].T, tuple(tensions)
        )

    def at(self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True) -> EvaluatedBlock:
        """Evaluate at frequencies in rad/s; complex steps differentiate by frequency."""
        return EvaluatedBlock(
            self, omega, [term.at(omega, lossy=lossy) for term in self.terms], lossy
        )

    def pulled(self, moves: Float[np.ndarray, "6 input"]) -> bool:
        """Whether motions of the support drive this block."""
        matrices = [
            self.constant,
            self.damping,
            self.mass,
            *(matrix for term in self.terms for matrix in term.matrices[:, 6:]),
        ]
        matrices += [part for each in self.tensions for part in (each.odd, each.even)]
        return any((np.abs(matrix[:, :6]) @ np.abs(moves)).any() for matrix in matrices)


@dataclass(frozen=True)
class Elements:
    """Elements of the dynamic stiffness of a block, with the tensions of its wires.

    Attributes
    ----------
    place
        Elements that are not 0 without the tensions.
    used
        Functions of each term in these elements.
    weights
        Weights of Re K, Im K, C, M and these functions.
    tensions
        Per kind of wires: places and numbers of tensions on the diagonal; places, numbers and
        coordinates (with the support's) of elements between tensions and coordinates.
    """

    block: FrequencyDependentBlock
    count: int
    place: Int[np.ndarray, " nonzero"]
    used: tuple[Int[np.ndarray, " _"], ...]
    weights: Float[np.ndarray, "nonzero weight"]
    tensions: tuple[tuple[Int[np.ndarray, " _"], ...], ...]

    def at(
        self, omega: Inexact[np.ndarray, " frequency"], now: list[Evaluated], *, lossy: bool
    ) -> Inexact[np.ndarray, "count frequency"]:
        """Evaluate at frequencies in rad/s."""
        stiffness = self._without_tensions(omega, now, lossy=lossy)
        rows = []
        for each in self.block.tensions:
            evaluated = now[each.number]
            assert isinstance(evaluated, EvaluatedWires)
            rows.append(each.rows(evaluated))
        result = np.zeros(
            (self.count, len(omega)),
            dtype=np.result_type(stiffness, *(diagonal for _, diagonal in rows)),
        )
        result[self.place] = stiffness
        for (on, own, places, numbers, coordinates), (across, diagonal) in zip(
            self.tensions, rows, strict=True
        ):
            result[on] = diagonal[own]
            result[places] = across[numbers, coordinates]
        return result

    def _without_tensions(
        self, omega: Inexact[np.ndarray, " frequency"], now: list[Evaluated], *, lossy: bool
    ) -> Inexact[np.ndarray, "nonzero frequency"]:
        present = np.any(self.weights[:, :4], axis=0) & np.array([True, lossy, lossy, True])
        parts = [np.ones(len(omega)), np.full(len(omega), 1j), 1j * omega, omega**2]
        parts = [part for part, here in zip(parts, present, strict=True) if here]
        for term, which in zip(now, self.used, strict=True):
            parts += term.functions(which)
        chosen = np.append(present, np.ones(self.weights.shape[1] - 4, dtype=bool))
        functions = np.array(parts).reshape(-1, len(omega))
        return multiply_real(self.weights[:, chosen], functions)


@dataclass(frozen=True)
class EvaluatedBlock:
    """One block at given frequencies (f,)."""

    block: FrequencyDependentBlock
    omega: Inexact[np.ndarray, " frequency"]
    terms: list[Evaluated]
    lossy: bool

    @cached_property
    def matrix(self) -> Inexact[np.ndarray, "all 6+all frequency"]:
        """Dynamic stiffness; its columns are those of support, block and tensions."""
        return self._evaluate(self.block.whole).reshape(
            self.block.pattern.size, -1, len(self.omega)
        )

    def _evaluate(self, elements: Elements) -> Inexact[np.ndarray, "element frequency"]:
        return elements.at(self.omega, self.terms, lossy=self.lossy)

    def solve(
        self, moves: Float[np.ndarray, "6 input"], forces: Float[np.ndarray, "own input"]
    ) -> Inexact[np.ndarray, "own input frequency"]:
        """Solve for coordinates, given support motions and forces."""
        count, pattern = len(forces), self.block.pattern
        forces = np.concatenate([forces, np.zeros((pattern.size - count, forces.shape[1]))])
        right = np.broadcast_to(forces[..., None], (*forces.shape, len(self.omega)))
        if moves.any():
            towards = self._evaluate(self.block.towards_support).reshape(pattern.size, 6, -1)
            right = right - np.einsum("csf,si->cif", towards, moves)
        return pattern.solve(self._evaluate(self.block.in_order), right)[:count]


def build_blocks(model: LinearSystem) -> list[FrequencyDependentBlock]:
    """Build all blocks of a system with frequency-dependent terms, once."""
    if "dispersive" not in model.prepared:
        model.prepared["dispersive"] = [_block(model, group) for group in model.blocks]
    return model.prepared["dispersive"]


def _block(model: LinearSystem, group: Int[np.ndarray, " own"]) -> FrequencyDependentBlock:
    owner = [model.coordinate[n].split(".", 1)[0] for n in group]
    rank = [-1 if name == FRAME else model.body.index(name) for name in owner]
    order = np.argsort(rank, kind="stable")
    keep = group[order]
    with_support = np.concatenate([np.arange(6), keep])
    terms = tuple(term.within(with_support) for term in model.terms)
    terms = tuple(
        term
        for term in terms
        if isinstance(term, WireTerm)
        or term.matrices[:, 6:, 6:].any()
        or term.matrices[:, 6:, :6].any()
    )
    tensions = tuple(
        found
        for n, term in enumerate(terms)
        if isinstance(term, WireTerm) and len((found := _tension_coordinates(n, term)).count)
    )
    stiffness = stiffness_without_stretching(model)
    coupled = np.zeros((len(keep),) * 2, dtype=bool)
    for matrix in (model.mass, stiffness, model.damping):
        coupled |= matrix[np.ix_(keep, keep)] != 0
    for term in terms:
        coupled |= (term.matrices[:, 6:, 6:] != 0).any(0)
    tension_pattern = np.concatenate(
        [
            np.zeros((0, len(keep)), dtype=bool),
            *((each.odd[:, 6:] != 0) | (each.even[:, 6:] != 0) for each in tensions),
        ]
    )
    coupled = np.block(
        [[coupled, tension_pattern.T], [tension_pattern, np.eye(len(tension_pattern), dtype=bool)]]
    )
    wires: list[Any] = [terms[each.number] for each in tensions for _ in each.count]
    stages = [one.stage for one in wires]
    pattern = elimination.by_body([*(owner[n] for n in order), *stages], coupled)
    rows = np.ix_(keep, with_support)
    return FrequencyDependentBlock(
        keep, stiffness[rows], model.damping[rows], model.mass[rows], terms, tensions, pattern
    )


def _tension_coordinates(number: int, term: WireTerm) -> Tensions:
    forms = np.where(
        np.append(term.allowed[6:, :6].any(0), np.ones(len(term.allowed) - 6, dtype=bool)),
        term.forms["stretch"],
        0.0,
    )
    rows, members = distinct(np.concatenate([forms[:, 1], forms[:, 0]], axis=1))
    width = forms.shape[-1]
    nonzero = rows[:, 6:width].any(1) | rows[:, width + 6 :].any(1)
    scale = float(term.strand.tension) / sum(
        section.length for section in term.strand.fibre.sections
    )
    count = np.array([len(group) for group in members], dtype=float)
    return Tensions(
        number, scale * rows[nonzero, :width], scale * rows[nonzero, width:], count[nonzero], scale
    )


def stiffness_without_stretching(
    model: LinearSystem,
) -> Inexact[np.ndarray, "coordinate coordinate"]:
    """Stiffness without the stretching of the wires among the terms; complex if lossy."""
    if "soft" not in model.prepared:
        full = model.stiffness if model.lossy is None else model.lossy
        if model.stretched is not None and any(isinstance(term, WireTerm) for term in model.terms):
            low = np.zeros_like(model.stiffness) if model.low is None else np.real(model.low)
            remainder = model.stretched.added(
                DoubleDouble(model.stiffness, low), -model.stretched.stiffness
            )
            full = remainder.value if model.lossy is None else remainder.value + 1j * np.imag(full)
        model.prepared["soft"] = full
    return model.prepared["soft"]


def coordinate_scales(
    diagonal: Float[np.ndarray, "frequency all"],
    across: Float[np.ndarray, "frequency tension coordinate"],
    first: int | None = None,
) -> Float[np.ndarray, "frequency all"]:
    """Scale the coordinates so that the elements of a matrix are at most about 1.

    Parameters
    ----------
    diagonal
        Of the matrix; a coordinate without stiffness has scale 1.
    across
        Absolute elements between the tensions and the other coordinates.
    first
        Number of coordinates from which the scales of tensions follow; default all. The others may
        have almost no stiffness apart from the tensions.
    """
    count = across.shape[-1]
    result = np.sqrt(np.abs(diagonal))
    result = np.where(result == 0, 1.0, result)
    if across.shape[1]:
        pull = (across[..., :first] / result[:, None, :count][..., :first]).max(-1, initial=0.0)
        result[:, count:] = np.maximum(np.sqrt(np.abs(diagonal[:, count:])), pull)
        result[:, :count] = np.maximum(result[:, :count], (across / result[:, count:, None]).max(1))
    return result
