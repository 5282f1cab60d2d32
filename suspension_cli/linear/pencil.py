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
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from suspension_cli.conventions import DOFS, FRAME
from suspension_cli.linear import elimination
from suspension_cli.linear.elimination import connected_groups, solve_each
from suspension_cli.linear.frequency_terms import (
    EvaluatedTerm,
    EvaluatedWires,
    Term,
    WireTerm,
    distinct,
    multiply_real,
)
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


def rounding(
    matrix: Inexact[np.ndarray, "row row"], place: Int[np.ndarray, " row"]
) -> Float[np.ndarray, "row row"]:
    """Largest rounding errors of the elements of a matrix of the forms of several parts."""
    size = sizes(matrix, place, place)
    own = np.sqrt(np.diag(size))
    return ROUNDING * np.maximum(size, own[:, None] * own)


@dataclass(frozen=True)
class Part:
    """Weights of some functions of frequency in elements of the equations of a block.

    Attributes
    ----------
    row, column
        Equation of each element, and its unknown with the support's motions before them.
    weights
        Of many builds there is only one function.
    """

    row: Int[np.ndarray, " element"]
    column: Int[np.ndarray, " element"]
    weights: Inexact[np.ndarray, "element function #build"]

    @staticmethod
    def of(weights: Inexact[np.ndarray, "function row column"]) -> Part:
        """Take the elements of one design that are not 0."""
        row, column = np.nonzero(weights.any(0))
        return Part(row, column, weights[:, row, column].T[..., None])

    def followed_by(
        self,
        row: Int[np.ndarray, " added"],
        column: Int[np.ndarray, " added"],
        weights: Inexact[np.ndarray, "added function #build"],
    ) -> Part:
        """Append elements."""
        if not len(row):
            return self
        shape = np.broadcast_shapes(self.weights.shape[1:], weights.shape[1:])
        pair = (np.broadcast_to(own, (len(own), *shape)) for own in (self.weights, weights))
        ends = (self.row, row), (self.column, column)
        return Part(*map(np.concatenate, ends), np.concatenate(list(pair)))

    @cached_property
    def dense(
        self,
    ) -> tuple[
        Int[np.ndarray, " row"],
        Int[np.ndarray, " column"],
        Inexact[np.ndarray, "function row column"],
    ]:
        """The rows and columns that have elements, and the weights in these, of one design."""
        (rows, i), (columns, j) = (
            np.unique(n, return_inverse=True) for n in (self.row, self.column)
        )
        result = np.zeros((self.weights.shape[1], len(rows), len(columns)), self.weights.dtype)
        result[:, i, j] = self.weights[..., 0].T
        return rows, columns, result

    def apply(
        self,
        functions: Inexact[np.ndarray, "function frequency"],
        motion: Inexact[np.ndarray, "unknown vector frequency"],
        result: Inexact[np.ndarray, "unknown vector frequency"],
    ) -> None:
        """Add the product with motions of one design's unknowns, the support at rest."""
        rows, columns, weights = self.dense
        own = columns >= 6
        x = motion[columns[own] - 6]
        for weight, values in zip(weights[..., own], functions, strict=True):
            if len(x) and values.any():
                moved = multiply_real(weight, x.reshape(len(x), -1))
                result[rows] += values * moved.reshape(len(rows), *x.shape[1:])

    def transformed(
        self,
        to_absolute: Float[np.ndarray, "all all"],
        place: Int[np.ndarray, " all"],
        error: Float[np.ndarray, "unknown all"] | float = 0.0,
    ) -> Part:
        """Change unknowns: old = `to_absolute` @ new. Rounding errors become 0.

        `error` is a bound of other errors of the new elements.
        """
        rows, columns, weights = self.dense
        if not len(rows):
            return self
        left, right = to_absolute[6 + rows, 6:], to_absolute[columns]
        terms = np.abs(left).T @ sizes(weights, place[6 + rows], place[columns]) @ np.abs(right)
        result = left.T @ weights @ right
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
        *,
        alike: bool = False,
    ) -> Rows:
        """Leave out wires that no coordinate moves; merge `alike` ones that move alike."""
        groups = [[n] for n in np.flatnonzero((form[..., 6:] != 0).any((0, 2))).tolist()]
        if alike and len(groups) > 1:
            some = [n for (n,) in groups]
            members = distinct(np.moveaxis(form[:, some], 1, 0).reshape(len(some), -1))[1]
            groups = [[some[n] for n in group] for group in members]
        first, count = [group[0] for group in groups], np.array([float(len(g)) for g in groups])
        return Rows(form[:, first], count, compliance[:, first], np.full(len(first), term))

    @staticmethod
    def joined(kinds: list[Rows]) -> Rows:
        """Join rows of several kinds."""
        axes = {"form": 1, "count": 0, "compliance": 1, "term": 0}
        return Rows(
            *(np.concatenate([getattr(one, name) for one in kinds], n) for name, n in axes.items())
        )


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
        For each part, its elements in the columns of each motion of the support.
    """

    to_absolute: Float[np.ndarray, "coordinate coordinate"] | None
    pattern: elimination.Pattern
    parts: list[tuple[Int[np.ndarray, " element"], Inexact[np.ndarray, "element function #build"]]]
    support: list[list[Part]]

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
            coupled[part.row, part.column] = True
        pattern = order_by_body(np.array(owner, dtype=int).tobytes(), coupled[:, 6:].tobytes())
        number = np.full((size, 6 + size), -1)
        number[pattern.row, 6 + pattern.column] = np.arange(len(pattern.row))
        elements, support = [], []
        for part in parts:
            place = number[part.row, part.column]
            elements.append((place[place >= 0], part.weights[place >= 0]))
            columns = (np.flatnonzero(part.column == motion) for motion in range(6))
            support.append([Part(part.row[n], part.column[n], part.weights[n]) for n in columns])
        return Equations(to_absolute, pattern, elements, support)

    def elements(
        self, functions: list[Inexact[np.ndarray, "function system"]]
    ) -> Inexact[np.ndarray, "element system"]:
        """Evaluate the elements of the pattern."""
        kind = np.result_type(*functions, *(own for _, own in self.parts if own.size))
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
        for motion in np.flatnonzero(moves.any((1, 2))):
            driven = np.flatnonzero(moves[motion].any(1))
            for columns, values in zip(self.support, functions, strict=True):
                if len(row := columns[motion].row):
                    pull = _multiply(columns[motion].weights, values)[:, None]
                    right[row[:, None], driven] -= pull * moves[motion, driven]
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
        """Terms that act on these coordinates, with their numbers in the system."""
        result = []
        for n, term in enumerate(self.pencil.model.terms):
            own = np.isin(term.columns, self.keep)
            if self.pencil.weights[n][:, own].any() or (isinstance(term, WireTerm) and own.any()):
                result.append((n, term))
        return result

    @cached_property
    def used(self) -> list[Int[np.ndarray, " _"]]:
        """Functions f_n of each term that are needed."""
        own = (np.isin(term.columns, self.keep) for _, term in self.terms)
        weights = (self.pencil.weights[n] for n, _ in self.terms)
        return [np.flatnonzero(w[:, o].any((1, 2))) for w, o in zip(weights, own, strict=True)]

    @cached_property
    def within(self) -> list[Any]:
        """See `WireTerm.within` and `LossTerm.within`, of each term."""
        return [term.within(self.keep) for _, term in self.terms]

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
        own, model = self.pencil.model.stretched, self.pencil.model
        kinds = [(np.zeros((1, 0, model.size)), np.zeros((1, 0)), -1)]
        for n, (_, term) in enumerate(self.terms):
            if isinstance(term, WireTerm):
                form = 2 * term.forms["stretch"][None, :, 1]
                kinds.append((form, np.zeros((1, form.shape[1])), n))
        if own is not None and not any(isinstance(term, WireTerm) for term in model.terms):
            form, c = as_builds(own.form), 1 / as_builds(self.pencil.stiff, 1)
            # builds without a common symmetry may differ from one by as little as rounding
            if self.pencil.many and model.allowed[6:, 6:].all():
                return Rows.of(form[..., self._columns] * self._kept, c)
            kind = [k.tobytes() for k in c.T]
            for one in dict.fromkeys(kind):
                alike = [n for n, other in enumerate(kind) if other == one]
                kinds.append((form[:, alike], c[:, alike], -1))
        made = []
        for form, c, n in kinds:
            own = form[..., self._columns] * self._kept
            small = 1e-14 * np.abs(own).max((1, 2), keepdims=True, initial=0.0)
            made.append(Rows.of(np.where(np.abs(own) > small, own, 0.0), c, n, alike=True))
        return Rows.joined(made)

    @cached_property
    def owner(self) -> list[int]:
        """Number of the body of each coordinate and tension, which is the lower one's."""
        own = self.pencil.owner[self.keep]
        lowest = ((self.rows.form[..., 6:] != 0).any(0) * own).max(1, initial=0)
        return [*own.tolist(), *lowest.tolist()]

    @cached_property
    def parts(self) -> list[Part]:
        """Weights of 1, of i, of i omega, of -omega^2; then of the functions of each term.

        The last of a term of wires is -1/k.
        """
        pencil, own, rows = self.pencil, len(self.keep), self.rows
        columns = self._columns[self._kept]
        number = np.full(pencil.model.size, -1)
        number[columns] = np.flatnonzero(self._kept)
        matrices = []
        for matrix, used in zip(pencil.matrices, pencil.used, strict=True):
            i, j = np.nonzero(used[np.ix_(self.keep, columns)])
            weights = matrix[:, self.keep[i], columns[j]].T[:, None]
            matrices.append(Part(i, number[columns[j]], weights))
        tension, constant = own + np.arange(len(rows.count)), rows.term < 0
        i, j = np.nonzero((rows.form != 0).any(0))
        form, below = rows.form[:, i, j].T[:, None], j >= 6
        matrices[0] = matrices[0].followed_by(tension[i], j, form)
        matrices[0] = matrices[0].followed_by(j[below] - 6, 6 + tension[i[below]], form[below])
        c = -(rows.compliance / rows.count)[:, constant].T[:, None]
        some = tension[constant], 6 + tension[constant]
        if np.iscomplexobj(c) and not pencil.many:
            matrices[1] = matrices[1].followed_by(*some, np.imag(c))
            c = np.real(c)
        matrices[0] = matrices[0].followed_by(*some, c)
        number[~np.isin(np.arange(len(number)), columns)] = -1
        for n, ((m, term), used) in enumerate(zip(self.terms, self.used, strict=True)):
            place = number[term.columns]
            weights = pencil.weights[m][used] * ((place >= 6)[:, None] & (place >= 0))
            if isinstance(term, WireTerm):
                weights = np.concatenate([weights, np.zeros((1, *weights.shape[1:]))])
            part = Part.of(weights)
            part = Part(place[part.row] - 6, place[part.column], part.weights)
            if isinstance(term, WireTerm):
                wires = np.flatnonzero(rows.term == n)
                last = np.zeros((len(wires), len(weights), 1))
                last[:, -1, 0] = 1 / rows.count[wires]
                part = part.followed_by(tension[wires], 6 + tension[wires], last)
            matrices.append(part)
        return matrices

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
        body[len(joint) :] = 0
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
        functions = [np.zeros((part.weights.shape[1], 1)) for part in self.parts]
        functions[0][:], functions[3][:] = 1.0, SHIFT
        for own, (_, term) in zip(functions[4:], self.terms, strict=False):
            if isinstance(term, WireTerm):
                own[-1] = -1 / term.static_stretching
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
            result[part.row, part.column] += multiply_real(part.weights[..., 0], values)
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
        terms = [there.terms[n] for n, _ in self.terms]
        return EvaluatedBlock(self, there.omega, terms, there.lossy, there.damped)


@dataclass(frozen=True)
class EvaluatedBlock:
    """One block of systems at given frequencies."""

    block: Block
    omega: Inexact[np.ndarray, " system"]
    terms: list[EvaluatedTerm]
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
            functions = term.functions(used)
            if isinstance(term, EvaluatedWires):
                functions.append(-term.compliance)
            result.append(np.array(np.broadcast_arrays(*functions, here[0])[:-1]))
        return result

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
        result = np.zeros((model.size, model.size), dtype=bool)
        matrices = [matrix[0] for matrix in self.matrices]
        if model.stretched is not None:
            form = model.stretched.form
            if self.many:
                moved = (form != 0).any(0).astype(float)
                result |= model.allowed & (moved.T @ moved > 0)
            alike = () if self.many else dict.fromkeys(self.stiff.tolist())
            for some in (form[self.stiff == k] for k in alike):
                matrices.append(np.where(model.allowed, some.T @ some, 0.0))
        if self.many:
            return np.logical_or.reduce([result, *self.used])
        for term, weights in zip(model.terms, self.weights, strict=True):
            result[np.ix_(term.columns, term.columns)] |= (weights != 0).any(0)
        for matrix in matrices:
            result |= np.abs(matrix) > rounding(matrix, place)
        return result

    @cached_property
    def weights(self) -> list[Float[np.ndarray, "function column column"]]:
        """A_n of each term among its columns, without rounding errors."""
        result = []
        for term in self.model.terms:
            own, small = self.place[term.columns], 0.0
            if isinstance(term, WireTerm):
                forms = {
                    part: list(sizes(np.array(rows), None, own))
                    for part, rows in term.resisted.items()
                }
                small = ROUNDING * term.products(forms)
            else:
                small = rounding(term.compact[0], own)
            allowed = self.model.allowed[np.ix_(term.columns, term.columns)]
            kept = (np.abs(term.compact) > small) & allowed
            result.append(np.where(kept, term.compact, 0.0))
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
