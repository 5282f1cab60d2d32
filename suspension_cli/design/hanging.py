"""What makes wires and blades that can hang: checks of their tables beyond single values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from suspension_cli.design import materials
from suspension_cli.design.bodies import LEAST_MASS, exclusive
from suspension_cli.design.faults import suggestion
from suspension_cli.design.schema import Design, Material
from suspension_cli.design.wires import Blade, BladeSet, Clamp, Wire, WireSection, WireSet
from suspension_cli.errors import Fault, shown

CLAMP_ANGLE = 0.5
"""Largest angle (rad) of a clamp off the nominal wire: beams bend little."""
SPAN = 1e-6
"""Share of the wire that its sections may miss."""


def of_material(material: Material, path: str) -> Iterator[Fault]:
    """The faults of the losses of one `[materials.NAME]` table."""
    loss = material.loss
    if loss is None:
        return
    if loss.angle is not None and material.loss_angle is not None:
        yield Fault(f"{path}.loss.angle", "stands beside loss_angle, which is short for it", "keep one of the two", shown(loss.angle))
    if loss.table is None:
        return
    if material.loss_angle is not None or loss.angle is not None:
        yield Fault(f"{path}.loss.table", "stands beside a constant loss angle", "keep one of the two")
    frequency, angle = loss.table.frequency, loss.table.angle
    if len(frequency) != len(angle):
        yield Fault(f"{path}.loss.table.angle", f"{len(angle)} loss angles for {len(frequency)} frequencies", "give one for each frequency")
    if any(after <= before for before, after in pairwise(frequency)):
        yield Fault(f"{path}.loss.table.frequency", "does not ascend", "sort the table by frequency", shown(frequency))


def named(design: Design, name: str, key: str) -> Iterator[Fault]:
    """A material that is used must be known."""
    if name not in materials.known(design):
        yield Fault(key, "unknown material", suggestion(name, materials.known(design)) + " or define it as [materials.NAME]", shown(name))


def of_wire(design: Design, wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    """What a wire is made of: k, or material and cross-section, or sections."""
    if wire.material is not None:
        yield from named(design, wire.material, f"{path}.material")
    if wire.sections is not None:
        yield from _of_sections(design, wire, path)
        return
    if wire.radius is not None and wire.section is not None:
        yield Fault(f"{path}.radius", "stands beside a section", "give radius for a round wire or section for a ribbon", shown(wire.radius))
    if wire.k is None:
        if wire.material is None:
            yield Fault(f"{path}.material", "missing", "name a material, or give k in N/m")
        if wire.radius is None and wire.section is None:
            yield Fault(f"{path}.radius", "missing", "give the wire's radius in m, or section, or k in N/m")


def _of_sections(design: Design, wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    for key in ("radius", "section"):
        if getattr(wire, key) is not None:
            yield Fault(f"{path}.{key}", "stands beside sections", "give it in the sections alone")
    assert wire.sections is not None
    for number, piece in enumerate(wire.sections, 1):
        yield from _of_section(design, wire, piece, f"{path}.sections.{number}")
    open_ended = [number for number, piece in enumerate(wire.sections, 1) if piece.length is None]
    for number in open_ended[1:]:
        yield Fault(f"{path}.sections.{number}.length", "missing", f"give it in m; section {open_ended[0]} takes the rest already")


def _of_section(design: Design, wire: WireSet | Wire, piece: WireSection, path: str) -> Iterator[Fault]:
    given = {"radius": piece.radius, "section": piece.section}
    yield from exclusive(path, given, "radius (one, or [upper, lower] of a taper) or section { width, thickness }")
    if piece.material is not None:
        yield from named(design, piece.material, f"{path}.material")
    elif wire.material is None and wire.k is None:
        yield Fault(f"{path}.material", "missing", "name a material here or for the whole wire")
    if piece.steps is not None and not isinstance(piece.radius, list):
        yield Fault(f"{path}.steps", "goes with a taper", "give radius = [upper, lower], or remove it", shown(piece.steps))


def along(wire: WireSet | Wire, span: tuple[float, float, float], path: str) -> Iterator[Fault]:
    """What must fit the nominal wire, whose first one runs along `span` (m): sections and clamps."""
    length = math.hypot(*span)
    if wire.sections is not None:
        given = sum(piece.length or 0.0 for piece in wire.sections)
        if any(piece.length is None for piece in wire.sections):
            if given >= length * (1 - SPAN):
                yield Fault(f"{path}.sections", f"take {given:.9g} m of {length:.9g} m and leave no rest", "give shorter sections, or all lengths")
        elif abs(given - length) > SPAN * length:
            yield Fault(f"{path}.sections", f"sum to {given:.9g} m, the wire has {length:.9g} m", "leave out one length, that section takes the rest")
    if isinstance(wire.clamp, Clamp):
        for end in ("upper", "lower"):
            if getattr(wire.clamp, end) is not None:
                yield from _direction(getattr(wire.clamp, end), span, f"{path}.clamp.{end}")


def _direction(given: tuple[float, float, float], span: tuple[float, float, float], key: str) -> Iterator[Fault]:
    size, length = math.hypot(*given), math.hypot(*span)
    if not size > 0:
        yield Fault(key, "has no direction", "give x, y, z, not all zero", shown(given))
        return
    cosine = sum(a / size * b / length for a, b in zip(given, span, strict=True))
    if cosine < math.cos(CLAMP_ANGLE):
        angle = math.acos(max(-1.0, cosine))
        remedy = f"tell it from the upper towards the lower end, at most {CLAMP_ANGLE} rad off"
        yield Fault(key, f"is {angle:.3g} rad off the wire", remedy, shown(given))


def of_blade(design: Design, blade: BladeSet | Blade, path: str) -> Iterator[Fault]:
    """The faults of one blade, or of a set of equal ones."""
    ways = {"stiffness": blade.stiffness, "uncoupled_frequency": blade.uncoupled_frequency, "geometry": blade.geometry}
    yield from exclusive(path, ways, "stiffness in N/m, uncoupled_frequency in Hz or geometry")
    if blade.geometry is not None:
        yield from named(design, blade.geometry.material, f"{path}.geometry.material")
        for key in ("material", "thickness"):
            if getattr(blade, key) is not None:
                yield Fault(f"{path}.{key}", "stands beside a geometry", "give it there alone", shown(getattr(blade, key)))
    elif blade.material is not None:
        yield from named(design, blade.material, f"{path}.material")
    elif blade.thickness is not None:
        yield Fault(f"{path}.thickness", "says nothing without a material", "name the material too", shown(blade.thickness))
    if 0 < blade.tip_mass < LEAST_MASS:
        yield Fault(f"{path}.tip_mass", "is too small for its motion to be computed", f"give 0, or at least {LEAST_MASS:g} kg", shown(blade.tip_mass))
