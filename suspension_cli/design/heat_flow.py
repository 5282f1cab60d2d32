"""Temperatures of bodies and along wires, from the heat that wires and links conduct.

Steady conduction in a wire of cross-section A(s) obeys Q = -A kappa(T) dT/ds, with the same heat Q
at each place. With Kirchhoff's integral theta(T) of the conductivity kappa,

    theta_1 - theta_2 = Q R,    R = integral of ds / A,

so theta is linear in the part of R up to a place, whatever kappa(T) is (Carslaw and Jaeger,
Conduction of Heat in Solids, section 1.6). Every body has one temperature; a wire of several
materials has one at each joint too. Those that are not held follow from the balance of heat: what
flows in by conductors, and what is absorbed, add up to 0. Radiation, the gas, the resistance of
joints and of blades are neglected.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgspec

from suspension_cli.conventions import GROUND, SUPPORT
from suspension_cli.design import derive, materials
from suspension_cli.design.derive import Keystone
from suspension_cli.design.heat import HOTTEST
from suspension_cli.design.links import Link
from suspension_cli.design.materials import Property, integrate, value_at
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.typed_tables import Problems
from suspension_cli.design.wires import BOUNDARIES, Wire, WireSet, stretches
from suspension_cli.errors import Fault, InputError, suggest

BALANCED = 1e-9
"""Heat that is left over in a body, over all that is conducted, below which it is rounding."""
EVEN = 1e-9
"""Relative difference of temperatures along a wire that is rounding."""


@dataclass(frozen=True)
class Piece:
    """A stretch of a conductor of one material."""

    material: str
    conductivity: Property  # W/(m K)
    stretches: tuple[tuple[float, float], ...]  # uniform: length (m), that over its area (1/m)

    @property
    def length(self) -> float:
        """Length, m."""
        return sum(length for length, _ in self.stretches)

    @property
    def resistance(self) -> float:
        """Integral of ds / A, 1/m."""
        return sum(resistance for _, resistance in self.stretches)


@dataclass(frozen=True)
class Conductor:
    """Equal wires side by side between two bodies, pieces from the first to the second."""

    label: str
    ends: tuple[str, str]
    count: int
    pieces: tuple[Piece, ...]

    @property
    def nodes(self) -> list[str]:
        """Names of the two bodies, and between them of the joints of the pieces."""
        joints = [f"{self.label} {n}" for n in range(1, len(self.pieces))]
        return [self.ends[0], *joints, self.ends[1]]


@dataclass(frozen=True)
class HeatFlow:
    """Solution: temperatures (K) of bodies and joints, and what conducts.

    Attributes
    ----------
    temperature
        By the name of a body or joint, K.
    absorbed
        By the name of a body, W.
    """

    temperature: dict[str, float]
    absorbed: dict[str, float]
    conductors: tuple[Conductor, ...]

    def power(self, conductor: Conductor) -> float:
        """Heat that flows from the first to the second body of a conductor, W."""
        upper, lower = (self.temperature[name] for name in conductor.nodes[:2])
        piece = conductor.pieces[0]
        return conductor.count * integrate(piece.conductivity, lower, upper) / piece.resistance

    def profile(self, conductor: Conductor) -> float | list[list[float]]:
        """Temperature of a wire, K; where it varies, [fraction of the length, K] along it."""
        ends = [self.temperature[name] for name in conductor.nodes]
        if max(ends) - min(ends) <= EVEN * max(ends):
            return ends[0]
        whole = sum(piece.length for piece in conductor.pieces)
        found: list[list[float]] = []
        start = 0.0
        for piece, (upper, lower) in zip(conductor.pieces, pairwise(ends), strict=True):
            passed = 0.0
            for length, resistance in piece.stretches:
                end = start + length / whole
                inside = [place for place in BOUNDARIES if start + EVEN < place < end - EVEN]
                for place in [start, *inside]:
                    here = passed + resistance * (place - start) / (end - start)
                    part = here / piece.resistance
                    found.append([place, _interpolate(piece.conductivity, upper, lower, part)])
                start = end
                passed += resistance
        return [*found, [1.0, ends[-1]]]


def _interpolate(conductivity: Property, upper: float, lower: float, part: float) -> float:
    """Temperature (K) at a part of the resistance of a piece from its upper end."""
    from scipy.optimize import brentq

    if part == 0 or upper == lower:
        return upper
    wanted = part * integrate(conductivity, upper, lower)

    def miss(kelvin: float) -> float:
        return integrate(conductivity, upper, kelvin) - wanted

    found: Any = brentq(miss, upper, lower)
    return found


def list_conductors(design: Design) -> tuple[Conductor, ...]:
    """List the wires of stages, and the links made of a material, as conductors of heat."""
    place = derive.origin_positions(design)
    found: list[Conductor] = []
    for stage, above in derive.with_bodies_above(design):
        ends = (_body(design, above), _body(design, stage.name))
        for label, wire in _wire_tables(stage):
            count = wire.count if isinstance(wire, WireSet) else 1
            length = _length(wire, place[above], place[stage.name])
            pieces = [
                (piece.material or "", piece.length, piece.length / piece.shape.area)
                for piece in stretches(wire, length)
            ]
            found.append(Conductor(label, ends, count, _merge(design, pieces)))
    for link in design.link:
        if link.strands is not None and link.cross_section is not None:
            ends = (_body(design, link.between[0]), _body(design, link.between[1]))
            length = _strand_length(link, place)
            piece = (link.strands.material, length, length / link.cross_section.area)
            found.append(Conductor(link.name, ends, link.strands.count, _merge(design, [piece])))
    return tuple(found)


def _wire_tables(stage: Stage) -> Iterator[tuple[str, WireSet | Wire]]:
    """List the tables of the wires of a stage, with labels."""
    if stage.wires is not None:
        yield f"{stage.name}.wires", stage.wires
    for number, wire in enumerate(stage.wire, 1):
        yield f"{stage.name}.{number}", wire


def _body(design: Design, name: str) -> str:
    """Name the body of a stage; a keystone has the temperature of its filter."""
    keystones = {one.name: one.blades_of for one in design.stage if isinstance(one, Keystone)}
    return keystones.get(name, name)


def _length(wire: WireSet | Wire, above: derive.Point, body: derive.Point) -> float:
    """Length of a wire between bodies whose origins are at `above` and `body`, m."""
    if isinstance(wire, WireSet):
        return wire.l
    upper = [a + b for a, b in zip(above, wire.upper, strict=True)]
    lower = [a + b for a, b in zip(body, wire.lower, strict=True)]
    return wire.natural_length or math.dist(upper, lower)


def _strand_length(link: Link, place: dict[str, derive.Point]) -> float:
    """Length of one wire of a link, m."""
    strands = link.strands
    assert strands is not None
    if strands.length is not None:
        return strands.length
    origin = (0.0, 0.0, 0.0)
    first, second = (place.get(name, origin) for name in link.between)
    end = [b + to - a for a, b, to in zip(first, second, strands.to, strict=True)]
    return sum(math.dist(*pair) for pair in pairwise([link.at, *strands.points, end]))


def _merge(design: Design, pieces: Sequence[tuple[str, float, float]]) -> tuple[Piece, ...]:
    """Merge neighbours of one material: name, length and resistance of each stretch."""
    merged: list[Piece] = []
    for name, *stretch in pieces:
        own = ((stretch[0], stretch[1]),)
        if merged and merged[-1].material == name:
            own = (*merged.pop().stretches, *own)
        conductivity = materials.look_up(design, name).thermal_conductivity or 0.0
        merged.append(Piece(name, conductivity, own))
    return tuple(merged)


def find_faults(design: Design) -> Problems:
    """Find what keeps temperatures from following from `[heat]`: key, problem and remedy."""
    heat = design.heat
    if heat is None:
        return
    stages = [stage.name for stage in design.stage]
    unknown = [
        (f"heat.{key}.{name}", "names no body", suggest(name, known))
        for key, known in (("held", [SUPPORT, GROUND, *stages]), ("absorbed", stages))
        for name in getattr(heat, key)
        if name not in known
    ]
    if unknown:
        yield from unknown
        return
    yield from _find_conflicts(design)
    conductors = list_conductors(derive.add_keystones(design))
    for name in sorted({piece.material for one in conductors for piece in one.pieces}):
        if name and materials.look_up(design, name).thermal_conductivity is None:
            remedy = "give it in W/(m K), a number or a table against temperature, for [heat]"
            yield f"materials.{name}.thermal_conductivity", "missing", remedy
    for one in conductors:
        if not one.pieces or not all(piece.material for piece in one.pieces):
            remedy = "give its material and radius or section, for its conductivity"
            yield f"stage.{one.label}", "conducts an unknown heat, so [heat] fails", remedy
    reached = {*heat.held}
    for _ in stages:
        reached |= {name for one in conductors if reached & {*one.ends} for name in one.ends}
    for name in stages:
        if name not in reached:
            problem = f"lacks {name}, from which no wire or link conducts heat to a held body"
            yield "heat.held", problem, f"give its temperature in K: held = {{ {name} = ... }}"


def _find_conflicts(design: Design) -> Problems:
    """Find parts that give a temperature, which follows from `[heat]`."""
    for stage in design.stage:
        path = f"stage.{stage.name}"
        tables = [
            *((path + label.removeprefix(stage.name), one) for label, one in _wire_tables(stage)),
            *((f"{path}.blades", blade) for blade in [stage.blades] if blade is not None),
            *((f"{path}.{blade.name}", blade) for blade in stage.blade),
        ]
        for where, table in tables:
            if table.temperature is not None:
                yield f"{where}.temperature", "follows from [heat]", "remove one of the two"


@dataclass(frozen=True)
class _Network:
    """Balance of heat in the bodies and joints whose temperature is not held."""

    free: list[str]
    held: dict[str, float]
    absorbed: dict[str, float]
    conductors: tuple[Conductor, ...]

    @property
    def edges(self) -> Iterator[tuple[float, Property, tuple[str, str]]]:
        """Area over length (m), conductivity and ends of what conducts."""
        for one in self.conductors:
            for piece, ends in zip(one.pieces, pairwise(one.nodes), strict=True):
                yield one.count / piece.resistance, piece.conductivity, ends

    def name(self, kelvin: Sequence[float]) -> dict[str, float]:
        """All temperatures by name, of those that are free."""
        return self.held | {name: float(own) for name, own in zip(self.free, kelvin, strict=True)}

    def gained(self, kelvin: Sequence[float]) -> list[float]:
        """Heat that each free body or joint gains, W."""
        known = self.name(kelvin)
        gained = dict.fromkeys(known, 0.0) | self.absorbed
        for conductance, conductivity, (first, second) in self.edges:
            power = conductance * integrate(conductivity, known[second], known[first])
            gained[first] -= power
            gained[second] += power
        return [gained[name] for name in self.free]

    def slope(self, kelvin: Sequence[float]) -> list[list[float]]:
        """Derivatives of `gained` with the temperatures, W/K."""
        known = self.name(kelvin)
        places = {name: place for place, name in enumerate(self.free)}
        slope = [[0.0] * len(self.free) for _ in self.free]
        for conductance, conductivity, ends in self.edges:
            for warmer, other in (ends, ends[::-1]):
                column = places.get(warmer)
                if column is None:
                    continue
                change = conductance * value_at(conductivity, known[warmer])
                slope[column][column] -= change
                if other in places:
                    slope[places[other]][column] += change
        return slope


def solve(design: Design) -> HeatFlow | None:
    """Solve for the temperatures of a design; None without `[heat]`.

    Raises `InputError` if the conductors cannot carry the heat.
    """
    heat = design.heat
    if heat is None:
        return None
    from scipy.optimize import least_squares

    conductors = list_conductors(design)
    names = dict.fromkeys(name for one in conductors for name in one.nodes)
    free = [name for name in names if name not in heat.held]
    network = _Network(free, heat.held, heat.absorbed, conductors)
    solution: Sequence[float] = []
    if free:
        slope: Any = network.slope
        solution = least_squares(
            network.gained,
            [1.01 * max(heat.held.values())] * len(free),
            jac=slope,
            bounds=(0.99 * min(heat.held.values()), HOTTEST),
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=1000,
        ).x
    flow = HeatFlow(network.name(solution), heat.absorbed, conductors)
    _demand_balance(flow, network.gained(solution))
    return flow


def _demand_balance(flow: HeatFlow, left: Sequence[float]) -> None:
    """Raise `InputError` if heat is left over."""
    scale = sum(flow.absorbed.values()) + sum(abs(flow.power(one)) for one in flow.conductors)
    if max(map(abs, left), default=0.0) > BALANCED * scale:
        problem = f"no temperatures up to {HOTTEST:g} K carry the heat away"
        remedy = "check the power in W, and the conductivity and cross-section of wires and links"
        raise InputError([Fault("heat.absorbed", problem, remedy)])


def complete(design: Design) -> Design:
    """Add what the file leaves to be computed: keystones of filters, temperatures from `[heat]`.

    Wires have the profile along them, blades the temperature of the body that they are fixed to.
    """
    design = derive.add_keystones(design)
    flow = solve(design)
    if flow is None:
        return design
    along = {one.label: flow.profile(one) for one in flow.conductors}
    stages = []
    for stage, above in derive.with_bodies_above(design):
        there = flow.temperature.get(_body(design, above))
        tables = {label: _at(table, along[label]) for label, table in _wire_tables(stage)}
        wires = tables.pop(f"{stage.name}.wires", None)
        blades = stage.blades and _at(stage.blades, there)
        each = {"wire": [*tables.values()], "blade": [_at(one, there) for one in stage.blade]}
        stages.append(msgspec.structs.replace(stage, wires=wires, blades=blades, **each))
    return msgspec.structs.replace(design, stage=stages)


def reduce_to_file(design: Design) -> Design:
    """Remove what `complete` added."""
    design = derive.drop_keystones(design)
    if design.heat is None:
        return design
    stages = []
    for stage in design.stage:
        wires = stage.wires and _at(stage.wires, None)
        blades = stage.blades and _at(stage.blades, None)
        each = {
            name: [_at(one, None) for one in getattr(stage, name)] for name in ("wire", "blade")
        }
        stages.append(msgspec.structs.replace(stage, wires=wires, blades=blades, **each))
    return msgspec.structs.replace(design, stage=stages)


def _at(table: Any, temperature: Any) -> Any:
    """A wire or blade at a temperature."""
    return msgspec.structs.replace(table, temperature=temperature)
