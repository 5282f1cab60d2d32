"""Checks of the tables of wires, blades and materials beyond single values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from suspension_cli.design import materials
from suspension_cli.design.body_checks import LEAST_MASS, TOO_LIGHT, check_exactly_one
from suspension_cli.design.cross_sections.round import Round
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.losses.registry import MECHANISMS
from suspension_cli.design.schema import Design, Spring
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
"""Largest relative difference of lengths of a wire and its measured profile, which is scaled."""
SPAN = 1e-6
"""Largest relative difference of a wire's length from the sum of its sections."""


def check_losses(design: Design, name: str, path: str) -> Iterator[Fault]:
    """Check the losses of one `[materials.NAME]` table."""
    for mechanism in MECHANISMS:
        yield from mechanism.check(design.materials[name], materials.resolve(design, name), path)


def check_material(design: Design, name: str, key: str) -> Iterator[Fault]:
    """Check that a material that is used is known."""
    known = materials.known(design)
    if name not in known:
        remedy = suggest(name, known) + " or define it as [materials.NAME]"
        yield Fault(key, "unknown material", remedy, format_value(name))


def check_loss_material(
    design: Design, table: Spring | BladeSet | Blade, path: str
) -> Iterator[Fault]:
    """Check the material of a spring or blade, for its loss."""
    if table.material is not None:
        yield from check_material(design, table.material, f"{path}.material")
    elif table.thickness is not None:
        problem = "has no effect without a material"
        yield fault_of(table, path, "thickness", problem, "name the material too")


def check_wire(design: Design, wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    """Check the losses and composition of a wire: k, or material and section, or sections."""
    for mechanism in MECHANISMS:
        yield from mechanism.check_wire(wire, path)
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
        remedy = "give " + " or ".join(f"{kind.key} for {kind.wire}" for kind in CROSS_SECTIONS)
        yield fault_of(wire, path, first.key, f"conflicts with a {second.key}", remedy)
    if wire.k is None and wire.material is None:
        yield fault_of(wire, path, "material", "missing", "name a material, or give k in N/m")
    if wire.k is None and not given:
        keys = [kind.key for kind in CROSS_SECTIONS]
        remedy = f"give the wire's {' or '.join(keys)} in m, or k in N/m"
        yield fault_of(wire, path, keys[0], "missing", remedy)


def _check_profile(wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    for key in (*(kind.key for kind in CROSS_SECTIONS), "sections", "neck"):
        if getattr(wire, key) is not None:
            yield Fault(f"{path}.{key}", "conflicts with a profile", "keep one of the two")
    if wire.material is None:
        yield fault_of(wire, path, "material", "missing", "name the material of the fibre")
    own = wire.profile
    if not isinstance(own, Profile):
        remedy = "read the design from its file, or give { position, diameter }"
        yield Fault(f"{path}.profile", "is a file that was not read", remedy)
        return
    count = len(own.position)
    if count < 2 or count != len(own.diameter):
        problem = f"has {len(own.diameter)} diameters at {count} places"
        yield Fault(
            f"{path}.profile", problem, "give one diameter per place, at two places or more"
        )
        return
    for n, (above, below) in enumerate(pairwise(own.position), 2):
        if not below > above:
            key, remedy = (
                f"{path}.profile.position.{n}",
                "sort the table by position, each place once",
            )
            yield Fault(key, "is not below the place before", remedy, format_value(below))
            return


def _check_neck(wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    assert wire.neck is not None
    others = (kind.key for kind in CROSS_SECTIONS if kind is not Round)
    for key in (*others, "sections"):
        if getattr(wire, key) is not None:
            yield Fault(f"{path}.neck", f"conflicts with {key}", "give radius and neck alone")
            return
    if wire.radius is None:
        remedy = "give the radius between the necks in m"
        yield fault_of(wire, path, "radius", "missing", remedy)
    elif not wire.neck.radius > wire.radius:
        problem = f"is not above the radius of the fibre ({wire.radius:g} m)"
        remedy = "give the radius of the thick ends in m"
        yield fault_of(wire.neck, f"{path}.neck", "radius", problem, remedy)


def _check_sections(design: Design, wire: WireSet | Wire, path: str) -> Iterator[Fault]:
    for shape in cross_sections(wire):
        remedy = "give it in the sections alone"
        yield Fault(f"{path}.{shape.key}", "conflicts with sections", remedy)
    assert wire.sections is not None
    for number, piece in enumerate(wire.sections, 1):
        yield from _check_section(design, wire, piece, f"{path}.sections.{number}")
    open_ended = [number for number, piece in enumerate(wire.sections, 1) if piece.length is None]
    for number in open_ended[1:]:
        remedy = f"give it in m; section {open_ended[0]} takes the rest already"
        yield Fault(f"{path}.sections.{number}.length", "missing", remedy)


def _check_section(
    design: Design, wire: WireSet | Wire, piece: WireSection, path: str
) -> Iterator[Fault]:
    given = {kind.key: getattr(piece, kind.key) for kind in CROSS_SECTIONS}
    yield from check_exactly_one(path, given, " or ".join(kind.form for kind in CROSS_SECTIONS))
    if piece.material is not None:
        yield from check_material(design, piece.material, f"{path}.material")
    elif wire.material is None and wire.k is None:
        remedy = "name a material here or for the whole wire"
        yield fault_of(piece, path, "material", "missing", remedy)
    if piece.steps is not None and not isinstance(piece.radius, list):
        remedy = "give radius = [upper, lower], or remove it"
        yield fault_of(piece, path, "steps", "goes with a taper", remedy)


def check_span(
    wire: WireSet | Wire, span: tuple[float, float, float], path: str
) -> Iterator[Fault]:
    """Check sections and clamps against the nominal wire (of a set, the first) along `span`, m."""
    length, neck = math.hypot(*span), wire.neck
    if isinstance(wire.profile, Profile) and len(wire.profile.position) > 1:
        measured = wire.profile.position[-1] - wire.profile.position[0]
        if abs(measured - length) > PROFILE * length:
            problem = f"is {measured:.6g} m long, but the wire is {length:.6g} m"
            remedy = "measure from clamp to clamp, or write the unit into the column's title"
            yield Fault(f"{path}.profile", problem, f"{remedy} (position_mm)")
    if neck is not None and 2 * (neck.length + neck.stock) >= length:
        problem = f"both necks take {2 * (neck.length + neck.stock):g} m of {length:.6g} m"
        remedy = "give a shorter neck" + (" (did you mean mm?)" if neck.length > 0.1 else "")
        yield fault_of(neck, f"{path}.neck", "length", problem, remedy)
    if wire.sections is not None:
        given = sum(piece.length or 0.0 for piece in wire.sections)
        if any(piece.length is None for piece in wire.sections):
            if given >= length * (1 - SPAN):
                problem = f"take {given:.9g} m of {length:.9g} m and leave nothing for the open one"
                remedy = "give shorter sections, or all lengths"
                yield Fault(f"{path}.sections", problem, remedy)
        elif abs(given - length) > SPAN * length:
            problem = f"sum to {given:.9g} m, but the wire is {length:.9g} m long"
            remedy = "leave out one length, that section takes the rest"
            yield Fault(f"{path}.sections", problem, remedy)
    if isinstance(wire.clamp, Clamp):
        for end in ("upper", "lower"):
            yield from _check_direction(wire.clamp, end, span, f"{path}.clamp")


def _check_direction(
    clamp: Clamp, end: str, span: tuple[float, float, float], path: str
) -> Iterator[Fault]:
    given = getattr(clamp, end)
    if given is None:
        return
    size, length = math.hypot(*given), math.hypot(*span)
    if not size > 0:
        remedy = "give x, y, z, not all zero"
        yield fault_of(clamp, path, end, "has no direction", remedy)
        return
    cosine = sum(a / size * b / length for a, b in zip(given, span, strict=True))
    if cosine < math.cos(CLAMP_ANGLE):
        problem = f"makes an angle of {math.acos(max(-1.0, cosine)):.3g} rad with the wire"
        within = f"within {CLAMP_ANGLE} rad of the wire"
        remedy = f"give it from the upper towards the lower end, {within}"
        yield fault_of(clamp, path, end, problem, remedy)


def check_blade(design: Design, blade: BladeSet | Blade, path: str) -> Iterator[Fault]:
    """Check one blade, or a set of equal ones."""
    ways = {key: getattr(blade, key) for key in ("stiffness", "uncoupled_frequency", "geometry")}
    what = "stiffness in N/m, uncoupled_frequency in Hz or geometry"
    yield from check_exactly_one(path, ways, what)
    if blade.geometry is None:
        yield from check_loss_material(design, blade, path)
    else:
        yield from check_material(design, blade.geometry.material, f"{path}.geometry.material")
        for key in ("material", "thickness"):
            if getattr(blade, key) is not None:
                remedy = "give it there alone"
                yield fault_of(blade, path, key, "conflicts with a geometry", remedy)
    if 0 < blade.tip_mass < LEAST_MASS:
        remedy = f"give 0, or at least {LEAST_MASS:g} kg"
        yield fault_of(blade, path, "tip_mass", TOO_LIGHT, remedy)
