"""Terms of wires that bend and twist, with losses and mass.

Equal wires of one design share their functions of frequency; those of many builds have each their
own. The stiffness k(omega) between the ends of a stretched wire is no function of the term: the
tension is an unknown instead (`pencil`), as a stiff wire would cost soft parts all their digits.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
>>> [wires] = [term for term in model.terms if isinstance(term, WireTerm)]
>>> wires.stage, len(wires.number)
('test', 4)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from suspension_cli.design.materials import Bulk
from suspension_cli.elements import sampled_wire
from suspension_cli.elements.dynamic_wire import PARTS, TautWire, WireAtFrequencies
from suspension_cli.elements.tensioned_beam import ELEMENT_PLACES
from suspension_cli.elimination import ROUNDING, multiply_real, sizes
from suspension_cli.linear.terms import EvaluatedTerm, Term

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

    from suspension_cli.linear.terms import Dissipation, Selection
    from suspension_cli.scene.scene import Section

    Ends = dict[str, tuple[Float[np.ndarray, "_ row own"], Float[np.ndarray, " row"]]]
    """Motions of the ends that differ by more than sign, by part, and how often each occurs."""

DIAGONAL = ((0, 0), (1, 1))
"""Places of the elements of a wire without mass, on the slopes of both ends."""
ALIKE = 1e-13
"""Relative difference of two linear forms that counts as rounding."""


@dataclass(frozen=True)
class WireTerm(Term):
    """Equal wires of one stage under equal tension; of many builds, wires of equal sections.

    Attributes
    ----------
    strand
        The wire that all of them equal; of many builds with arrays (wire, build) of numbers.
    number
        Their numbers among the wires of the scene.
    acts_on
        Coordinates, of `size`, that move their ends.
    motion
        Motion of the ends of each wire per such coordinate, for each of `dynamic_wire.PARTS`.
    """

    stage: str
    strand: TautWire
    number: Int[np.ndarray, " wire"]
    acts_on: Int[np.ndarray, " column"]
    motion: dict[str, Float[np.ndarray, "*build wire _ column"]]
    size: int

    @property
    def has_complex_frequency(self) -> bool:
        """Whether the wires have mass, which acts on any motion exp(s t)."""
        return self.strand.massive

    @cached_property
    def columns(self) -> Int[np.ndarray, " column"]:
        """Coordinates that move their ends."""
        return self.acts_on

    @property
    def static_stretching(self) -> Any:
        """Static stiffness k between the ends of a wire, N/m, without loss."""
        sections = self.strand.fibre.sections
        return 1 / sum(section.length / section.stretching for section in sections)

    @cached_property
    def forms(self) -> dict[str, Float[np.ndarray, "*build wire _ coordinate"]]:
        """`motion` per coordinate of the system."""
        to_all = np.eye(self.size)[self.acts_on]
        return {part: rows @ to_all for part, rows in self.motion.items()}

    @cached_property
    def resisted(self) -> dict[str, list[Float[np.ndarray, "*build wire column"]]]:
        """Motions of the wires, by part, that `PartAtFrequencies.change` resists.

        The first of stretching is the elongation, which the tension covers.
        """
        massive = self.strand.massive
        half = sum(section.length for section in self.strand.fibre.sections) / 2
        if np.ndim(half) == 2:
            half = np.asarray(half).T[..., None]  # builds are in front here
        result = {}
        for part, rows in self.motion.items():
            each = [rows[..., n, :] for n in range(rows.shape[-2])]
            if _bends(part):
                even, even_turn, odd, odd_turn = each
                chord = odd / half
                off = odd_turn - chord
                result[part] = [even, even_turn, chord, off] if massive else [even_turn, off]
            else:
                even, odd = each
                ends = [even - odd, even + odd] if massive else []
                result[part] = [2 * odd, *ends]
        return result

    @cached_property
    def places(self) -> tuple[tuple[str, int, int], ...]:
        """Part and two of its `resisted` of each f_n; the planes of a round wire share theirs."""
        uniform = len(self.strand.fibre.sections) == 1
        result: list[tuple[str, int, int]] = []
        for part in PARTS:
            if part == "bend-2" and self.strand.round:
                continue
            size = len(self.resisted[part])
            if not _bends(part):
                # the springs at both ends of a uniform wire are equal
                last = min(size, 2) if uniform else size
                first = int(part == "stretch")
                result += [(part, i, i) for i in range(first, last)]
            elif uniform:
                elements = ELEMENT_PLACES if size > 2 else DIAGONAL
                result += [(part, *element) for element in elements]
            else:
                result += [(part, i, j) for i in range(size) for j in range(i, size)]
        return tuple(result)

    @cached_property
    def compact(self) -> Float[np.ndarray, "function column column"]:
        """A_n among `columns`."""
        return self._products(self.resisted)

    def _products(
        self, resisted: dict[str, list[Float[np.ndarray, "wire column"]]]
    ) -> Float[np.ndarray, "function column column"]:
        """Sum `compact` over the wires, of motions like `resisted`."""
        result = np.zeros((len(self.places), len(self.acts_on), len(self.acts_on)))
        uniform = len(self.strand.fibre.sections) == 1
        for n, (part, i, j) in enumerate(self.places):
            shared = [(part, i, j)]
            if part == "bend-1" and self.strand.round:
                shared.append(("bend-2", i, j))
            if uniform and i and not _bends(part):
                shared.append((part, 2, 2))
            for name, k, m in shared:
                product = resisted[name][k].T @ resisted[name][m]
                result[n] += product if k == m else product + product.T
        return result

    def rounding(
        self, place: Int[np.ndarray, " column"]
    ) -> Float[np.ndarray, "function column column"]:
        """Largest rounding errors of the elements of `compact`."""
        forms = {
            part: list(sizes(np.array(rows), None, place)) for part, rows in self.resisted.items()
        }
        return ROUNDING * self._products(forms)

    def at(self, omega: Inexact[np.ndarray, " system"], *, lossy: bool = True) -> EvaluatedWires:
        """Evaluate at frequencies in rad/s; of many builds, at one each."""
        strand = self.strand if lossy else replace(self.strand, lossy=False)
        return EvaluatedWires(self, sampled_wire.at(strand, omega))

    def within(self, keep: Int[np.ndarray, " own"]) -> Ends:
        """Motions of the ends that differ by more than sign, of both planes if equal; how often."""
        forms = {part: rows[..., keep] for part, rows in self.forms.items()}
        if self.strand.round:
            both_planes = [forms["bend-1"], forms.pop("bend-2")]
            forms["bend-1"] = np.concatenate(both_planes)
        result = {}
        for part, form in forms.items():
            rows, members = distinct(form.reshape(len(form), -1))
            if members:
                rows = rows.reshape(-1, *form.shape[1:]).swapaxes(0, 1)
                count = np.array([len(wires) for wires in members], dtype=float)
                result[part] = rows, count
        return result

    def with_loss_angle(self, angle: float) -> WireTerm:
        """The wires with one loss angle (rad) in all deformations, in vacuum."""
        fibre = self.strand.fibre
        losses = (Bulk(angle),)
        sections = tuple(
            replace(
                section,
                losses=losses,
                damper=section.damper and msgspec.structs.replace(section.damper, loss_angle=angle),
            )
            for section in fibre.sections
        )
        fibre = replace(fibre, sections=sections)
        return replace(self, strand=replace(self.strand, fibre=fibre, surrounded=None))

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> WireTerm:
        """Change to new coordinates: old = `from_new` @ new."""
        moved = from_new[self.acts_on]
        motion = {part: rows @ moved for part, rows in self.motion.items()}
        moves = [rows.any(tuple(range(rows.ndim - 1))) for rows in motion.values()]
        some = np.any(moves, axis=0)
        motion = {part: np.compress(some, rows, axis=-1) for part, rows in motion.items()}
        return replace(self, acts_on=np.flatnonzero(some), motion=motion, size=len(from_new.T))

    def select(self, which: Selection) -> WireTerm:
        """Select some of many builds."""
        fibre = self.strand.fibre
        sections = tuple(_select_section(section, which) for section in fibre.sections)
        tension = np.asarray(self.strand.tension)[..., which]
        strand = replace(self.strand, fibre=replace(fibre, sections=sections), tension=tension)
        motion = {part: rows[which] for part, rows in self.motion.items()}
        return replace(self, strand=strand, motion=motion)


def _bends(part: str) -> bool:
    """Whether a part of `dynamic_wire.PARTS` is bending."""
    return part.startswith("bend")


def _select_section(section: Section, which: Selection) -> Section:
    """Select the numbers of a section of wires of many builds."""
    names = ("length", "stretching", "torsion_factor")
    values = {name: getattr(section, name) for name in names}
    return replace(
        section, **{name: value[..., which] for name, value in values.items() if np.ndim(value)}
    )


def is_massive(term: Term) -> bool:
    """Whether a term is that of wires with mass."""
    return isinstance(term, WireTerm) and term.strand.massive


def distinct(
    forms: Float[np.ndarray, "wire coordinate"],
) -> tuple[Float[np.ndarray, "row coordinate"], list[list[int]]]:
    """Find the non-zero forms that differ by more than sign, and the wires of each.

    >>> distinct(np.array([[1.0, 2.0], [-1.0, -2.0], [0.0, 0.0]]))
    (array([[1., 2.]]), [[0, 1]])
    """
    size = np.abs(forms).max(1, initial=0.0)
    difference = np.abs(forms[:, None] - forms).max(2, initial=0.0)
    total = np.abs(forms[:, None] + forms).max(2, initial=0.0)
    alike = np.minimum(difference, total) <= ALIKE * size[:, None]
    members: list[list[int]] = []
    for n in np.flatnonzero(size):
        for group in members:
            if alike[n, group[0]]:
                group.append(int(n))
                break
        else:
            members.append([int(n)])
    return forms[[group[0] for group in members]], members


@dataclass(frozen=True)
class EvaluatedWires(EvaluatedTerm):
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
            result.append(change[i, j] if _bends(part) else change[i])
        return result

    @property
    def compliance(self) -> Inexact[np.ndarray, "*wire frequency"]:
        """1/k(omega) between the ends of a wire, m/N."""
        return 1 / self.moving["stretch"].change[0]

    @property
    def stiffness(self) -> Complex[np.ndarray, "build column column"]:
        """The sum of f_n A_n among `WireTerm.columns`, of many builds."""
        resisted = self.term.resisted
        places = [
            (part, i)
            for part, motions in resisted.items()
            for i in range(part == "stretch", len(motions))  # tensions cover the elongation
        ]
        count, wires, columns = resisted[PARTS[0]][0].shape
        rows = np.empty((count, len(places), wires, columns))
        forces = np.empty(rows.shape, dtype=complex)
        for n, (part, i) in enumerate(places):
            motions = resisted[part]
            # (..., wire, build) to (build, wire)
            change = np.swapaxes(self.moving[part].change[i], -1, -2)[..., None]
            rows[:, n] = motions[i]
            if not _bends(part):
                np.multiply(change, motions[i], out=forces[:, n])
                continue
            np.multiply(change[i], motions[i], out=forces[:, n])
            for j, motion in enumerate(motions):
                if j != i and change[j].any():
                    forces[:, n] += change[j] * motion
        rows = rows.reshape(count, -1, columns)
        pull = forces.reshape(rows.shape).view(float)
        return (rows.swapaxes(-1, -2) @ pull).view(complex)

    def dissipated(self, within: Ends, motion: Inexact[np.ndarray, "own frequency"]) -> Dissipation:
        """Compute the dissipation by part of a wire, `within` being that of `WireTerm.within`."""
        result: Dissipation = {}
        for part, (rows, count) in within.items():
            moved = multiply_real(rows, motion)
            for (cause, temperature), value in self.moving[part].dissipated(moved).items():
                key = f"{self.term.stage}.{cause}", temperature
                result[key] = result.get(key, 0.0) + count @ value
        return result
