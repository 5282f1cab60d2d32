"""Dynamic stiffness and dissipation of one wire in bending, stretching and twisting.

The motion of the two ends of a wire falls into four parts that do not couple (`PARTS`): bending in
the two principal planes (W_s, T_s, W_a, T_a each, see `elements.beam`), stretching (U_s, U_a, see
`elements.rod`) and twisting (the same two, in rad).

A wire under tension T resists twisting with GJ + T I_p/A (Buckley, Phil. Mag. 28, 778 (1914)), I_p
the polar second moment of its area A: at a twist theta' per length, a filament at the distance r
from the axis leans by r theta', so its part sigma dA of the tension pulls back with the torque
sigma r^2 theta' dA about the axis. This second term has no loss.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.elements import beam, gas, joined_sections, loss, resting, rod
from suspension_cli.elements.joined_sections import Joined
from suspension_cli.scene.composition import Fibre, Gas, Section

if TYPE_CHECKING:
    from collections.abc import Iterable

    from jaxtyping import Float, Inexact, Int

PARTS = ("bend-1", "bend-2", "stretch", "twist")
COORDINATES = {"bend-1": 4, "bend-2": 4, "stretch": 2, "twist": 2}
"""Number of coordinates of each part."""
EQUAL_WITHIN = 1e-12
"""Relative difference of lengths, stiffnesses and tensions below which wires count as equal."""


@dataclass(frozen=True)
class TautWire:
    """A wire under tension.

    Attributes
    ----------
    fibre : Fibre
    tension
        N. An array (..., f), with such arrays as lengths of the fibre's sections, stands for wires
        of the same sections in many builds, each at one frequency.
    massive : bool
        Whether the wire has inertia (`violin` model).
    lossy : bool
    surrounded : Gas or None
        The gas that damps the wire.
    """

    fibre: Fibre
    tension: Inexact[np.ndarray, "*#wire frequency"] | float
    massive: bool
    lossy: bool
    surrounded: Gas | None = None

    @property
    def round(self) -> bool:
        """Whether both planes have the same bending stiffness."""
        return all(section.round for section in self.fibre.sections)

    def at(self, omega: Inexact[np.ndarray, " frequency"]) -> WireAtFrequencies:
        """The wire at frequencies (f,), rad/s; kept for further blocks at the same array."""
        if not self._latest or self._latest[0].omega is not omega:
            self._latest[:] = [WireAtFrequencies(self, omega)]
        return self._latest[0]

    @cached_property
    def _latest(self) -> list[WireAtFrequencies]:
        return []

    @cached_property
    def static(self) -> dict[str, Inexact[np.ndarray, "_ _"]]:
        """Static stiffness (c, c) of every part, without loss."""
        return {part: self.resting(part)[..., 0] for part in PARTS}

    def resting(self, part: str) -> Inexact[np.ndarray, "end end frequency"]:
        """Static stiffness (c, c, f) of one part, without loss, for f tensions and lengths."""
        return self._at_rest.stiffness(part)

    @cached_property
    def _at_rest(self) -> WireAtFrequencies:
        return TautWire(self.fibre, self.tension, massive=False, lossy=False).at(
            np.zeros(np.size(self.tension))
        )

    def resonances_below(
        self, omega: Float[np.ndarray, " frequency"], parts: tuple[str, ...] = PARTS
    ) -> Int[np.ndarray, " frequency"]:
        """Count resonances (f,) below each omega (rad/s) with clamped ends, in the given parts."""
        lossless = replace(self, lossy=False)
        return lossless.at(np.asarray(omega, dtype=float)).resonances_below(parts)

    def held_resonances(self, part: str, omega: float) -> Float[np.ndarray, " resonance"]:
        """Resonances (rad/s) of one part with clamped ends, up to the second above omega.

        By bisection on their number below a frequency, which misses none.
        """
        wanted = self.resonances_below(np.array([omega]), (part,))[0] + 2
        highest = 1.1 * omega
        while (count := self.resonances_below(np.array([highest]), (part,))[0]) < wanted:
            highest *= 1.5
        number = np.arange(1, count + 1)
        low, high = np.zeros(count), np.full(count, highest)
        for _ in range(40):
            middle = (low + high) / 2
            above = self.resonances_below(middle, (part,)) >= number
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return high


class SectionNumbers(NamedTuple):
    """EI, EA or GJ, inertia per length, and half the length of the sections of a wire."""

    rigidity: Inexact[np.ndarray, "section *#frequency"]
    inertia: Inexact[np.ndarray, "section *#frequency"]
    half: Inexact[np.ndarray, "section *#frequency"]


@dataclass(frozen=True)
class WireAtFrequencies:
    """A wire at given frequencies.

    Attributes
    ----------
    strand : TautWire
    omega
        rad/s.
    """

    strand: TautWire
    omega: Inexact[np.ndarray, " frequency"]

    def stiffness(self, part: str) -> Inexact[np.ndarray, "end end *frequency"]:
        """Dynamic stiffness (c, c, f) of one part, N/m, N and N m."""
        part = self._twin(part)
        if part not in self._known_stiffness:
            self._known_stiffness[part] = self._even_odd(part)
        return self._known_stiffness[part]

    def _even_odd(self, part: str) -> Inexact[np.ndarray, "end end *frequency"]:
        sections = self.strand.fibre.sections
        length = sum(section.length for section in sections)
        pull = sum(self._tension(section) * section.length for section in sections)
        # phi = 2 W_a / L, d = T_a - phi
        if _is_bending(part) and self.strand.massive and len(sections) == 1:
            *even, pp, pd, dd = (own[0] for own in self._uniform_beams(part))
            odd = (pp + pull - 2 * pd + dd) * (2 / length) ** 2, (pd - dd) * (2 / length), dd
            return _symmetric(4, beam.ELEMENT_PLACES, [*even, *odd])
        own = self._joined(part).stiffness
        if not _is_bending(part):
            between, upper, lower = own
            odd = upper + lower + 4 * between
            return np.array([[upper + lower, lower - upper], [lower - upper, odd]])
        result = np.zeros((4, 4, *own.shape[2:]), dtype=own.dtype)
        some = slice(None) if len(own) == 4 else slice(1, None, 2)
        result[some, some] = own
        result[2, 2] += pull
        for half in (result, result.swapaxes(0, 1)):
            half[2] -= half[3]
            half[2] *= 2 / length
        return result

    def change(self, part: str) -> Inexact[np.ndarray, "*elements"]:
        """F(omega) - F(0) of one part, with F(0) without loss and inertia.

        Of bending on (W, T_s, phi, d), or without mass on (T_s, d) (see `elements.beam`); of
        twisting as springs between the ends and from either end to the ground; of stretching F
        itself, as such springs.
        """
        own, strand = self._joined(self._twin(part)).stiffness, self.strand
        if part == "stretch":
            return own
        whole, sections = own.copy(), strand.fibre.sections
        if part == "twist":
            whole[0] -= 1 / sum(own.length / _twisting(own, strand.tension) for own in sections)
            return whole
        lengths = self._stack(section.length for section in sections)
        rigidity = np.array([section.rigidity[_plane(part)] for section in sections])
        rigidity = rigidity.reshape(-1, *(1,) * (lengths.ndim - 1))
        still = resting.slope_stiffness(rigidity, strand.tension, lengths).stiffness
        if len(whole) == 2:
            return whole - still
        whole[1::2, 1::2] -= still
        whole[2, 2] += sum(section.tension_offset * section.length for section in sections)
        return whole

    def resonances_below(self, parts: tuple[str, ...]) -> Int[np.ndarray, " frequency"]:
        """Count resonances (f,) below each frequency with clamped ends.

        Those of the sections, and those that joining them adds (see `elements.joined_sections`).
        """
        total = np.zeros(np.shape(self.omega), dtype=int)
        if not self.strand.massive:
            return total
        for part in parts:
            own = self._twin(part)
            if _is_bending(part):
                below = beam.resonances_below(self._bends[own][0])
            else:
                below = rod.resonances_below(*self._section_numbers(part), self.omega)
            total = total + below.sum(0) + self._joined(own).negative
        return total

    def dissipated(
        self, part: str, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> dict[str, Float[np.ndarray, "motion frequency"]]:
        """Dissipation x^H Im(F) x of motions x of the ends, by cause.

        Parameters
        ----------
        part : str
        motion
            Of r motions, m and rad.

        Returns
        -------
        dict of (r, f) arrays
            N m: ``stretching`` or ``torsion``; or ``bending-upper`` and ``bending-lower``, split at
            the middle of the wire; and ``gas``.
        """
        if not _is_bending(part):
            lost, drag = self._material_and_gas(part, motion)
            result = {"stretching" if part == "stretch" else "torsion": lost.sum(0)}
            return result if drag is None else result | {"gas": drag.sum(0)}
        return self._halves._bending_dissipation(part, motion)

    def _bending_dissipation(
        self, part: str, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> dict[str, Float[np.ndarray, "motion frequency"]]:
        """By cause, each section at the temperature of its end of the wire."""
        fibre, result, top = self.strand.fibre, {}, 0.0
        names = ("bending-upper", "bending-lower")
        result = {name: np.zeros(motion.shape[1:]) for name in names}
        losses, drag = self._material_and_gas(part, motion)
        if drag is not None:
            result["gas"] = drag.sum(0)
        middle = sum(section.length for section in fibre.sections) / 2
        for section, lost in zip(fibre.sections, losses, strict=True):
            end = int(top + section.length / 2 > middle)
            top += section.length
            angle = self._loss_angle(section, part, sum(fibre.temperature) / 2)
            per_angle = lost / np.where(angle == 0, 1.0, angle)
            rest = self._loss_angle(section, part, fibre.temperature[end])
            causes = loss.bending_causes(
                section, _plane(part), np.real(self.omega), fibre.temperature[end]
            )
            for cause, own in causes.items():
                result[cause] = result.get(cause, 0.0) + own * per_angle
                rest = rest - own
            result[names[end]] = result[names[end]] + rest * per_angle
        return result

    def _material_and_gas(
        self, part: str, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> tuple[
        Float[np.ndarray, "section motion frequency"],
        Float[np.ndarray, "section motion frequency"] | None,
    ]:
        """Dissipation in every section, in its material and by the gas around it.

        In proportion to that of either alone: exact to first order in the losses, except within the
        width of a resonance of the clamped wire.
        """
        total = self._section_losses(part, motion)
        if self.strand.surrounded is None or not self.strand.massive:
            return total, None
        material, drag = (own._section_losses(part, motion) for own in self._alone)
        both = material + drag
        drag = total * drag / np.where(both == 0, 1.0, both)
        return total - drag, drag

    def _section_losses(
        self, part: str, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> Float[np.ndarray, "section motion frequency"]:
        """Dissipation x^H Im(F) x of every section: the power its ends take in and do not return.

        The imaginary parts keep their digits however small the loss, as in a complex step: on the
        chord and the slopes relative to it nothing cancels.
        """
        joints, places = self._joints(self._twin(part)), ((0, 0), (1, 1), (2, 2))
        if _is_bending(part):
            length = sum(section.length for section in self.strand.fibre.sections)
            chord = np.array(motion)
            chord[2] *= 2 / length
            chord[3] -= chord[2]
            elements, places = self._uniform_beams(self._twin(part)), beam.ELEMENT_PLACES
            if not self.strand.massive:
                chord, places = chord[1::2], ((0, 0), (1, 1))
            moved = joined_sections.section_motions(joints, chord).swapaxes(0, 1)
        else:
            ends = np.tensordot(joined_sections.ENDS[1], motion, 1)
            upper, lower = joined_sections.section_motions(joints, ends).swapaxes(0, 1)
            elements, moved = self._springs(part), (lower - upper, upper, lower)
        total = np.zeros(moved[0].shape)
        for (i, j), value in zip(places, elements, strict=True):
            product = np.real(np.conj(moved[i]) * moved[j])
            total += (1 if i == j else 2) * np.imag(value)[:, None] * product
        return np.maximum(total, 0.0)

    @cached_property
    def _halves(self) -> WireAtFrequencies:
        """The wire with the section in its middle cut there, so that each section has one end."""
        fibre = self.strand.fibre
        left, sections = sum(section.length for section in fibre.sections) / 2, []
        for section in fibre.sections:
            if EQUAL_WITHIN * section.length < left < (1 - EQUAL_WITHIN) * section.length:
                sections.append(replace(section, length=left))
                section = replace(section, length=section.length - left)
                left = 0.0
            left -= section.length
            sections.append(section)
        return replace(self.strand, fibre=replace(fibre, sections=tuple(sections))).at(self.omega)

    @cached_property
    def _alone(self) -> tuple[WireAtFrequencies, WireAtFrequencies]:
        """The wire without the gas, and in it without losses of its own."""
        fibre = self.strand.fibre
        elastic = tuple(replace(section, losses=()) for section in fibre.sections)
        return (
            replace(self.strand, surrounded=None).at(self.omega),
            replace(self.strand, fibre=replace(fibre, sections=elastic)).at(self.omega),
        )

    def _twin(self, part: str) -> str:
        """Return the part whose results apply: both planes of a round wire are equal."""
        return "bend-1" if part == "bend-2" and self.strand.round else part

    @cached_property
    def _known_stiffness(self) -> dict[str, Inexact[np.ndarray, "end end *frequency"]]:
        return {}

    @cached_property
    def _known_joints(self) -> dict[str, list[tuple[np.ndarray, ...]]]:
        return {}

    @cached_property
    def _known_joined(self) -> dict[str, Joined]:
        return {}

    @cached_property
    def _known_numbers(self) -> dict[str, SectionNumbers]:
        return {}

    def _joined(self, part: str) -> Joined:
        if part not in self._known_joined:
            join = self._joined_beams if _is_bending(part) else self._joined_rods
            self._known_joined[part] = join(part)
        return self._known_joined[part]

    def _joints(self, part: str) -> list[tuple[np.ndarray, ...]]:
        """Motion of the sections per motion of the whole."""
        if part not in self._known_joints:
            some = _is_bending(part) and part not in self._known_joined
            joined = self._joined_beams(part, motions_only=True) if some else self._joined(part)
            self._known_joints[part] = joined.motions
        return self._known_joints[part]

    def _joined_beams(self, part: str, *, motions_only: bool = False) -> Joined:
        sections, elements = self.strand.fibre.sections, self._uniform_beams(part)
        places = beam.ELEMENT_PLACES if self.strand.massive else ((0, 0), (1, 1))
        parts = _symmetric(places[-1][0] + 1, places, elements)
        if len(sections) == 1:
            return Joined(parts[:, :, 0], [], 0)
        lengths = self._stack(section.length for section in sections)
        tensions = self._stack(self._tension(section) for section in sections)
        return joined_sections.join(parts, tensions, lengths, motions_only=motions_only)

    def _uniform_beams(self, part: str) -> list[Inexact[np.ndarray, "*section"]]:
        """Stiffness of each section, see `beam.stiffness`; without mass, on T_s and on d."""
        if self.strand.massive:
            waves, rigidity, _ = self._bends[part]
            return beam.stiffness(rigidity, waves)
        rigidity, _, half = self._section_numbers(part)
        return resting.uniform_stiffness(rigidity, self.strand.tension, half)

    def _joined_rods(self, part: str) -> Joined:
        return joined_sections.join_rods(self._springs(part))

    def _springs(self, part: str) -> Inexact[np.ndarray, "3 section *frequency"]:
        """Springs between the ends of each section, and from either end to the ground."""
        even, odd = rod.stiffness(*self._section_numbers(part), self.omega)
        between = (odd - even) / 4
        # where losses damp a wave before it reaches the other end
        between = np.where(between == 0, joined_sections.EPS * np.abs(odd), between)
        return np.array([between, even / 2, even / 2])

    @cached_property
    def _bends(
        self,
    ) -> dict[
        str,
        tuple[
            beam.Waves,
            Inexact[np.ndarray, "section *#frequency"],
            Inexact[np.ndarray, "section *#frequency"],
        ],
    ]:
        """Waves, EI and mass per length of the sections, by plane."""
        result = {}
        tension = self._stack(self._tension(section) for section in self.strand.fibre.sections)
        for part in ("bend-1",) if self.strand.round else ("bend-1", "bend-2"):
            rigidity, mass, half = self._section_numbers(part)
            waves = beam.waves(rigidity, tension, mass, half, self.omega)
            result[part] = waves, rigidity, mass
        return result

    def _section_numbers(self, part: str) -> SectionNumbers:
        if part not in self._known_numbers:
            sections = self.strand.fibre.sections
            self._known_numbers[part] = SectionNumbers(
                self._stack(self._rigidity(section, part) for section in sections),
                self._stack(self._inertia(section, part) for section in sections),
                self._stack(section.length / 2 for section in sections),
            )
        return self._known_numbers[part]

    def _stack(
        self, values: Iterable[Inexact[np.ndarray, "*#frequency"] | complex]
    ) -> Inexact[np.ndarray, "section *#frequency"]:
        """Stack numbers of the sections, with axes of length 1 where they do not vary."""
        arrays, axes = [np.asarray(value) for value in values], np.ndim(self.strand.tension)
        shape = np.broadcast_shapes((1,) * max(axes, 1), *(array.shape for array in arrays))
        result = np.empty((len(arrays), *shape), dtype=np.result_type(*arrays))
        for row, array in zip(result, arrays, strict=True):  # quicker than numpy.stack
            row[...] = array
        return result

    def _tension(self, section: Section) -> Inexact[np.ndarray, " frequency"] | float:
        """Tension in the middle of a section, N, which the weight of a wire with mass changes."""
        return self.strand.tension + (section.tension_offset if self.strand.massive else 0.0)

    def _rigidity(self, section: Section, part: str) -> Inexact[np.ndarray, " frequency"] | complex:
        """EI, EA or GJ times 1 + i phi; for twisting also T I_p/A."""
        factor = 1.0
        if self.strand.lossy:
            temperature = sum(self.strand.fibre.temperature) / 2
            factor = 1 + 1j * self._loss_angle(section, part, temperature)
        if part == "twist":
            return _twisting(section, self.strand.tension, factor)
        return _elastic_rigidity(section, part) * factor

    def _loss_angle(
        self, section: Section, part: str, temperature: float
    ) -> Inexact[np.ndarray, " frequency"]:
        omega = np.real(self.omega)
        if _is_bending(part):
            return loss.bending_angle(
                section, _plane(part), omega, self.strand.tension, temperature
            )
        angle = loss.stretching_angle if part == "stretch" else loss.twisting_angle
        return angle(section, omega)

    def _inertia(self, section: Section, part: str) -> Inexact[np.ndarray, " frequency"] | complex:
        """Mass (kg/m) or polar moment of inertia (kg m) per length, with the drag of the gas."""
        if not self.strand.massive:
            return 0.0
        inertia, around = section.polar if part == "twist" else section.mass, self.strand.surrounded
        if around is None or not self.strand.lossy:
            return inertia
        drag = section.shape.drag(*gas.surface_drag(around))[PARTS.index(part)]
        with np.errstate(divide="ignore"):
            return inertia - 1j * drag / np.where(self.omega == 0, np.inf, self.omega)


def _is_bending(part: str) -> bool:
    return part.startswith("bend")


def _plane(part: str) -> int:
    return PARTS.index(part)


def _elastic_rigidity(section: Section, part: str) -> float:
    """EI (N m^2), EA (N) or GJ (N m^2)."""
    if _is_bending(part):
        return section.rigidity[_plane(part)]
    return section.stretching if part == "stretch" else section.twisting


def _twisting(
    section: Section,
    tension: Inexact[np.ndarray, "*#frequency"] | complex,
    lossy: Inexact[np.ndarray, "*#frequency"] | complex = 1.0,
) -> Inexact[np.ndarray, "*frequency"] | complex:
    """(GJ (1 + i phi) + T I_p/A) times the factor that fits it to a given torsional stiffness."""
    return (section.twisting * lossy + tension * section.polar_area) * section.torsion_factor


def fit_to_equilibrium(
    fibre: Fibre,
    length: Inexact[np.ndarray, " frequency"] | complex,
    k: Inexact[np.ndarray, " frequency"] | complex,
    tension: Inexact[np.ndarray, " frequency"] | complex,
    torsion: Inexact[np.ndarray, " frequency"] | complex,
) -> Fibre:
    """Scale a fibre to its length in equilibrium and to the stiffnesses of the scene's wire.

    Parameters
    ----------
    fibre
    length
        Length in equilibrium, m; an array, as below, for many builds at once.
    k
        Stretching stiffness, N/m.
    tension
        N.
    torsion
        Torsional stiffness given by the design, N m/rad; 0 where none is given.
    """
    stretch = length / sum(section.length for section in fibre.sections)
    compliance = sum(section.length * stretch / section.stretching for section in fibre.sections)
    has_torsion = np.any(torsion)
    fits = np.all(np.abs(stretch - 1) < EQUAL_WITHIN) and np.all(
        np.abs(compliance * k - 1) < EQUAL_WITHIN
    )
    if np.ndim(stretch) == 0 and fits and not has_torsion:
        return fibre
    factor = 1.0
    if has_torsion:
        torsional_compliance = sum(
            section.length * stretch / (section.twisting + tension * section.polar_area)
            for section in fibre.sections
        )
        factor = np.where(np.real(torsion) > 0, torsion * torsional_compliance, 1.0)
    sections = tuple(
        replace(
            section,
            length=section.length * stretch,
            stretching=section.stretching * compliance * k,
            torsion_factor=factor,
        )
        for section in fibre.sections
    )
    return replace(fibre, sections=sections)


def _symmetric(
    size: int, places: tuple[tuple[int, int], ...], elements: list[Inexact[np.ndarray, "*shape"]]
) -> Inexact[np.ndarray, "size size *shape"]:
    """Symmetric matrices from their elements on and above the diagonal."""
    result = np.zeros((size, size, *elements[0].shape), dtype=elements[0].dtype)
    for (i, j), value in zip(places, elements, strict=True):
        result[i, j] = result[j, i] = value
    return result
