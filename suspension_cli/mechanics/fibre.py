"""One kind of wire at given frequencies: its dynamic stiffness in bending, stretching and twisting, and where it dissipates.

The motion of a wire's two ends falls into four parts that do not couple (`PARTS`): bending in its two principal planes
(W_s, T_s, W_a, T_a each, see `mechanics.beam`), stretching (U_s, U_a) and twisting (the same two, rad).

A wire under tension T resists twisting with GJ + T I_p/A (Buckley, Phil. Mag. 28, 778 (1914)), I_p the polar second moment of its area A: turned
by theta' per length, a filament at the distance r from the axis leans by r theta', and its share sigma dA of the tension pulls back with the
torque sigma r^2 theta' dA about the axis.  The second part is the tension's, which has no loss.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.design.fibres import Fibre, Gas, Section
from suspension_cli.mechanics import beam, curvature, gas, joined, loss, rod

PARTS = ("bend-1", "bend-2", "stretch", "twist")
WIDTH = {"bend-1": 4, "bend-2": 4, "stretch": 2, "twist": 2}
"""How many coordinates each part has."""
ALIKE = 1e-12
"""Relative difference of lengths and stiffnesses (and tensions) of wires that are alike."""


@dataclass(frozen=True)
class Strand:
    """A wire under tension, as a function of frequency.

    Attributes
    ----------
    fibre : Fibre
    tension : float or (f,) array
        N; an array (and lengths of the fibre's sections in one) for a wire that hangs otherwise in each of many builds, the frequencies being theirs.
    massive : bool
        Whether its mass counts (`violin`).
    lossy : bool
    surrounded : Gas or None
    """

    fibre: Fibre
    tension: Any
    massive: bool
    lossy: bool
    surrounded: Gas | None = None

    @property
    def round(self) -> bool:
        """Whether both planes are alike."""
        return all(section.round for section in self.fibre.sections)

    def at(self, omega: Any) -> Moving:
        """The wire at frequencies (f,), rad/s."""
        return Moving(self, omega)

    @cached_property
    def static(self) -> dict[str, Any]:
        """Stiffness (c, c) of every part at rest, without loss."""
        return {part: self.resting(part)[..., 0] for part in PARTS}

    def resting(self, part: str) -> Any:
        """The same of one part as (c, c, f), for as many wires as there are tensions and lengths."""
        return self._still.stiffness(part).real

    @cached_property
    def _still(self) -> Moving:
        return Strand(self.fibre, self.tension, massive=False, lossy=False).at(np.zeros(np.size(self.tension)))

    def resonances_below(self, omega: Any, parts: tuple[str, ...] = PARTS) -> Any:
        """How many resonances (f,) of the wire with both ends held lie below each omega (rad/s), in some of its parts."""
        return Moving(replace(self, lossy=False), np.asarray(omega, dtype=float)).resonances_below(parts)

    def held_resonances(self, part: str, omega: float) -> Any:
        """The resonances (rad/s) of one part of the wire with both ends held, up to the second above omega."""
        highest = 1.1 * omega
        while self.resonances_below(np.array([highest]), (part,))[0] < self.resonances_below(np.array([omega]), (part,))[0] + 2:
            highest *= 1.5
        number = np.arange(1, self.resonances_below(np.array([highest]), (part,))[0] + 1)
        low, high = np.zeros(len(number)), np.full(len(number), highest)
        for _ in range(40):
            middle = (low + high) / 2
            passed = self.resonances_below(middle, (part,)) >= number
            low, high = np.where(passed, low, middle), np.where(passed, middle, high)
        return high


@dataclass(frozen=True)
class Moving:
    """A wire at given frequencies."""

    strand: Strand
    omega: Any

    def stiffness(self, part: str) -> Any:
        """Stiffness (c, c, f) of one part."""
        part = self._twin(part)
        if part not in self._known:
            self._known[part] = self._joined(part)[0]
        return self._known[part]

    def resonances_below(self, parts: tuple[str, ...]) -> Any:
        """How many resonances (f,) of the held wire lie below: those of its sections, and what joining them adds."""
        total = np.zeros(np.shape(self.omega), dtype=int)
        if not self.strand.massive:
            return total
        for part in parts:
            for section in self.strand.fibre.sections:
                rigidity, mass, half = self._rigidity(section, part), self._inertia(section, part), section.length / 2
                if part.startswith("bend"):
                    total = total + beam.resonances_below(rigidity, self.strand.tension, mass, half, self.omega)
                else:
                    total = total + rod.resonances_below(rigidity, mass, half, self.omega)
            total = total + self._joined(self._twin(part))[2]
        return total

    def dissipated(self, part: str, motion: Any) -> dict[str, Any]:
        """What the ends' motion (c, r, f) of one part dissipates: x^H Im(F) x, split by its cause, (r, f) each, N m.

        Bending is split at the middle of the wire: its two boundary layers.
        """
        sections, nodes = self.strand.fibre.sections, self._joined(self._twin(part))[1]
        each = [motion]
        if nodes:
            form = joined.ENDS[WIDTH[part] // 2]
            back = np.linalg.inv(form)
            whole = np.einsum("ij,jrf->irf", form, motion)
            each = [np.einsum("ij,jrf->irf", back, moved) for moved in joined.sections_moved(nodes, whole)]
        return self._bent(part, sections, each) if part.startswith("bend") else self._strained(part, sections, each)

    def _bent(self, part: str, sections: tuple[Section, ...], each: list[Any]) -> dict[str, Any]:
        result = {"bending-upper": 0.0, "bending-lower": 0.0}
        length, top = sum(section.length for section in sections), 0.0
        for section, motion, (waves, rigidity, mass) in zip(sections, each, self._bends[self._twin(part)], strict=True):
            for half, value in enumerate(curvature.squared(waves, motion)):
                end = int(top + (0.25 + 0.5 * half) * section.length >= length / 2)
                result[("bending-upper", "bending-lower")[end]] += self._lost(section, part, end, rigidity) * value
            if self._dragged:
                result["gas"] = result.get("gas", 0.0) - np.imag(mass) * self.omega**2 * curvature.displaced(waves, motion)
            top += section.length
        return result

    def _lost(self, section: Section, part: str, end: int, rigidity: Any) -> Any:
        """Im(EI) at the temperature of one end; thermoelastic loss goes with it."""
        upper, lower = self.strand.fibre.temperature
        if upper == lower:
            return np.imag(rigidity)
        plane = int(part[-1]) - 1
        return section.rigidity[plane] * loss.bending_angle(section, plane, self.omega, self.strand.tension, (upper, lower)[end])

    def _strained(self, part: str, sections: tuple[Section, ...], each: list[Any]) -> dict[str, Any]:
        name = "stretching" if part == "stretch" else "torsion"
        result = {name: 0.0}
        for section, motion in zip(sections, each, strict=True):
            rigidity, mass = self._rigidity(section, part), self._inertia(section, part)
            strained, moved = rod.squared(rigidity, mass, section.length / 2, self.omega, motion)
            result[name] += np.imag(rigidity) * strained
            if self._dragged:
                result["gas"] = result.get("gas", 0.0) - np.imag(mass) * self.omega**2 * moved
        return result

    @property
    def _dragged(self) -> bool:
        """Whether a gas drags at the wire."""
        return self.strand.surrounded is not None and self.strand.massive

    def _twin(self, part: str) -> str:
        """Both planes of a round wire bend alike."""
        return "bend-1" if part == "bend-2" and self.strand.round else part

    @cached_property
    def _known(self) -> dict[str, Any]:
        return {}

    def _joined(self, part: str) -> tuple[Any, list[Any], Any]:
        """What joining the sections gives for one part; the stiffness is on even and odd motion."""
        key = f"joined {part}"
        if key not in self._known:
            sections = self._sections(part)
            if len(sections) == 1:
                self._known[key] = sections[0], [], 0
            elif WIDTH[part] == 2:
                self._known[key] = joined.join_rods(sections)
            else:
                whole, nodes, negative = joined.join([joined.ends(section) for section in sections])
                self._known[key] = joined.even_odd(whole), nodes, negative
        return self._known[key]

    def _sections(self, part: str) -> list[Any]:
        """Stiffness (c, c, f) of every section in one part, on even and odd motion."""
        if part.startswith("bend"):
            return [_filled(4, beam.PLACE, beam.stiffness(rigidity, waves)) for waves, rigidity, _ in self._bends[part]]
        return [
            _filled(2, ((0, 0), (1, 1)), rod.stiffness(self._rigidity(section, part), self._inertia(section, part), section.length / 2, self.omega))
            for section in self.strand.fibre.sections
        ]

    @cached_property
    def _bends(self) -> dict[str, list[tuple[Any, Any, Any]]]:
        """Waves, EI and mass a length of every section in both planes."""
        result: dict[str, list[tuple[Any, Any, Any]]] = {}
        for part in ("bend-1",) if self.strand.round else ("bend-1", "bend-2"):
            result[part] = []
            for section in self.strand.fibre.sections:
                rigidity, mass = self._rigidity(section, part), self._inertia(section, part)
                result[part].append((beam.waves(rigidity, self.strand.tension, mass, section.length / 2, self.omega), rigidity, mass))
        return result

    def _rigidity(self, section: Section, part: str) -> Any:
        """EI, EA or GJ, times 1 + i phi; of twisting with what the tension adds, without loss."""
        tension, (upper, lower) = self.strand.tension, self.strand.fibre.temperature
        temperature, added = (upper + lower) / 2, 0.0
        if part.startswith("bend"):
            plane = int(part[-1]) - 1
            value, angle = section.rigidity[plane], lambda: loss.bending_angle(section, plane, np.real(self.omega), tension, temperature)
        elif part == "stretch":
            value, angle = section.stretching, lambda: loss.stretching_angle(section, np.real(self.omega))
        else:
            value, angle = section.twisting, lambda: loss.twisting_angle(section, np.real(self.omega))
            added = tension * section.polar_area
        elastic = value * (1 + 1j * angle()) if self.strand.lossy else value
        return (elastic + added) * section.torsion_factor if part == "twist" else elastic

    def _inertia(self, section: Section, part: str) -> Any:
        """Mass (kg/m) or polar moment of inertia (kg m) per length, with the drag of the gas."""
        if not self.strand.massive:
            return 0.0
        inertia, around = section.polar if part == "twist" else section.mass, self.strand.surrounded
        if around is None or not self.strand.lossy:
            return inertia
        drag = gas.wire_drag(section, around)[PARTS.index(part)]
        with np.errstate(divide="ignore"):
            return inertia - 1j * drag / np.where(self.omega == 0, np.inf, self.omega)


def kinds(fibres: tuple[Fibre, ...], *numbers: Any) -> list[list[int]]:
    """Places of wires that are made alike, and are alike to the last bit in all numbers (..., w): kind by kind."""
    found: dict[tuple[Any, ...], list[int]] = {}
    for n, fibre in enumerate(fibres):
        key = (fibre.sections, fibre.effective, *(np.ascontiguousarray(values[..., n]).tobytes() for values in numbers))
        found.setdefault(key, []).append(n)
    return list(found.values())


def fitted(fibre: Fibre, length: Any, k: Any, tension: Any, torsion: Any) -> Fibre:
    """A fibre as long as it is in equilibrium, and as stiff against stretching and, if that is given, against twisting as the scene's wire.

    Parameters
    ----------
    fibre : Fibre
    length, k, tension, torsion : float or (f,) array
        m, N/m, N and N m/rad (0: not given); arrays for many builds at once.
    """
    stretch = length / sum(section.length for section in fibre.sections)
    compliance = sum(section.length * stretch / section.stretching for section in fibre.sections)
    twisted = np.any(torsion)
    if np.ndim(stretch) == 0 and abs(stretch - 1) < ALIKE and abs(compliance * k - 1) < ALIKE and not twisted:
        return fibre
    factor = 1.0
    if twisted:
        compliant = sum(section.length * stretch / (section.twisting + tension * section.polar_area) for section in fibre.sections)
        factor = np.where(torsion > 0, torsion * compliant, 1.0)
    changed = (replace(s, length=s.length * stretch, stretching=s.stretching * compliance * k, torsion_factor=factor) for s in fibre.sections)
    return replace(fibre, sections=tuple(changed))


def _filled(size: int, place: Any, elements: Any) -> Any:
    result = np.zeros((size, size, elements.shape[-1]), dtype=elements.dtype)
    for (i, j), value in zip(place, elements, strict=True):
        result[i, j] = result[j, i] = value
    return result
