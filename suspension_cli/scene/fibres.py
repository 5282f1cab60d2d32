"""Composition of the wires and blades of a design, for the models in which wires bend."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from suspension_cli.design import materials
from suspension_cli.design.derive import (
    gravity_strength,
    part_loss,
    wire_signs,
)
from suspension_cli.design.links import Link
from suspension_cli.design.materials import (
    Bulk,
    Material,
    Mechanism,
    at_temperature,
    mechanisms_of,
)
from suspension_cli.design.schema import Design, Spring
from suspension_cli.design.wires import (
    CLOSE,
    AnyBlade,
    Clamp,
    Stretch,
    Wire,
    WireDamper,
    WireSet,
    is_ring,
    stretches,
)
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.arrays import Array, Row
from suspension_cli.scene.expand import members_of
from suspension_cli.scene.scene import BladeLoss, Fibre, Fibres, Section

POISSON = 0.3
"""Poisson's ratio of a material for which none is known."""


def explain_unsuitable(design: Design, massive: bool) -> str:
    """Explain why wires of a design cannot be beams (if `massive`, with mass); "" if all can."""
    for stage in design.stage:
        for number, wire in enumerate(stage.wire_tables, 1):
            pieces = stretches(wire, 1.0)
            name = f"wire {stage.name}.{number}"
            if not pieces:
                return f"{name} has no cross-section"
            for piece in pieces:
                if piece.material is None:
                    return f"{name} has no material"
                if massive and materials.resolve(design, piece.material).density is None:
                    return f"{name} is of {piece.material}, which has no density"
    return ""


def compose(design: Design) -> Fibres:
    """List the composition of wires and blades of a design, in the scene's order.

    Without imperfections. `explain_unsuitable` must return "" for the design.
    """
    ambient = design.constants.temperature
    members = members_of(design)
    wires: list[Fibre] = []
    blades: list[BladeLoss] = []
    springs: list[BladeLoss] = []
    for stage, lines, rows in zip(design.stage, members.wires, members.blades, strict=True):
        if stage.wires is not None:
            wires += _fibres(design, stage.wires, lines)
        for wire, line in zip(stage.wire, lines, strict=False):
            wires += _fibres(design, wire, [line])
        tables = [stage.blades] * stage.blades.count if stage.blades else stage.blade
        for row, table in zip(rows, tables, strict=True):
            blades.append(_part_loss(design, row["label"], table))
        for n, spring in enumerate(stage.spring, 1):
            if spring.made_of is not None:
                springs.append(_part_loss(design, f"{stage.name}.spring{n}", spring))
    for link in design.link:
        if link.made_of is not None and link.loss_angle is None:
            springs.append(_part_loss(design, f"{link.name}.link", link))
    gas = design.gas and msgspec.structs.replace(
        design.gas, temperature=design.gas.temperature or ambient
    )
    return Fibres(tuple(wires), tuple(blades), gas, ambient, tuple(springs))


def _fibres(design: Design, table: WireSet | Wire, lines: Sequence[Row]) -> Iterator[Fibre]:
    """Compose the wires of one table."""
    length = table.l if isinstance(table, WireSet) else table.natural_length or lines[0]["length"]
    sections = _sections(design, table, length)
    moments = lines[0]["mass"]
    for number, line in enumerate(lines):
        direction = line["span"] / line["length"]
        if number == 0 and any(moments):
            sections = _weighed(sections, direction, moments, gravity_strength(design))
        yield Fibre(
            label=line["label"],
            sections=sections,
            plane=_plane(direction),
            clamp=_clamp(number, table, direction),
            effective=table.clamp == "bending-point",
        )


def _sections(design: Design, table: WireSet | Wire, length: float) -> tuple[Section, ...]:
    """Sections of a wire of a length (m); a given k scales their stretching stiffness."""
    made: dict[str, tuple[Material, tuple[Mechanism, ...]]] = {}
    sections = []
    for piece in stretches(table, length):
        name = piece.material or ""
        if name not in made:
            own = materials.look_up(design, name)
            made[name] = own, mechanisms_of(own, table)
        temperature = piece.temperature or design.constants.temperature
        sections.append(_section(piece, *made[name], temperature))
    sections = _with_dampers(sections, table.dampers)
    if table.k is None:
        return tuple(sections)
    along = table.k * sum(own.length / own.stretching for own in sections)
    return tuple(replace(own, stretching=along * own.stretching) for own in sections)


def _with_dampers(sections: list[Section], dampers: Sequence[WireDamper]) -> list[Section]:
    """Cut the sections of a wire where dampers are, each at the lower end of a section."""
    whole = sum(section.length for section in sections)
    left = list(sections)
    result: list[Section] = []
    above = 0.0
    for damper in dampers:
        place = damper.at * whole
        while above + left[0].length < place * (1 - CLOSE):
            result.append(left.pop(0))
            above += result[-1].length
        upper = min(place - above, left[0].length)
        lower = left[0].length - upper
        result.append(replace(left[0], length=upper, damper=damper))
        above += upper
        left[0] = replace(left[0], length=lower)
        if lower < CLOSE * whole:
            left.pop(0)
    return [*result, *left]


def _weighed(
    sections: tuple[Section, ...], direction: Array, moments: Sequence[float], gravity: float
) -> tuple[Section, ...]:
    """Sections with their `tension_offset`.

    Down from the upper end the tension falls by the weight above, times the cosine of the angle to
    the vertical. That of the wire is below that of its upper end by the part m_uu + m_ul of the
    weight that this end carries (`elements.weight`).
    """
    along = -gravity * direction[2]
    left = moments[0] + moments[1]
    result = []
    for section in sections:
        own = section.mass * section.length
        result.append(replace(section, tension_offset=along * (left - own / 2)))
        left = left - own - (section.damper.mass if section.damper else 0.0)
    return tuple(result)


def _section(
    piece: Stretch, material: Material, losses: tuple[Mechanism, ...], temperature: float
) -> Section:
    """Compute the stiffnesses of one stretch of wire at a temperature (K)."""
    poisson = material.poisson_ratio
    modulus = at_temperature(material, temperature).youngs_modulus
    density = material.density or 0.0
    assert modulus is not None  # known for all wires (`explain_unsuitable`)
    shear = modulus / (2 * (1 + (POISSON if poisson is None else poisson)))
    shape = piece.shape
    first, second = shape.moments
    mass, polar = shape.bulk
    return Section(
        length=piece.length,
        rigidity=(modulus * first, modulus * second),
        stretching=modulus * shape.area,
        twisting=shear * shape.torsion,
        mass=density * mass,
        polar=density * polar,
        shape=shape,
        losses=losses,
        temperature=temperature,
    )


def _plane(direction: Array) -> Array:
    """Find the unit vector across a wire nearest to x (to y for a wire along x)."""
    across, along_y = np.eye(3)[:2] - direction[:2, None] * direction
    if (across**2).sum() <= 1e-6:
        across = along_y
    return across / np.sqrt((across**2).sum())


def _clamp(number: int, table: WireSet | Wire, along: Array) -> tuple[Array, Array]:
    """Directions in which a wire leaves its clamps.

    A symmetric set gives those of its first wire, mirrored (on a ring: turned) for the others.
    """
    clamp = table.clamp
    if not isinstance(clamp, Clamp):
        return along, along
    turn = np.eye(3)
    if isinstance(table, WireSet) and is_ring(table):
        angle = 2 * np.pi * number / table.count
        turn = rotation_matrix(np.array([0.0, 0.0, angle]))
    elif isinstance(table, WireSet):
        x, y = wire_signs(table.count)[number]
        turn = np.diag([x or 1, y or 1, 1.0])

    def direction(given: tuple[float, float, float] | None) -> Array:
        if given is None:
            return along
        turned = turn @ np.array(given)
        return turned / np.sqrt(turned @ turned)

    return direction(clamp.upper), direction(clamp.lower)


def _part_loss(design: Design, label: str, part: AnyBlade | Spring | Link) -> BladeLoss:
    """Look up the loss of a part; its own loss angle replaces the bulk's."""
    ambient = design.constants.temperature
    losses = None
    if part.made_of is not None:
        losses = mechanisms_of(materials.look_up(design, part.made_of), None)
        if part.loss_angle is not None:
            others = tuple(own for own in losses if not isinstance(own, Bulk))
            losses = (Bulk(part.loss_angle), *others)
    angle = part_loss(design, part)
    if isinstance(part, Link):
        shape = part.cross_section
        assert shape is not None
        return BladeLoss(label, angle, losses, min(shape.depth), ambient, shape)
    geometry = None if isinstance(part, Spring) else part.geometry
    thickness = (part.thickness if geometry is None else geometry.thickness) or 0.0
    return BladeLoss(label, angle, losses, thickness, part.temperature or ambient)
