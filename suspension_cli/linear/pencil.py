"""The pencil: equations of small motions at any frequency, in plain doubles.

The tensions t of wires are unknowns beside the coordinates x, so that a stiff wire costs soft parts
no digits (mixed formulation: Zienkiewicz and Taylor, The Finite Element Method, 5th ed., vol. 1,
chapter 11):

    ( Z    E^T ) (x)   (f)
    ( E    -c  ) (t) = (0),    Z = K + i omega C - omega^2 M + sum over n of f_n(omega) A_n,

with the elongations E x of wires, their compliances c = 1 / k(omega), and K without their
stretching.

Each element is a sum of a few functions of frequency with constant weights (`Part`); only those
that are not 0 are evaluated. A *system* is one design at one frequency, or one of many builds at
its frequency; all are solved together, on the last axis. Coordinates that do not couple are blocks,
solved apart, each body by body (`elimination`).

Around and above the lowest undamped mode the coordinates of a block are those of the system. Below
it all bodies move with the support, and what is to be found is their small relative motion: there
each body of a design is counted from the one above it, x = T q. Nothing resists when all move
together in x, y, z and yaw, so such elements of T^T Z T are 0; what rounding left of them is
removed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from suspension_cli.conventions import DOFS, FRAME
from suspension_cli.linear import elimination
from suspension_cli.linear.connected_groups import connected_groups
from suspension_cli.linear.frequency_terms import (
    EvaluatedTerm,
    EvaluatedWires,
    Term,
    WireTerm,
    multiply_real,
)
from suspension_cli.linear.small_matrices import solve_each
from suspension_cli.linear.stretching import distinct
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

Loss = Literal["all", "dampers", "none"]
"""Losses that act; loss angles, which are phase lags, act on oscillations alone."""
ROUNDING = 4e-15
"""Fraction of its terms up to which a sum is a rounding error."""
FAR = 0.5
"""Fraction of the lowest mode below which coordinates are relative: at it they gain nothing yet."""
SHIFT = 1e-4
"""(rad/s)^2, by which squared frequencies are shifted to find the lowest: some are 0."""


def sizes(
    matrix: Float[np.ndarray, "*rows row column"],
    of_row: Int[np.ndarray, " row"] | None,
    of_column: Int[np.ndarray, " column"],
) -> Float[np.ndarray, "*rows row column"]:
    """Largest absolute element over the rows and columns of equal, neighbouring places.

    A place is the translation of a body, its rotation, a blade tip, or a tension.
    """
    result = np.abs(matrix)
    for axis, place in ((-2, of_row), (-1, of_column)):
        if place is not None:
            starts = np.flatnonzero(np.diff(place, prepend=-1))
            result = np.maximum.reduceat(result, starts, axis)
            result = np.repeat(result, np.diff(np.append(starts, len(place))), axis)
    return result


@dataclass(frozen=True)
class Part:
    """Weights of some functions of frequency in the equations of a block.

    Attributes
    ----------
    row, column
        Equations, and unknowns with the support's motions before them, that the weights are for.
    used
        Elements that are not 0.
    source
        Matrices of each function; of many builds there is only one function.
    place
        Rows and columns of these that the weights are.
    """

    row: Int[np.ndarray, " row"]
    column: Int[np.ndarray, " column"]
    used: Bool[np.ndarray, "row column"]
    source: Inexact[np.ndarray, "function *#build _ _"]
    place: tuple[Int[np.ndarray, " row"], Int[np.ndarray, " column"]]

    @staticmethod
    def of(
        source: Inexact[np.ndarray, "function *#build own_row own_column"],
        row: Int[np.ndarray, " own_row"] | None = None,
        column: Int[np.ndarray, " own_column"] | None = None,
        used: Bool[np.ndarray, "own_row own_column"] | None = None,
    ) -> Part:
        """Keep the rows and columns that are not 0, and have a number that is not negative.

        Weights of one design may lack the axis of builds.
        """
        source = source if source.ndim == 4 else source[:, None]
        if used is None:
            used = np.asarray((source != 0).any((0, 1)))
        row = np.arange(source.shape[2]) if row is None else row
        column = np.arange(source.shape[3]) if column is None else column
        used = used & (row >= 0)[:, None] & (column >= 0)
        place = np.flatnonzero(used.any(1)), np.flatnonzero(used.any(0))
        return Part(row[place[0]], column[place[1]], used[np.ix_(*place)], source, place)

    def gather(
        self, i: Int[np.ndarray, " element"], j: Int[np.ndarray, " element"]
    ) -> Inexact[np.ndarray, "element function #build"]:
        """Weights in some elements, numbered by `row` and `column`."""
        flat = self.source.reshape(*self.source.shape[:2], -1)
        chosen = self.place[0][i] * self.source.shape[3] + self.place[1][j]
        result = np.take(flat, chosen, axis=-1).transpose(2, 0, 1)
        return result if flat.shape[1] > 1 else np.ascontiguousarray(result)

    @cached_property
    def weights(self) -> Inexact[np.ndarray, "function row column"]:
        """All of them, of one design."""
        own = self.source[:, 0][:, self.place[0][:, None], self.place[1]]
        return np.where(self.used, own, 0.0)

    def apply(
        self,
        functions: Inexact[np.ndarray, "function frequency"],
        motion: Inexact[np.ndarray, "unknown vector frequency"],
        result: Inexact[np.ndarray, "unknown vector frequency"],
    ) -> None:
        """Add the product with motions of one design's unknowns, the support at rest."""
        own = self.column >= 6
        if own.any() and functions.any():
            x = motion[self.column[own] - 6]
            for weights, values in zip(self.weights[..., own], functions, strict=True):
                if values.any():
                    moved = multiply_real(weights, x.reshape(len(x), -1))
                    result[self.row] += values * moved.reshape(-1, *x.shape[1:])

    def transformed(
        self,
        to_absolute: Float[np.ndarray, "all all"],
        place: Int[np.ndarray, " all"],
        error: Float[np.ndarray, "unknown all"] | float = 0.0,
    ) -> Part:
        """Change unknowns: old = `to_absolute` @ new. Rounding errors become 0.

        `error` is a bound of other errors of the new elements.
        """
        if not len(self.row):
            return self
        left, right = to_absolute[6 + self.row, 6:], to_absolute[self.column]
        terms = sizes(self.weights, place[6 + self.row], place[self.column])
        terms = np.abs(left).T @ terms @ np.abs(right)
        result = left.T @ self.weights @ right
        return Part.of(np.where(np.abs(result) > ROUNDING * terms + error, result, 0.0))


@dataclass(frozen=True)
class Rows:
    """Elongations of wires; those that move alike are one row.

    Attributes
    ----------
    form
        Elongation per coordinate of support and block.
    count
        Number of wires per row.
    compliance
        1/k of one wire, m/N.
    term
        Number of their term among the block's, which has the compliance instead; -1 for none.
    """

    form: Inexact[np.ndarray, "#build row coordinate"]
    count: Float[np.ndarray, " row"]
    compliance: Inexact[np.ndarray, "#build row"]
    term: Int[np.ndarray, " row"]

    @staticmethod
    def of(
        form: Float[np.ndarray, "#build wire coordinate"],
        compliance: Inexact[np.ndarray, "#build wire"],
        term: int = -1,
    ) -> Rows:
        """Leave out wires that no coordinate moves."""
        some = (form[..., 6:] != 0).any((0, 2))
        if not some.all():
            form, compliance = form[:, some], compliance[:, some]
        size = form.shape[1]
        return Rows(form, np.ones(size), compliance, np.full(size, term))

    def merged(self) -> Rows:
        """Merge wires of one compliance that move alike."""
        size = len(self.count)
        if size < 2:
            return self
        members = distinct(np.moveaxis(self.form, 1, 0).reshape(size, -1))[1]
        first = [group[0] for group in members]
        count = np.array([len(group) for group in members], dtype=float)
        return Rows(self.form[:, first], count, self.compliance[:, first], self.term[first])

    @cached_property
    def moved(self) -> Bool[np.ndarray, "row coordinate"]:
        """Whether each coordinate moves each row."""
        return (self.form != 0).any(0)


@dataclass(frozen=True)
class Equations:
    """Equations of one block in one choice of coordinates q, with x = T q.

    Attributes
    ----------
    to_absolute
        T (6 + c, 6 + c) with the support's coordinates; None if q = x.
    pattern
        Order of elimination of the coordinates and tensions.
    parts
        For each part, elements of the pattern and the weights of its functions in them.
    support
        For each part, equations, motions of the support and the weights of these in them.
    """

    to_absolute: Float[np.ndarray, "coordinate coordinate"] | None
    pattern: elimination.Pattern
    parts: list[tuple[Int[np.ndarray, " element"], Inexact[np.ndarray, "element function #build"]]]
    support: list[
        tuple[
            Int[np.ndarray, " row"],
            Int[np.ndarray, " motion"],
            Inexact[np.ndarray, "row motion function #build"],
        ]
    ]

    @staticmethod
    def of(
        parts: list[Part],
        owner: Sequence[int],
        to_absolute: Float[np.ndarray, "coordinate coordinate"] | None = None,
    ) -> Equations:
        """Order the equations for elimination body by body."""
        size = len(owner)
        coupled = np.eye(size, 6 + size, 6, dtype=bool)
        for part in parts:
            coupled[np.ix_(part.row, part.column)] |= part.used
        pattern = order_by_body(np.array(owner, dtype=int).tobytes(), coupled[:, 6:].tobytes())
        number = np.full((size, 6 + size), -1)
        number[pattern.row, 6 + pattern.column] = np.arange(len(pattern.row))
        elements, support = [], []
        for part in parts:
            if not len(part.row):
                elements.append((part.row, np.zeros((0, 1, 1))))
                support.append((part.row, part.row, np.zeros((0, 0, 1, 1))))
                continue
            i, j = np.nonzero(part.used)
            place = number[part.row[i], part.column[j]]
            some = place >= 0
            elements.append((place[some], part.gather(i[some], j[some])))
            outer = np.flatnonzero(part.column < 6)
            rows = np.flatnonzero(part.used[:, outer].any(1))
            i, j = (grid.ravel() for grid in np.meshgrid(rows, outer, indexing="ij"))
            towards = part.gather(i, j) * part.used[i, j][:, None, None]
            shape = len(rows), len(outer), *towards.shape[1:]
            support.append((part.row[rows], part.column[outer], towards.reshape(shape)))
        return Equations(to_absolute, pattern, elements, support)

    def elements(
        self, functions: list[Inexact[np.ndarray, "function system"]]
    ) -> Inexact[np.ndarray, "element system"]:
        """Evaluate the elements of the pattern."""
        weights = [own for _, own in self.parts]
        kind = np.result_type(*functions, *(own for own in weights if own.size))
        result = np.zeros((len(self.pattern.row), functions[0].shape[1]), dtype=kind)
        for (place, own), values in zip(self.parts, functions, strict=True):
            if len(place) and values.any():
                result[place] += _multiply(own, values)
        return result

    def solve(
        self,
        functions: list[Inexact[np.ndarray, "function system"]],
        moves: Float[np.ndarray, "6 input #system"],
        forces: Float[np.ndarray, "own input #system"],
    ) -> Inexact[np.ndarray, "own input system"]:
        """Solve for coordinates q, given support motions and forces on x."""
        elements, (own, inputs) = self.elements(functions), forces.shape[:2]
        shape = self.pattern.size, inputs, functions[0].shape[1]
        right = np.zeros(shape, dtype=elements.dtype)
        if self.to_absolute is not None:
            forces = np.tensordot(self.to_absolute[6 : 6 + own, 6 : 6 + own].T, forces, 1)
        right[:own] = forces
        moving = np.asarray(moves.any((1, 2)))
        for (row, motion, towards), values in zip(self.support, functions, strict=True):
            if len(row) and (some := moving[motion]).any():
                pull = np.einsum("rcnb,cib->rinb", towards[:, some], moves[motion[some]])
                right[row] -= _multiply(pull, values)
        return self.pattern.solve(elements, right)[:own]


@lru_cache(maxsize=64)
def order_by_body(owner: bytes, coupled: bytes) -> elimination.Pattern:
    """Order coordinates for elimination (`elimination.by_body`)."""
    order = np.frombuffer(owner, dtype=int)
    return elimination.by_body(order, np.frombuffer(coupled, dtype=bool).reshape(len(order), -1))


def _multiply(
    weights: Inexact[np.ndarray, "*rows function #build"],
    functions: Inexact[np.ndarray, "function system"],
) -> Inexact[np.ndarray, "*rows system"]:
    if len(functions) == 1:
        return weights[..., 0, :] * functions[0]
    return multiply_real(weights[..., 0], functions)


def _apply(
    form: Float[np.ndarray, "output own #system"], q: Inexact[np.ndarray, "own input system"]
) -> Inexact[np.ndarray, "output input system"]:
    if form.shape[-1] == 1:
        flat = multiply_real(form[..., 0], q.reshape(len(q), -1))
        return flat.reshape(len(form), *q.shape[1:])
    return np.einsum("ocs,cis->ois", form, q)


@dataclass(frozen=True)
class Block:
    """One block of a pencil.

    Attributes
    ----------
    keep
        Coordinates of the system, parents before children.
    pull
        Whether each motion of the support acts on them.
    """

    pencil: Pencil
    keep: Int[np.ndarray, " own"]
    pull: Bool[np.ndarray, " 6"]

    @cached_property
    def terms(self) -> list[tuple[int, Term]]:
        """Terms in the coordinates of support and block, with their numbers in the system."""
        own = np.zeros(self.pencil.model.size, dtype=bool)
        own[self.keep] = True
        kept, result = np.diag(self._kept.astype(float)), []
        for n, term in enumerate(self.pencil.model.terms):
            if own[term.columns].any():
                some = term.within(self._columns)
                if (some.columns >= 6).any():
                    result.append((n, some.spread(kept) if isinstance(some, WireTerm) else some))
        return result

    @cached_property
    def used(self) -> list[Int[np.ndarray, " _"]]:
        """Functions f_n of each term that are needed."""
        return [
            np.flatnonzero(term.compact[:, term.columns >= 6].any((1, 2))) for _, term in self.terms
        ]

    @cached_property
    def loss(self) -> Float[np.ndarray, "own own"]:
        """Im K with the stretching of wires whose stiffness is constant."""
        lossy, at = self.pencil.model.lossy, np.ix_(self.keep, self.keep)
        return np.zeros((len(self.keep),) * 2) if lossy is None else np.imag(lossy[at])

    @cached_property
    def damping(self) -> Float[np.ndarray, "own own"]:
        """C."""
        return self.pencil.model.damping[np.ix_(self.keep, self.keep)]

    @cached_property
    def _columns(self) -> Int[np.ndarray, " coordinate"]:
        return np.concatenate([np.arange(6), self.keep])

    @cached_property
    def _kept(self) -> Bool[np.ndarray, " coordinate"]:
        """Whether each of `_columns` has elements that are more than rounding errors."""
        return np.append(self.pull, np.ones(len(self.keep), dtype=bool))

    @cached_property
    def rows(self) -> Rows:
        """Elongations of the wires that move with these coordinates."""
        own, columns = self.pencil.model.stretched, self._columns
        wires = [(n, term) for n, (_, term) in enumerate(self.terms) if isinstance(term, WireTerm)]
        kinds = []
        for n, term in wires:
            form = 2 * term.forms["stretch"][None, :, 1]
            kinds.append(Rows.of(form, np.zeros((1, form.shape[1])), n).merged())
        if not wires and own is not None:
            form = np.take(as_builds(own.form), columns, axis=-1)
            form[..., ~self._kept] = 0.0
            c = 1 / as_builds(self.pencil.stiff, 1)
            # builds without a common symmetry may differ from one by as little as rounding
            if self.pencil.many and own.allowed[6:, 6:].all():
                return Rows.of(form, c)
            largest = np.abs(form).max((1, 2), keepdims=True, initial=0.0)
            form[np.abs(form) <= 1e-14 * largest] = 0.0
            kind = [k.tobytes() for k in c.T]
            for one in dict.fromkeys(kind):
                alike = [n for n, other in enumerate(kind) if other == one]
                kinds.append(Rows.of(form[:, alike], c[:, alike]).merged())
        if not kinds:
            return Rows.of(np.zeros((1, 0, len(columns))), np.zeros((1, 0)))
        return Rows(
            np.concatenate([one.form for one in kinds], axis=1),
            np.concatenate([one.count for one in kinds]),
            np.concatenate([one.compliance for one in kinds], axis=1),
            np.concatenate([one.term for one in kinds]),
        )

    @cached_property
    def owner(self) -> list[int]:
        """Number of the body of each coordinate and tension, which is the lower one's."""
        own = self.pencil.owner[self.keep]
        lowest = (self.rows.moved[:, 6:] * own).max(1, initial=0)
        return [*own.tolist(), *lowest.tolist()]

    @cached_property
    def parts(self) -> list[Part]:
        """Weights of 1, of i, of i omega, of -omega^2; of the functions of each term; of tensions.

        The last of a term of wires is -1/k, those of tensions are 1 and i.
        """
        pencil, own, kept = self.pencil, np.arange(len(self.keep)), self._kept
        size = pencil.model.size
        row, column = np.full(size, -1), np.full(size, -1)
        row[self.keep], column[self._columns[kept]] = own, np.flatnonzero(kept)
        result = [
            Part.of(matrix[None], row, column, used)
            for matrix, used in zip(pencil.matrices, pencil.used, strict=True)
        ]
        rows = self.rows
        tension = len(own) + np.arange(len(rows.count))
        for n, ((_, term), used) in enumerate(zip(self.terms, self.used, strict=True)):
            moving, wires = np.flatnonzero(term.columns >= 6), np.flatnonzero(rows.term == n)
            size, count = len(moving), len(wires)
            weights = np.zeros((len(used) + 1, 1, size + count, len(term.columns) + count))
            weights[:-1, 0, :size, : len(term.columns)] = (
                term.compact[used][:, moving] * kept[term.columns]
            )
            across = np.arange(count)
            weights[-1, 0, size + across, len(term.columns) + across] = 1 / rows.count[wires]
            row = np.append(term.columns[moving] - 6, tension[wires])
            result.append(Part.of(weights, row, np.append(term.columns, 6 + tension[wires])))
        c = np.zeros((*rows.compliance.shape, len(tension)), dtype=rows.compliance.dtype)
        c[:, np.arange(len(tension)), np.arange(len(tension))] = -rows.compliance / rows.count
        split = np.iscomplexobj(c) and not pencil.many
        pulled = np.swapaxes(rows.form[..., 6:], -1, -2)
        return [
            *result,
            Part.of(rows.form[None], tension, used=rows.moved),
            Part.of(pulled[None], own, 6 + tension, rows.moved[:, 6:].T),
            Part.of(np.array([np.real(c), np.imag(c)]) if split else c[None], tension, 6 + tension),
        ]

    @cached_property
    def absolute(self) -> Equations:
        """Equations in the coordinates of the system."""
        return Equations.of(self.parts, self.owner)

    @cached_property
    def relative(self) -> Equations:
        """Equations in coordinates relative to the body above."""
        joint, tensions = self.pencil.joint(self._columns), len(self.owner) - len(self.keep)
        joint[6:, :6] *= self.pull
        whole = np.eye(6 + len(self.owner))
        whole[: len(joint), : len(joint)] = joint
        place = np.append(
            self.pencil.place[self._columns], self.pencil.model.size + np.arange(tensions)
        )
        # all bodies below turned about z by t turn forces by t: only those that are not balanced
        turning = np.zeros(len(whole), dtype=bool)
        turning[: len(joint)] = self._columns % 6 == 5
        turning[: len(joint)] &= self._columns < 6 * (len(self.pencil.model.body) + 1)
        body = np.append(np.zeros(6, dtype=int), self.owner)
        below = (body[:, None] > body) & turning
        unbalanced = self.pencil.unbalanced * (below | below.T)[6:]
        static, *others = self.parts
        parts = [static.transformed(whole, place, unbalanced)]
        parts += [part.transformed(whole, place) for part in others]
        return Equations.of(parts, self.owner, joint)

    @cached_property
    def lowest(self) -> float:
        """Lowest undamped mode, rad/s; 0 if it is rigid or unstable, or rigid motion not known."""
        count = len(self.keep)
        if self.pencil.model.rigid is None or self.pencil.many:
            return 0.0
        mass = self.pencil.model.mass[np.ix_(self.keep, self.keep)]
        values, vectors = np.linalg.eigh(mass)
        root = np.zeros((len(self.owner), count))
        root[:count] = vectors * np.sqrt(np.maximum(values, 0.0))
        functions = [np.zeros((len(part.source), 1)) for part in self.parts]
        functions[3][:] = SHIFT
        for own in (functions[0], *functions[4 + len(self.terms) :]):
            own[0] = 1.0
        for own, (_, term) in zip(functions[4:], self.terms, strict=False):
            own[-1] = -1 / term.static_stretching if isinstance(term, WireTerm) else 0.0
        moved = root.T @ solve_each(self.matrix(functions)[:, 6:, 0], root)
        if not np.isfinite(moved).all():
            return 0.0
        inverse = np.linalg.eigvalsh((moved + moved.T) / 2)
        if not len(inverse) or inverse[0] < -1e-9 * inverse[-1]:
            return 0.0
        return float(np.sqrt(max(1 / inverse[-1] - SHIFT, 0.0)))

    def matrix(
        self, functions: list[Inexact[np.ndarray, "function frequency"]]
    ) -> Inexact[np.ndarray, "unknown all frequency"]:
        """All elements of one design from the functions of `parts`."""
        size = len(self.owner)
        shape = size, 6 + size, functions[0].shape[1]
        result = np.zeros(shape, dtype=np.result_type(*functions))
        for part, values in zip(self.parts, functions, strict=True):
            if len(part.row):
                at = np.ix_(part.row, part.column)
                result[at] += multiply_real(np.moveaxis(part.weights, 0, -1), values)
        return result

    def is_driven(
        self,
        moves: Float[np.ndarray, "6 input #system"],
        forces: Float[np.ndarray, "coordinate input #system"],
    ) -> Bool[np.ndarray, " input"]:
        """Whether each input, a motion of the support or a force, drives this block."""
        driven = (moves[self.pull] != 0).any(0) | (forces[self.keep] != 0).any(0)
        return np.asarray(driven if driven.ndim == 1 else driven.any(1))

    def at(self, there: AtFrequencies) -> EvaluatedBlock:
        """Evaluate at frequencies."""
        known: list[Any] = there.terms
        terms = [replace(known[n], term=own) for n, own in self.terms]
        return EvaluatedBlock(self, there.omega, terms, there.lossy, there.damped)


@dataclass(frozen=True)
class EvaluatedBlock:
    """One block of systems at given frequencies."""

    block: Block
    omega: Inexact[np.ndarray, " system"]
    terms: list[Any]
    lossy: bool
    damped: bool

    @cached_property
    def functions(self) -> list[Inexact[np.ndarray, "function system"]]:
        """Functions of frequency of each of `Block.parts`."""
        here = np.ones((1, len(self.omega)))
        loss, damping = (bool(len(part.row)) for part in self.block.parts[1:3])
        result = [here, 1j * here if self.lossy and loss else 0 * here]
        result.append(1j * self.omega * here if self.damped and damping else 0 * here)
        result.append(-(self.omega**2) * here)
        for term, used in zip(self.terms, self.block.used, strict=True):
            last = -term.compliance if isinstance(term, EvaluatedWires) else 0 * here[0]
            functions = [*term.functions(used), last]
            result.append(np.array(np.broadcast_arrays(*functions, here[0])[:-1]))
        stretching = [len(part.source) for part in self.block.parts[len(result) :][:3]]
        both = np.concatenate([here, 1j * here if self.lossy else 0 * here])
        return result + [here if functions == 1 else both for functions in stretching]

    @property
    def matrix(self) -> Inexact[np.ndarray, "unknown all frequency"]:
        """All elements of one design; the columns are those of support, block and tensions."""
        return self.block.matrix(self.functions)

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
        outputs, moves, forces = (
            part if part.ndim == 3 else part[..., None] for part in (outputs, moves, forces)
        )
        offset = np.asarray(direct)
        offset = offset if offset.ndim == 3 else offset[..., None]
        below = self.omega < FAR * self.block.lowest
        parts = []
        for relative, where in ((True, below), (False, ~below)):
            if not where.any():
                continue
            equations = self.block.relative if relative else self.block.absolute
            some = self.functions if where.all() else [part[:, where] for part in self.functions]
            form, own = outputs, offset
            if equations.to_absolute is not None:
                follow, (rows, moved) = equations.to_absolute[6:], (outputs[..., 0], moves[..., 0])
                first = offset[..., 0]
                terms = np.abs(first) + np.abs(rows) @ np.abs(follow[:, :6]) @ np.abs(moved)
                first = first + rows @ follow[:, :6] @ moved
                own = np.where(np.abs(first) > ROUNDING * terms, first, 0.0)[..., None]
                form = (rows @ follow[:, 6:])[..., None]
            value = _apply(form, equations.solve(some, moves, forces))
            parts.append((where, value + own if own.any() else value))
        if len(parts) == 1:
            return parts[0][1]
        result = np.empty((*parts[0][1].shape[:2], len(self.omega)), dtype=parts[0][1].dtype)
        for where, value in parts:
            result[..., where] = value
        return result


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
    """Equations of small motions of one design, or of many builds without terms in frequency."""

    model: LinearSystem

    @cached_property
    def many(self) -> bool:
        """Whether there are many builds."""
        return np.ndim(self.soft) > 2

    @staticmethod
    def of(model: LinearSystem) -> Pencil:
        """Build the pencil of a system, once."""
        if "pencil" not in model.prepared:
            model.prepared["pencil"] = Pencil(model)
        return model.prepared["pencil"]

    def at(self, omega: Float[np.ndarray, " frequency"], *, lossy: bool = True) -> AtFrequencies:
        """Evaluate at frequencies in rad/s."""
        terms = [term.at(omega, lossy=lossy) for term in self.model.terms]
        return AtFrequencies(omega, terms, lossy, lossy)

    def at_poles(self, s: Complex[np.ndarray, " pole"], loss: Loss) -> AtFrequencies:
        """Evaluate at motions exp(s t), s in rad/s."""
        omega, real = -1j * s, np.imag(s).copy()
        terms = [
            term.at(
                omega if term.dispersive else real,
                lossy=loss == "all" or (loss == "dampers" and term.viscous),
            )
            for term in self.model.terms
        ]
        return AtFrequencies(omega, terms, loss == "all", loss != "none")

    @property
    def dispersive(self) -> bool:
        """Whether a term is a function of complex frequency."""
        return any(term.dispersive for term in self.model.terms)

    @cached_property
    def blocks(self) -> list[Block]:
        """Coordinates that couple to each other, without the support's."""
        coupled = self.coupled
        groups = [6 + group for group in connected_groups(coupled[6:, 6:])]
        groups = [group[np.argsort(self.owner[group], kind="stable")] for group in groups]
        return [Block(self, group, coupled[group, :6].any(0)) for group in groups]

    @cached_property
    def soft(self) -> Inexact[np.ndarray, "coordinate coordinate"]:
        """K without the stretching of wires; complex if lossy."""
        model = self.model
        full = model.stiffness if model.lossy is None else model.lossy
        soft = full if model.stretched is None else model.stretched.soft
        return np.real(soft) if model.lossy is None else soft

    @cached_property
    def matrices(self) -> list[Inexact[np.ndarray, "#build coordinate coordinate"]]:
        """Re K and Im K without the stretching of wires, C and M; of many builds K and nothing."""
        soft = as_builds(self.soft)
        split = np.isrealobj(soft) or self.many
        parts = [soft, np.zeros((1, *soft.shape[1:]))] if split else [np.real(soft), np.imag(soft)]
        return [*parts, as_builds(self.model.damping), as_builds(self.model.mass)]

    @cached_property
    def used(self) -> list[Bool[np.ndarray, "coordinate coordinate"]]:
        """Elements of `matrices` that are not 0 in all builds."""
        return [(matrix != 0).any(0) for matrix in self.matrices]

    @cached_property
    def stiff(self) -> Inexact[np.ndarray, " wire"]:
        """Constant stiffness k of wires, N/m."""
        if self.model.stretched is None:
            return np.zeros(0)
        k = self.model.stretched.stiffness
        return np.real(k) if self.model.lossy is None else k

    @cached_property
    def owner(self) -> Int[np.ndarray, " coordinate"]:
        """Number of the body of each coordinate, from 1; 0: the support and its structure.

        A blade's tip goes with the stage below.
        """
        number = {name: n for n, name in enumerate(self.model.body, 1)}
        return np.array([number.get(name.split(".", 1)[0], 0) for name in self.model.coordinate])

    @cached_property
    def place(self) -> Int[np.ndarray, " coordinate"]:
        """See `sizes`."""
        number = np.arange(self.model.size)
        return np.where(number < 6 * (len(self.model.body) + 1), number // 3, number)

    @cached_property
    def coupled(self) -> Bool[np.ndarray, "coordinate coordinate"]:
        """Whether coordinates couple by more than rounding errors.

        What one wire exerts, an equal one may cancel, so equal wires are taken together.
        """
        model, place = self.model, self.place
        matrices = [(None, matrix[0]) for matrix in self.matrices]
        result = np.zeros((model.size, model.size), dtype=bool)
        if model.stretched is not None:
            form, allowed = model.stretched.form, model.stretched.allowed
            if self.many:
                moved = (form != 0).any(0).astype(float)
                result |= allowed & (moved.T @ moved > 0)
            alike = () if self.many else dict.fromkeys(self.stiff.tolist())
            for some in (form[self.stiff == k] for k in alike):
                matrices.append((None, np.where(allowed, some.T @ some, 0.0)))
        if self.many:
            return np.logical_or.reduce([result, *self.used])
        for term in model.terms:
            columns, own = np.ix_(term.columns, term.columns), place[term.columns]
            if isinstance(term, WireTerm):
                forms = {
                    part: list(sizes(np.array(rows), None, own))
                    for part, rows in term.resisted.items()
                }
                small = ROUNDING * term.products(forms)
                result[columns] |= (np.abs(term.compact) > small).any(0)
            else:
                matrices += [(term.columns, matrix) for matrix in term.compact]
        for columns, matrix in matrices:
            at = np.arange(model.size) if columns is None else columns
            size = sizes(matrix, place[at], place[at])
            own = np.sqrt(np.diag(size))
            small = ROUNDING * np.maximum(size, own[:, None] * own)
            result[np.ix_(at, at)] |= np.abs(matrix) > small
        return result

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
        """T of x = T q, in which each body follows all those above it rigidly.

        `columns` are the coordinates: those of the support, then the block's.
        """
        rigid, last = self.model.rigid, 6 * (len(self.model.body) + 1)
        assert rigid is not None
        place = {int(n): m for m, n in enumerate(columns)}
        result = np.eye(len(columns))
        for row, n in enumerate(columns[6:].tolist(), 6):
            if n >= last:
                continue
            result[row, :6] = rigid[n]
            for m, dof in enumerate(DOFS):
                other = f"{FRAME}.{dof}"
                if other in self.model.coordinate:
                    result[row, place.get(self.model.coordinate.index(other), row)] = rigid[n, m]
            above = self.parent[n // 6]
            while above:
                first = 6 * above
                for dof in range(6):
                    if first + dof in place:
                        result[row, place[first + dof]] = (
                            rigid[n, dof] - rigid[first + n % 6, dof] + (n % 6 == dof)
                        )
                above = self.parent[above]
            result[row, row] = 1.0
        return result
