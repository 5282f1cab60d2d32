"""Checks of the tables of wires, blades and materials beyond single values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from suspension_cli.design import materials
from suspension_cli.design.body_checks import LEAST_MASS, check_exactly_one
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.schema import Design, Material
from suspension_cli.design.sections import stretches
from suspension_cli.design.wires import (
    CROSS_SECTIONS,
    Blade,
    BladeSet,
    Clamp,
    Profile,
    Wire,
    WireSection,
    WireSet,
    cross_sections,
)
from suspension_cli.errors import Fault, format_value

CLAMP_ANGLE = 0.5
"""Largest angle of a clamp to the nominal wire, rad: the beam model assumes small slopes."""
PROFILE = 0.05
"""Largest relative difference of a wire's length and that of its measured profile, which is scaled
to fit."""
SPAN = 1e-6
"""Largest relative difference of a wire's length and the sum of its sections."""


def check_losses(material: Material, path: str) -> Iterator[Fault]:
    """Check the losses of one `[materials.NAME]` table."""
    loss = material.loss
    if loss is None:
        return
    if loss.angle is not None and material.loss_angle is not None:
        yield Fault(
            f"{path}.loss.angle",
            "conflicts with loss_angle, which is short for it",
            "keep one of the two",
            format_value(loss.angle),
        )
    if loss.table is None:
        return
    if material.loss_angle is not None or loss.angle is not None:
        yield Fault(
            f"{path}.loss.table", "conflicts with a constant loss angle", "keep one of the two"
        )
    frequency, angle = loss.table.frequency, loss.table.angle
    if len(frequency) != len(angle):
        yield Fault(
            f"{path}.loss.table.angle",
            f"{len(angle)} loss angles for {len(frequency)} frequencies",
            "give one for each frequency",
        )
    if any(after <= before for before, after in pairwise(frequency)):
        yield Fault(
            f"{path}.loss.table.frequency",
            "is not in ascending order",
            "sort the table by frequency",
            format_value(frequency),
        )


def check_material(design: Design, name: str, key: str) -> Iterator[Fault]:
    """Check that a material that is used is known."""
    if name not in materials.known(design):
        yield Fault(
            key,
            "unknown material",
            suggest(name, materials.known(design)) + " or define it as [materials.NAME]",
            format_value(name),
        )


def check_wire(design: Design, wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    """Check the composition of a wire: k, or material and cross-section, or sections."""
    if wire.material is not None:
        yield from check_material(design, wire.material, f"{path}.material")
    if wire.bending is not None and wire.k is not None and not stretches(wire, 1.0):
        remedy = "give material and radius too, or remove it"
        yield Fault(f"{path}.bending", "needs the wire's cross-section", remedy)
    if wire.profile is not None:
        yield from _check_profile(wire, path)
        return
    if wire.neck is not None:
        yield from _check_neck(wire, path)
    if wire.sections is not None:
        yield from _check_sections(design, wire, path)
        return
    given = cross_sections(wire)
    if len(given) > 1:
        first, second, *_ = given
        yield Fault(
            f"{path}.{first.key}",
            f"conflicts with a {second.key}",
            "give " + " or ".join(f"{kind.key} for {kind.wire}" for kind in CROSS_SECTIONS),
            format_value(getattr(wire, first.key)),
        )
    if wire.k is None:
        if wire.material is None:
            yield Fault(f"{path}.material", "missing", "name a material, or give k in N/m")
        if not given:
            keys = " or ".join(kind.key for kind in CROSS_SECTIONS)
            yield Fault(
                f"{path}.{CROSS_SECTIONS[0].key}",
                "missing",
                f"give the wire's {keys} in m, or k in N/m",
            )


def _check_profile(wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    for key in ("radius", "section", "sections", "neck"):
        if getattr(wire, key) is not None:
            yield Fault(f"{path}.{key}", "conflicts with a profile", "keep one of the two")
    if wire.material is None:
        yield Fault(f"{path}.material", "missing", "name the material of the fibre")
    own = wire.profile
    if not isinstance(own, Profile):
        remedy = "read the design from its file, or give { position, diameter }"
        yield Fault(f"{path}.profile", "is a file that was not read", remedy)
        return
    count = len(own.position)
    if count < 2 or count != len(own.diameter):
        yield Fault(
            f"{path}.profile",
            f"has {len(own.diameter)} diameters at {count} places",
            "give one diameter per place, at two places or more",
        )
        return
    for n, (above, below) in enumerate(pairwise(own.position), 2):
        if not below > above:
            yield Fault(
                f"{path}.profile.position.{n}",
                "is not below the place before",
                "sort the table by position, each place once",
                format_value(below),
            )
            return


def _check_neck(wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    assert wire.neck is not None
    for key in ("section", "sections"):
        if getattr(wire, key) is not None:
            yield Fault(f"{path}.neck", f"conflicts with {key}", "give radius and neck alone")
            return
    if wire.radius is None:
        yield Fault(f"{path}.radius", "missing", "give the radius between the necks in m")
    elif not wire.neck.radius > wire.radius:
        yield Fault(
            f"{path}.neck.radius",
            f"is not above the radius of the fibre ({wire.radius:g} m)",
            "give the radius of the thick ends in m",
            format_value(wire.neck.radius),
        )


def _check_sections(design: Design, wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    for shape in cross_sections(wire):
        yield Fault(
            f"{path}.{shape.key}", "conflicts with sections", "give it in the sections alone"
        )
    assert wire.sections is not None
    for number, piece in enumerate(wire.sections, 1):
        yield from _check_section(design, wire, piece, f"{path}.sections.{number}")
    open_ended = [number for number, piece in enumerate(wire.sections, 1) if piece.length is None]
    for number in open_ended[1:]:
        yield Fault(
            f"{path}.sections.{number}.length",
            "missing",
            f"give it in m; section {open_ended[0]} takes the rest already",
        )


def _check_section(
    design: Design, wire: WireSet | Wire, piece: WireSection, path: str
) -> Iterator[Fault]:
    given = {kind.key: getattr(piece, kind.key) for kind in CROSS_SECTIONS}
    yield from check_exactly_one(path, given, " or ".join(kind.form for kind in CROSS_SECTIONS))
    if piece.material is not None:
        yield from check_material(design, piece.material, f"{path}.material")
    elif wire.material is None and wire.k is None:
        yield Fault(f"{path}.material", "missing", "name a material here or for the whole wire")
    if piece.steps is not None and not isinstance(piece.radius, list):
        yield fault_of(
            piece, path, "steps", "goes with a taper", "give radius = [upper, lower], or remove it"
        )


def check_span(
    wire: WireSet | Wire, span: tuple[float, float, float], path: str
) -> Iterator[Fault]:
    """Check sections and clamps against the nominal wire (of a set, the first) along `span`, m."""
    length = math.hypot(*span)
    if isinstance(wire.profile, Profile) and len(wire.profile.position) > 1:
        measured = wire.profile.position[-1] - wire.profile.position[0]
        if abs(measured - length) > PROFILE * length:
            yield Fault(
                f"{path}.profile",
                f"is {measured:.6g} m long, but the wire is {length:.6g} m",
                "measure from clamp to clamp, or write the unit into the column's title"
                " (position_mm)",
            )
    if wire.neck is not None and 2 * (wire.neck.length + wire.neck.stock) >= length:
        yield Fault(
            f"{path}.neck.length",
            f"both necks take {2 * (wire.neck.length + wire.neck.stock):g} m of {length:.6g} m",
            "give a shorter neck" + (" (did you mean mm?)" if wire.neck.length > 0.1 else ""),
            format_value(wire.neck.length),
        )
    if wire.sections is not None:
        given = sum(piece.length or 0.0 for piece in wire.sections)
        if any(piece.length is None for piece in wire.sections):
            if given >= length * (1 - SPAN):
                yield Fault(
                    f"{path}.sections",
                    f"take {given:.9g} m of {length:.9g} m and leave nothing for the open one",
                    "give shorter sections, or all lengths",
                )
        elif abs(given - length) > SPAN * length:
            yield Fault(
                f"{path}.sections",
                f"sum to {given:.9g} m, but the wire is {length:.9g} m long",
                "leave out one length, that section takes the rest",
            )
    if isinstance(wire.clamp, Clamp):
        for end in ("upper", "lower"):
            if getattr(wire.clamp, end) is not None:
                yield from _check_direction(getattr(wire.clamp, end), span, f"{path}.clamp.{end}")


def _check_direction(
    given: tuple[float, float, float], span: tuple[float, float, float], key: str
) -> Iterator[Fault]:
    size, length = math.hypot(*given), math.hypot(*span)
    if not size > 0:
        yield Fault(key, "has no direction", "give x, y, z, not all zero", format_value(given))
        return
    cosine = sum(a / size * b / length for a, b in zip(given, span, strict=True))
    if cosine < math.cos(CLAMP_ANGLE):
        angle = math.acos(max(-1.0, cosine))
        remedy = (
            f"give it from the upper towards the lower end, within {CLAMP_ANGLE} rad of the wire"
        )
        yield Fault(
            key, f"makes an angle of {angle:.3g} rad with the wire", remedy, format_value(given)
        )


def check_blade(design: Design, blade: BladeSet | Blade, path: str) -> Iterator[Fault]:
    """Check one blade, or a set of equal ones."""
    ways = {
        "stiffness": blade.stiffness,
        "uncoupled_frequency": blade.uncoupled_frequency,
        "geometry": blade.geometry,
    }
    yield from check_exactly_one(
        path, ways, "stiffness in N/m, uncoupled_frequency in Hz or geometry"
    )
    if blade.geometry is not None:
        yield from check_material(design, blade.geometry.material, f"{path}.geometry.material")
        for key in ("material", "thickness"):
            if getattr(blade, key) is not None:
                yield fault_of(blade, path, key, "conflicts with a geometry", "give it there alone")
    elif blade.material is not None:
        yield from check_material(design, blade.material, f"{path}.material")
    elif blade.thickness is not None:
        yield fault_of(
            blade, path, "thickness", "has no effect without a material", "name the material too"
        )
    if 0 < blade.tip_mass < LEAST_MASS:
        yield fault_of(
            blade,
            path,
            "tip_mass",
            "is too small for its motion to be computed",
            f"give 0, or at least {LEAST_MASS:g} kg",
        )
