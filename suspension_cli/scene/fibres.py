"""Composition of the wires and blades of a design, for the models in which wires bend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from suspension_cli.conventions import AVOGADRO
from suspension_cli.design import materials
from suspension_cli.design.cross_sections import Round
from suspension_cli.design.derive import blade_material, gravity_strength, wire_signs
from suspension_cli.design.losses import Bulk, Mechanism, mechanisms_of
from suspension_cli.design.schema import Design, Material, Spring
from suspension_cli.design.sections import Stretch, stretches
from suspension_cli.design.wires import (
    Blade,
    BladeSet,
    Clamp,
    EndTemperatures,
    Wire,
    WireSet,
    is_ring,
)
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.arrays import Array, gather
from suspension_cli.scene.composition import BladeLoss, Fibre, Fibres, Gas, Section
from suspension_cli.scene.expand import list_wires
from suspension_cli.scene.links import link_loss, of_stage
from suspension_cli.scene.scene import Wires

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
    rows, blade_rows = list_wires(design)
    wires: list[Fibre] = []
    for stage in design.stage:
        for table in stage.wire_tables:
            count = table.count if isinstance(table, WireSet) else 1
            own = gather(Wires, rows[len(wires) : len(wires) + count])
            wires += _fibres(design, table, own)

    @cache
    def losses(name: str) -> tuple[Mechanism, ...]:
        return mechanisms_of(materials.resolve(design, name), None)

    blades: list[BladeLoss] = []
    for stage in design.stage:
        for table in [stage.blades] * stage.blades.count if stage.blades else stage.blade:
            row, material = blade_rows[len(blades)], blade_material(table)
            own = None if material is None else losses(material)
            blades.append(_blade(row["label"], table, own, row["loss"], ambient))
    springs = [
        _blade(row["label"], spring, losses(spring.material), row["loss"], ambient)
        for stage in design.stage
        for spring, row in zip(stage.spring, of_stage(design, stage), strict=True)
        if spring.material is not None
    ]
    for link in design.link:
        if (wire := link.strands) is not None and link.loss_angle is None:
            angle, shape = link_loss(design, link), Round(wire.diameter / 2, wire.diameter / 2)
            known = angle, losses(wire.material), wire.diameter, ambient, shape
            springs.append(BladeLoss(f"{link.name}.link", *known))
    gas = design.gas and Gas(
        design.gas.pressure,
        design.gas.molar_mass / AVOGADRO,
        design.gas.temperature or ambient,
    )
    return Fibres(tuple(wires), tuple(blades), gas, ambient, tuple(springs))


def _fibres(design: Design, table: WireSet | Wire, lines: Wires) -> Iterator[Fibre]:
    """Compose the wires of one table."""
    directions = lines.span / lines.length[:, None]
    at = table.temperature or design.constants.temperature
    length = table.l if isinstance(table, WireSet) else table.natural_length or lines.length[0]
    sections = _sections(design, table, length)
    if lines.mass.any():
        sections = _weighed(sections, directions[0], lines.mass[0], gravity_strength(design))
    for number, (label, direction) in enumerate(zip(lines.label, directions, strict=True)):
        yield Fibre(
            label=label,
            sections=sections,
            plane=_plane(direction),
            clamp=_clamp(number, table, direction),
            temperature=(at.upper, at.lower) if isinstance(at, EndTemperatures) else (at, at),
            effective=table.clamp == "bending-point",
        )


def _sections(design: Design, table: WireSet | Wire, length: float) -> tuple[Section, ...]:
    """Sections of a wire of a length (m); a given k scales their stretching stiffness."""
    pieces = stretches(table, length)
    known = {name: materials.resolve(design, name) for name in {p.material or "" for p in pieces}}
    losses = {name: mechanisms_of(own, table) for name, own in known.items()}
    names = [piece.material or "" for piece in pieces]
    sections = tuple(
        _section(piece, known[name], losses[name])
        for piece, name in zip(pieces, names, strict=True)
    )
    if table.k is None:
        return sections
    along = table.k * sum(own.length / own.stretching for own in sections)
    return tuple(replace(own, stretching=along * own.stretching) for own in sections)


def _weighed(
    sections: tuple[Section, ...], direction: Array, moments: Array, gravity: float
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
        left = left - own
    return tuple(result)


def _section(piece: Stretch, material: Material, losses: tuple[Mechanism, ...]) -> Section:
    """Compute the stiffnesses of one stretch of wire."""
    poisson, modulus = material.poisson_ratio, material.youngs_modulus
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
    )


def _plane(direction: Array) -> Array:
    """Find the unit vector across a wire nearest to x (to y for a wire along x)."""
    for axis in np.eye(3):
        across = axis - (axis @ direction) * direction
        size = np.sqrt(across @ across)
        if size > 1e-3:
            return across / size
    raise AssertionError("no direction is along both x and y")


def _clamp(number: int, table: WireSet | Wire, along: Array) -> tuple[Array, Array]:
    """Directions in which a wire leaves its clamps.

    A symmetric set gives those of its first wire, mirrored (on a ring: turned) for the others.
    """
    clamp = table.clamp if isinstance(table.clamp, Clamp) else Clamp()
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


def _blade(
    label: str,
    table: BladeSet | Blade | Spring,
    losses: tuple[Mechanism, ...] | None,
    angle: float,
    ambient: float,
) -> BladeLoss:
    """Look up the loss of a blade or spring; its own loss angle replaces the bulk's."""
    if losses is not None and table.loss_angle is not None:
        others = tuple(own for own in losses if not isinstance(own, Bulk))
        losses = (Bulk(table.loss_angle), *others)
    geometry = None if isinstance(table, Spring) else table.geometry
    thickness = table.thickness if geometry is None else geometry.thickness
    return BladeLoss(label, angle, losses, thickness or 0.0, table.temperature or ambient)
