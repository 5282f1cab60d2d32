"""Dynamic stiffness and dissipation of one wire in bending, stretching and twisting.

>>> import suspension_cli as sus
>>> from suspension_cli.scene.fibres import compose
>>> fibre = compose(sus.example("geo-silica-triple").design).wire[-1]
>>> wire = TautWire(fibre, tension=14.0, massive=True, lossy=False)
>>> (wire.held_resonances("bend-1", 2 * np.pi * 300.0) / (2 * np.pi)).round()  # violin modes, Hz
array([ 649., 1293.])

The motion of the two ends of a wire falls into four parts that do not couple (`PARTS`): bending in
the two principal planes (W_s, T_s, W_a, T_a each, see `elements.tensioned_beam`), stretching (U_s,
U_a, see `elements.joined_sections`) and twisting (the same two, in rad).

A wire under tension T resists twisting with GJ + T I_p/A (Buckley, Phil. Mag. 28, 778 (1914)), I_p
the polar second moment of its area A: at a twist theta' per length, a filament at the distance r
from the axis leans by r theta', so its part sigma dA of the tension pulls back with the torque
sigma r^2 theta' dA about the axis. This second term has no loss.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suspension_cli.design.schema import Gas
from suspension_cli.elements import (
    joined_sections,
    loss,
    resting,
    tensioned_beam,
    wire_damper,
)
from suspension_cli.elements.joined_sections import ENDS, EPS, Joined
from suspension_cli.scene.scene import Fibre, Section

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from jaxtyping import Float, Inexact, Int

    Product = Callable[[np.ndarray, np.ndarray], np.ndarray]
    """What is formed of motions: `product_of_each` of them, or `product_of_pairs`."""

PARTS = ("bend-1", "bend-2", "stretch", "twist")
COORDINATES = {"bend-1": 4, "bend-2": 4, "stretch": 2, "twist": 2}
"""Number of coordinates of each part."""
TOTAL = ("", 0.0)
"""Key of the dissipation by material and gas together, see `dissipation_forms`."""
DAMPERS = "dampers"
"""Cause of the dissipation in dampers on a wire."""
EQUAL_WITHIN = 1e-12
"""Relative difference of lengths, stiffnesses and tensions below which wires count as equal."""


@dataclass(frozen=True)
class TautWire:
    """A wire under tension (N).

    An array (..., f) of tensions, with such arrays as lengths of the fibre's sections, stands for
    wires of the same sections in many builds, each at one frequency.
    """

    fibre: Fibre
    tension: Inexact[np.ndarray, "*#wire frequency"] | float
    massive: bool  # whether it has inertia (`violin` model)
    lossy: bool
    surrounded: Gas | None = None  # by the gas that damps it

    @property
    def round(self) -> bool:
        """Whether both planes have the same bending stiffness."""
        return all(section.round for section in self.fibre.sections)

    @property
    def damped(self) -> bool:
        """Whether dampers are on it."""
        return any(section.damper is not None for section in self.fibre.sections)

    def at(self, omega: Inexact[np.ndarray, " frequency"]) -> WireAtFrequencies:
        """The wire at frequencies (f,), rad/s."""
        return WireAtFrequencies(self, omega)

    def stack(
        self, values: Sequence[Inexact[np.ndarray, "*#frequency"] | complex]
    ) -> Inexact[np.ndarray, "section *#frequency"]:
        """Stack numbers of the sections, with axes of length 1 where they do not vary."""
        axes = (1,) * max(np.ndim(self.tension), 1)
        shape = np.broadcast_shapes(axes, *map(np.shape, values))
        result = np.empty((len(values), *shape), dtype=np.result_type(*values))
        for row, value in zip(result, values, strict=True):
            row[...] = value
        return result

    @cached_property
    def lengths(self) -> Inexact[np.ndarray, "section *#frequency"]:
        """Lengths of the sections, m."""
        return self.stack([section.length for section in self.fibre.sections])

    @cached_property
    def tensions(self) -> Inexact[np.ndarray, "section *#frequency"]:
        """Tension in the middle of each section, N; the weight of a wire with mass changes it."""
        return self.stack([self.tension_of(section) for section in self.fibre.sections])

    def tension_of(self, section: Section) -> Inexact[np.ndarray, "*frequency"] | float:
        """Tension in the middle of a section, N."""
        return self.tension + (section.tension_offset if self.massive else 0.0)

    @cached_property
    def static_slopes(self) -> list[Inexact[np.ndarray, "2 2 *#frequency"]]:
        """Static stiffness of bending in each plane on (T_s, d), without loss, N m."""
        result = []
        for plane in (0, 1):
            rigidity = np.array([section.rigidity[plane] for section in self.fibre.sections])
            rigidity = rigidity.reshape(-1, *(1,) * (self.lengths.ndim - 1))
            result.append(resting.slope_stiffness(rigidity, self.tension, self.lengths).stiffness)
        return result

    @cached_property
    def static_torsion(self) -> Any:
        """Static stiffness against twisting, without loss, N m/rad."""
        sections = self.fibre.sections
        return 1 / sum(own.length / _twisting(own, self.tension) for own in sections)

    @cached_property
    def static(self) -> dict[str, Inexact[np.ndarray, "_ _"]]:
        """Static stiffness (c, c) of every part, without loss."""
        still = TautWire(self.fibre, self.tension, massive=False, lossy=False).at(np.zeros(1))
        return {part: still[part].stiffness[..., 0] for part in PARTS}

    def resonances_below(
        self, omega: Float[np.ndarray, " frequency"], parts: tuple[str, ...] = PARTS
    ) -> Int[np.ndarray, " frequency"]:
        """Count resonances (f,) below each omega (rad/s) with clamped ends, in the given parts."""
        there = replace(self, lossy=False).at(np.asarray(omega, dtype=float))
        return sum((there[part].resonances_below() for part in parts), np.zeros(1, dtype=int))

    def held_resonances(self, part: str, omega: float) -> Float[np.ndarray, " resonance"]:
        """Resonances (rad/s) of one part with clamped ends, up to the second above omega.

        By bisection on their number below a frequency, which misses none.
        """
        wanted = self.resonances_below(np.array([omega]), (part,))[0] + 2
        highest = 1.1 * omega
        while (count := self.resonances_below(np.array([highest]), (part,))[0]) < wanted:
            highest *= 1.5
        number = np.arange(1, count + 1)
        low = np.zeros(count)
        high = np.full(count, highest)
        for _ in range(40):
            middle = (low + high) / 2
            above = self.resonances_below(middle, (part,)) >= number
            low = np.where(above, low, middle)
            high = np.where(above, middle, high)
        return high


class WireAtFrequencies(dict[str, "PartAtFrequencies"]):
    """The parts of a wire at given frequencies (rad/s); both planes of a round wire are one."""

    def __init__(self, strand: TautWire, omega: Inexact[np.ndarray, " frequency"]) -> None:
        super().__init__()
        self.strand = strand
        self.omega = omega

    def __missing__(self, part: str) -> PartAtFrequencies:
        """Make a part when it is first needed."""
        if part == "bend-2" and self.strand.round:
            return self["bend-1"]
        self[part] = self.make(PARTS.index(part))
        return self[part]

    def make(self, number: int) -> PartAtFrequencies:
        """Make a part, by its number in `PARTS`."""
        return PartAtFrequencies(self.strand, self.omega, number)


class _Piece(NamedTuple):
    """Piece of a wire: number of its section, length (m), and the end that it is near, 0 or 1."""

    section: int
    length: float
    end: int


@dataclass(frozen=True)
class PartAtFrequencies:
    """One part of the motion of a wire at given frequencies, in rad/s.

    `number` is that of the part in `PARTS`; for bending also of the plane, as `Section.rigidity`.
    `bending_angles` keeps the loss angles of bending that are known, by losses, shape and
    temperature: pieces into which the wire is cut for its dissipation share them.
    """

    strand: TautWire
    omega: Inexact[np.ndarray, " frequency"]
    number: int
    bending_angles: dict[Any, Inexact[np.ndarray, "*frequency"]] = field(default_factory=dict)

    @property
    def bends(self) -> bool:
        """Whether this is bending in a plane."""
        return self.number < 2

    @property
    def sections(self) -> tuple[Section, ...]:
        """Sections of the wire."""
        return self.strand.fibre.sections

    @cached_property
    def stiffness(self) -> Inexact[np.ndarray, "end end *frequency"]:
        """Dynamic stiffness (c, c, f), N/m, N and N m."""
        own = self.joined_stiffness
        if not self.bends:
            between, upper, lower = own
            odd = upper + lower + 4 * between
            return np.array([[upper + lower, lower - upper], [lower - upper, odd]])
        result = np.zeros((4, 4, *own.shape[2:]), dtype=own.dtype)
        some = slice(None) if len(own) == 4 else slice(1, None, 2)
        result[some, some] = own
        result[2, 2] += sum(
            self.strand.tension_of(section) * section.length for section in self.sections
        )
        # phi = 2 W_a / L, d = T_a - phi
        for half in (result, result.swapaxes(0, 1)):
            half[2] -= half[3]
            half[2] *= 2 / self._length
        return result

    @cached_property
    def change(self) -> Inexact[np.ndarray, "*elements"]:
        """F(omega) - F(0), with F(0) without loss and inertia.

        Of bending on (W, T_s, phi, d), or without mass on (T_s, d) (see `elements.tensioned_beam`);
        of twisting as springs between the ends and from either end to the ground; of stretching F
        itself, as such springs.
        """
        own = self.joined_stiffness
        if PARTS[self.number] == "stretch":
            return own
        whole = own.copy()
        if not self.bends:
            whole[0] -= self.strand.static_torsion
            return whole
        still = self.strand.static_slopes[self.number]
        if len(whole) == 2:
            return whole - still
        whole[1::2, 1::2] -= still
        whole[2, 2] += sum(section.tension_offset * section.length for section in self.sections)
        return whole

    def resonances_below(self) -> Int[np.ndarray, " frequency"]:
        """Count resonances (f,) below each frequency with clamped ends.

        Those of the sections and of the dampers between them at rest, and those that joining them
        adds (see `elements.joined_sections`).
        """
        if not self.strand.massive:
            return np.zeros(np.shape(self.omega), dtype=int)
        if self.bends:
            below = tensioned_beam.resonances_below(self._waves)
        else:
            below = joined_sections.rod_resonances_below(*self._numbers, self.omega)
        of_dampers = sum(
            wire_damper.resonances_below(section.damper, PARTS[self.number], self.omega)
            for section in self.sections
        )
        return below.sum(0) + self._joined.negative + of_dampers

    def dissipated(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, "motion frequency"]]:
        """Dissipation x^H Im(F) x of motions x of the ends (m and rad), N m.

        By cause and temperature (K), that of the section or of the gas. Causes are ``stretching``
        or ``torsion``; or ``bending-upper`` and ``bending-lower``, split at the middle of the wire;
        causes of their own that losses of bending have; ``dampers``; and ``gas``.
        """
        losses, drag = self._material_and_gas(motion)
        result = self._by_cause(losses)
        for cause, lost in self._damper_losses(motion, product_of_each).items():
            result[cause] += np.maximum(lost, 0.0)
        around = self.strand.surrounded
        if drag is not None and around is not None and around.temperature is not None:
            result["gas", around.temperature] += drag.sum(0)
        return result

    def dissipation_forms(self) -> dict[tuple[str, float], Inexact[np.ndarray, "pair frequency"]]:
        """Hermitian forms G of dissipations x^H G x, by cause and temperature (K).

        Their elements on and above the diagonal, row by row. With gas, those of the material in
        vacuum and of the gas on a wire without losses, and their sum in truth, `TOTAL`. Near a
        resonance of the clamped wire they keep fewer digits than `dissipated`, as the wire moves
        much more than its ends there.
        """
        count = COORDINATES[PARTS[self.number]]
        units = np.broadcast_to(np.eye(count)[..., None], (count, count, len(self.omega)))
        losses = self._piece_losses(units, product_of_pairs)
        around = self.strand.surrounded
        if around is None or not self.strand.massive:
            result = self._by_cause(losses)
        else:
            material, drag = (
                own._piece_losses(units, product_of_pairs) for own in self.alone_and_elastic
            )
            result = self._by_cause(material)
            if around.temperature is not None:
                result["gas", around.temperature] = drag.sum(0)
            result[TOTAL] = losses.sum(0)
        for cause, lost in self._damper_losses(units, product_of_pairs).items():
            result[cause] += lost
        return result

    def _by_cause(
        self, losses: Inexact[np.ndarray, "piece motion frequency"]
    ) -> defaultdict[tuple[str, float], Any]:
        """Sum what `_pieces` dissipate by cause and temperature."""
        names = ("bending-upper", "bending-lower")
        if not self.bends:
            names = ("stretching" if PARTS[self.number] == "stretch" else "torsion",)
        result: defaultdict[tuple[str, float], Any] = defaultdict(float)
        for piece, lost in zip(self._pieces, losses, strict=True):
            section = self.sections[piece.section]
            causes = self._separate_causes(section)
            for cause, fraction in causes.items():
                result[cause, section.temperature] += fraction * lost
            rest = 1 - sum(causes.values())
            result[names[piece.end], section.temperature] += rest * lost
        return result

    def _damper_losses(
        self, motion: Inexact[np.ndarray, "end motion frequency"], product: Product
    ) -> defaultdict[tuple[str, float], Any]:
        """Sum what dampers between the sections dissipate, by temperature."""
        result: defaultdict[tuple[str, float], Any] = defaultdict(float)
        if self._dampers is None:
            return result
        moved = self._node_motions(motion)
        lost = np.imag(self._dampers)[:, None] * product(moved, moved)
        for section, own in zip(self.sections, lost, strict=False):
            if section.damper is not None:
                result[DAMPERS, section.temperature] += own
        return result

    def _separate_causes(self, section: Section) -> dict[str, Float[np.ndarray, " frequency"]]:
        """Fractions of the loss of a section that have causes of their own."""
        if not self.bends or not any(own.cause for own in section.losses):
            return {}
        omega = np.real(self.omega)
        angle = self._loss_angle(section)
        causes = loss.bending_causes(section, self.number, omega, section.temperature)
        return {cause: own / np.where(angle == 0, 1.0, angle) for cause, own in causes.items()}

    def _material_and_gas(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> tuple[
        Float[np.ndarray, "piece motion frequency"],
        Float[np.ndarray, "piece motion frequency"] | None,
    ]:
        """Dissipation in each of `_pieces`, in its material and by the gas around it.

        In proportion to that of either alone: exact to first order in the losses, except within the
        width of a resonance of the clamped wire.
        """
        total = self._nonnegative_losses(motion)
        if self.strand.surrounded is None or not self.strand.massive:
            return total, None
        material, drag = (own._nonnegative_losses(motion) for own in self.alone_and_elastic)
        both = material + drag
        drag = total * drag / np.where(both == 0, 1.0, both)
        return total - drag, drag

    @property
    def alone_and_elastic(self) -> tuple[PartAtFrequencies, PartAtFrequencies]:
        """The same part of the wire without gas, and of one whose material has no losses."""
        alone = replace(self, strand=replace(self.strand, surrounded=None))
        elastic = self._with_sections(replace(section, losses=()) for section in self.sections)
        return alone, elastic

    def _with_sections(self, sections: Iterable[Section]) -> PartAtFrequencies:
        """The same part of a wire of other sections."""
        fibre = replace(self.strand.fibre, sections=tuple(sections))
        return replace(self, strand=replace(self.strand, fibre=fibre))

    @cached_property
    def _pieces(self) -> list[_Piece]:
        """Pieces whose dissipation is listed: sections, for bending cut in the middle of a wire."""
        left = self._length / 2 if self.bends else np.inf
        result = []
        for n, section in enumerate(self.sections):
            length = section.length
            if EQUAL_WITHIN * length < left < (1 - EQUAL_WITHIN) * length:
                result.append(_Piece(n, left, 0))
                result.append(_Piece(n, length - left, 1))
            else:
                result.append(_Piece(n, length, int(left < length / 2)))
            left -= length
        return result

    def _nonnegative_losses(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> Float[np.ndarray, "piece motion frequency"]:
        """Dissipation x^H Im(F) x of each of `_pieces`; rounding errors below 0 become 0."""
        return np.maximum(self._piece_losses(motion, product_of_each), 0.0)

    def _piece_losses(
        self, motion: Inexact[np.ndarray, "end motion frequency"], product: Product
    ) -> Inexact[np.ndarray, "piece product frequency"]:
        """Dissipation x^H Im(F) x of each of `_pieces`: the power its ends take in and keep.

        The imaginary parts keep their digits however small the loss, as in a complex step: on the
        chord and the slopes relative to it nothing cancels.
        """
        moved = self._section_motions(motion)
        if not self.bends:
            upper, lower = moved.swapaxes(0, 1)
            springs = np.array([lower - upper, upper, lower])
            return _dissipate(((0, 0), (1, 1), (2, 2)), [*self._springs], springs, product)
        beams = self._uniform_beams
        if not self._cut:
            return _dissipate(self._places, beams, moved.swapaxes(0, 1), product)
        middle = self._cut[0].section
        whole_sections = np.arange(len(moved)) != middle
        in_whole = _dissipate(
            self._places,
            [own[whole_sections] for own in beams],
            moved[whole_sections].swapaxes(0, 1),
            product,
        )
        in_cut = self._cut_losses(moved[middle], product)
        return np.concatenate([in_whole[:middle], in_cut, in_whole[middle:]])

    @cached_property
    def _cut(self) -> list[_Piece]:
        """Both pieces of the section in which the middle of the wire is; none at a joint."""
        return [p for p in self._pieces if p.length < self.sections[p.section].length]

    @cached_property
    def _cut_beams(self) -> list[Inexact[np.ndarray, "2 frequency"]]:
        """Stiffness of the two pieces of that section, as `_uniform_beams`."""
        section = self.sections[self._cut[0].section]
        lengths = [piece.length for piece in self._cut]
        if math.isclose(*lengths, rel_tol=EQUAL_WITHIN):
            lengths = [section.length / 2]
        parts = self._with_sections(replace(section, length=length) for length in lengths)
        return [np.broadcast_to(own, (2, own.shape[-1])) for own in parts._uniform_beams]

    def _cut_losses(
        self, motion: Inexact[np.ndarray, "coordinate motion frequency"], product: Product
    ) -> Inexact[np.ndarray, "2 product frequency"]:
        """Dissipation of the two pieces of the section in the middle, in motions of its ends."""
        tension = float(self.strand.tension_of(self.sections[self._cut[0].section]))
        lengths = [piece.length for piece in self._cut]
        moved = joined_sections.cut(self._places, self._cut_beams, tension, lengths, motion)
        return _dissipate(self._places, self._cut_beams, moved.swapaxes(0, 1), product)

    @cached_property
    def joined_stiffness(self) -> Inexact[np.ndarray, "*elements"]:
        """Dynamic stiffness in the coordinates that join the sections, see `_joined`."""
        return self._joined.stiffness

    @cached_property
    def _joined(self) -> Joined:
        """All sections together."""
        if not self.bends:
            springs = self._springs
            if self._dampers is not None:
                # each from the lower end of its section to the ground
                held = np.concatenate([self._dampers, np.zeros_like(self._dampers[:1])])
                between, upper, lower = springs
                springs = np.stack(np.broadcast_arrays(between, upper, lower + held))
            return joined_sections.join_rods(springs)
        size = 4 if self.strand.massive else 2
        places = self._places
        elements = self._uniform_beams
        parts = np.zeros((size, size, *elements[0].shape), dtype=elements[0].dtype)
        for (i, j), value in zip(places, elements, strict=True):
            parts[i, j] = parts[j, i] = value
        return joined_sections.join(parts, self.strand.tensions, self.strand.lengths, self._dampers)

    @cached_property
    def _dampers(self) -> Inexact[np.ndarray, "node *#frequency"] | None:
        """Dynamic stiffness of dampers between the sections, N/m; None if nothing is there."""
        between = [section.damper for section in self.sections[:-1]]
        part = PARTS[self.number]
        if part == "twist" or not self.strand.massive or not any(between):
            return None
        lossy = self.strand.lossy
        return self.strand.stack(
            [wire_damper.stiffness(damper, part, self.omega, lossy=lossy) for damper in between]
        )

    def _node_motions(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> Inexact[np.ndarray, "node motion frequency"]:
        """Motion (m) of the points between the sections, in motions of the ends of the wire."""
        moved = self._section_motions(motion)[:-1]
        if not self.bends:
            return moved[:, 1]
        return moved[:, 0] + self.strand.lengths[:-1, None] / 2 * moved[:, 2]

    def _section_motions(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> Inexact[np.ndarray, "section end motion frequency"]:
        """Motion of every section in the coordinates that join them."""
        if not self.bends:
            whole = np.tensordot(ENDS[1], motion, 1)
        else:
            whole = np.array(motion)
            whole[2] *= 2 / self._length
            whole[3] -= whole[2]
            if not self.strand.massive:
                whole = whole[1::2]
        return joined_sections.section_motions(self._joined.motions, whole)

    @property
    def _places(self) -> tuple[tuple[int, int], ...]:
        """Places of the elements of `_uniform_beams` in their symmetric matrices."""
        return tensioned_beam.ELEMENT_PLACES if self.strand.massive else ((0, 0), (1, 1))

    @cached_property
    def _uniform_beams(self) -> list[Inexact[np.ndarray, "*section"]]:
        """Stiffness of each section (`tensioned_beam.stiffness`); without mass, on T_s and on d."""
        rigidity, _, half = self._numbers
        if self.strand.massive:
            return tensioned_beam.stiffness(rigidity, self._waves)
        return resting.uniform_stiffness(rigidity, self.strand.tension, half)

    @cached_property
    def _springs(self) -> Inexact[np.ndarray, "3 section *frequency"]:
        """Springs between the ends of each section, and from either end to the ground."""
        if not self.strand.massive:
            rigidity, _, half = self._numbers
            between = rigidity / (2 * half)
            none = np.zeros_like(between)
            return np.array([between, none, none])
        even, odd = joined_sections.rod_stiffness(*self._numbers, self.omega)
        between = (odd - even) / 4
        # where losses damp a wave before it reaches the other end
        between = np.where(between == 0, EPS * np.abs(odd), between)
        return np.array([between, even / 2, even / 2])

    @cached_property
    def _waves(self) -> tensioned_beam.Waves:
        """Waves of the sections."""
        rigidity, mass, half = self._numbers
        return tensioned_beam.waves(rigidity, self.strand.tensions, mass, half, self.omega)

    @cached_property
    def _numbers(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """EI, EA or GJ, inertia per length, and half the length of the sections."""
        strand = self.strand
        return (
            strand.stack([self._rigidity(section) for section in self.sections]),
            strand.stack([self._inertia(section) for section in self.sections]),
            strand.lengths / 2,
        )

    @property
    def _length(self) -> Any:
        return sum(section.length for section in self.sections)

    def _rigidity(self, section: Section) -> Inexact[np.ndarray, "*frequency"] | complex:
        """EI, EA or GJ times 1 + i phi; for twisting also T I_p/A."""
        factor = 1.0
        if self.strand.lossy:
            factor = 1 + 1j * self._loss_angle(section)
        if PARTS[self.number] == "twist":
            return _twisting(section, self.strand.tension, factor)
        return factor * (section.rigidity[self.number] if self.bends else section.stretching)

    def _loss_angle(self, section: Section) -> Inexact[np.ndarray, "*frequency"]:
        omega = np.real(self.omega)
        if self.bends:
            known = (section.losses, section.shape, section.temperature)
            if known not in self.bending_angles:
                self.bending_angles[known] = loss.bending_angle(
                    section, self.number, omega, self.strand.tension, section.temperature
                )
            return self.bending_angles[known]
        stretched = PARTS[self.number] == "stretch"
        return (loss.stretching_angle if stretched else loss.twisting_angle)(section, omega)

    def _inertia(self, section: Section) -> Inexact[np.ndarray, " frequency"] | complex:
        """Mass (kg/m) or polar moment of inertia (kg m) per length, with the drag of the gas."""
        if not self.strand.massive:
            return 0.0
        around = self.strand.surrounded
        inertia = section.polar if PARTS[self.number] == "twist" else section.mass
        if around is None or not self.strand.lossy:
            return inertia
        drag = section.shape.drag(*loss.surface_drag(around))[self.number]
        return inertia - 1j * drag / np.where(self.omega == 0, np.inf, self.omega)


def product_of_each(
    a: Inexact[np.ndarray, "*section motion frequency"],
    b: Inexact[np.ndarray, "*section motion frequency"],
) -> Float[np.ndarray, "*section motion frequency"]:
    """Re(a^* b) of each motion."""
    return np.real(a) * np.real(b) + np.imag(a) * np.imag(b)


def product_of_pairs(
    a: Inexact[np.ndarray, "*section motion frequency"],
    b: Inexact[np.ndarray, "*section motion frequency"],
) -> Inexact[np.ndarray, "*section pair frequency"]:
    """(a_m^* b_n + b_m^* a_n) / 2 of pairs of motions m <= n, by m first."""
    m, n = np.triu_indices(a.shape[-2])
    one = np.conj(a[..., m, :]) * b[..., n, :]
    other = np.conj(b[..., m, :]) * a[..., n, :]
    return (one + other) / 2


def _dissipate(
    places: tuple[tuple[int, int], ...],
    elements: list[Inexact[np.ndarray, "section frequency"]],
    motion: Inexact[np.ndarray, "coordinate section motion frequency"],
    product: Product,
) -> Inexact[np.ndarray, "section product frequency"]:
    """Dissipation x^H Im(F) x of sections with elements of F at `places`, in motions x."""
    total: Any = 0.0
    for (i, j), value in zip(places, elements, strict=True):
        weight = (1 if i == j else 2) * np.imag(value)
        total = total + weight[:, None] * product(motion[i], motion[j])
    return total


def _twisting(
    section: Section,
    tension: Inexact[np.ndarray, "*#frequency"] | complex,
    lossy: Inexact[np.ndarray, "*#frequency"] | complex = 1.0,
) -> Any:
    """(GJ (1 + i phi) + T I_p/A) times the factor that fits it to a given torsional stiffness."""
    return (section.twisting * lossy + tension * section.polar_area) * section.torsion_factor


def fit_to_equilibrium(
    fibre: Fibre,
    length: Inexact[np.ndarray, "*frequency"] | complex,
    k: Inexact[np.ndarray, "*frequency"] | complex,
    tension: Inexact[np.ndarray, "*frequency"] | complex,
    torsion: Inexact[np.ndarray, "*frequency"] | complex,
) -> Fibre:
    """Scale a fibre to its length in equilibrium and to the stiffnesses of the scene's wire.

    These are the length (m), the stretching stiffness (N/m), the tension (N) and the torsional
    stiffness that the design gives (N m/rad; 0 where it gives none); arrays for many builds.
    """
    sections = fibre.sections
    stretch = length / sum(section.length for section in sections)
    compliance = sum(section.length * stretch / section.stretching for section in sections)
    factor = 1.0
    if np.any(torsion):
        twist = sum(section.length * stretch / _twisting(section, tension) for section in sections)
        factor = np.where(np.real(torsion) > 0, torsion * twist, 1.0)
    fitted = (
        replace(
            section,
            length=section.length * stretch,
            stretching=section.stretching * compliance * k,
            torsion_factor=factor,
        )
        for section in sections
    )
    return replace(fibre, sections=tuple(fitted))
