"""The pencil: equations of small motions of one design at any frequency, in plain doubles.

The tensions t of wires are unknowns beside the coordinates x, so that a stiff wire costs soft parts
no digits (mixed formulation: Zienkiewicz and Taylor, The Finite Element Method, 5th ed., vol. 1,
chapter 11):

    ( Z    E^T ) (x)   (f)
    ( E    -c  ) (t) = (0),    Z = K + i omega C - omega^2 M + sum over n of f_n(omega) A_n,

with the elongations E x of wires, their compliances c = 1 / k, and K without their stretching. Of a
wire with mass the row of E is that of the odd motion of its ends plus F_sa / F_aa of the even one,
and c = 1 / F_aa (F: stretching stiffness for even (s) and odd (a) motion).

Each element is a sum of a few functions of frequency with constant weights (`Part`); only those
that are not 0 are evaluated. Coordinates that do not couple are blocks, solved apart, each body by
body (`elimination`).

Around and above the lowest undamped mode the coordinates of a block are those of the system. Below
it all bodies move with the support, and what is to be found is their small relative motion: there
each body is counted from the one above it, x = T q. Nothing resists when all move together in x, y,
z and yaw, so such elements of T^T Z T are 0; what rounding left of them is removed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from suspension_cli.conventions import DOFS, FRAME
from suspension_cli.linear import elimination
from suspension_cli.linear.connected_groups import connected_groups
from suspension_cli.linear.frequency_terms import Evaluated, Term, WireTerm, multiply_real
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


def _real_and_imaginary(
    matrix: Inexact[np.ndarray, "row column"],
) -> tuple[Float[np.ndarray, "row column"], Float[np.ndarray, "row column"]]:
    return np.real(matrix), np.imag(matrix)


@dataclass(frozen=True)
class Part:
    """Weights of some functions of frequency in the equations of a block.

    Attributes
    ----------
    row, column
        Equations, and unknowns with the support's motions before them, that the weights are for.
    weights
        Of each function.
    """

    row: Int[np.ndarray, " row"]
    column: Int[np.ndarray, " column"]
    weights: Float[np.ndarray, "function row column"]

    @staticmethod
    def of(weights: Float[np.ndarray, "function unknown all"]) -> Part:
        """Keep the rows and columns that are not 0."""
        row, column = (np.flatnonzero(weights.any((0, axis))) for axis in (2, 1))
        return Part(row, column, weights[:, row[:, None], column])

    def whole(self, size: int) -> Float[np.ndarray, "function unknown all"]:
        """Weights in all equations."""
        result = np.zeros((len(self.weights), size, 6 + size))
        result[:, self.row[:, None], self.column] = self.weights
        return result

    def apply(
        self,
        functions: Inexact[np.ndarray, "function frequency"],
        motion: Inexact[np.ndarray, "unknown vector frequency"],
        result: Inexact[np.ndarray, "unknown vector frequency"],
    ) -> None:
        """Add the product with motions of the unknowns, the support at rest, to a result."""
        own = self.column >= 6
        if own.any() and functions.any():
            x = motion[self.column[own] - 6]
            for weights, values in zip(self.weights[..., own], functions, strict=True):
                if values.any():
                    moved = multiply_real(weights, x.reshape(len(x), -1))
                    result[self.row] += values * moved.reshape(-1, *x.shape[1:])

    def transformed(
        self, to_absolute: Float[np.ndarray, "all all"], place: Int[np.ndarray, " all"]
    ) -> Part:
        """Change unknowns: old = `to_absolute` @ new. Rounding errors become 0."""
        if not len(self.row):
            return self
        left, right = to_absolute[6 + self.row, 6:], to_absolute[self.column]
        terms = sizes(self.weights, place[6 + self.row], place[self.column])
        terms = np.abs(left).T @ terms @ np.abs(right)
        result = left.T @ self.weights @ right
        return Part.of(np.where(np.abs(result) > ROUNDING * terms, result, 0.0))


@dataclass(frozen=True)
class Rows:
    """Elongations of wires of one kind; those that move alike are one row.

    Attributes
    ----------
    odd, even
        Of odd and even motion of a wire's ends, per coordinate of support and block.
    count
        Number of wires per row.
    term
        Number of their term among the block's; None if k is constant.
    stiffness
        That k, N/m.
    """

    odd: Float[np.ndarray, "row coordinate"]
    even: Float[np.ndarray, "row coordinate"]
    count: Float[np.ndarray, " row"]
    term: int | None
    stiffness: complex

    @staticmethod
    def of(
        forms: Float[np.ndarray, "wire 2 coordinate"], term: int | None, stiffness: complex
    ) -> Rows:
        """Merge odd and even motions of wires; leave out those that no coordinate moves."""
        rows, members = distinct(forms.reshape(len(forms), -1))
        odd, even = rows.reshape(len(rows), *forms.shape[1:]).swapaxes(0, 1)
        count = np.array([len(group) for group in members], dtype=float)
        every = Rows(odd, even, count, term, stiffness)
        some = every.moved.any(1)
        return Rows(odd[some], even[some], count[some], term, stiffness)

    @property
    def moved(self) -> Bool[np.ndarray, "row own"]:
        """Whether each coordinate of the block moves each row."""
        return (self.odd[:, 6:] != 0) | (self.even[:, 6:] != 0)


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
        For each part, elements of the pattern and the weights (e, n) of its functions in them.
    support
        For each part, equations and the weights (r, 6, n) of the support's motions in them.
    """

    to_absolute: Float[np.ndarray, "coordinate coordinate"] | None
    pattern: elimination.Pattern
    parts: list[tuple[Int[np.ndarray, " element"], Float[np.ndarray, "element function"]]]
    support: list[tuple[Int[np.ndarray, " row"], Float[np.ndarray, "row 6 function"]]]

    @staticmethod
    def of(
        parts: list[Part],
        owner: list[int],
        to_absolute: Float[np.ndarray, "coordinate coordinate"] | None = None,
    ) -> Equations:
        """Order the equations for elimination body by body."""
        size = len(owner)
        coupled = np.zeros((size, 6 + size), dtype=bool)
        for part in parts:
            coupled[np.ix_(part.row, part.column)] |= part.weights.any(0)
        pattern = elimination.by_body(np.array(owner), coupled[:, 6:])
        number = np.full((size, 6 + size), -1)
        number[pattern.row, 6 + pattern.column] = np.arange(len(pattern.row))
        elements, support = [], []
        for part in parts:
            place = np.where(part.weights.any(0), number[np.ix_(part.row, part.column)], -1)
            i, j = np.nonzero(place >= 0)
            elements.append((place[i, j], np.ascontiguousarray(part.weights[:, i, j].T)))
            outer = part.column < 6
            towards = np.zeros((len(part.row), 6, len(part.weights)))
            towards[:, part.column[outer]] = np.moveaxis(part.weights[:, :, outer], 0, -1)
            some = towards.any((1, 2))
            support.append((part.row[some], towards[some]))
        return Equations(to_absolute, pattern, elements, support)

    def elements(
        self, functions: list[Inexact[np.ndarray, "function frequency"]]
    ) -> Inexact[np.ndarray, "element frequency"]:
        """Evaluate the elements of the pattern."""
        shape = len(self.pattern.row), functions[0].shape[1]
        result = np.zeros(shape, dtype=np.result_type(*functions))
        for (place, weights), values in zip(self.parts, functions, strict=True):
            if len(place) and values.any():
                result[place] += _multiply(weights, values)
        return result

    def solve(
        self,
        functions: list[Inexact[np.ndarray, "function frequency"]],
        moves: Float[np.ndarray, "6 input"],
        forces: Float[np.ndarray, "own input"],
    ) -> Inexact[np.ndarray, "own input frequency"]:
        """Solve for coordinates q, given support motions and forces on x."""
        count, (own, inputs) = functions[0].shape[1], forces.shape
        right = np.zeros((self.pattern.size, inputs, count), dtype=np.result_type(*functions))
        if self.to_absolute is not None:
            forces = self.to_absolute[6 : 6 + own, 6 : 6 + own].T @ forces
        right[:own] = forces[..., None]
        for (row, towards), values in zip(self.support, functions, strict=True):
            if len(row) and moves.any():
                pull = np.swapaxes(np.swapaxes(towards, 1, 2) @ moves, 1, 2)
                right[row] -= _multiply(pull, values)
        return self.pattern.solve(self.elements(functions), right)[:own]


def _multiply(
    weights: Float[np.ndarray, "*rows function"],
    functions: Inexact[np.ndarray, "function frequency"],
) -> Inexact[np.ndarray, "*rows frequency"]:
    return weights * functions if len(functions) == 1 else multiply_real(weights, functions)


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
        terms = enumerate(self.pencil.model.terms)
        some = [(n, term.within(self._columns)) for n, term in terms if own[term.columns].any()]
        return [(n, term) for n, term in some if isinstance(term, WireTerm) or len(term.columns)]

    @cached_property
    def used(self) -> list[Int[np.ndarray, " _"]]:
        """Functions f_n of each term that are needed."""
        result = []
        for _, term in self.terms:
            used = term.compact[:, term.columns >= 6].any((1, 2))
            # the tensions cover the odd stretching of wires
            result.append(np.flatnonzero(used[:-1] if isinstance(term, WireTerm) else used))
        return result

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
    def rows(self) -> list[Rows]:
        """Elongations of the wires that move with these coordinates."""
        model, kept = self.pencil.model, self._kept
        wires = [(n, term) for n, (_, term) in enumerate(self.terms) if isinstance(term, WireTerm)]
        if wires or model.stretched is None:
            forms = [(term.forms["stretch"][:, ::-1] * kept, n, 0j) for n, term in wires]
        else:
            odd, stiff = model.stretched.form[:, self._columns] * kept, self.pencil.stiff
            odd[np.abs(odd) <= 1e-14 * np.abs(odd).max(initial=0.0)] = 0.0
            whole = np.stack([odd, np.zeros_like(odd)], axis=1)
            forms = [(whole[stiff == k], None, complex(k)) for k in dict.fromkeys(stiff.tolist())]
        return [Rows.of(*each) for each in forms]

    @cached_property
    def owner(self) -> list[int]:
        """Number of the body of each coordinate and tension, which is the lower one's."""
        own = self.pencil.owner[self.keep]
        result = own.tolist()
        for rows in self.rows:
            result += (rows.moved * own).max(1, initial=0).tolist()
        return result

    @cached_property
    def parts(self) -> list[Part]:
        """Weights of 1, of i, of i omega, of -omega^2, and of the functions of each term.

        The latter are its f_n, and of wires F_sa / F_aa and -1 / F_aa.
        """
        pencil, count, size = self.pencil, len(self.keep), len(self.owner)
        at, outer, kept = np.ix_(self.keep, self._columns), 6 + count, self._kept
        base = np.zeros((4, size, 6 + size))
        matrices = (*_real_and_imaginary(pencil.soft), pencil.model.damping, pencil.model.mass)
        base[:, :count, :outer] = [matrix[at] * kept for matrix in matrices]
        start, tensions = count, {}
        for rows in self.rows:
            own = np.arange(start, start := start + len(rows.odd))
            base[0, own, :outer], base[0, :count, 6 + own] = rows.odd, rows.odd[:, 6:]
            if rows.term is None:
                compliance = 1 / (rows.count * rows.stiffness)
                base[:2, own, 6 + own] = -compliance.real, -compliance.imag
            else:
                tensions[rows.term] = rows, own
        of_terms = [
            self._part_of_term(term, used, *tensions.get(n, (None, np.zeros(0, dtype=int))))
            for n, ((_, term), used) in enumerate(zip(self.terms, self.used, strict=True))
        ]
        return [*(Part.of(one[None]) for one in base), *of_terms]

    def _part_of_term(
        self,
        term: Term,
        used: Int[np.ndarray, " function"],
        rows: Rows | None,
        tension: Int[np.ndarray, " row"],
    ) -> Part:
        """Weights of the functions of a term, on the coordinates that it acts on and tensions."""
        columns = term.columns
        moving, count = columns >= 6, len(columns)
        own = columns[moving] - 6
        weights = np.zeros((len(used) + 2, len(own) + len(tension), count + len(tension)))
        weights[:-2, : len(own), :count] = term.compact[used][:, moving] * self._kept[columns]
        if rows is not None:
            even, across = rows.even[:, columns], np.arange(len(tension))
            weights[-2, len(own) :, :count] = even
            weights[-2, : len(own), count:] = even[:, moving].T
            weights[-1, len(own) + across, count + across] = 1 / rows.count
        return Part(np.append(own, tension), np.append(columns, 6 + tension), weights)

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
        return Equations.of(
            [part.transformed(whole, place) for part in self.parts], self.owner, joint
        )

    @cached_property
    def lowest(self) -> float:
        """Lowest undamped mode, rad/s; 0 if it is rigid or unstable, or rigid motion not known."""
        count, size = len(self.keep), len(self.owner)
        if self.pencil.model.rigid is None:
            return 0.0
        values, vectors = np.linalg.eigh(self.pencil.model.mass[np.ix_(self.keep, self.keep)])
        root = np.zeros((size, count))
        root[:count] = vectors * np.sqrt(np.maximum(values, 0.0))
        static = SHIFT * (root @ root.T)
        static += self.parts[0].whole(size)[0, :, 6:]
        start = count
        for rows in self.rows:
            own = np.arange(start, start := start + len(rows.odd))
            if rows.term is not None:
                wires = self.terms[rows.term][1]
                assert isinstance(wires, WireTerm)
                static[own, own] = -1 / (rows.count * wires.strand.static["stretch"][1, 1])
        moved = root.T @ solve_each(static, root)
        if not np.isfinite(moved).all():
            return 0.0
        inverse = np.linalg.eigvalsh((moved + moved.T) / 2)
        if not len(inverse) or inverse[0] < -1e-9 * inverse[-1]:
            return 0.0
        return float(np.sqrt(max(1 / inverse[-1] - SHIFT, 0.0)))

    def matrix(
        self, functions: list[Inexact[np.ndarray, "function frequency"]]
    ) -> Inexact[np.ndarray, "unknown all frequency"]:
        """All elements from the functions of `parts`."""
        size = len(self.owner)
        shape = size, 6 + size, functions[0].shape[1]
        result = np.zeros(shape, dtype=np.result_type(*functions))
        for part, values in zip(self.parts, functions, strict=True):
            if len(part.row):
                at = np.ix_(part.row, part.column)
                result[at] += multiply_real(np.moveaxis(part.weights, 0, -1), values)
        return result

    def is_driven(
        self, moves: Float[np.ndarray, "6 input"], forces: Float[np.ndarray, "coordinate input"]
    ) -> Bool[np.ndarray, " input"]:
        """Whether each input, a motion of the support or a force, drives this block."""
        return np.asarray(moves[self.pull].any(0) | forces[self.keep].any(0))

    def at(self, there: AtFrequencies) -> EvaluatedBlock:
        """Evaluate at frequencies."""
        known: list[Any] = there.terms
        terms = [replace(known[n], term=own) for n, own in self.terms]
        return EvaluatedBlock(self, there.omega, terms, there.lossy, there.damped)


@dataclass(frozen=True)
class EvaluatedBlock:
    """One block at given frequencies (f,)."""

    block: Block
    omega: Inexact[np.ndarray, " frequency"]
    terms: list[Any]
    lossy: bool
    damped: bool

    @cached_property
    def functions(self) -> list[Inexact[np.ndarray, "function frequency"]]:
        """Functions of frequency of each of `Block.parts`."""
        here = np.ones((1, len(self.omega)))
        loss, damping = (bool(len(part.row)) for part in self.block.parts[1:3])
        result = [here, 1j * here if self.lossy and loss else 0 * here]
        result.append(1j * self.omega * here if self.damped and damping else 0 * here)
        result.append(-(self.omega**2) * here)
        stretched = {rows.term for rows in self.block.rows}
        for n, (term, used) in enumerate(zip(self.terms, self.block.used, strict=True)):
            functions = [*term.functions(used), 0 * here[0], 0 * here[0]]
            if n in stretched:
                _, mixed, odd = term.stretching
                functions[-2:] = mixed / odd, -1 / odd
            result.append(np.array(np.broadcast_arrays(*functions)))
        return result

    @property
    def matrix(self) -> Inexact[np.ndarray, "unknown all frequency"]:
        """All elements; the columns are those of support, block and tensions."""
        return self.block.matrix(self.functions)

    def respond(
        self,
        outputs: Float[np.ndarray, "output own"],
        moves: Float[np.ndarray, "6 input"],
        forces: Float[np.ndarray, "own input"],
        direct: Float[np.ndarray, "output input"] | float = 0.0,
    ) -> Inexact[np.ndarray, "output input frequency"]:
        """Solve for linear forms of the coordinates, given support motions and forces.

        `direct` is added: the response of the outputs to the support's own motion.
        """
        below = self.omega < FAR * self.block.lowest
        parts = []
        for relative, where in ((True, below), (False, ~below)):
            if not where.any():
                continue
            equations = self.block.relative if relative else self.block.absolute
            some = self.functions if where.all() else [part[:, where] for part in self.functions]
            q = equations.solve(some, moves, forces)
            form, offset = outputs, np.asarray(direct)
            if relative:
                assert equations.to_absolute is not None
                follow = equations.to_absolute[6:]
                terms = np.abs(direct) + np.abs(outputs) @ np.abs(follow[:, :6]) @ np.abs(moves)
                offset = direct + outputs @ follow[:, :6] @ moves
                offset = np.where(np.abs(offset) > ROUNDING * terms, offset, 0.0)
                form = outputs @ follow[:, 6:]
            value = multiply_real(form, q.reshape(len(q), -1)).reshape(len(form), *q.shape[1:])
            parts.append((where, value + offset[..., None] if offset.any() else value))
        if len(parts) == 1:
            return parts[0][1]
        result = np.empty((*parts[0][1].shape[:2], len(self.omega)), dtype=parts[0][1].dtype)
        for where, value in parts:
            result[..., where] = value
        return result


@dataclass(frozen=True)
class AtFrequencies:
    """The terms of a system at given frequencies (rad/s)."""

    omega: Inexact[np.ndarray, " frequency"]
    terms: list[Evaluated]
    lossy: bool
    damped: bool


@dataclass(frozen=True)
class Pencil:
    """Equations of small motions of a system without batch axes."""

    model: LinearSystem

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
        matrices = [(None, m) for m in (*_real_and_imaginary(self.soft), model.damping, model.mass)]
        if model.stretched is not None:
            form, allowed = model.stretched.form, model.stretched.allowed
            alike = [form[self.stiff == k] for k in dict.fromkeys(self.stiff.tolist())]
            matrices += [(None, np.where(allowed, some.T @ some, 0.0)) for some in alike]
        result = np.zeros((model.size, model.size), dtype=bool)
        for term in model.terms:
            columns, own = np.ix_(term.columns, term.columns), place[term.columns]
            if isinstance(term, WireTerm):
                forms = {
                    part: sizes(form[..., term.columns], None, own)
                    for part, form in term.forms.items()
                }
                small = ROUNDING * term.products(forms)
                result[columns] |= (np.abs(term.compact) > small).any(0)
            else:
                matrices += [(term.columns, matrix) for matrix in term.compact]
        for columns, matrix in matrices:
            if matrix.any():
                at = np.arange(model.size) if columns is None else columns
                size = sizes(matrix, place[at], place[at])
                own = np.sqrt(np.diag(size))
                small = ROUNDING * np.maximum(size, own[:, None] * own)
                result[np.ix_(at, at)] |= np.abs(matrix) > small
        return result

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
