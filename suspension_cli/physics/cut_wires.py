"""A suspension with its wires cut in pieces, whose joints and dampers become coordinates.

Every wire is cut at one place; one with dampers (`elements.wire_damper`) at these, and between them
at one place each. The motion v of a damper's mass m along each direction of its spring is a
coordinate of its own; with the motion w of the wire there, its energies are m v'^2 / 2 and
k (v - w)^2 / 2. In other directions the mass moves with the wire. So neither the pole of its
dynamic stiffness nor a large loss is in a function of frequency.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.VIOLIN.system(reader.parse(reader.template("single", "single")))
>>> system, [wires] = cut_all(model, 0.4)
>>> system.size - model.size, len(wires.pieces)  # of four wires, in two pieces each
(24, 2)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import wire_damper
from suspension_cli.elements.dynamic_wire import COORDINATES, PARTS
from suspension_cli.elements.joined_sections import ENDS
from suspension_cli.linear.coordinates import AddedCoordinates, momentum_units
from suspension_cli.linear.matrix_terms import StructuralLoss
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import Term
from suspension_cli.linear.wire_term import WireTerm
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Section

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

    from suspension_cli.design.wires import WireDamper

FIRST = {part: sum(COORDINATES[other] // 2 for other in PARTS[:n]) for n, part in enumerate(PARTS)}
"""Number of the first coordinate of a joint by part; that of its motion, not its slope."""
PER_CUT = sum(COORDINATES[part] // 2 for part in PARTS)
"""Coordinates of a joint."""
UNITS = ("m", "rad", "m", "rad", "m", "rad")
"""Their units: deflection and slope in both planes, stretching, twist."""


@dataclass(frozen=True)
class CutWires:
    """Wires of one kind, cut.

    Attributes
    ----------
    term
        The whole wires.
    pieces
        Sections of each piece, from the top.
    dampers
        Those at the joints between pieces; None at other cuts.
    start
        Number of their first coordinate. Those of joints, wire by wire, precede those of
        dampers.
    """

    term: WireTerm
    pieces: tuple[tuple[Section, ...], ...]
    dampers: tuple[WireDamper | None, ...]
    start: int

    @staticmethod
    def of(term: WireTerm, fraction: float, start: int) -> CutWires:
        """Cut wires at their dampers, and between these at a fraction of the length from above."""
        sections = term.strand.fibre.sections
        ends = np.cumsum([section.length for section in sections]).tolist()
        held = [section.damper for section in sections]
        dampers = {
            end: damper for end, damper in zip(ends, held, strict=True) if damper is not None
        }
        places: dict[float, WireDamper | None] = dict(dampers)
        for upper, lower in pairwise([0.0, *dampers, ends[-1]]):
            places[upper + fraction * (lower - upper)] = None
        joints = sorted(places)
        pieces = tuple(
            _between(sections, upper, lower) for upper, lower in pairwise([0.0, *joints, ends[-1]])
        )
        return CutWires(term, pieces, tuple(places[joint] for joint in joints), start)

    @property
    def count(self) -> int:
        """Number of wires."""
        return len(self.term.forms["twist"])

    @cached_property
    def sprung(self) -> list[tuple[int, str, WireDamper]]:
        """Joint, part of the motion, and damper, of each coordinate of a damper."""
        return [
            (joint, part, damper)
            for joint, damper in enumerate(self.dampers)
            if damper is not None
            for part in wire_damper.sprung_parts(damper)
        ]

    @property
    def end(self) -> int:
        """Number of the first coordinate after theirs."""
        return self.start + self.count * (PER_CUT * len(self.dampers) + len(self.sprung))

    @property
    def names(self) -> list[str]:
        """Names of their coordinates."""
        joints = self.count * len(self.dampers)
        stage = self.term.stage
        names = [f"{stage}.cut{self.start}-{n}.{k}" for n in range(joints) for k in range(PER_CUT)]
        dampers = self.count * len(self.sprung)
        return names + [f"{stage}.damper{self.start}.{n}" for n in range(dampers)]

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        joints = self.count * len(self.dampers)
        return UNITS * joints + ("m",) * (self.count * len(self.sprung))

    def joint(self, number: int, part: str) -> Int[np.ndarray, " wire"]:
        """Coordinates of the motion of a joint in one part, in which its slope is the next."""
        wires = np.arange(self.count)
        return self.start + PER_CUT * (len(self.dampers) * wires + number) + FIRST[part]

    def masses(self, number: int) -> Int[np.ndarray, " wire"]:
        """Coordinates of the masses of dampers that are `sprung`."""
        joints = PER_CUT * len(self.dampers) * self.count
        return self.start + joints + number * self.count + np.arange(self.count)

    def terms(self, size: int) -> list[WireTerm]:
        """The pieces as wires of their own, in a system of so many coordinates."""
        motion: list[dict[str, Array]] = [{} for _ in self.pieces]
        more = size - self.term.size
        for part in PARTS:
            p = COORDINATES[part] // 2
            ends = np.pad(ENDS[p] @ self.term.forms[part], ((0, 0), (0, 0), (0, more)))
            joints = [
                np.eye(size)[self.joint(n, part)[:, None] + np.arange(p)]
                for n in range(len(self.dampers))
            ]
            back = np.linalg.inv(ENDS[p])
            chain = pairwise([ends[:, :p], *joints, ends[:, p:]])
            for own, (upper, lower) in zip(motion, chain, strict=True):
                own[part] = back @ np.concatenate([upper, lower], axis=1)
        return [
            replace(
                self.term,
                strand=replace(
                    self.term.strand, fibre=replace(self.term.strand.fibre, sections=sections)
                ),
                acts_on=np.arange(size),
                motion=own,
                size=size,
            ).spread(np.eye(size))
            for sections, own in zip(self.pieces, motion, strict=True)
        ]

    def point_masses(self) -> Iterator[tuple[str, Int[np.ndarray, " wire"], float]]:
        """Part, coordinates and mass (kg) of each motion of the masses of dampers."""
        for number, (_, part, damper) in enumerate(self.sprung):
            yield part, self.masses(number), damper.mass
        for joint, damper in enumerate(self.dampers):
            if damper is not None:
                sprung = wire_damper.sprung_parts(damper)
                for part in ("bend-1", "bend-2", "stretch"):
                    if part not in sprung:
                        yield part, self.joint(joint, part), damper.mass

    def springs(self, size: int) -> Iterator[tuple[WireDamper, float, Array]]:
        """Damper, temperature (K) and stiffness matrix of the springs of each motion."""
        for number, (joint, part, damper) in enumerate(self.sprung):
            stretch = np.zeros((self.count, size))
            wires = np.arange(self.count)
            stretch[wires, self.masses(number)] = 1.0
            stretch[wires, self.joint(joint, part)] = -1.0
            temperature = self.pieces[joint][-1].temperature
            yield damper, temperature, damper.spring * stretch.T @ stretch

    def damper_energies(
        self, motion: Inexact[np.ndarray, "mode coordinate"]
    ) -> Float[np.ndarray, "part mode"]:
        """Twice the kinetic energy of dampers over omega^2, kg m^2, by part of the motion."""
        result = np.zeros((len(PARTS), len(motion)))
        for part, coordinates, mass in self.point_masses():
            result[PARTS.index(part)] += mass * (np.abs(motion[:, coordinates]) ** 2).sum(1)
        return result


def cut_all(model: LinearSystem, fraction: float) -> tuple[LinearSystem, list[CutWires]]:
    """Cut every wire, between its dampers at a fraction of the length; return also each kind.

    The coordinates are the model's, then those of each kind. The first terms are the pieces of the
    wires of each kind, from the top.
    """
    kinds: list[CutWires] = []
    start = model.size
    for term in model.terms:
        if isinstance(term, WireTerm):
            kinds.append(CutWires.of(term, fraction, start))
            start = kinds[-1].end
    size = start
    stiffness, mass = np.zeros((2, size, size))
    pieces: list[WireTerm] = []
    losses: list[Term] = []
    for kind in kinds:
        own = kind.terms(size)
        pieces += own
        for sign, one in (-1, kind.term), *((1, piece) for piece in own):
            stiffness[np.ix_(one.columns, one.columns)] += sign * _static_stiffness(one)
        for _, coordinates, each in kind.point_masses():
            mass[coordinates, coordinates] += each
        for damper, temperature, spring in kind.springs(size):
            stiffness += spring
            cause = f"{kind.term.stage}.dampers"
            angle = partial(np.full_like, fill_value=damper.loss_angle, dtype=float)
            losses.append(StructuralLoss(cause, temperature, spring, angle))
    units = sum((kind.units for kind in kinds), ())
    cuts = AddedCoordinates(
        tuple(name for kind in kinds for name in kind.names),
        units,
        momentum_units(units),
        mass,
        stiffness,
        np.zeros_like(mass),
        belong_to_bodies=True,
    )
    system = model.widened(cuts)
    others = [term for term in system.terms if not isinstance(term, WireTerm)]
    return (
        replace(
            system,
            elongation=np.zeros((0, size)),
            k=np.zeros(0),
            allowed=np.ones((size, size), dtype=bool),
            terms=(*pieces, *others, *losses),
            rigid=None,
        ),
        kinds,
    )


def _static_stiffness(term: WireTerm) -> Array:
    """Static stiffness of wires among `term.columns`, without their stretching."""
    result = np.zeros((len(term.columns),) * 2)
    for part, rows in term.motion.items():
        if part != "stretch":
            static = term.strand.static[part]
            result += np.einsum("wic,ij,wjd->cd", rows, static, rows)
    return result


def _between(sections: tuple[Section, ...], upper: float, lower: float) -> tuple[Section, ...]:
    """Sections between two places (m) below the upper end of a wire, without dampers."""
    found = []
    start = 0.0
    for section in sections:
        end = start + section.length
        inside = min(end, lower) - max(start, upper)
        if inside > 1e-12 * section.length:
            found.append(replace(section, length=inside, damper=None))
        start = end
    return tuple(found)
