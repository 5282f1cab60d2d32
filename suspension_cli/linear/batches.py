"""Equations of many builds: responses, stability.

The tensions of wires are unknowns, as in `pencil`, and all builds, or builds times frequencies, are
eliminated together (`elimination`), in chunks that stay in the cache; in real arithmetic if nothing
is lossy or damped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Protocol

import numpy as np

from suspension_cli.conventions import FRAME, SUPPORT
from suspension_cli.linear.elimination import Pattern, Positions, as_slice, by_body
from suspension_cli.linear.stretching import Stretching
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

RIGID = 64 * np.finfo(float).eps
"""Fraction of its terms below which omega^2 is a rounding error and the mode rigid."""
CHUNK = 512
"""Systems that are eliminated at once."""
ONE = np.ones(1)


class Term(Protocol):
    """A frequency-dependent part of many builds (`models.batch_terms.BatchTerm`)."""

    def add(
        self,
        dynamic: Complex[np.ndarray, "system coordinate coordinate"],
        compliance: Complex[np.ndarray, "system wire"],
        omega: Float[np.ndarray, " system"],
        which: Int[np.ndarray, " system"],
    ) -> None:
        """Add it to the stiffness of systems, or set the compliance of their wires."""
        ...


@dataclass(frozen=True)
class Part:
    """Matrices of builds times a function of frequency, in the equations of all coordinates.

    Attributes
    ----------
    matrix
        Of all builds, or (N, N); without `factor`, of some builds at each frequency.
    factor
        The function; None if there is a matrix for each build and frequency.
    used
        Elements that are not 0 in all builds.
    """

    matrix: Inexact[np.ndarray, "*build coordinate coordinate"]
    factor: Inexact[np.ndarray, " frequency"] | None
    used: Bool[np.ndarray, "coordinate coordinate"]

    @staticmethod
    def of(
        matrix: Inexact[np.ndarray, "*build coordinate coordinate"],
        factor: Inexact[np.ndarray, " frequency"] | None = ONE,
    ) -> Part:
        """Find the elements that are used."""
        return Part(matrix, factor, used(matrix))

    def elements(
        self,
        some: Positions,
        row: Int[np.ndarray, " element"],
        column: Int[np.ndarray, " element"],
    ) -> Inexact[np.ndarray, "element build frequency"]:
        """Gather elements of some builds."""
        if self.factor is None:
            chosen = gather(self.matrix, slice(None), row, column)
            return chosen.reshape(len(row), *self.matrix.shape[:-2])
        return gather(self.matrix, some, row, column) * self.factor


def used(matrix: Inexact[np.ndarray, "*build row column"]) -> Bool[np.ndarray, "row column"]:
    """Find elements that are not 0 in all builds: fast, from their bits but for the signs."""
    row, column = matrix.shape[-2:]
    count, words = math.prod(matrix.shape[:-2]), matrix.itemsize // 8
    bits = np.ascontiguousarray(matrix).view(np.uint64).reshape(count, row * column * words)
    some = np.bitwise_or.reduce(bits, axis=0) << np.uint64(1)
    return (some != 0).reshape(row, column, words).any(-1)


def gather(
    matrix: Inexact[np.ndarray, "*build row column"],
    some: Positions,
    row: Int[np.ndarray, " element"],
    column: Int[np.ndarray, " element"],
) -> Inexact[np.ndarray, "element build 1"]:
    """Gather elements of some builds, the builds on a contiguous axis."""
    rows, columns = matrix.shape[-2:]
    flat = matrix.reshape(math.prod(matrix.shape[:-2]), rows * columns)
    chosen = flat[some] if len(flat) > 1 else flat
    return chosen[:, row * columns + column].T[..., None]


def owners(model: LinearSystem) -> Int[np.ndarray, " own"]:
    """Order of coordinates without the support's: twice the number of their body.

    A blade's tip comes after the body below, so that it is eliminated before.
    """
    known, last = (SUPPORT, FRAME, *model.body), 6 * (len(model.body) + 1)
    body = [known.index(name.split(".", 1)[0]) for name in model.coordinate]
    return (2 * np.array(body) + (np.arange(model.size) >= last))[6:]


@dataclass(frozen=True)
class Equations:
    """Equations of many builds, with the tensions of their wires as unknowns.

    Attributes
    ----------
    parts
        Their sum is the stiffness without the stretching of wires, and what is added to it.
    form
        Elongation of each wire per coordinate.
    """

    parts: list[Part]
    form: Float[np.ndarray, "*build wire coordinate"]

    @cached_property
    def own(self) -> int:
        """Number of coordinates without the support's."""
        return self.form.shape[-1] - 6

    @cached_property
    def stretching(self) -> Bool[np.ndarray, "wire coordinate"]:
        """Elements of `form` that are not 0 in all builds."""
        return used(self.form)

    def pattern(
        self, owner: Int[np.ndarray, " own"], tensions: Int[np.ndarray, " wire"] | None = None
    ) -> Pattern:
        """Order coordinates and tensions for elimination, those of the last owner first.

        A tension belongs to the last body that it acts on (see `owners`), unless given.
        """
        form, own = self.stretching[:, 6:], self.own
        if tensions is None:
            tensions = np.asarray((form * owner).max(1, initial=0) // 2 * 2)
        coupled = np.eye(own + len(form), dtype=bool)
        for part in self.parts:
            coupled[:own, :own] |= part.used[6:, 6:]
        coupled[own:, :own], coupled[:own, own:] = form, form.T
        return _pattern(owner.tobytes() + tensions.tobytes(), coupled.tobytes())

    def elements(
        self,
        pattern: Pattern,
        some: Positions,
        compliance: Inexact[np.ndarray, "wire build frequency"],
    ) -> Inexact[np.ndarray, "element build frequency"]:
        """Assemble the elements of some builds."""
        row, column = (
            np.maximum(pattern.row, pattern.column),
            np.minimum(pattern.row, pattern.column),
        )
        kinds = (
            (part.matrix.dtype for part in self.parts),
            (part.factor for part in self.parts if part.factor is not None),
        )
        result = np.zeros(
            (len(row), *compliance.shape[1:]),
            dtype=np.result_type(compliance, *kinds[0], *kinds[1]),
        )
        # a tension's row; its coordinates are columns
        wire, from_ = row - self.own, 6 + column
        for part in self.parts:
            place = np.flatnonzero(wire < 0)
            place = place[part.used[6 + row[place], from_[place]]]
            result[place] += part.elements(some, 6 + row[place], from_[place])
        place = np.flatnonzero((wire >= 0) & (column < self.own))
        result[place] = gather(self.form, some, wire[place], from_[place])
        place = np.flatnonzero((wire >= 0) & (row == column))
        result[place] = -compliance[wire[place]]
        return result

    def pull(
        self,
        some: Positions,
        moves: Float[np.ndarray, "build 6 input"],
        result: Inexact[np.ndarray, "unknown input build frequency"],
    ) -> None:
        """Subtract the forces and elongations that motions of the support cause."""
        for column in np.flatnonzero(moves.any((0, 2))):
            moved = np.moveaxis(moves[some, column], 0, -1)[..., None]
            for part in self.parts:
                row = 6 + np.flatnonzero(part.used[6:, column])
                result[row - 6] -= part.elements(some, row, column + 0 * row)[:, None] * moved
            row = np.flatnonzero(self.stretching[:, column])
            result[self.own + row] -= (
                gather(self.form, some, row, column + 0 * row)[:, None] * moved
            )


@lru_cache(maxsize=64)
def _pattern(owner: bytes, coupled: bytes) -> Pattern:
    order = np.frombuffer(owner, dtype=int)
    return by_body(order, np.frombuffer(coupled, dtype=bool).reshape(len(order), -1))


def stretching_of(model: LinearSystem) -> Stretching | None:
    """Stretching of the wires of each build; None if only the whole stiffness is known."""
    own = model.stretched
    return own if own is not None and own.form.ndim > 2 else None


def of_stiffness(model: LinearSystem, *, lossy: bool = True) -> Equations:
    """Static equations of builds, with or without losses that do not depend on frequency."""
    full, form = model.stiffness if model.lossy is None else model.lossy, np.zeros((0, model.size))
    if (own := stretching_of(model)) is not None:
        full, form = own.soft, own.form
    return Equations([Part.of(full if lossy else np.real(full))], form)


def transfer(
    model: LinearSystem,
    terms: tuple[Term, ...],
    which: Int[np.ndarray, " build"],
    omega: Float[np.ndarray, " frequency"],
    moves: Float[np.ndarray, "every 6 input"],
    forces: Float[np.ndarray, "every own input"],
    rows: Float[np.ndarray, "every output own"],
) -> Inexact[np.ndarray, "build frequency output input"]:
    """Responses of linear forms of the coordinates of builds `which`.

    `terms` are the frequency-dependent parts of the model; `omega` in rad/s; `moves` of the
    support, `forces` and `rows` are those of all builds.
    """
    static, own = of_stiffness(model), model.size - 6
    static.parts.append(Part.of(model.mass, -(omega**2)))
    if model.damping.any():
        static.parts.append(Part.of(model.damping, 1j * omega))
    owner, result = owners(model), []
    seen = np.flatnonzero(rows.any((0, 1)))
    step = max(1, CHUNK // len(omega))
    for start in range(0, len(which), step):
        chosen = which[start : start + step]
        some = as_slice(chosen)
        shape = (len(chosen), len(omega))
        every = np.repeat(chosen, len(omega)), np.tile(omega, len(chosen))
        added, compliance = evaluate_terms(model, terms, *every)
        equations = static
        if added is not None:
            equations = replace(
                static,
                parts=[*static.parts, Part.of(added.reshape(*shape, *added.shape[1:]), None)],
            )
        pattern = equations.pattern(owner)
        elements = equations.elements(pattern, some, compliance.T.reshape(-1, *shape))
        right = np.zeros((pattern.size, moves.shape[-1], *shape), dtype=elements.dtype)
        right[:own] = np.moveaxis(forces[some], 0, -1)[..., None]
        equations.pull(some, moves, right)
        flat = pattern.solve(
            elements.reshape(len(elements), -1), right.reshape(*right.shape[:2], -1)
        )
        x = flat.reshape(right.shape)[seen]
        result.append(np.einsum("boc,cibf->bfoi", rows[some][..., seen], x))
    return np.concatenate(result)


def further_stiffness(
    model: LinearSystem,
    terms: tuple[Term, ...],
    which: Int[np.ndarray, " system"],
    omega: Float[np.ndarray, " system"],
) -> Complex[np.ndarray, "system coordinate coordinate"]:
    """Compute the frequency-dependent stiffness of systems, with that of stretching wires."""
    added, compliance = evaluate_terms(model, terms, which, omega)
    if added is None:
        return np.zeros((len(which), model.size, model.size), dtype=complex)
    if (own := stretching_of(model)) is not None:
        form, change = own.form[which], 1 / compliance - own.stiffness[which]
        added += (np.swapaxes(form, -1, -2) * change[:, None]) @ form
    return added


def evaluate_terms(
    model: LinearSystem,
    terms: tuple[Term, ...],
    which: Int[np.ndarray, " system"],
    omega: Float[np.ndarray, " system"],
) -> tuple[
    Complex[np.ndarray, "system coordinate coordinate"] | None, Inexact[np.ndarray, "system wire"]
]:
    """Compute the further stiffness of systems, and the compliance of their wires."""
    compliance: np.ndarray = np.zeros((len(which), 0))
    if (own := stretching_of(model)) is not None:
        compliance = 1 / own.stiffness[which]
    if not terms:
        return None, compliance
    compliance = compliance.astype(complex)
    added = np.zeros((len(which), model.size, model.size), dtype=complex)
    for term in terms:
        term.add(added, compliance, omega, which)
    return added, compliance


def grows(model: LinearSystem) -> Bool[np.ndarray, " build"]:
    """Find builds with an unstable mode: K + c M is not positive definite.

    The small c, `RIGID` times the sum of K/M, covers the rounding error of a rigid mode.
    """
    mass = np.broadcast_to(model.mass, model.stiffness.shape)
    own, inert = (np.abs(np.einsum("pnn->pn", part)[:, 6:]) for part in (model.stiffness, mass))
    scale = np.where(inert > 0, own / np.where(inert > 0, inert, 1.0), 0.0).sum(1)
    shifted = model.stiffness + RIGID * scale[:, None, None] * mass
    equations = Equations([Part.of(shifted)], np.zeros((0, model.size)))
    pattern, every = equations.pattern(owners(model)), np.arange(len(model.stiffness))
    elements = equations.elements(pattern, every, np.zeros((0, len(every), 1)))[..., 0]
    with np.errstate(all="ignore"):
        factors = pattern.factor(elements)
    return np.asarray(~(np.array(factors.pivots) > 0).all(0))
