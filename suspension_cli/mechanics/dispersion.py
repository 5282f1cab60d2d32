"""What depends on frequency beyond K + i omega C - omega^2 M: wires with mass, and everything that is lossy.

Each term adds to the stiffness of a model a few functions of frequency times constant matrices,

    Z(omega) = K + i omega C - omega^2 M + sum over terms and n of f_n(omega) A_n,

where K holds the static, lossless stiffness of everything: f_n(0) without loss is 0.  All wires that are alike share their functions.
The odd motion of the ends of a wire is not among these functions: a stiff wire would drown what is soft.  Its tension is a coordinate instead
(`mechanics.stretching`), and what is left of the stretching acts on the even motion.
A term also tells what it dissipates in a motion x, x^H Im(f A) x, split by its causes: sums of squares, in which nothing cancels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from suspension_cli.mechanics.beam import PLACE
from suspension_cli.mechanics.fibre import PARTS, WIDTH, Moving, Strand


class Term(Protocol):
    """A part of a model that depends on frequency."""

    @property
    def matrices(self) -> Any:
        """A_n: (n, N, N), real and symmetric."""
        ...

    @property
    def all_matrices(self) -> Any:
        """A_n with that of the odd motion of stretching, which `matrices` leaves to the tensions, last."""
        ...

    def at(self, omega: Any, *, lossy: bool = True) -> Evaluated:
        """The term at frequencies (f,), rad/s; complex to differentiate by them."""
        ...

    def within(self, columns: Any) -> Term:
        """The same for some of the coordinates, in which the others do not take part."""
        ...

    def spread(self, from_new: Any) -> Term:
        """The same for new coordinates, from which the old ones follow as `from_new` (N, N') @ new."""
        ...


class Evaluated(Protocol):
    """A term at given frequencies."""

    def functions(self, which: Any) -> Any:
        """Some of the f_n: (w, f), complex where lossy."""
        ...

    def all_functions(self) -> Any:
        """The f_n (n, f) of `Term.all_matrices`, for wires without mass."""
        ...

    def dissipated(self, motion: Any) -> dict[tuple[str, float], Any]:
        """x^H Im(f A) x (f,) for motions (N, f), by name of the cause and its temperature (K)."""
        ...


@dataclass(frozen=True)
class WireTerm:
    """Wires of one kind: alike in everything, under the same tension.

    Attributes
    ----------
    stage : str
        Whose wires they are.
    strand : Strand
    forms : dict of (w, c, N) arrays
        How the ends of each wire move with the coordinates, for each of `fibre.PARTS`.
    allowed : (N, N) bool array
        Elements that a symmetry does not forbid.
    """

    stage: str
    strand: Strand
    forms: dict[str, Any]
    allowed: Any

    @cached_property
    def functions(self) -> tuple[tuple[str, int, int], ...]:
        """Part and place of each f_n; both planes of a round wire share theirs."""
        simple = len(self.strand.fibre.sections) == 1
        parts = [part for part in PARTS if part != "bend-2" or not self.strand.round]
        result = []
        for part in parts:
            every = [(i, j) for i in range(WIDTH[part]) for j in range(i, WIDTH[part])]
            places = {"stretch": ((0, 0),), "twist": ((0, 0), (1, 1)) if simple else every}
            result += [(part, i, j) for i, j in places.get(part, PLACE if simple else every)]
        return tuple(result)

    @cached_property
    def matrices(self) -> Any:
        """A_n: (n, N, N)."""
        result = []
        for part, i, j in self.functions:
            total = 0.0
            for name in ("bend-1", "bend-2") if part == "bend-1" and self.strand.round else (part,):
                product = self.forms[name][:, i].T @ self.forms[name][:, j]
                total = total + (product if i == j else product + product.T)
            result.append(np.where(self.allowed, total, 0.0))
        return np.array(result)

    @cached_property
    def all_matrices(self) -> Any:
        """A_n with that of the odd motion of stretching last: (n + 1, N, N)."""
        odd = self.forms["stretch"][:, 1]
        return np.concatenate([self.matrices, np.where(self.allowed, odd.T @ odd, 0.0)[None]])

    def at(self, omega: Any, *, lossy: bool = True) -> EvaluatedWires:
        """The wires at frequencies (f,)."""
        strand = self.strand if lossy else replace(self.strand, lossy=False)
        return EvaluatedWires(self, strand.at(omega))

    @cached_property
    def distinct(self) -> dict[str, tuple[Any, Any]]:
        """Forms that differ by more than their sign, and how many wires have each: (r, c, N) and (r,)."""
        result = {}
        for part, forms in self.forms.items():
            size = np.abs(forms).max((1, 2), keepdims=True)
            kept = forms[size[:, 0, 0] > 0]
            rows: list[Any] = []
            count: list[float] = []
            for form in kept:
                near = 1e-13 * np.abs(form).max()
                same = next((n for n, row in enumerate(rows) if min(np.abs(row - form).max(), np.abs(row + form).max()) <= near), None)
                if same is None:
                    rows.append(form)
                    count.append(1.0)
                else:
                    count[same] += 1.0
            result[part] = (np.array(rows), np.array(count))
        return result

    def within(self, columns: Any) -> WireTerm:
        """The same for some of the coordinates."""
        largest = {part: np.abs(form).max(initial=0.0) for part, form in self.forms.items()}
        some = {part: np.where(np.abs(f := form[..., columns]) > 1e-14 * largest[part], f, 0.0) for part, form in self.forms.items()}
        return WireTerm(self.stage, self.strand, some, self.allowed[np.ix_(columns, columns)])

    def spread(self, from_new: Any) -> WireTerm:
        """The same for new coordinates."""
        reach = (from_new != 0).astype(float)
        forms = {part: form @ from_new for part, form in self.forms.items()}
        return WireTerm(self.stage, self.strand, forms, reach.T @ self.allowed @ reach > 0)


@dataclass(frozen=True)
class EvaluatedWires:
    """Wires of one kind at given frequencies."""

    term: WireTerm
    moving: Moving

    def functions(self, which: Any) -> Any:
        """Some of the f_n: (w, f)."""
        static = self.term.strand.static
        wanted = [self.term.functions[n] for n in which]
        return np.stack([self.beside if part == "stretch" else self.moving.stiffness(part)[i, j] - static[part][i, j] for part, i, j in wanted])

    def all_functions(self) -> Any:
        """The f_n (n + 1, f) of all matrices, for wires without mass: only the odd motion of their ends stretches these."""
        odd = self.stretching[2] - self.term.strand.static["stretch"][1, 1]
        return np.concatenate([self.functions(range(len(self.term.functions))), odd[None]])

    @property
    def beside(self) -> Any:
        """Stiffness (f,) of the even motion where the tension is a coordinate: F_ss - F_sa^2 / F_aa."""
        even, mixed, odd = self.stretching
        return even - mixed**2 / odd

    @property
    def stretching(self) -> tuple[Any, Any, Any]:
        """F_ss, F_sa, F_aa (f,) of stretching."""
        whole = self.moving.stiffness("stretch")
        return whole[0, 0], whole[0, 1], whole[1, 1]

    def dissipated(self, motion: Any) -> dict[tuple[str, float], Any]:
        """x^H Im(f A) x (f,), split into bending at the upper and lower end, stretching, torsion and gas."""
        fibre, around = self.term.strand.fibre, self.term.strand.surrounded
        upper, lower = fibre.temperature
        warmth = {"bending-upper": upper, "bending-lower": lower, "gas": around.temperature if around else 0.0}
        result: dict[tuple[str, float], Any] = {}
        for part in PARTS:
            rows, count = self.term.distinct[part]
            if not len(rows):
                continue
            ends = np.moveaxis(rows @ motion, 0, 1)  # (c, r, f)
            for cause, value in self.moving.dissipated(part, ends).items():
                key = (f"{self.term.stage}.{cause}", warmth.get(cause, (upper + lower) / 2))
                result[key] = result.get(key, 0.0) + count @ value
        return result


@dataclass(frozen=True)
class LossTerm:
    """A constant stiffness (or damping) that dissipates: i phi(omega) K, or i omega C.

    Attributes
    ----------
    cause : str
        ``upper.blades`` and so on.
    temperature : float
        K.
    matrix : (N, N) array
        K in N/m, or C in N s/m.
    angle : callable
        phi (f,) of omega (f,); omega itself for a damping.
    elastic : bool
        Whether the matrix stores energy too.
    """

    cause: str
    temperature: float
    matrix: Any
    angle: Callable[[Any], Any]
    elastic: bool = True

    @property
    def matrices(self) -> Any:
        """A_n: (1, N, N)."""
        return self.matrix[None]

    @property
    def all_matrices(self) -> Any:
        """A_n: (1, N, N)."""
        return self.matrices

    def at(self, omega: Any, *, lossy: bool = True) -> EvaluatedLoss:
        """The loss at frequencies (f,)."""
        angle = self.angle(np.real(omega) if self.elastic else omega)  # a loss angle is that at the frequency of the oscillation
        return EvaluatedLoss(self, angle if lossy else np.zeros(np.shape(omega)), lossy)

    def within(self, columns: Any) -> LossTerm:
        """The same for some of the coordinates."""
        return LossTerm(self.cause, self.temperature, self.matrix[np.ix_(columns, columns)], self.angle, self.elastic)

    def spread(self, from_new: Any) -> LossTerm:
        """The same for new coordinates."""
        return LossTerm(self.cause, self.temperature, from_new.T @ self.matrix @ from_new, self.angle, self.elastic)


@dataclass(frozen=True)
class EvaluatedLoss:
    """A loss at given frequencies: its angle (f,)."""

    term: LossTerm
    angle: Any
    lossy: bool

    def functions(self, which: Any) -> Any:
        """Some of the f_n: (w, f)."""
        return (1j * self.angle if self.lossy else self.angle)[None][which]

    def all_functions(self) -> Any:
        """The f_n: (1, f)."""
        return self.functions(slice(None))

    def dissipated(self, motion: Any) -> dict[tuple[str, float], Any]:
        """x^H Im(f A) x (f,)."""
        value = np.einsum("if,if->f", np.conj(motion), self.term.matrix @ motion).real
        return {(self.term.cause, self.term.temperature): self.angle * value}
