"""Frequency-dependent terms of the stiffness: wires with mass, and losses.

Each term adds to the stiffness a few functions of frequency times constant matrices,

    Z(omega) = K + i omega C - omega^2 M + sum over terms and n of f_n(omega) A_n,

where K is the whole static, lossless stiffness: f_n(0) is 0 without loss. Equal wires of one design
share their functions; those of many builds have each their own. The stiffness k(omega) between the
ends of a stretched wire is no such function: the tension is an unknown instead (`pencil`), as a
stiff wire would cost soft parts all their digits. A term also computes its dissipation
x^H Im(f A) x in a motion x, by cause: sums of squares, in which nothing cancels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard

import numpy as np

from suspension_cli.elements.dynamic_wire import PARTS, TautWire, WireAtFrequencies
from suspension_cli.elements.tensioned_beam import ELEMENT_PLACES
from suspension_cli.elimination import multiply_real

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

    Function = Callable[[Inexact[np.ndarray, " frequency"]], Inexact[np.ndarray, " frequency"]]
    Ends = dict[str, tuple[Float[np.ndarray, "_ row own"], Float[np.ndarray, " row"]]]


@dataclass(frozen=True)
class WireTerm:
    """Equal wires of one stage under equal tension; of many builds, wires of equal sections.

    Attributes
    ----------
    strand
        The wire that all of them equal; of many builds with arrays (wire, build) of numbers.
    number
        Their numbers among the wires of the scene.
    columns
        Coordinates, of `size`, that move their ends.
    motion
        Motion of the ends of each wire per such coordinate, for each of `dynamic_wire.PARTS`.
    """

    stage: str
    strand: TautWire
    number: Int[np.ndarray, " wire"]
    columns: Int[np.ndarray, " column"]
    motion: dict[str, Float[np.ndarray, "*build wire _ column"]]
    size: int

    @property
    def dispersive(self) -> bool:
        """Whether the wires have mass."""
        return self.strand.massive

    @property
    def static_stretching(self) -> Any:
        """Static stiffness k between the ends of a wire, N/m, without loss."""
        sections = self.strand.fibre.sections
        return 1 / sum(section.length / section.stretching for section in sections)

    @cached_property
    def forms(self) -> dict[str, Float[np.ndarray, "*build wire _ coordinate"]]:
        """`motion` per coordinate of the system."""
        to_all = np.eye(self.size)[self.columns]
        return {part: rows @ to_all for part, rows in self.motion.items()}

    @cached_property
    def resisted(self) -> dict[str, list[Float[np.ndarray, "*build wire column"]]]:
        """Motions of the wires, by part, that `PartAtFrequencies.change` resists.

        The first of stretching is the elongation, which the tension covers.
        """
        result, massive = {}, self.strand.massive
        half = sum(section.length for section in self.strand.fibre.sections) / 2
        if np.ndim(half) == 2:
            half = np.asarray(half).T[..., None]  # builds are in front here
        for part, rows in self.motion.items():
            one = [rows[..., n, :] for n in range(rows.shape[-2])]
            if part.startswith("bend"):
                even, even_turn, odd, odd_turn = one
                chord = odd / half
                off = odd_turn - chord
                result[part] = [even, even_turn, chord, off] if massive else [even_turn, off]
            else:
                even, odd = one
                result[part] = [2 * odd, *([even - odd, even + odd] if massive else [])]
        return result

    @cached_property
    def places(self) -> tuple[tuple[str, int, int], ...]:
        """Part and two of its `resisted` of each f_n; the planes of a round wire share theirs."""
        simple, result = len(self.strand.fibre.sections) == 1, []
        for part in PARTS:
            if part == "bend-2" and self.strand.round:
                continue
            size = len(self.resisted[part])
            if not part.startswith("bend"):
                # the springs at both ends of a uniform wire are equal
                last = min(size, 2) if simple else size
                result += [(part, i, i) for i in range(int(part == "stretch"), last)]
            elif simple:
                result += [(part, *place) for place in (ELEMENT_PLACES if size > 2 else DIAGONAL)]
            else:
                result += [(part, i, j) for i in range(size) for j in range(i, size)]
        return tuple(result)

    @cached_property
    def compact(self) -> Float[np.ndarray, "function column column"]:
        """A_n among `columns`."""
        return self.products(self.resisted)

    def products(
        self, resisted: dict[str, list[Float[np.ndarray, "wire column"]]]
    ) -> Float[np.ndarray, "function column column"]:
        """Sum `compact` over the wires, of motions like `resisted`."""
        result = np.zeros((len(self.places), len(self.columns), len(self.columns)))
        simple = len(self.strand.fibre.sections) == 1
        for n, (part, i, j) in enumerate(self.places):
            shared = [(part, i, j)]
            if part == "bend-1" and self.strand.round:
                shared.append(("bend-2", i, j))
            if simple and i and not part.startswith("bend"):
                shared.append((part, 2, 2))
            for name, k, m in shared:
                product = resisted[name][k].T @ resisted[name][m]
                result[n] += product if k == m else product + product.T
        return result

    def at(self, omega: Inexact[np.ndarray, " system"], *, lossy: bool = True) -> EvaluatedWires:
        """Evaluate at frequencies in rad/s; of many builds, at one each."""
        strand = self.strand if lossy else replace(self.strand, lossy=False)
        return EvaluatedWires(self, strand.at(omega))

    def within(self, keep: Int[np.ndarray, " own"]) -> Ends:
        """Motions of the ends that differ by more than sign, of both planes if equal; how often."""
        forms = {part: rows[..., keep] for part, rows in self.forms.items()}
        if self.strand.round:
            forms["bend-1"] = np.concatenate([forms["bend-1"], forms.pop("bend-2")])
        result = {}
        for part, form in forms.items():
            rows, members = distinct(form.reshape(len(form), -1))
            if members:
                rows = rows.reshape(-1, *form.shape[1:]).swapaxes(0, 1)
                result[part] = rows, np.array([len(wires) for wires in members], dtype=float)
        return result

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> WireTerm:
        """Change to new coordinates: old = `from_new` @ new."""
        moved = from_new[self.columns]
        motion = {part: rows @ moved for part, rows in self.motion.items()}
        some = np.any([r.any(tuple(range(r.ndim - 1))) for r in motion.values()], axis=0)
        motion = {part: np.compress(some, rows, axis=-1) for part, rows in motion.items()}
        return replace(self, columns=np.flatnonzero(some), motion=motion, size=len(from_new.T))

    def select(self, which: Int[np.ndarray, " system"] | slice | int) -> WireTerm:
        """Select some of many builds."""
        fibre = self.strand.fibre
        names = ("length", "stretching", "torsion_factor")
        sections = tuple(
            replace(
                one, **{n: value[..., which] for n in names if np.ndim(value := getattr(one, n))}
            )
            for one in fibre.sections
        )
        fibre, tension = replace(fibre, sections=sections), np.asarray(self.strand.tension)
        strand = replace(self.strand, fibre=fibre, tension=tension[..., which])
        motion = {part: rows[which] for part, rows in self.motion.items()}
        return replace(self, strand=strand, motion=motion)


DIAGONAL = ((0, 0), (1, 1))
"""Places of the elements of a wire without mass, on the slopes of both ends."""


ALIKE = 1e-13
"""Relative difference of two linear forms that counts as rounding."""


def is_damper(term: Term) -> bool:
    """Whether a term is that of a damper."""
    return isinstance(term, LossTerm) and not term.elastic


def is_light(term: Term) -> TypeGuard[LossTerm]:
    """Whether a term is that of the light of a cavity."""
    return isinstance(term, LossTerm) and term.light is not None


def is_massive(term: Term) -> bool:
    """Whether a term is that of wires with mass."""
    return isinstance(term, WireTerm) and term.strand.massive


def distinct(
    forms: Float[np.ndarray, "wire coordinate"],
) -> tuple[Float[np.ndarray, "row coordinate"], list[list[int]]]:
    """Find the non-zero forms that differ by more than sign, and the wires of each."""
    rows: list[Float[np.ndarray, " coordinate"]] = []
    members: list[list[int]] = []
    for n, form in enumerate(forms):
        tolerance = ALIKE * np.abs(form).max(initial=0.0)
        for row, group in zip(rows, members, strict=True):
            if min(np.abs(row - form).max(), np.abs(row + form).max()) <= tolerance:
                group.append(n)
                break
        else:
            if tolerance:
                rows.append(form)
                members.append([n])
    return np.array(rows).reshape(-1, forms.shape[1]), members


@dataclass(frozen=True)
class EvaluatedWires:
    """Equal wires at given frequencies (f,), or the wires of many builds at one each."""

    term: WireTerm
    moving: WireAtFrequencies

    def functions(
        self, which: Int[np.ndarray, " function"]
    ) -> list[Inexact[np.ndarray, " #frequency"]]:
        """Select functions f_n by number."""
        result = []
        for part, i, j in (self.term.places[n] for n in which):
            change = self.moving[part].change
            result.append(change[i, j] if part.startswith("bend") else change[i])
        return result

    @property
    def compliance(self) -> Inexact[np.ndarray, "*wire frequency"]:
        """1/k(omega) between the ends of a wire, m/N."""
        return 1 / self.moving["stretch"].change[0]

    @property
    def stiffness(self) -> Complex[np.ndarray, "build column column"]:
        """The sum of f_n A_n among `WireTerm.columns`, of many builds."""
        rows, forces = [], []
        for part, motions in self.term.resisted.items():
            # (..., wire, build) to (build, wire)
            change = np.swapaxes(self.moving[part].change, -1, -2)[..., None]
            for i, one in enumerate(motions):
                if not part.startswith("bend"):
                    if part == "twist" or i:
                        rows.append(one)
                        forces.append(change[i] * one)
                    continue
                total = change[i, i] * one
                for j, other in enumerate(motions):
                    if j != i and change[i, j].any():
                        total += change[i, j] * other
                rows.append(one)
                forces.append(total)
        pull = np.ascontiguousarray(np.concatenate(forces, axis=-2)).view(float)
        return (np.concatenate(rows, axis=-2).swapaxes(-1, -2) @ pull).view(complex)

    def dissipated(
        self, ends: Ends, motion: Inexact[np.ndarray, "own frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, " frequency"]]:
        """Dissipation x^H Im(f A) x by part of a wire, `ends` being those of `WireTerm.within`."""
        fibre, gas = self.term.strand.fibre, self.term.strand.surrounded
        upper, lower = fibre.temperature
        temperatures = {
            "bending-upper": upper,
            "bending-lower": lower,
            "gas": gas.temperature if gas else 0.0,
        }
        result: dict[tuple[str, float], Float[np.ndarray, " frequency"]] = {}
        for part, (rows, count) in ends.items():
            moved = multiply_real(rows, motion)
            for cause, value in self.moving[part].dissipated(moved).items():
                key = (f"{self.term.stage}.{cause}", temperatures.get(cause, (upper + lower) / 2))
                result[key] = result.get(key, 0.0) + count @ value
        return result


@dataclass(frozen=True)
class LossTerm:
    """Loss of a constant stiffness, i phi(omega) K, or of a damper, i omega C.

    A stiffness given as a table against frequency also changes its real part; so does the light of
    a cavity, whose function is complex.

    Attributes
    ----------
    matrix
        K in N/m, or C in N s/m.
    angle
        phi (f,) of omega (f,); omega itself for a damper.
    elastic
        Whether the matrix also stores energy.
    storage
        Relative change (f,) of Re K from its static value; None if constant.
    light
        Pole and detuning (rad/s) of the cavity whose light acts (`models.cavity`); None for others.
    """

    cause: str
    temperature: float
    matrix: Float[np.ndarray, "*#batch coordinate coordinate"]
    angle: Function
    elastic: bool = True
    storage: Function | None = None
    light: tuple[float, float] | None = None

    @property
    def dispersive(self) -> bool:
        """Whether this is a damper."""
        return not self.elastic

    @cached_property
    def columns(self) -> Int[np.ndarray, " column"]:
        """Coordinates that it acts on."""
        return np.flatnonzero(self.matrix.any(tuple(range(self.matrix.ndim - 1))))

    @cached_property
    def compact(self) -> Float[np.ndarray, "_ column column"]:
        """The matrix A_1 among `columns`, as a stack of one, or of those of many builds."""
        own = self.matrix[..., self.columns[:, None], self.columns]
        return own if own.ndim > 2 else own[None]

    def at(self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True) -> EvaluatedLoss:
        """Evaluate at frequencies in rad/s."""
        # loss angles are taken at the frequency of oscillation, the real part
        at = np.real(omega) if self.elastic else omega
        angle = self.angle(at) if lossy else np.zeros(at.shape)
        value = 1j * angle if lossy else angle
        if self.storage is not None:
            value = value + self.storage(np.real(omega))
        return EvaluatedLoss(self, angle, value)

    def within(self, keep: Int[np.ndarray, " own"]) -> Float[np.ndarray, "own own"]:
        """The matrix among some coordinates."""
        return self.matrix[np.ix_(keep, keep)]

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> LossTerm:
        """Change to new coordinates."""
        return replace(self, matrix=from_new.T @ self.matrix @ from_new)

    def select(self, which: Int[np.ndarray, " system"] | slice | int) -> LossTerm:
        """Select some of many builds."""
        return self if self.matrix.ndim == 2 else replace(self, matrix=self.matrix[which])


@dataclass(frozen=True)
class EvaluatedLoss:
    """One loss at given frequencies: its angle and the function f_1."""

    term: LossTerm
    angle: Inexact[np.ndarray, " frequency"]
    value: Inexact[np.ndarray, " frequency"]

    def functions(
        self, which: Int[np.ndarray, " function"]
    ) -> list[Inexact[np.ndarray, " frequency"]]:
        """Select functions f_n by number."""
        return [self.value] * len(which)

    @property
    def stiffness(self) -> Inexact[np.ndarray, "system column column"]:
        """The function times the matrix, among `LossTerm.columns`."""
        return self.value[:, None, None] * self.term.compact

    def dissipated(
        self, matrix: Float[np.ndarray, "own own"], motion: Inexact[np.ndarray, "own frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, " frequency"]]:
        """Dissipation x^H Im(f A) x, with the `matrix` of `LossTerm.within`."""
        key = self.term.cause, self.term.temperature
        return {key: np.real(self.angle) * quadratic_form(matrix, motion)}


def quadratic_form(
    matrix: Float[np.ndarray, "coordinate coordinate"],
    motion: Inexact[np.ndarray, "coordinate frequency"],
) -> Float[np.ndarray, " frequency"]:
    """Compute x^H A x of a symmetric real matrix A and columns x."""
    used = np.flatnonzero(matrix.any(0))
    x = motion[used]
    return np.real(np.conj(x) * multiply_real(matrix[np.ix_(used, used)], x)).sum(0)


Term: TypeAlias = WireTerm | LossTerm
EvaluatedTerm: TypeAlias = EvaluatedWires | EvaluatedLoss
