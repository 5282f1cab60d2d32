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

from collections import defaultdict
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.schema import Gas
from suspension_cli.elements import joined_sections, loss, resting, tensioned_beam
from suspension_cli.elements.joined_sections import ENDS, EPS, Joined
from suspension_cli.scene.scene import Fibre, Section

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from jaxtyping import Float, Inexact, Int

PARTS = ("bend-1", "bend-2", "stretch", "twist")
COORDINATES = {"bend-1": 4, "bend-2": 4, "stretch": 2, "twist": 2}
"""Number of coordinates of each part."""
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
        self[part] = PartAtFrequencies(self.strand, self.omega, PARTS.index(part))
        return self[part]


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
        own = self._joined.stiffness
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
        own = self._joined.stiffness
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

        Those of the sections, and those that joining them adds (see `elements.joined_sections`).
        """
        if not self.strand.massive:
            return np.zeros(np.shape(self.omega), dtype=int)
        if self.bends:
            below = tensioned_beam.resonances_below(self._waves)
        else:
            below = joined_sections.rod_resonances_below(*self._numbers, self.omega)
        return below.sum(0) + self._joined.negative

    def dissipated(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, "motion frequency"]]:
        """Dissipation x^H Im(F) x of motions x of the ends (m and rad), N m.

        By cause and temperature (K), that of the section or of the gas. Causes are ``stretching``
        or ``torsion``; or ``bending-upper`` and ``bending-lower``, split at the middle of the wire;
        causes of their own that losses of bending have; and ``gas``.
        """
        names = ("bending-upper", "bending-lower")
        halves = _cut_in_middle(self.sections)
        if not self.bends:
            names = ("stretching" if PARTS[self.number] == "stretch" else "torsion",)
            halves = [(section, 0) for section in self.sections]
        cut = self
        if len(halves) > len(self.sections):
            cut = self._with_sections(section for section, _ in halves)
        losses, drag = cut._material_and_gas(motion)
        result: defaultdict[tuple[str, float], Any] = defaultdict(float)
        for (section, end), lost in zip(halves, losses, strict=True):
            causes = self._separate_causes(section)
            for cause, fraction in causes.items():
                result[cause, section.temperature] += fraction * lost
            rest = 1 - sum(causes.values())
            result[names[end], section.temperature] += rest * lost
        around = self.strand.surrounded
        if drag is not None and around is not None and around.temperature is not None:
            result["gas", around.temperature] += drag.sum(0)
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
        Float[np.ndarray, "section motion frequency"],
        Float[np.ndarray, "section motion frequency"] | None,
    ]:
        """Dissipation in every section, in its material and by the gas around it.

        In proportion to that of either alone: exact to first order in the losses, except within the
        width of a resonance of the clamped wire.
        """
        total = self._section_losses(motion)
        if self.strand.surrounded is None or not self.strand.massive:
            return total, None
        alone = replace(self, strand=replace(self.strand, surrounded=None))
        elastic = self._with_sections(replace(section, losses=()) for section in self.sections)
        material, drag = (own._section_losses(motion) for own in (alone, elastic))
        both = material + drag
        drag = total * drag / np.where(both == 0, 1.0, both)
        return total - drag, drag

    def _with_sections(self, sections: Iterable[Section]) -> PartAtFrequencies:
        """The same part of a wire of other sections."""
        fibre = replace(self.strand.fibre, sections=tuple(sections))
        return replace(self, strand=replace(self.strand, fibre=fibre))

    def _section_losses(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> Float[np.ndarray, "section motion frequency"]:
        """Dissipation x^H Im(F) x of every section: the power its ends take in and do not return.

        The imaginary parts keep their digits however small the loss, as in a complex step: on the
        chord and the slopes relative to it nothing cancels.
        """
        if self.bends:
            whole = np.array(motion)
            whole[2] *= 2 / self._length
            whole[3] -= whole[2]
            elements = self._uniform_beams
            places = self._places
            if not self.strand.massive:
                whole = whole[1::2]
        else:
            whole = np.tensordot(ENDS[1], motion, 1)
            elements = self._springs
            places = ((0, 0), (1, 1), (2, 2))
        moved = joined_sections.section_motions(self._joined.motions, whole).swapaxes(0, 1)
        if not self.bends:
            moved = (moved[1] - moved[0], *moved)
        total = np.zeros(moved[0].shape)
        for (i, j), value in zip(places, elements, strict=True):
            product = np.real(np.conj(moved[i]) * moved[j])
            total += (1 if i == j else 2) * np.imag(value)[:, None] * product
        return np.maximum(total, 0.0)

    @cached_property
    def _joined(self) -> Joined:
        """All sections together."""
        if not self.bends:
            return joined_sections.join_rods(self._springs)
        size = 4 if self.strand.massive else 2
        places = self._places
        elements = self._uniform_beams
        parts = np.zeros((size, size, *elements[0].shape), dtype=elements[0].dtype)
        for (i, j), value in zip(places, elements, strict=True):
            parts[i, j] = parts[j, i] = value
        return joined_sections.join(parts, self.strand.tensions, self.strand.lengths)

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


def _cut_in_middle(sections: tuple[Section, ...]) -> list[tuple[Section, int]]:
    """Cut the section in the middle of a wire there; each part with the end it is near, 0 or 1."""
    left = sum(section.length for section in sections) / 2
    result = []
    for section in sections:
        if EQUAL_WITHIN * section.length < left < (1 - EQUAL_WITHIN) * section.length:
            result.append((replace(section, length=left), 0))
            section = replace(section, length=section.length - left)
            left = 0.0
        result.append((section, int(left < section.length / 2)))
        left -= section.length
    return result


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
