"""Quantities derived from a design: stiffness of wires and blades, losses, places, gravity."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from suspension_cli.conventions import SUPPORT
from suspension_cli.design import materials, towers
from suspension_cli.design.bodies import Body, Point, centre_of_mass
from suspension_cli.design.links import Link
from suspension_cli.design.schema import Design, Spring, Stage
from suspension_cli.design.towers import SUFFIX, Filter, keystone_inertia
from suspension_cli.design.wires import (
    AnyBlade,
    BladeGeometry,
    Stretch,
    Wire,
    WireSet,
    is_ring,
    stretches,
)


def wire_stiffness(design: Design, wire: WireSet | Wire, length: float) -> float:
    """Compute the spring constant of a wire in N/m: given, or k = E A / l.

    l is the loaded length in the nominal pose (Husman et al., equation 15) or the given unstretched
    one. Sections are in series.
    """
    if wire.k is not None:
        return wire.k
    pieces = stretches(wire, length)
    if len(pieces) == 1 and wire.sections is None:
        modulus = _modulus(design, pieces[0].material or "", pieces[0].temperature)
        return modulus * pieces[0].shape.least_area / length
    return 1.0 / sum(_compliance(design, piece) for piece in pieces)


def _compliance(design: Design, piece: Stretch) -> float:
    """Elongation of a uniform stretch of wire per tension, m/N."""
    modulus = _modulus(design, piece.material or "", piece.temperature)
    return piece.length / (modulus * piece.shape.area)


def _modulus(design: Design, material: str, temperature: float | None) -> float:
    modulus = materials.resolve(design, material, temperature).youngs_modulus
    assert modulus is not None
    return modulus


def wire_loss(design: Design, wire: WireSet | Wire, length: float) -> float:
    """Compute the loss angle of the stretching of a wire of a loaded length (m), rad.

    That of its material in the design, or 0; of several sections the mean weighted by compliance.
    """
    pieces = [piece for piece in stretches(wire, length) if piece.material is not None]
    names = [piece.material for piece in pieces] or [wire.material]
    angles = [0.0 if name is None else materials.constant_angle(design, name) for name in names]
    if len({*angles}) == 1:
        return angles[0]
    compliances = [_compliance(design, piece) for piece in pieces]
    return sum(c * a for c, a in zip(compliances, angles, strict=True)) / sum(compliances)


def part_loss(design: Design, part: AnyBlade | Spring | Link) -> float:
    """Look up the loss angle of a part, rad: its own, or that of its material in the design."""
    if part.loss_angle is not None:
        return part.loss_angle
    return 0.0 if part.made_of is None else materials.constant_angle(design, part.made_of)


def blade_stiffness(design: Design, blade: AnyBlade, stage_mass: float, count: int) -> float:
    """Compute the vertical stiffness of one blade at its tip in N/m.

    Given; or (2 pi f)^2 m / count for an uncoupled frequency f of the stage's mass m on `count`
    blades; or from the geometry.
    """
    if blade.stiffness is not None:
        return blade.stiffness
    if blade.uncoupled_frequency is not None:
        return (2 * math.pi * blade.uncoupled_frequency) ** 2 * stage_mass / count
    assert blade.geometry is not None
    modulus = _modulus(design, blade.geometry.material, blade.temperature)
    return cantilever_stiffness(blade.geometry, modulus)


def cantilever_stiffness(blade: BladeGeometry, youngs_modulus: float) -> float:
    """Compute the vertical stiffness of a cantilever blade from its geometry, N/m.

    k = E a h^3 / (4 alpha L^3) with base width a, thickness h, length L and shape factor alpha:
    alpha = 1 for a rectangular blade (then k = 3 E I / L^3), 1.5 for a triangular one. Torrie, PhD
    thesis, University of Glasgow (2001), after Plissi et al., Rev. Sci. Instrum. 71, 2539 (2000).
    """
    rest = 4 * blade.shape_factor * blade.length**3
    return youngs_modulus * blade.base_width * blade.thickness**3 / rest


def gives_natural_lengths(design: Design) -> bool:
    """Whether a design gives a natural length, so that its nominal pose need not balance."""
    return any(wire.natural_length is not None for stage in design.stage for wire in stage.wire)


@dataclass(frozen=True)
class SetGeometry:
    """Geometry of a symmetric set of wires (all in m; the paper's symbols)."""

    count: int
    length: float
    s_upper: float
    s_lower: float
    t1: float
    t2: float
    d: float
    d_upper: float
    ring_upper: float = 0.0
    ring_lower: float = 0.0
    phase: float = 0.0
    is_ring: bool = False

    @property
    def ends(self) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        """x and y (m) of the upper and of the lower end of each wire."""
        if not self.is_ring:
            return [
                ((x * self.s_upper, y * self.t1), (x * self.s_lower, y * self.t2))
                for x, y in wire_signs(self.count)
            ]
        turns = (towers.direction(self.phase, n, self.count) for n in range(self.count))
        upper = self.ring_upper
        lower = self.ring_lower
        return [((upper * x, upper * y), (lower * x, lower * y)) for x, y in turns]

    @property
    def height_squared(self) -> float:
        """Square of the vertical span of a wire, m^2; not positive if the wire is too short."""
        if self.is_ring:
            return self.length**2 - (self.ring_upper - self.ring_lower) ** 2
        return self.length**2 - (self.t2 - self.t1) ** 2 - (self.s_lower - self.s_upper) ** 2

    @property
    def height(self) -> Any:
        """Vertical span of a wire in m."""
        return math.sqrt(self.height_squared)


def wire_signs(count: int) -> list[tuple[int, int]]:
    """List the signs of x and y of the wires of a symmetric set, by number."""
    return {1: [(0, 0)], 2: [(0, 1), (0, -1)], 4: [(1, 1), (1, -1), (-1, 1), (-1, -1)]}[count]


def set_geometry(wires: WireSet) -> SetGeometry:
    """Fill in the defaults of the geometry of a symmetric set."""
    values = msgspec.structs.asdict(wires)
    given = {key: values[key] or 0.0 for key in ("t1", "t2", "d", "d_upper", "phase")}
    for whole in ("s", "ring"):
        for end in ("upper", "lower"):
            key = f"{whole}_{end}"
            given[key] = (values[whole] if values[key] is None else values[key]) or 0.0
    return SetGeometry(count=wires.count, length=wires.l, is_ring=is_ring(wires), **given)


def origin_offset(stage: Stage) -> Point:
    """Compute the vector from the origin of the body above (or support point) to that of a stage.

    In the nominal pose, m. The origin is the COM unless the body has parts.
    """
    if stage.wires is not None:
        shape = set_geometry(stage.wires)
        return (0.0, 0.0, -(shape.d_upper + shape.height + shape.d))
    if stage.position is not None:
        return stage.position
    assert stage.inverted_pendulum is not None
    return towers.offset(stage.inverted_pendulum)


def origin_positions(design: Design) -> dict[str, Point]:
    """Compute the nominal origin of every body, the support's included, from the suspension point.

    In m.
    """
    found = {SUPPORT: (0.0, 0.0, 0.0)}
    for stage, above in with_bodies_above(design):
        found[stage.name] = add_points(found[above], origin_offset(stage))
    return found


def com_positions(design: Design) -> dict[str, Point]:
    """Compute the nominal COM of every body from the suspension point (also of the support), m."""
    centre = {SUPPORT: (0.0, 0.0, 0.0)}
    centre |= {stage.name: centre_of_mass(stage.body) for stage in design.stage}
    origins = origin_positions(design)
    return {name: add_points(place, centre[name]) for name, place in origins.items()}


def add_points(one: Sequence[float], other: Sequence[float]) -> Point:
    """Add two vectors."""
    x, y, z = (a + b for a, b in zip(one, other, strict=True))
    return x, y, z


def with_bodies_above(design: Design) -> Iterator[tuple[Stage, str]]:
    """List the stages of a design with its keystones, each with the name of what it hangs from."""
    above = SUPPORT
    for stage in design.stage:
        yield stage, stage.hangs_from or above
        above = stage.name


def main_chain(design: Design) -> list[str]:
    """List the stages from the support to the mirror.

    The mirror is the stage with ``mirror = true``, else the end of the longest chain; of several as
    long, the one that the file lists first.
    """
    chains: dict[str, list[str]] = {SUPPORT: []}
    for stage, above in with_bodies_above(design):
        chains[stage.name] = [*chains[above], stage.name]
    named = [chains[stage.name] for stage in design.stage if stage.mirror]
    return max(named or chains.values(), key=len)


def mirror(design: Design) -> str:
    """Name the mirror, whose motion is the default output of every command."""
    return main_chain(design)[-1]


def gravity_strength(design: Design) -> Any:
    """Compute the strength of gravity at the suspension point, m/s^2."""
    given = design.constants.gravity
    return math.hypot(*given) if isinstance(given, list) else given


def gravity_field(design: Design) -> tuple[list[float], list[list[float]]] | None:
    """Find gravity at the suspension point, m/s^2, and its gradient dg_i/dx_j, 1/s^2.

    None for a uniform pull along -z. A gradient of a single number G is dg_z/dz. Then dg_x/dx =
    dg_y/dy = -G/2, so that the divergence of the field is 0 (Laplace's equation, outside the masses
    that attract).
    """
    vector = design.constants.gravity
    gradient = design.constants.gravity_gradient
    if not isinstance(gradient, list):
        across = -gradient / 2 if gradient else 0.0
        gradient = [[across, 0.0, 0.0], [0.0, across, 0.0], [0.0, 0.0, gradient]]
    if not isinstance(vector, list) or (vector[0] == 0 and vector[1] == 0):
        vector = [0.0, 0.0, -gravity_strength(design)]
        if all(value == 0 for row in gradient for value in row):
            return None
    return vector, gradient


def wire_mass_moments(design: Design, wire: WireSet | Wire, length: float) -> Point:
    """Compute the moments of the mass of a wire of a loaded length (m), kg.

    The integrals of (1 - s)^2, s (1 - s) and s^2 over its mass and that of its dampers, with the
    fraction s of its length from the upper end; 0 without ``constants.wire_weight``, and of wires
    of unknown density or cross-section.
    """
    upper = mixed = lower = start = 0.0
    weighed = design.constants.wire_weight
    for piece, density in wire_line_densities(design, wire, length) if weighed else ():
        end = start + piece / length
        # of uniform stretches: integrals of powers of s
        zeroth = end - start
        first = (end**2 - start**2) / 2
        second = (end**3 - start**3) / 3
        upper += density * length * (zeroth - 2 * first + second)
        mixed += density * length * (first - second)
        lower += density * length * second
        start = end
    for damper in wire.dampers if weighed else ():
        upper += damper.mass * (1 - damper.at) ** 2
        mixed += damper.mass * damper.at * (1 - damper.at)
        lower += damper.mass * damper.at**2
    return upper, mixed, lower


def wire_line_densities(
    design: Design, wire: WireSet | Wire, length: float
) -> list[tuple[float, float]]:
    """List length (m) and mass per length (kg/m) of the uniform stretches of a wire."""
    found = []
    for piece in stretches(wire, length):
        density = materials.resolve(design, piece.material).density if piece.material else None
        found.append((piece.length, (density or 0.0) * piece.shape.bulk[0]))
    return found


def beyond_symmetric_chains(design: Design) -> str:
    """Name the physics that symmetric-chain models omit besides bending and wire mass, or ""."""
    if gravity_field(design) is not None:
        return "its gravity is a vector or has a gradient"
    if design.constants.wire_weight:
        return "its wires have weight"
    for stage in design.stage:
        if stage.wires is not None and is_ring(stage.wires):
            return f"the wires of stage {stage.name} are on a ring"
        if any(wire.bending is not None for wire in stage.wire_tables):
            return f"wires of stage {stage.name} are hinged"
    return ""


class Keystone(Stage, frozen=True):
    """The keystone of a filter: a stage that is not in the file, held by the filter's blades."""

    blades_of: str
    """Name of the stage with the filter."""
    blades_table: Filter
    """The filter."""


def add_keystones(design: Design) -> Design:
    """Insert the keystone of each filter as a stage after that of the filter."""
    stages: list[Stage] = []
    for stage in design.stage:
        stages.append(stage)
        if stage.filter is not None:
            table = stage.filter.keystone
            name = stage.name + SUFFIX
            body = Body(mass=table.mass, inertia=list(keystone_inertia(table)))
            position = stage.filter.at
            stages.append(
                Keystone(
                    name=name,
                    body=body,
                    position=position,
                    blades_of=stage.name,
                    blades_table=stage.filter,
                )
            )
    return msgspec.structs.replace(design, stage=stages)


def drop_keystones(design: Design) -> Design:
    """Remove the stages that `add_keystones` inserted."""
    stages = [stage for stage in design.stage if not isinstance(stage, Keystone)]
    return msgspec.structs.replace(design, stage=stages)
