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

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from suspension_cli.conventions import DOFS, FRAME
from suspension_cli.elimination import connected_groups, solve_each
from suspension_cli.linear.equations import ROUNDING, Equations, Part, rounding, sizes
from suspension_cli.linear.frequency_terms import (
    EvaluatedTerm,
    EvaluatedWires,
    Term,
    WireTerm,
    distinct,
    is_damper,
    multiply_real,
)
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

Loss = Literal["all", "dampers", "none"]
"""Losses that act; loss angles, which are phase lags, act on oscillations alone."""
FAR = 0.5
"""Fraction of the lowest mode below which coordinates are relative: at it they gain nothing yet."""
SHIFT = 1e-4
"""(rad/s)^2, by which squared frequencies are shifted to find the lowest: some are 0."""


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
        return self.pencil.model.loss[np.ix_(self.keep, self.keep)]

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
        model = self.pencil.model
        form, kinds = np.zeros((1, 0, model.size)), []
        c, term = np.zeros((1, 0)), np.zeros(0, dtype=int)
        for n, (_, own) in enumerate(self.terms):
            if isinstance(own, WireTerm):
                form = np.append(form, 2 * own.forms["stretch"][None, :, 1], axis=1)
                term = np.append(term, np.full(form.shape[1] - len(term), n))
                kinds.append(np.flatnonzero(term == n))
                c = np.zeros((1, len(term)))
        if not any(isinstance(own, WireTerm) for own in model.terms):
            form, c = as_builds(model.elongation), 1 / as_builds(model.k, 1)
            term, kind = np.full(form.shape[1], -1), [k.tobytes() for k in c.T]
            kinds = [np.flatnonzero([k == one for k in kind]) for one in dict.fromkeys(kind)]
        form = form[..., self._columns] * self._kept
        if self.pencil.many and model.allowed[6:, 6:].all():
            # builds without a common symmetry may differ from one by as little as rounding
            members = np.arange(len(term))[:, None].tolist()
        else:
            for some in kinds:
                small = 1e-14 * np.abs(form[:, some]).max((1, 2), keepdims=True, initial=0.0)
                form[:, some] *= np.abs(form[:, some]) > small
            flat = np.moveaxis(form, 1, 0).reshape(len(term), len(form) * form.shape[2])
            members = [some[group].tolist() for some in kinds for group in distinct(flat[some])[1]]
        members = [group for group in members if form[:, group[0], 6:].any()]
        first, count = [group[0] for group in members], [float(len(group)) for group in members]
        return Rows(form[:, first], np.array(count), c[:, first], term[first])

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
    def functions(self) -> list[Inexact[np.ndarray, "function system"]]:
        """Functions of frequency of each of `Block.parts`."""
        here = np.ones((1, len(self.omega)))
        loss, damping = (bool(len(part.row)) for part in self.block.parts[1:3])
        result = [here, 1j * here if self.there.lossy and loss else 0 * here]
        result.append(1j * self.omega * here if self.there.damped and damping else 0 * here)
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
        return np.ndim(self.model.soft) > 2

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
                lossy=loss == "all" or (loss == "dampers" and is_damper(term)),
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
    def matrices(self) -> list[Inexact[np.ndarray, "#build coordinate coordinate"]]:
        """Re K and Im K without the stretching of wires, C and M; of many builds K and nothing."""
        soft = as_builds(self.model.soft)
        split = np.isrealobj(soft) or self.many
        parts = [soft, np.zeros((1, *soft.shape[1:]))] if split else [np.real(soft), np.imag(soft)]
        return [*parts, as_builds(self.model.damping), as_builds(self.model.mass)]

    @cached_property
    def used(self) -> list[Bool[np.ndarray, "coordinate coordinate"]]:
        """Elements of `matrices` that are not 0 in all builds."""
        return [(matrix != 0).any(0) for matrix in self.matrices]

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
        model, matrices = self.model, [matrix[0] for matrix in self.matrices]
        if self.many:
            moved = (as_builds(model.elongation) != 0).any(0).astype(float)
            return np.logical_or.reduce([model.allowed & (moved.T @ moved > 0), *self.used])
        for k in dict.fromkeys(model.k.tolist()):
            some = model.elongation[model.k == k]
            matrices.append(np.where(model.allowed, some.T @ some, 0.0))
        result = np.any([np.abs(m) > rounding(m, self.place) for m in matrices], axis=0)
        for term, weights in zip(model.terms, self.weights, strict=True):
            result[np.ix_(term.columns, term.columns)] |= (weights != 0).any(0)
        return np.asarray(result)

    @cached_property
    def weights(self) -> list[Float[np.ndarray, "function column column"]]:
        """A_n of each term among its columns, without rounding errors."""
        result = []
        for term in self.model.terms:
            own = self.place[term.columns]
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
        rigid, bodies = self.model.rigid, len(self.model.body) + 1
        assert rigid is not None
        result = np.eye(self.model.size)
        result[:, :6] = rigid
        for n, dof in enumerate(DOFS):
            if (name := f"{FRAME}.{dof}") in self.model.coordinate:
                result[6 : 6 * bodies, self.model.coordinate.index(name)] = rigid[6 : 6 * bodies, n]
        body = [slice(6 * n, 6 * n + 6) for n in range(bodies)]
        for n, above in enumerate(self.parent):
            while above:
                result[body[n], body[above]] = rigid[body[n]] - rigid[body[above]] + np.eye(6)
                above = self.parent[above]
        return result[np.ix_(columns, columns)]
