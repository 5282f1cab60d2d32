"""The pencil: equations of small motions at any frequency, in plain doubles.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
>>> [len(block.owner) for block in Pencil(Structure(model)).make_blocks()]  # with tensions
[3, 3, 2, 2]

The tensions t of wires are unknowns beside the coordinates x, so that a stiff wire costs soft parts
no digits (mixed formulation: Zienkiewicz and Taylor, The Finite Element Method, 5th ed., vol. 1,
chapter 11):

    ( Z    E^T ) (x)   (f)
    ( E    -c  ) (t) = (0),    Z = K + i omega C - omega^2 M + sum over n of f_n(omega) A_n,

with the elongations E x of wires, their compliances c = 1 / k(omega), and K without their
stretching.

Each element is a sum of a few functions of frequency with constant weights; only those that are not
0 are evaluated. A *system* is one design at one frequency, or one of many builds at its frequency;
all are solved together, on the last axis. Coordinates that do not couple are blocks, solved apart,
each body by body (`elimination`).

Around and above the lowest undamped mode the coordinates of a block are those of the system. Below
it all bodies move with the support, and what is to be found is their small relative motion: there
each body of a design is counted from the one above it in x, y, z and yaw, x = T q. Nothing resists
when all move together in these, so such elements of T^T Z T are 0; what rounding left of them is
removed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from suspension_cli.conventions import DOFS, FRAME
from suspension_cli.elimination import (
    ROUNDING,
    Elements,
    Equations,
    as_slice,
    multiply_real,
)
from suspension_cli.linear.batch_modes import solve_block
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import EvaluatedTerm, Term
from suspension_cli.linear.wire_term import EvaluatedWires, WireTerm, distinct

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

Piece: TypeAlias = tuple[Any, Any, int, Any]
"""Rows and columns of some elements, the first function that they have weights of, and these."""
Loss = Literal["all", "dampers", "none"]
"""Losses that act; loss angles, which are phase lags, act on oscillations alone."""
ROUNDED = 1e-14
"""Fraction of the largest element of forms below which an element is a rounding error."""
FREQUENCIES = 4096
"""Frequencies at which terms are evaluated at once."""
UNKNOWNS = 1 << 16
"""Unknowns (coordinates and tensions, times inputs, times frequencies) solved at once."""
FAR = 0.5
"""Fraction of the lowest mode below which coordinates are relative: at it they gain nothing yet."""


@dataclass(frozen=True)
class Rows:
    """Elongations of wires; those that move alike are one row.

    Each has the form per coordinate of support and block, the number of wires, the compliance 1/k
    (m/N) of one, and the number of their term among the block's, which has the compliance instead.
    """

    form: Inexact[np.ndarray, "#build row coordinate"]
    count: Float[np.ndarray, " row"]
    compliance: Inexact[np.ndarray, "#build row"]
    term: Int[np.ndarray, " row"]


@dataclass(frozen=True)
class Block:
    """One block of a pencil: coordinates `keep`, parents before children.

    `pull` marks the motions of the support that act on them.
    """

    pencil: Pencil
    keep: Int[np.ndarray, " own"]
    pull: Bool[np.ndarray, " 6"]

    @cached_property
    def terms(self) -> list[tuple[int, Term]]:
        """Terms that act on these coordinates, with their numbers in the system."""
        return [
            (n, term)
            for n, term in enumerate(self.pencil.model.terms)
            if self._weights_here(n).any()
            or (isinstance(term, WireTerm) and self._contains[term.columns].any())
        ]

    @cached_property
    def used(self) -> list[Int[np.ndarray, " _"]]:
        """Functions f_n of each term that are needed."""
        return [np.flatnonzero(self._weights_here(n).any((1, 2))) for n, _ in self.terms]

    def _weights_here(self, number: int) -> Float[np.ndarray, "function own column"]:
        """A_n of a term of the system, with its columns that are among these coordinates."""
        here = self._contains[self.pencil.model.terms[number].columns]
        return self.pencil.structure.weights[number][:, here]

    @cached_property
    def _contains(self) -> Bool[np.ndarray, " every"]:
        """Whether each coordinate of the system is one of these."""
        result = np.zeros(self.pencil.model.size, dtype=bool)
        result[self.keep] = True
        return result

    @cached_property
    def within(self) -> list[Any]:
        """See `Term.within`, of each term."""
        return [term.within(self.keep) for _, term in self.terms]

    @cached_property
    def loss(self) -> Float[np.ndarray, "own own"]:
        """Im K with the stretching of wires whose stiffness is constant."""
        return self.pencil.model.loss[np.ix_(self.keep, self.keep)]

    @cached_property
    def damping(self) -> Float[np.ndarray, "own own"]:
        """C."""
        return self.pencil.model.damping[np.ix_(self.keep, self.keep)]

    @cached_property
    def _columns(self) -> Int[np.ndarray, " coordinate"]:
        """Coordinates of the support and of the block."""
        return np.concatenate([np.arange(6), self.keep])

    @cached_property
    def _number(self) -> Int[np.ndarray, " coordinate"]:
        """Column of each coordinate of the system; -1 for those with nothing but rounding."""
        result = np.full(self.pencil.model.size, -1)
        result[self._columns] = np.arange(len(self._columns))
        result[:6][~self.pull] = -1
        return result

    @cached_property
    def rows(self) -> Rows:
        """Elongations of the wires that move with these coordinates."""
        model = self.pencil.model
        of_terms = any(isinstance(term, WireTerm) for term in model.terms)
        every, kinds = self._rows_of_terms() if of_terms else self._rows_of_constants()
        form = every.form[..., self._columns] * (self._number[self._columns] >= 0)
        if self.pencil.many and model.allowed[6:, 6:].all():
            # builds without a common symmetry may differ from one by as little as rounding
            members = [[n] for n in range(form.shape[1])]
        else:
            members = _find_equal_rows(form, kinds)
        members = [group for group in members if form[:, group[0], 6:].any()]
        first = [group[0] for group in members]
        count = np.array([float(len(group)) for group in members])
        return Rows(form[:, first], count, every.compliance[:, first], every.term[first])

    def _rows_of_terms(self) -> tuple[Rows, list[Int[np.ndarray, " _"]]]:
        """One row per wire whose compliance is that of a term; also the rows of each term."""
        wires = [(n, term) for n, (_, term) in enumerate(self.terms) if isinstance(term, WireTerm)]
        forms = [2 * term.forms["stretch"][:, 1] for _, term in wires]
        form = np.concatenate([np.zeros((0, self.pencil.model.size)), *forms])
        number = np.repeat([n for n, _ in wires], [len(rows) for rows in forms]).astype(int)
        rows = Rows(form[None], np.ones(len(form)), np.zeros((1, len(form))), number)
        return rows, [np.flatnonzero(number == n) for n, _ in wires]

    def _rows_of_constants(self) -> tuple[Rows, list[Int[np.ndarray, " _"]]]:
        """One row per wire of constant stiffness; also the rows of each stiffness."""
        form = as_builds(self.pencil.model.elongation)
        compliance = 1 / as_builds(self.pencil.model.k, 1)
        count = form.shape[1]
        rows = Rows(form, np.ones(count), compliance, np.full(count, -1))
        stiffness = [own.tobytes() for own in compliance.T]
        kinds = [
            np.flatnonzero([own == kind for own in stiffness]) for kind in dict.fromkeys(stiffness)
        ]
        return rows, kinds

    @cached_property
    def owner(self) -> list[int]:
        """Number of the body of each coordinate and tension, which is the lower one's."""
        own = self.pencil.owner[self.keep]
        lowest = ((self.rows.form[..., 6:] != 0).any(0) * own).max(1, initial=0)
        return [*own.tolist(), *lowest.tolist()]

    @cached_property
    def pieces(self) -> list[Piece]:
        """Pieces of `elements`."""
        if self.pencil.many:  # without terms in frequency
            return [self._piece_of_builds(), *self._pieces_of_tensions()]
        constant = len(self.pencil.matrices)
        return [
            *self._pieces_of_matrices(),
            *self._pieces_of_tensions(),
            *self._pieces_of_terms(constant),
        ]

    def _piece_of_builds(self) -> Piece:
        """Elements of the dynamic stiffness of many builds without the stretching of wires."""
        pencil = self.pencil
        assert pencil.omega is not None
        columns = self._columns[self._number[self._columns] >= 0]
        i, j = np.nonzero(pencil.coupled[np.ix_(self.keep, columns)])
        model = pencil.model
        soft, damping, mass = (
            np.moveaxis(as_builds(matrix), 0, -1)[self.keep[i], columns[j]]
            for matrix in (model.soft, model.damping, model.mass)
        )
        values = soft - pencil.omega**2 * mass
        if damping.any():
            values = values + 1j * pencil.omega * damping
        return i, self._number[columns[j]], 0, values

    def _pieces_of_matrices(self) -> Iterator[Piece]:
        """Elements of the matrices of the system."""
        columns = self._columns[self._number[self._columns] >= 0]
        both = zip(self.pencil.matrices, self.pencil.used, strict=True)
        for function, (matrix, used) in enumerate(both):
            i, j = np.nonzero(used[np.ix_(self.keep, columns)])
            values = np.moveaxis(matrix, 0, -1)[self.keep[i], columns[j]]
            yield i, self._number[columns[j]], function, values

    @property
    def _tension(self) -> Int[np.ndarray, " row"]:
        """Number of the tension of each row among the unknowns."""
        return len(self.keep) + np.arange(len(self.rows.count))

    def _pieces_of_tensions(self) -> Iterator[Piece]:
        """Elongations, and the compliances that are constant."""
        rows = self.rows
        tension = self._tension
        i, j = np.nonzero((rows.form != 0).any(0))
        form = np.moveaxis(rows.form, 0, -1)[i, j]
        own = j >= 6
        yield tension[i], j, 0, form
        yield j[own] - 6, 6 + tension[i[own]], 0, form[own]
        constant = np.flatnonzero(rows.term < 0)
        place = tension[constant]
        compliance = -(rows.compliance / rows.count)[:, constant].T
        if np.iscomplexobj(compliance) and not self.pencil.many:
            yield place, 6 + place, 1, np.imag(compliance)
            compliance = np.real(compliance)
        yield place, 6 + place, 0, compliance

    def _pieces_of_terms(self, first: int) -> Iterator[Piece]:
        """Matrices of the terms, and the compliances of wires, from the function `first` on."""
        rows = self.rows
        for n, ((number, term), used) in enumerate(zip(self.terms, self.used, strict=True)):
            place = self._number[term.columns]
            here = (place >= 6)[:, None] & (place >= 0)
            weights = self.pencil.structure.weights[number][used] * here
            i, j = np.nonzero(weights.any(0))
            yield place[i] - 6, place[j], first, weights[:, i, j].T
            first += len(used)
            if isinstance(term, WireTerm):
                own = np.flatnonzero(rows.term == n)
                tension = self._tension[own]
                yield tension, 6 + tension, first, (1 / rows.count[own])[:, None]
                first += 1

    @cached_property
    def elements(self) -> Elements:
        """Weights of 1, of i, of i omega, of -omega^2; then of the functions of each term.

        The last of a term of wires is -1/k. Those of many builds are evaluated already.
        """
        pieces = self.pieces
        omega = self.pencil.omega
        if omega is not None:
            pieces = [
                (row, column, first, np.broadcast_to(values, (len(values), len(omega))))
                for row, column, first, values in pieces
            ]
        functions = max(first + values.shape[1] for _, _, first, values in pieces)
        return Elements.of(pieces, functions)

    @cached_property
    def absolute(self) -> Equations:
        """Equations in the coordinates of the system."""
        return Equations(self.elements, self.owner)

    @cached_property
    def relative(self) -> Equations:
        """Equations in coordinates relative to the body above."""
        model = self.pencil.model
        columns = self._columns
        count = len(columns)
        tensions = len(self.owner) - len(self.keep)
        joint = self.pencil.joint(columns)
        joint[6:, :6] *= self.pull
        whole = np.eye(count + tensions)
        whole[:count, :count] = joint
        place = np.append(self.pencil.structure.place[columns], model.size + np.arange(tensions))
        # forces that are not balanced turn with the bodies, which looks like a stiffness of yaw
        yaw = np.zeros(count + tensions, dtype=bool)
        yaw[:count] = (columns % 6 == 5) & (columns < 6 * (len(model.body) + 1))
        unbalanced = self.pencil.unbalanced * (yaw[6:, None] | yaw)
        return Equations(self.elements.transformed(whole, place, unbalanced), self.owner, joint)

    @cached_property
    def lowest(self) -> float:
        """Lowest undamped mode, rad/s; 0 if none, rigid or unstable, or if rigidity is unknown."""
        if self.pencil.model.rigid is None or self.pencil.many:
            return 0.0
        squared = solve_block(self.pencil.model, self.keep)[0]
        return float(np.sqrt(squared[:1].max(initial=0.0)))

    def matrix(
        self, functions: Inexact[np.ndarray, "function frequency"]
    ) -> Inexact[np.ndarray, "unknown all frequency"]:
        """All elements of one design from the functions of `elements`."""
        values = self.elements.at(functions)
        size = len(self.owner)
        result = np.zeros((size, 6 + size, values.shape[1]), dtype=values.dtype)
        result[self.elements.row, self.elements.column] = values
        return result

    def is_driven(
        self,
        moves: Float[np.ndarray, "6 input"],
        forces: Float[np.ndarray, "coordinate input"],
    ) -> Bool[np.ndarray, " input"]:
        """Whether each input, a motion of the support or a force, drives this block."""
        driven = (moves[self.pull] != 0).any(0) | (forces[self.keep] != 0).any(0)
        return np.asarray(driven if driven.ndim == 1 else driven.any(1))

    def at(self, there: AtFrequencies) -> EvaluatedBlock:
        """Evaluate at frequencies."""
        return EvaluatedBlock(self, there)


@dataclass(frozen=True)
class EvaluatedBlock:
    """One block of systems at given frequencies."""

    block: Block
    there: AtFrequencies

    @property
    def omega(self) -> Inexact[np.ndarray, " system"]:
        """Angular frequencies, rad/s."""
        return self.there.omega

    @property
    def terms(self) -> list[EvaluatedTerm]:
        """The terms of the block."""
        return [self.there.terms[n] for n, _ in self.block.terms]

    @cached_property
    def functions(self) -> Inexact[np.ndarray, "function system"]:
        """Functions of frequency of `Block.elements`; none of many builds."""
        if self.block.pencil.many:
            return np.zeros((0, len(self.omega)))
        one = np.ones(len(self.omega))
        used = np.any(self.block.elements.weights, axis=0)
        result = [
            one,
            1j * one if self.there.lossy and used[1] else 0 * one,
            1j * self.omega if self.there.damped and used[2] else 0 * one,
            -(self.omega**2),
        ]
        for term, own in zip(self.terms, self.block.used, strict=True):
            result += term.functions(own)
            if isinstance(term, EvaluatedWires):
                result.append(-term.compliance)
        return np.array(np.broadcast_arrays(*result))

    @property
    def matrix(self) -> Inexact[np.ndarray, "unknown all frequency"]:
        """All elements of one design; the columns are those of support, block and tensions."""
        return self.block.matrix(self.functions)

    def dissipated(
        self, motion: Inexact[np.ndarray, "own frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, " frequency"]]:
        """Dissipation x^H Im(f A) x in the terms, by cause and temperature (K)."""
        result: dict[tuple[str, float], Any] = {}
        for term, within in zip(self.terms, self.block.within, strict=True):
            for key, lost in term.dissipated(within, motion).items():
                result[key] = result.get(key, 0.0) + lost
        return result

    def respond(
        self,
        outputs: Float[np.ndarray, "output own *#system"],
        moves: Float[np.ndarray, "6 input *#system"],
        forces: Float[np.ndarray, "own input *#system"],
        direct: Float[np.ndarray, "output input *#system"] | float = 0.0,
    ) -> Inexact[np.ndarray, "output input system"]:
        """Solve for linear forms of the coordinates, given support motions and forces.

        `direct` is added: the response of the outputs to the support's own motion.
        """
        outputs, moves, forces, offset = (
            part if part.ndim == 3 else part[..., None]
            for part in (outputs, moves, forces, np.asarray(direct))
        )
        result = np.empty((len(outputs), moves.shape[1], len(self.omega)), dtype=complex)
        below = self.omega < FAR * self.block.lowest
        for equations, where in (("relative", below), ("absolute", ~below)):
            for some in self._chunks(np.flatnonzero(where), moves.shape[1]):
                chosen: Equations = getattr(self.block, equations)
                functions = self.functions[:, some]
                result[..., some] = _solve(chosen, functions, outputs, moves, forces, offset)
        return result

    def _chunks(
        self, systems: Int[np.ndarray, " system"], inputs: int
    ) -> Iterator[slice | Int[np.ndarray, " _"]]:
        """Divide systems into chunks that stay in the cache; those of many builds are one."""
        step = max(UNKNOWNS // (len(self.block.owner) * max(inputs, 1)), 64)
        if self.block.pencil.many:
            step = max(len(systems), 1)
        for start in range(0, len(systems), step):
            yield as_slice(systems[start : start + step])


def _solve(
    equations: Equations,
    functions: Inexact[np.ndarray, "function system"],
    outputs: Float[np.ndarray, "output own #system"],
    moves: Float[np.ndarray, "6 input #system"],
    forces: Float[np.ndarray, "own input #system"],
    direct: Float[np.ndarray, "output input #system"],
) -> Inexact[np.ndarray, "output input system"]:
    """Solve equations for linear forms of the coordinates, see `EvaluatedBlock.respond`."""
    joint = equations.to_absolute
    if joint is not None:  # of one design: x = T q, with the support among the q
        rows = outputs[..., 0]
        moved = moves[..., 0]
        of_support = rows @ joint[6:, :6] @ moved
        terms = np.abs(direct[..., 0])
        terms = terms + np.abs(rows) @ np.abs(joint[6:, :6]) @ np.abs(moved)
        total = direct[..., 0] + of_support
        direct = np.where(np.abs(total) > ROUNDING * terms, total, 0.0)[..., None]
        outputs = (rows @ joint[6:, 6:])[..., None]
    q = equations.solve(functions, moves, forces)
    if outputs.shape[-1] > 1:
        return np.einsum("ocs,cis->ois", outputs, q) + direct
    value = multiply_real(outputs[..., 0], q.reshape(len(q), -1))
    return value.reshape(len(outputs), *q.shape[1:]) + direct


def _find_equal_rows(
    form: Inexact[np.ndarray, "#build row coordinate"], kinds: list[Int[np.ndarray, " _"]]
) -> list[list[int]]:
    """Group rows of one kind that are equal but for their sign; rounding becomes 0, in place."""
    members = []
    for rows in kinds:
        small = ROUNDED * np.abs(form[:, rows]).max((1, 2), keepdims=True, initial=0.0)
        form[:, rows] *= np.abs(form[:, rows]) > small
        flat = np.moveaxis(form[:, rows], 1, 0).reshape(len(rows), len(form) * form.shape[2])
        members += [rows[group].tolist() for group in distinct(flat)[1]]
    return members


def as_builds(matrix: Any, axes: int = 2) -> Any:
    """Give an array of one design the axis of builds in front of its own `axes`."""
    return matrix if matrix.ndim > axes else matrix[None]


@dataclass(frozen=True)
class AtFrequencies:
    """The terms of a system at given frequencies (rad/s)."""

    omega: Inexact[np.ndarray, " frequency"]
    terms: list[EvaluatedTerm]
    lossy: bool
    damped: bool


@dataclass(frozen=True)
class Pencil:
    """Equations of small motions of one design, or of many builds at one frequency (rad/s) each.

    Those of builds have no terms in frequency (`LinearSystem.at`).
    """

    structure: Structure
    omega: Float[np.ndarray, " build"] | None = None

    @property
    def many(self) -> bool:
        """Whether there are many builds."""
        return self.omega is not None

    @property
    def model(self) -> LinearSystem:
        """The system."""
        return self.structure.system

    def at(self, omega: Float[np.ndarray, " frequency"], *, lossy: bool = True) -> AtFrequencies:
        """Evaluate at frequencies in rad/s."""
        terms = [term.at(omega, lossy=lossy) for term in self.model.terms]
        return AtFrequencies(omega, terms, lossy, lossy)

    def at_poles(
        self,
        s: Complex[np.ndarray, " pole"],
        loss: Loss,
        oscillating: Float[np.ndarray, " pole"] | None = None,
    ) -> AtFrequencies:
        """Evaluate at motions exp(s t), s in rad/s.

        Losses that are phase lags are taken at the frequency of oscillation, by default Im s.
        """
        omega = -1j * s
        real = np.imag(s).copy() if oscillating is None else oscillating
        terms = [
            term.at(
                omega if term.has_complex_frequency else real,
                lossy=loss == "all" or (loss == "dampers" and term.is_viscous),
            )
            for term in self.model.terms
        ]
        return AtFrequencies(omega, terms, loss == "all", loss != "none")

    def block(self, group: Int[np.ndarray, " own"]) -> Block:
        """Coordinates that couple to no others."""
        keep = group[np.argsort(self.owner[group], kind="stable")]
        return Block(self, keep, np.asarray(self.coupled[keep, :6].any(0)))

    def make_blocks(self) -> list[Block]:
        """Make the blocks of the system."""
        return [self.block(group) for group in self.structure.blocks]

    @cached_property
    def matrices(self) -> list[Inexact[np.ndarray, "#build coordinate coordinate"]]:
        """Re K and Im K without the stretching of wires, C and M, of one design."""
        soft, damping, mass = map(as_builds, (self.model.soft, self.model.damping, self.model.mass))
        return [np.real(soft), np.imag(soft), damping, mass]

    @cached_property
    def used(self) -> list[Bool[np.ndarray, "coordinate coordinate"]]:
        """Elements of `matrices` that are not 0."""
        return [(matrix != 0).any(0) for matrix in self.matrices]

    @property
    def owner(self) -> Int[np.ndarray, " coordinate"]:
        """Number of the body of each coordinate, see `LinearSystem.owner`."""
        return self.model.owner

    @property
    def coupled(self) -> Bool[np.ndarray, "coordinate coordinate"]:
        """Whether coordinates couple, see `Structure.coupled`."""
        return self.structure.coupled

    @property
    def unbalanced(self) -> float:
        """Largest unbalanced force in the equilibrium, N."""
        masses = np.diag(self.model.mass)[6 : 6 * (len(self.model.body) + 1) : 6]
        return float(self.model.residual * 10.0 * masses.sum())  # it is a fraction of the weight

    @cached_property
    def parent(self) -> list[int]:
        """Number of the body before each (from 1; 0: the support) that it is coupled to most."""
        bodies = len(self.model.body) + 1
        size = np.abs(self.model.stiffness[: 6 * bodies, : 6 * bodies])
        coupling = size.reshape(bodies, 6, bodies, 6)[:, :3, :, :3].sum((1, 3))
        return [0, *(int(coupling[n, :n].argmax()) for n in range(1, bodies))]

    def joint(self, columns: Int[np.ndarray, " own"]) -> Float[np.ndarray, "coordinate coordinate"]:
        """T of x = T q, in which each body follows all those above it in translation and yaw.

        What hangs does not follow roll and pitch. `columns` are the coordinates: those of the
        support, then the block's.
        """
        model = self.model
        bodies = len(self.model.body) + 1
        assert model.rigid is not None
        follow = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 1.0])
        rigid = model.rigid @ follow
        result = np.eye(model.size)
        result[6:, :6] = rigid[6:]
        for n, dof in enumerate(DOFS):
            if (name := f"{FRAME}.{dof}") in model.coordinate:
                result[6 : 6 * bodies, model.coordinate.index(name)] = rigid[6 : 6 * bodies, n]
        body = [slice(6 * n, 6 * n + 6) for n in range(bodies)]
        for n, above in enumerate(self.parent):
            while above:
                result[body[n], body[above]] = rigid[body[n]] - rigid[body[above]] + follow
                above = self.parent[above]
        return result[np.ix_(columns, columns)]
