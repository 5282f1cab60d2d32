"""Composition of the wires and blades of a design, for the models in which wires bend."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from suspension_cli.conventions import AVOGADRO
from suspension_cli.design import materials
from suspension_cli.design.cross_sections.round import Round
from suspension_cli.design.derive import (
    blade_material,
    gravity_strength,
    is_ring,
    spring_loss,
)
from suspension_cli.design.losses.bulk import Bulk
from suspension_cli.design.losses.mechanism import Mechanism
from suspension_cli.design.losses.registry import mechanisms_of
from suspension_cli.design.schema import Design, Material, Spring, Stage
from suspension_cli.design.sections import Stretch, stretches
from suspension_cli.design.wires import Blade, BladeSet, Clamp, EndTemperatures, Wire, WireSet
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import BladeLoss, Fibre, Fibres, Gas, Section
from suspension_cli.scene.expand import expand_stages, wire_signs
from suspension_cli.scene.links import link_loss
from suspension_cli.scene.parts import StagePart, WirePart

POISSON = 0.3
"""Poisson's ratio of a material for which none is known."""


def explain_unsuitable(design: Design, massive: bool) -> str:
    """Explain why wires of a design cannot be beams (if `massive`, with mass); "" if all can."""
    for stage in design.stage:
        for number, wire in enumerate(_wires(stage), 1):
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

    found: dict[tuple[str, int], tuple[Mechanism, ...]] = {}

    def losses(name: str, wire: WireSet | Wire | None) -> tuple[Mechanism, ...]:
        """Losses of a material; equal wires share one object, as tables may be long."""
        key = (name, id(wire))
        if key not in found:
            found[key] = mechanisms_of(materials.resolve(design, name), wire)
        return found[key]

    wires: list[Fibre] = []
    blades: list[BladeLoss] = []
    parts = expand_stages(design)
    for part in parts:
        for number, (wire, table) in enumerate(zip(part.wires, _wires(part.stage), strict=True)):
            temperature = table.temperature or ambient
            natural = table.natural_length if isinstance(table, Wire) else None
            length = natural or np.sqrt(wire.span @ wire.span).item()
            sections = _sections(design, table, length, losses)
            if np.any(wire.mass):
                sections = _weighed(sections, wire, gravity_strength(design))
            wires.append(
                Fibre(
                    label=wire.label,
                    sections=sections,
                    plane=_plane(wire.direction),
                    clamp=_clamp(number, table, wire),
                    temperature=(temperature.upper, temperature.lower)
                    if isinstance(temperature, EndTemperatures)
                    else (temperature, temperature),
                    effective=table.clamp == "bending-point",
                )
            )
        tables = [part.stage.blades] * len(part.blades) if part.stage.blades else part.stage.blade
        for blade, table in zip(part.blades.values(), tables, strict=True):
            material = blade_material(table)
            own = None if material is None else losses(material, None)
            blades.append(_blade(blade.label, table, own, blade.loss, ambient))
    gas = design.gas and Gas(
        design.gas.pressure,
        design.gas.molar_mass / AVOGADRO,
        design.gas.temperature or ambient,
    )
    return Fibres(
        tuple(wires),
        tuple(blades),
        gas,
        ambient,
        (*_springs(design, parts, lambda name: losses(name, None)), *_links(design, losses)),
    )


def _springs(
    design: Design, parts: list[StagePart], losses: Callable[[str], tuple[Mechanism, ...]]
) -> tuple[BladeLoss, ...]:
    """List the losses of the springs of known material, by the labels of the scene."""
    every = [
        (part.stage.name, spring)
        for part in parts
        for spring in (*part.stage.spring, *part.flexures)
    ]
    result = []
    for number, (stage, spring) in enumerate(every, 1):
        if spring.material is not None:
            own, angle = losses(spring.material), spring_loss(design, spring)
            ambient = design.constants.temperature
            result.append(_blade(f"{stage}.spring{number}", spring, own, angle, ambient))
    return tuple(result)


def _links(
    design: Design, losses: Callable[[str, WireSet | Wire | None], tuple[Mechanism, ...]]
) -> Iterator[BladeLoss]:
    """List the losses of links of wires of known material, which bend, by the scene's labels."""
    for link in design.link:
        if link.strands is not None and link.loss_angle is None:
            radius = link.strands.diameter / 2
            yield BladeLoss(
                f"{link.name}.link",
                link_loss(design, link),
                losses(link.strands.material, None),
                link.strands.diameter,
                design.constants.temperature,
                Round(radius, radius),
            )


def _sections(
    design: Design,
    table: WireSet | Wire,
    length: float,
    losses: Callable[[str, WireSet | Wire], tuple[Mechanism, ...]],
) -> tuple[Section, ...]:
    """Sections of a wire of a length (m); a given k scales their stretching stiffness."""
    pieces = [
        (piece, materials.resolve(design, piece.material or ""))
        for piece in stretches(table, length)
    ]
    compliance = sum(piece.length / (_modulus(own) * piece.shape.area) for piece, own in pieces)
    along = 1.0 if table.k is None else table.k * compliance
    return tuple(
        _section(piece, own, losses(piece.material or "", table), along) for piece, own in pieces
    )


def _weighed(sections: tuple[Section, ...], wire: WirePart, gravity: float) -> tuple[Section, ...]:
    """Sections with their `tension_offset`.

    Down from the upper end the tension falls by the weight above, times the cosine of the angle to
    the vertical. That of the wire is below that of its upper end by the part m_uu + m_ul of the
    weight that this end carries (`elements.weight`).
    """
    along = -gravity * wire.direction[2]
    left = wire.mass[0] + wire.mass[1]
    result = []
    for section in sections:
        own = section.mass * section.length
        result.append(replace(section, tension_offset=along * (left - own / 2)))
        left = left - own
    return tuple(result)


def _modulus(material: Material) -> float:
    """Young's modulus, Pa, known for all wires (`explain_unsuitable`)."""
    assert material.youngs_modulus is not None
    return material.youngs_modulus


def _wires(stage: Stage) -> list[WireSet | Wire]:
    """List the table of each wire of a stage, in order."""
    return [stage.wires] * stage.wires.count if stage.wires is not None else [*stage.wire]


def _section(
    piece: Stretch, material: Material, losses: tuple[Mechanism, ...], along: float
) -> Section:
    """Compute the stiffnesses of one stretch of wire; `along` is a factor on that of stretching."""
    poisson, modulus = material.poisson_ratio, _modulus(material)
    density = material.density or 0.0
    shear = modulus / (2 * (1 + (POISSON if poisson is None else poisson)))
    shape = piece.shape
    first, second = shape.moments
    mass, polar = shape.bulk
    return Section(
        length=piece.length,
        rigidity=(modulus * first, modulus * second),
        stretching=modulus * shape.area * along,
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
        if np.real(size) > 1e-3:
            return across / size
    raise AssertionError("no direction is along both x and y")


def _clamp(number: int, table: WireSet | Wire, wire: WirePart) -> tuple[Array, Array]:
    """Directions in which a wire leaves its clamps.

    A symmetric set gives those of its first wire, mirrored (on a ring: turned) for the others.
    """
    clamp = table.clamp if isinstance(table.clamp, Clamp) else Clamp()
    turn = np.eye(3)
    if isinstance(table, WireSet) and is_ring(table):
        angle = 2 * np.pi * number / table.count
        turn = rotation_matrix(np.array([0.0, 0.0, angle]))
    elif isinstance(table, WireSet):
        along, across = wire_signs(table.count)[number]
        turn = np.diag([along or 1, across or 1, 1.0])

    def direction(given: tuple[float, float, float] | None) -> Array:
        if given is None:
            return wire.direction
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
