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

from suspension_cli.elements import beam, curvature, gas, joined_sections, loss, resting, rod
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
        N. An array, with arrays as lengths of the fibre's sections, stands for the wire in many
        builds, one per frequency.
    massive : bool
        Whether the wire has inertia (`violin` model).
    lossy : bool
    surrounded : Gas or None
        The gas that damps the wire.
    """

    fibre: Fibre
    tension: Inexact[np.ndarray, " frequency"] | float
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


class RodSection(NamedTuple):
    """A section in stretching or twisting.

    Attributes
    ----------
    rigidity, inertia
        EA (N) or GJ (N m^2), and inertia per length.
    strain, displacement
        Integrals of the squares of both, for even and for odd motion (`rod.square_integrals`).
    """

    rigidity: Inexact[np.ndarray, "*#frequency"]
    inertia: Inexact[np.ndarray, "*#frequency"]
    strain: tuple[Float[np.ndarray, " frequency"], Float[np.ndarray, " frequency"]]
    displacement: tuple[Float[np.ndarray, " frequency"], Float[np.ndarray, " frequency"]]


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
        joints = self._joined(self._twin(part)).motions
        if not joints:
            motions = motion[None]
        elif _is_bending(part):
            motions = self._section_bending(joints, motion)
        else:
            ends = np.tensordot(joined_sections.ENDS[1], motion, 1)
            ends = joined_sections.section_motions(joints, ends)
            even, odd = ends.sum(1) / 2, (ends[:, 1] - ends[:, 0]) / 2
            motions = np.stack([even, odd], axis=1)
        if _is_bending(part):
            return self._bending_dissipation(part, motions)
        return self._rod_dissipation(part, motions)

    def _section_bending(
        self,
        joints: list[tuple[Inexact[np.ndarray, "end end pair *#frequency"], ...]],
        motion: Inexact[np.ndarray, "4 motion frequency"],
    ) -> Inexact[np.ndarray, "section 4 motion frequency"]:
        """Motion (W_s, T_s, W_a, T_a) of the ends of the sections, those without mass on chords."""
        half = self._stack(section.length / 2 for section in self.strand.fibre.sections)[
            ..., None, :
        ]
        chord = np.array(motion)
        chord[2] /= half.sum(0)
        chord[3] -= chord[2]
        massless = len(joints[0][0]) == 2
        parts = joined_sections.section_motions(joints, chord[1::2] if massless else chord)
        if massless:
            still = np.zeros_like(parts[:, 0])
            return np.stack([still, parts[:, 0], still, parts[:, 1]], axis=1)
        parts[:, 3] += parts[:, 2]
        parts[:, 2] *= half
        return parts

    def _bending_dissipation(
        self, part: str, motions: Inexact[np.ndarray, "section 4 motion frequency"]
    ) -> dict[str, Float[np.ndarray, "motion frequency"]]:
        sections = self.strand.fibre.sections
        result = {name: np.zeros(motions.shape[2:]) for name in ("bending-upper", "bending-lower")}
        length, top = sum(section.length for section in sections), 0.0
        stacked, *numbers = self._bends[self._twin(part)]
        for section, motion, waves, rigidity, mass in zip(
            sections, motions, stacked.sections, *numbers, strict=True
        ):
            halves = curvature.integrate_squared_curvature(waves, motion)
            for half, integral in enumerate(halves):
                end = int(top + (0.25 + 0.5 * half) * section.length >= length / 2)
                rest = self._imaginary_rigidity(section, part, end, rigidity)
                for cause, own in self._separate_causes(section, part, end).items():
                    result[cause] = result.get(cause, 0.0) + own * integral
                    rest = rest - own
                name = ("bending-upper", "bending-lower")[end]
                result[name] = result[name] + rest * integral
            if self._has_drag:
                integral = curvature.integrate_squared_displacement(waves, motion)
                result["gas"] = result.get("gas", 0.0) - np.imag(mass) * self.omega**2 * integral
            top += section.length
        return result

    def _imaginary_rigidity(
        self,
        section: Section,
        part: str,
        end: int,
        rigidity: Inexact[np.ndarray, " frequency"] | complex,
    ) -> Inexact[np.ndarray, " frequency"] | float:
        """Im(EI) at the temperature of one end, on which the thermoelastic loss depends."""
        temperature = self.strand.fibre.temperature
        if temperature[0] == temperature[1]:
            return np.imag(rigidity)
        return _elastic_rigidity(section, part) * self._loss_angle(section, part, temperature[end])

    def _separate_causes(
        self, section: Section, part: str, end: int
    ) -> dict[str, Inexact[np.ndarray, " frequency"]]:
        """Parts of Im(EI) that are listed under their own causes."""
        angles = loss.bending_causes(
            section, _plane(part), np.real(self.omega), self.strand.fibre.temperature[end]
        )
        return {cause: _elastic_rigidity(section, part) * own for cause, own in angles.items()}

    def _rod_dissipation(
        self, part: str, motions: Inexact[np.ndarray, "section 2 motion frequency"]
    ) -> dict[str, Float[np.ndarray, "motion frequency"]]:
        name = "stretching" if part == "stretch" else "torsion"
        result = {name: np.zeros(motions.shape[2:])}
        for motion, (rigidity, inertia, strain, displacement) in zip(
            motions, self._rods(part), strict=True
        ):
            even, odd = np.real(motion) ** 2 + np.imag(motion) ** 2
            loss = np.imag(rigidity)
            result[name] = result[name] + (even * (loss * strain[0]) + odd * (loss * strain[1]))
            if self._has_drag:
                drag = -np.imag(inertia) * self.omega**2
                result["gas"] = (
                    result.get("gas", 0.0)
                    + even * (drag * displacement[0])
                    + odd * (drag * displacement[1])
                )
        return result

    def _rods(self, part: str) -> list[RodSection]:
        if part not in self._known_rods:
            self._known_rods[part] = [
                RodSection(
                    rigidity, inertia, *rod.square_integrals(rigidity, inertia, half, self.omega)
                )
                for rigidity, inertia, half in zip(*self._section_numbers(part), strict=True)
            ]
        return self._known_rods[part]

    @property
    def _has_drag(self) -> bool:
        return self.strand.surrounded is not None and self.strand.massive

    def _twin(self, part: str) -> str:
        """Return the part whose results apply: both planes of a round wire are equal."""
        return "bend-1" if part == "bend-2" and self.strand.round else part

    @cached_property
    def _known_stiffness(self) -> dict[str, Inexact[np.ndarray, "end end *frequency"]]:
        return {}

    @cached_property
    def _known_joined(self) -> dict[str, Joined]:
        return {}

    @cached_property
    def _known_rods(self) -> dict[str, list[RodSection]]:
        return {}

    @cached_property
    def _known_numbers(self) -> dict[str, SectionNumbers]:
        return {}

    def _joined(self, part: str) -> Joined:
        if part not in self._known_joined:
            join = self._joined_beams if _is_bending(part) else self._joined_rods
            self._known_joined[part] = join(part)
        return self._known_joined[part]

    def _joined_beams(self, part: str) -> Joined:
        sections, strand = self.strand.fibre.sections, self.strand
        if strand.massive:
            parts = _symmetric(4, beam.ELEMENT_PLACES, self._uniform_beams(part))
            if len(sections) == 1:
                return Joined(parts[:, :, 0], [], 0)
        lengths = self._stack(section.length for section in sections)
        if not strand.massive:
            rigidity = self._section_numbers(part).rigidity
            return resting.slope_stiffness(rigidity, strand.tension, lengths)
        tensions = self._stack(self._tension(section) for section in sections)
        return joined_sections.join(parts, tensions, lengths)

    def _uniform_beams(self, part: str) -> list[Inexact[np.ndarray, "section *frequency"]]:
        waves, rigidity, _ = self._bends[part]
        return beam.stiffness(rigidity, waves)

    def _joined_rods(self, part: str) -> Joined:
        even, odd = rod.stiffness(*self._section_numbers(part), self.omega)
        return joined_sections.join_rods(np.array([(odd - even) / 4, even / 2, even / 2]))

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


def group_identical(
    fibres: tuple[Fibre, ...], *numbers: Inexact[np.ndarray, "*batch wire"]
) -> list[list[int]]:
    """Group the indices of wires of equal sections and bitwise equal numbers."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for n, fibre in enumerate(fibres):
        key = (
            fibre.sections,
            fibre.effective,
            *(np.ascontiguousarray(values[..., n]).tobytes() for values in numbers),
        )
        groups.setdefault(key, []).append(n)
    return list(groups.values())


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
