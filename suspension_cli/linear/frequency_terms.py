"""Frequency-dependent terms of the stiffness: wires with mass, and losses.

Each term adds to the stiffness a few functions of frequency times constant matrices,

    Z(omega) = K + i omega C - omega^2 M + sum over terms and n of f_n(omega) A_n,

where K is the whole static, lossless stiffness: f_n(0) is 0 without loss. Equal wires share their
functions. The tension of a wire is a coordinate instead (`stretching`), as a stiff wire would cost
soft parts all their digits. It covers the odd stretching motion (the ends move apart); the rest, on
the even motion, is a function here. A term also computes its dissipation x^H Im(f A) x in a motion
x, by cause: sums of squares, in which nothing cancels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from suspension_cli.elements.beam import ELEMENT_PLACES
from suspension_cli.elements.dynamic_wire import COORDINATES, PARTS, TautWire, WireAtFrequencies
from suspension_cli.linear.stretching import distinct

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int


class Term(Protocol):
    """Frequency-dependent part of a linear system."""

    @property
    def columns(self) -> Any:
        """Numbers of the coordinates (c,) that it acts on, ascending."""
        ...

    @property
    def compact(self) -> Any:
        """A_n among these: (n, c, c), real and symmetric.

        Of wires, last that of the odd stretching motion, which the tensions cover.
        """
        ...

    @property
    def all_matrices(self) -> Any:
        """The same A_n among all coordinates."""
        ...

    @property
    def dispersive(self) -> bool:
        """Whether it is a function of a complex frequency, not a loss at that of oscillation."""
        ...

    @property
    def viscous(self) -> bool:
        """Whether it also acts on motion that does not oscillate."""
        ...

    def at(self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True) -> Evaluated:
        """Evaluate at frequencies in rad/s; complex steps differentiate by frequency."""
        ...

    def within(self, columns: Int[np.ndarray, " kept"]) -> Term:
        """Restrict to some coordinates."""
        ...

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> Term:
        """Change to new coordinates: old = `from_new` @ new."""
        ...


class Evaluated(Protocol):
    """One term at given frequencies (f,)."""

    def functions(
        self, which: Int[np.ndarray, " function"]
    ) -> list[Inexact[np.ndarray, " frequency"]]:
        """Select functions f_n by number, complex where lossy."""
        ...

    def all_functions(self) -> Inexact[np.ndarray, "function frequency"]:
        """Functions f_n of `Term.all_matrices`, for wires without mass."""
        ...

    def dissipated(
        self, motion: Inexact[np.ndarray, "coordinate frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, " frequency"]]:
        """Dissipation x^H Im(f A) x in motions, by (cause, temperature in K)."""
        ...


@dataclass(frozen=True)
class WireTerm:
    """Equal wires of one stage under equal tension.

    Attributes
    ----------
    stage
        Stage that hangs on them.
    strand
        The wire that all of them equal.
    forms
        Motion of the ends of each wire per coordinate, for each of `dynamic_wire.PARTS`.
    allowed
        Elements of a matrix that the symmetry allows.
    """

    stage: str
    strand: TautWire
    forms: dict[str, Float[np.ndarray, "wire _ coordinate"]]
    allowed: Bool[np.ndarray, "coordinate coordinate"]

    @cached_property
    def functions(self) -> tuple[tuple[str, int, int], ...]:
        """Part and element (i, j) of each f_n; the planes of a round wire share theirs."""
        simple = len(self.strand.fibre.sections) == 1
        parts = [part for part in PARTS if part != "bend-2" or not self.strand.round]
        result = []
        for part in parts:
            every = [(i, j) for i in range(COORDINATES[part]) for j in range(i, COORDINATES[part])]
            places = {"stretch": ((0, 0),), "twist": ((0, 0), (1, 1)) if simple else every}
            result += [
                (part, i, j) for i, j in places.get(part, ELEMENT_PLACES if simple else every)
            ]
        return tuple(result)

    @property
    def dispersive(self) -> bool:
        """Whether the wires have mass."""
        return self.strand.massive

    @property
    def viscous(self) -> bool:
        """Loss angles act on oscillations alone."""
        return False

    @cached_property
    def columns(self) -> Int[np.ndarray, " column"]:
        """Coordinates that move the ends of the wires."""
        return np.flatnonzero(np.any([form.any((0, 1)) for form in self.forms.values()], axis=0))

    @cached_property
    def compact(self) -> Float[np.ndarray, "function column column"]:
        """A_n among `columns`, with that of the odd stretching motion last."""
        forms = {part: form[..., self.columns] for part, form in self.forms.items()}
        return np.where(self.allowed[np.ix_(self.columns, self.columns)], self.products(forms), 0.0)

    @property
    def all_matrices(self) -> Float[np.ndarray, "function coordinate coordinate"]:
        """A_n among all coordinates."""
        return _spread_columns(self.compact, self.columns, len(self.allowed))

    def products(
        self, forms: dict[str, Float[np.ndarray, "wire _ column"]]
    ) -> Float[np.ndarray, "function column column"]:
        """Sum `compact` over the wires, of motions like `forms`."""
        result = []
        for part, i, j in (*self.functions, ("stretch", 1, 1)):
            total = 0.0
            for name in ("bend-1", "bend-2") if part == "bend-1" and self.strand.round else (part,):
                product = forms[name][:, i].T @ forms[name][:, j]
                total = total + (product if i == j else product + product.T)
            result.append(total)
        return np.array(result)

    def at(self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True) -> EvaluatedWires:
        """Evaluate at frequencies in rad/s."""
        strand = self.strand if lossy else replace(self.strand, lossy=False)
        return EvaluatedWires(self, strand.at(omega))

    @cached_property
    def distinct(self) -> dict[str, DistinctMotions]:
        """Motions of the ends that differ by more than sign; of round wires in both planes."""
        return self._distinct(0)

    @cached_property
    def distinct_at_rest(self) -> dict[str, DistinctMotions]:
        """As `distinct`, with the support, the first 6 coordinates, at rest."""
        return self._distinct(6)

    def _distinct(self, first: int) -> dict[str, DistinctMotions]:
        forms = {
            part: form * (np.arange(form.shape[-1]) >= first) for part, form in self.forms.items()
        }
        if self.strand.round:
            planes = forms.pop("bend-1"), forms.pop("bend-2")
            forms = {"bend-1": np.concatenate(planes), **forms}
        found = {part: DistinctMotions.of(form) for part, form in forms.items()}
        return {part: motions for part, motions in found.items() if len(motions.count)}

    def within(self, columns: Int[np.ndarray, " kept"]) -> WireTerm:
        """Restrict to some coordinates."""
        largest = {part: np.abs(form).max(initial=0.0) for part, form in self.forms.items()}
        some = {
            part: np.where(np.abs(f := form[..., columns]) > 1e-14 * largest[part], f, 0.0)
            for part, form in self.forms.items()
        }
        return WireTerm(self.stage, self.strand, some, self.allowed[np.ix_(columns, columns)])

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> WireTerm:
        """Change to new coordinates."""
        reach = (from_new != 0).astype(float)
        forms = {part: form @ from_new for part, form in self.forms.items()}
        return WireTerm(self.stage, self.strand, forms, reach.T @ self.allowed @ reach > 0)


def _spread_columns(
    compact: Float[np.ndarray, "function column column"],
    columns: Int[np.ndarray, " column"],
    size: int,
) -> Float[np.ndarray, "function coordinate coordinate"]:
    result = np.zeros((len(compact), size, size))
    result[:, columns[:, None], columns] = compact
    return result


def is_massive(term: Term) -> bool:
    """Whether a term is that of wires with mass."""
    return isinstance(term, WireTerm) and term.strand.massive


@dataclass(frozen=True)
class DistinctMotions:
    """Motions of the ends of wires per coordinate, in one part of `dynamic_wire.PARTS`.

    Attributes
    ----------
    columns
        The coordinates that move them.
    forms
        Motions that differ by more than sign.
    count
        Number of wires of each.
    """

    columns: Int[np.ndarray, " moving"]
    forms: Float[np.ndarray, "end row moving"]
    count: Float[np.ndarray, " row"]

    @staticmethod
    def of(forms: Float[np.ndarray, "wire end coordinate"]) -> DistinctMotions:
        """Find the motions that are not 0."""
        rows, members = distinct(forms.reshape(len(forms), -1))
        rows = rows.reshape(-1, *forms.shape[1:]).swapaxes(0, 1)
        columns = np.flatnonzero(rows.any((0, 1)))
        count = np.array([len(wires) for wires in members], dtype=float)
        return DistinctMotions(columns, rows[..., columns], count)

    def ends(
        self, motion: Inexact[np.ndarray, "coordinate frequency"]
    ) -> Inexact[np.ndarray, "end row frequency"]:
        """Motions of the ends from coordinates."""
        return multiply_real(self.forms, motion[self.columns])


def multiply_real(
    matrix: Float[np.ndarray, "*rows coordinate"],
    columns: Inexact[np.ndarray, "coordinate frequency"],
) -> Inexact[np.ndarray, "*rows frequency"]:
    """Multiply a real matrix by real or complex columns, in real arithmetic."""
    if not np.iscomplexobj(columns):
        return matrix @ columns
    return (matrix @ np.ascontiguousarray(columns).view(float)).view(complex)


@dataclass(frozen=True)
class EvaluatedWires:
    """Equal wires at given frequencies (f,)."""

    term: WireTerm
    moving: WireAtFrequencies

    def functions(
        self, which: Int[np.ndarray, " function"]
    ) -> list[Inexact[np.ndarray, " frequency"]]:
        """Select functions f_n by number."""
        static = self.term.strand.static
        wanted = [self.term.functions[n] for n in which]
        return [
            self.even_stiffness
            if part == "stretch"
            else self.moving.stiffness(part)[i, j] - static[part][i, j]
            for part, i, j in wanted
        ]

    def all_functions(self) -> Inexact[np.ndarray, "function frequency"]:
        """Functions f_n of `all_matrices`.

        For wires without mass: only the odd motion of their ends stretches them.
        """
        odd = self.stretching[2] - self.term.strand.static["stretch"][1, 1]
        return np.stack([*self.functions(np.arange(len(self.term.functions))), odd])

    @property
    def even_stiffness(self) -> Inexact[np.ndarray, " frequency"]:
        """Stiffness F_ss - F_sa^2 / F_aa of the even motion, with the tension a coordinate."""
        even, mixed, odd = self.stretching
        return even - mixed**2 / odd

    @property
    def stretching(
        self,
    ) -> tuple[
        Inexact[np.ndarray, " frequency"],
        Inexact[np.ndarray, " frequency"],
        Inexact[np.ndarray, " frequency"],
    ]:
        """Stretching stiffness F_ss, F_sa, F_aa of even (s) and odd (a) motion of the ends."""
        whole = self.moving.stiffness("stretch")
        return whole[0, 0], whole[0, 1], whole[1, 1]

    def dissipated(
        self, motion: Inexact[np.ndarray, "coordinate frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, " frequency"]]:
        """Dissipation x^H Im(f A) x by bending at either end, stretching, torsion and gas."""
        fibre, gas = self.term.strand.fibre, self.term.strand.surrounded
        upper, lower = fibre.temperature
        temperatures = {
            "bending-upper": upper,
            "bending-lower": lower,
            "gas": gas.temperature if gas else 0.0,
        }
        result: dict[tuple[str, float], Float[np.ndarray, " frequency"]] = {}
        moves = self.term.distinct if motion[:6].any() else self.term.distinct_at_rest
        for part, own in moves.items():
            for cause, value in self.moving.dissipated(part, own.ends(motion)).items():
                key = (f"{self.term.stage}.{cause}", temperatures.get(cause, (upper + lower) / 2))
                result[key] = result.get(key, 0.0) + own.count @ value
        return result


@dataclass(frozen=True)
class LossTerm:
    """Loss of a constant stiffness, i phi(omega) K, or of a damper, i omega C.

    A stiffness given as a table against frequency also changes its real part.

    Attributes
    ----------
    cause
        For example ``upper.blades``.
    temperature
        K.
    matrix
        K in N/m, or C in N s/m.
    angle
        phi (f,) of omega (f,); omega itself for a damper.
    elastic
        Whether the matrix also stores energy.
    storage
        Relative change (f,) of Re K from its static value; None if constant.
    """

    cause: str
    temperature: float
    matrix: Float[np.ndarray, "*#batch coordinate coordinate"]
    angle: Callable[[Inexact[np.ndarray, " frequency"]], Inexact[np.ndarray, " frequency"]]
    elastic: bool = True
    storage: (
        Callable[[Inexact[np.ndarray, " frequency"]], Inexact[np.ndarray, " frequency"]] | None
    ) = None

    @property
    def dispersive(self) -> bool:
        """Whether this is a damper."""
        return not self.elastic

    @property
    def viscous(self) -> bool:
        """Whether this is a damper."""
        return not self.elastic

    @cached_property
    def columns(self) -> Int[np.ndarray, " column"]:
        """Coordinates that it acts on."""
        return np.flatnonzero(self.matrix.any(0))

    @cached_property
    def compact(self) -> Float[np.ndarray, "1 column column"]:
        """The matrix A_1 among `columns`."""
        return self.matrix[None, self.columns[:, None], self.columns]

    @property
    def all_matrices(self) -> Float[np.ndarray, "1 coordinate coordinate"]:
        """The matrix A_1."""
        return self.matrix[None]

    def at(self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True) -> EvaluatedLoss:
        """Evaluate at frequencies in rad/s."""
        # loss angles are taken at the frequency of oscillation, the real part
        at = np.real(omega) if self.elastic else omega
        stored = None if self.storage is None else self.storage(np.real(omega))
        return EvaluatedLoss(self, self.angle(at) if lossy else np.zeros(at.shape), lossy, stored)

    def within(self, columns: Int[np.ndarray, " kept"]) -> LossTerm:
        """Restrict to some coordinates."""
        return LossTerm(
            self.cause,
            self.temperature,
            self.matrix[np.ix_(columns, columns)],
            self.angle,
            self.elastic,
            self.storage,
        )

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> LossTerm:
        """Change to new coordinates."""
        return LossTerm(
            self.cause,
            self.temperature,
            from_new.T @ self.matrix @ from_new,
            self.angle,
            self.elastic,
            self.storage,
        )


@dataclass(frozen=True)
class EvaluatedLoss:
    """One loss at given frequencies: its angle and its relative change of Re K (f,)."""

    term: LossTerm
    angle: Inexact[np.ndarray, " frequency"]
    lossy: bool
    stored: Inexact[np.ndarray, " frequency"] | None = None

    def functions(
        self, which: Int[np.ndarray, " function"]
    ) -> list[Inexact[np.ndarray, " frequency"]]:
        """Select functions f_n by number."""
        value = 1j * self.angle if self.lossy else self.angle
        return [value if self.stored is None else value + self.stored] * len(which)

    def all_functions(self) -> Inexact[np.ndarray, "1 frequency"]:
        """The function f_1."""
        return np.stack(self.functions(np.arange(1)))

    def dissipated(
        self, motion: Inexact[np.ndarray, "coordinate frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, " frequency"]]:
        """Dissipation x^H Im(f A) x."""
        return {
            (self.term.cause, self.term.temperature): self.angle
            * quadratic_form(self.term.matrix, motion)
        }


def quadratic_form(
    matrix: Float[np.ndarray, "coordinate coordinate"],
    motion: Inexact[np.ndarray, "coordinate frequency"],
) -> Float[np.ndarray, " frequency"]:
    """Compute x^H A x of a symmetric real matrix A and columns x."""
    used = np.flatnonzero(matrix.any(0))
    x = motion[used]
    return np.real(np.conj(x) * multiply_real(matrix[np.ix_(used, used)], x)).sum(0)
