"""Checks of a design beyond its types: which keys go together, which names exist.

Each function yields the faults of one kind of table; `check_design` collects them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from suspension_cli.conventions import ANALYSES, DOFS, FRAME, SUPPORT
from suspension_cli.design import (
    body_checks,
    foton,
    imperfections,
    link_checks,
    loop_filters,
    materials,
    wire_checks,
)
from suspension_cli.design.body_checks import LEAST_MASS, TOO_LIGHT, check_exactly_one
from suspension_cli.design.derive import SetGeometry, is_ring, set_geometry
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.filters import SUFFIX, check_filter
from suspension_cli.design.inverted_pendulum import check_legs, leg_count
from suspension_cli.design.link_checks import is_symmetric
from suspension_cli.design.schema import (
    Design,
    Loop,
    NoiseSpectrum,
    Perturbation,
    Requirement,
    Spring,
    Stage,
    Support,
)
from suspension_cli.design.units import Table
from suspension_cli.design.wires import BladeSet, Wire, WireSet
from suspension_cli.errors import Fault, format_key, format_value

BLADES_FOR_WIRES = {1: (1,), 2: (1, 2), 4: (2, 4)}
"""Numbers of blades that can carry a symmetric set, by its number of wires."""
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


def check_design(design: Design) -> list[Fault]:
    """List all faults of a design whose single values are valid."""
    found = [*_check_names(design), *_check_materials(design)]
    for stage in design.stage:
        path = f"stage.{stage.name}"
        found += body_checks.check_body(stage.body, f"{path}.body")
        found += _check_suspension(design, stage, path)
        for number, spring in enumerate(stage.spring, 1):
            found += _check_spring(design, spring, f"{path}.spring.{number}")
    if not found:
        for number, perturbation in enumerate(design.perturbation, 1):
            found += _check_perturbation(design, perturbation, f"perturbation.{number}")
    found += link_checks.check_links(design, placed=not found)
    found += [*_check_gravity(design), *_check_control(design), *_check_tolerance(design)]
    if design.support is not None:
        found += _check_frame(design.support)
    if not found:
        found += link_checks.check_active(design)
    commands = [*ANALYSES, "info"]
    for command in design.analysis:
        if command not in commands:
            key, remedy = f"analysis.{format_key(command)}", suggest(command, commands)
            found.append(Fault(key, "unknown command", remedy))
    return found


def _check_gravity(design: Design) -> Iterator[Fault]:
    given, path = design.constants, "constants"
    gradient = given.gravity_gradient
    if isinstance(given.gravity, list) and not given.gravity[2] < 0:
        problem = "does not point down, so that nothing hangs"
        remedy = "give [x, y, z] with z below 0: [0.0, 0.0, -9.81]"
        yield fault_of(given, path, "gravity", problem, remedy)
    if isinstance(gradient, list) and len(gradient) != 3:
        remedy = "give one number dg_z/dz, or three rows of three"
        yield fault_of(given, path, "gravity_gradient", f"has {len(gradient)} rows", remedy)
    elif isinstance(gradient, list) and not is_symmetric(gradient):
        problem = "is not symmetric, but gravity is conservative"
        yield fault_of(given, path, "gravity_gradient", problem, "give dg_i/dx_j = dg_j/dx_i")


def _check_names(design: Design) -> Iterator[Fault]:
    above: list[str] = [SUPPORT]
    for stage in design.stage:
        path = f"stage.{stage.name}"
        if stage.name in above:
            taken = "is also the name of an earlier stage"
            if stage.name == SUPPORT:
                taken = "is the name of the suspension point"
            yield fault_of(stage, path, "name", taken, "give each stage a name of its own")
        if stage.name == FRAME and design.support is not None:
            problem = "is the name of the support structure that [support] describes"
            yield fault_of(stage, path, "name", problem, "give the stage another name")
        named: list[tuple[Table, str, str, str | None]] = [
            (stage, path, "hangs_from", stage.hangs_from)
        ]
        if stage.damping is not None:
            named.append((stage.damping, f"{path}.damping", "against", stage.damping.against))
        for table, where, key, name in named:
            if name is not None and name not in above:
                remedy = suggest(name, above)
                yield fault_of(table, where, key, "names no earlier stage", remedy)
        above += [stage.name, *([stage.name + SUFFIX] if stage.filter is not None else [])]
    for stage in [stage for stage in design.stage if stage.mirror][1:]:
        path, problem = f"stage.{stage.name}", "is given for an earlier stage too"
        yield fault_of(stage, path, "mirror", problem, "keep it on the stage that is the mirror")


def _check_materials(design: Design) -> Iterator[Fault]:
    for name in design.materials:
        if not NAME.fullmatch(name):
            yield Fault(
                f"materials.{format_key(name)}",
                "is not a valid name, so no wire can refer to it",
                "call it by letters, digits, _ and -, starting with a letter",
            )
        elif materials.resolve(design, name).youngs_modulus is None:
            yield Fault(f"materials.{name}.youngs_modulus", "missing", "give Young's modulus in Pa")
        yield from wire_checks.check_losses(design.materials[name], f"materials.{format_key(name)}")


def _check_suspension(design: Design, stage: Stage, path: str) -> Iterator[Fault]:
    if stage.wires is not None and stage.wire:
        problem = "conflicts with a symmetric set [stage.wires]"
        yield Fault(f"{path}.wire", problem, "keep one of the two")
    legs = stage.inverted_pendulum
    if stage.wires is None and not stage.wire and not stage.spring and legs is None:
        remedy = "add [stage.wires], [[stage.wire]], [[stage.spring]] or [stage.inverted_pendulum]"
        yield Fault(path, "has neither wires nor springs", remedy)
    yield from _check_tower(stage, path)
    if stage.wires is not None:
        yield from _check_wire_set(design, stage.wires, f"{path}.wires")
        if stage.position is not None:
            problem = "a symmetric set implies the position"
            yield fault_of(stage, path, "position", problem, "remove it")
    elif stage.position is None and legs is None:
        remedy = "give the nominal COM from the COM above, [x, y, z] in m"
        yield fault_of(stage, path, "position", "missing", remedy)
    if stage.blades is not None:
        yield from _check_blade_set(design, stage, stage.blades, f"{path}.blades")
    for number, wire in enumerate(stage.wire, 1):
        yield from _check_wire(design, stage, wire, f"{path}.wire.{number}")
    for n, blade in enumerate(stage.blade):
        where = f"{path}.blade.{blade.name}"
        if blade.name in [other.name for other in stage.blade[:n]]:
            problem = "is the name of another blade of this stage"
            yield fault_of(blade, where, "name", problem, "give each blade a name of its own")
        yield from wire_checks.check_blade(design, blade, where)
        if not any(wire.blade == blade.name for wire in stage.wire):
            yield Fault(where, "carries no wire", f'name it in a wire: blade = "{blade.name}"')


def _check_tower(stage: Stage, path: str) -> Iterator[Fault]:
    legs = stage.inverted_pendulum
    if legs is not None:
        if stage.wires is not None or stage.wire:
            problem = "conflicts with wires: a stage either stands on legs or hangs on wires"
            yield Fault(f"{path}.inverted_pendulum", problem, "keep one of the two")
        yield from check_legs(legs, f"{path}.inverted_pendulum")
    if stage.filter is not None:
        yield from check_filter(stage.filter, f"{path}.filter")


def _check_wire_set(design: Design, wires: WireSet, path: str) -> Iterator[Fault]:
    yield from wire_checks.check_wire(design, wires, path)
    if is_ring(wires):
        yield from _check_ring(wires, path)
        return
    if wires.count not in BLADES_FOR_WIRES:
        remedy = "give one of these, or ring (the radius in m of the circle of the ends)"
        yield fault_of(wires, path, "count", "is not 1, 2 or 4", remedy)
        return
    if wires.phase:
        remedy = "give ring in m too, or remove it"
        yield fault_of(wires, path, "phase", "goes with a ring", remedy)
    halves = (wires.s_upper, wires.s_lower)
    if wires.s is not None and halves != (None, None):
        remedy = "give s alone, or s_upper and s_lower"
        yield fault_of(wires, path, "s", "conflicts with s_upper or s_lower", remedy)
    elif wires.s is None and halves.count(None) == 1:
        yield Fault(path, "s_upper and s_lower go together", "give both, or s alone")
    elif wires.count == 4 and wires.s is None and None in halves:
        yield fault_of(wires, path, "s", "missing", "give the half separation in x, m")
    across, along = ("t1", "t2"), ("s", "s_upper", "s_lower")
    for key in across:
        if wires.count > 1 and getattr(wires, key) is None:
            yield fault_of(wires, path, key, "missing", "give the half separation in y, m")
    for key in {1: (*along, *across), 2: along, 4: ()}[wires.count]:
        if getattr(wires, key):
            problem = f"must be 0 for {wires.count} wire{'s' * (wires.count > 1)}"
            yield fault_of(wires, path, key, problem, "remove it or change count")
    shape = set_geometry(wires)
    span = (shape.s_lower - shape.s_upper, shape.t2 - shape.t1)
    yield from _check_set_length(wires, shape, span, path)


def _check_ring(wires: WireSet, path: str) -> Iterator[Fault]:
    for key in ("s", "s_upper", "s_lower", "t1", "t2"):
        if getattr(wires, key) is not None:
            yield fault_of(wires, path, key, "conflicts with a ring", "keep one of the two")
    halves = (wires.ring_upper, wires.ring_lower)
    if wires.ring is not None and halves != (None, None):
        remedy = "give ring alone, or ring_upper and ring_lower"
        yield fault_of(wires, path, "ring", "conflicts with ring_upper or ring_lower", remedy)
    elif wires.ring is None and None in halves:
        yield Fault(path, "ring_upper and ring_lower go together", "give both, or ring alone")
    else:
        shape = set_geometry(wires)
        (a, b), (c, d) = shape.ring_ends(0)
        yield from _check_set_length(wires, shape, (c - a, d - b), path)


def _check_set_length(
    wires: WireSet, shape: SetGeometry, across: tuple[float, float], path: str
) -> Iterator[Fault]:
    """Check that the wires of a set exceed their horizontal span, and their sections and clamps."""
    if shape.height_squared > 1e-12 * wires.l**2:
        yield from wire_checks.check_span(wires, (*across, -shape.height), path)
        return
    span = math.hypot(*across)
    problem = f"the wire is not longer than its horizontal span of {span:g} m"
    millimetres = span > 1.0 and wires.l > 5e-4 * span
    remedy = "give a longer wire or a smaller span" + " (did you mean mm?)" * millimetres
    yield fault_of(wires, path, "l", problem, remedy)


def _check_wire(design: Design, stage: Stage, wire: Wire, path: str) -> Iterator[Fault]:
    yield from wire_checks.check_wire(design, wire, path)
    if wire.natural_length is not None and wire.tension is not None:
        problem = "conflicts with natural_length"
        yield fault_of(wire, path, "tension", problem, "give one of them")
    blades = [blade.name for blade in stage.blade]
    if wire.blade is not None and wire.blade not in blades:
        remedy = suggest(wire.blade, blades)
        yield fault_of(wire, path, "blade", "names no [[stage.blade]]", remedy)
    if stage.position is not None:
        ends = zip(stage.position, wire.lower, wire.upper, strict=True)
        x, y, z = (p + q - u for p, q, u in ends)
        if math.hypot(x, y, z) < 1e-9:
            remedy = "check upper, lower and position"
            yield fault_of(wire, path, "lower", "both ends of the wire are at one point", remedy)
        else:
            yield from wire_checks.check_span(wire, (x, y, z), path)


def _check_blade_set(design: Design, stage: Stage, blades: BladeSet, path: str) -> Iterator[Fault]:
    yield from wire_checks.check_blade(design, blades, path)
    if stage.wires is None:
        remedy = "use [[stage.blade]] and name the blade in each wire"
        yield Fault(path, "goes with a symmetric set [stage.wires]", remedy)
        return
    count = stage.wires.count
    allowed = BLADES_FOR_WIRES.get(count, (blades.count,))
    if is_ring(stage.wires):
        allowed = (1, count)
    if blades.count not in allowed:
        remedy = f"give {' or '.join(map(str, allowed))}"
        yield fault_of(blades, path, "count", f"cannot carry {count} wires", remedy)


def _check_spring(design: Design, spring: Spring, path: str) -> Iterator[Fault]:
    for key in ("stiffness", "damping"):
        yield from link_checks.check_matrix(getattr(spring, key), f"{path}.{key}")
    yield from wire_checks.check_loss_material(design, spring, path)


def _parts_of(design: Design) -> dict[str, list[str]]:
    """List the names of all parts that have imperfections."""
    found: dict[str, list[str]] = {part: [] for part in imperfections.PARTS}
    for stage in design.stage:
        name, legs, count = stage.name, stage.inverted_pendulum, len(stage.wire)
        blades = [blade.name for blade in stage.blade]
        if stage.wires is not None:
            count = stage.wires.count
        if stage.blades is not None:
            blades = [f"blade{n}" for n in range(1, stage.blades.count + 1)]
        found["wire"] += [f"{name}.{n}" for n in range(1, count + 1)]
        found["body"] += [name, *([name + SUFFIX] if stage.filter is not None else [])]
        found["blade"] += [f"{name}.{blade}" for blade in blades]
        found["leg"] += [f"{name}.leg{n}" for n in range(1, leg_count(legs) + 1)] if legs else []
    found["blade"] += [stage.name for stage in design.stage if stage.filter is not None]
    found["link"] = [link.name for link in design.link]
    return found


def _check_perturbation(design: Design, item: Perturbation, path: str) -> Iterator[Fault]:
    parts = [part for part in imperfections.PARTS if getattr(item, part) is not None]
    if len(parts) != 1:
        remedy = 'give wire = "test.1" or body = "test"'
        yield Fault(path, "must name one wire, body, blade, leg or link", remedy)
        return
    part = parts[0]
    known = [row.name for row in imperfections.perturbed(part)]
    every = (row.name for one in imperfections.PARTS for row in imperfections.perturbed(one))
    for key in dict.fromkeys(every):
        if key not in known and getattr(item, key) is not None:
            remedy = f"known here: {', '.join(known)}"
            yield fault_of(item, path, key, f"is not for a {part}", remedy)
    if all(getattr(item, key) is None for key in known):
        yield Fault(path, "changes nothing", f"give {' or '.join(known)}")
    if part == "link":
        yield from _check_no_table(design, item.link, f"{path}.link")
    names, given = _parts_of(design)[part], getattr(item, part)
    if given not in names:
        problem = f"names no {'stage' if part == 'body' else part}"
        yield fault_of(item, path, part, problem, suggest(given, names))


def _check_no_table(design: Design, name: str, path: str) -> Iterator[Fault]:
    if any(link.name == name and link.table is not None for link in design.link):
        problem = "names a link given by a table, whose stiffness cannot differ from build to build"
        remedy = f"vary link.{name}.table.factor with --set or sweep"
        yield Fault(path, problem, remedy, format_value(name))


def _check_scattered_stage(design: Design, kind: str, item: Any, path: str) -> Iterator[Fault]:
    key, called, names = "stage", "stage", _parts_of(design)[kind]
    if kind == "link":
        key = called = "link"
        yield from _check_no_table(design, item.link, f"{path}.link")
    elif kind != "body":
        names = list(dict.fromkeys(name.split(".", 1)[0] for name in names))
        called = f"stage with {kind}s"
    given = getattr(item, key)
    if given is not None and given not in names:
        yield fault_of(item, path, key, f"names no {called}", suggest(given, names))


def _check_frame(support: Support) -> Iterator[Fault]:
    if all(getattr(support.stiffness, dof) is None for dof in DOFS):
        remedy = "give z = ... (N/m), or leave [support] out"
        yield Fault("support.stiffness", "leaves the support rigid in every direction", remedy)
        return
    for dof in DOFS:
        if getattr(support.damping, dof) and getattr(support.stiffness, dof) is None:
            remedy = f"give support.stiffness.{dof} too"
            yield fault_of(
                support.damping, "support.damping", dof, "damps a rigid direction", remedy
            )
    for key, given, unit in (
        ("mass", [support.mass], "kg"),
        ("inertia", support.inertia, "kg m^2"),
    ):
        if any(0 < value < LEAST_MASS for value in given):
            remedy = f"give 0, or at least {LEAST_MASS:g} {unit}"
            yield fault_of(support, "support", key, TOO_LIGHT, remedy)


def _check_control(design: Design) -> Iterator[Fault]:
    loops = design.control.loop if design.control is not None else []
    for n, loop in enumerate(loops):
        path = f"control.loop.{loop.name}"
        if loop.name in [other.name for other in loops[:n]]:
            remedy = "give each loop a name of its own"
            yield fault_of(loop, path, "name", "is the name of another loop", remedy)
        yield from _check_filter(loop, path)
        if isinstance(loop.sensor_noise, NoiseSpectrum):
            yield from _check_noise_spectrum(loop.sensor_noise, f"{path}.sensor_noise")


def _check_filter(loop: Loop, path: str) -> Iterator[Fault]:
    """Check that a loop has one filter, and that filter and sensor can be built."""
    ways = {key: getattr(loop, key) for key in ("damper", "gain", "filter", "gain_at")}
    if loop.filter is not None:
        ways["gain_at"] = None
    what = "damper, or gain (or gain_at) with zeros and poles, or filter"
    found = [*check_exactly_one(path, ways, what)]
    for key in ("filter", "sensor_response"):
        try:
            if getattr(loop, key) is not None:
                foton.parse(getattr(loop, key))
        except foton.FotonError as error:
            found.append(fault_of(loop, path, key, error.problem, error.remedy))
    if (loop.damper is not None or loop.filter is not None) and (loop.zeros or loop.poles):
        problem, other = "a damper has no filter", "damper"
        if loop.damper is None:
            problem, other = "conflicts with filter, which has its own roots", "filter"
        key = "zeros" if loop.zeros else "poles"
        found.append(fault_of(loop, path, key, problem, f"give gain instead of {other}"))
    yield from found or _check_order(loop, path)


def _check_order(loop: Loop, path: str) -> Iterator[Fault]:
    """Check that the gain of a filter can be set, and that it does not grow without bound."""
    if loop.gain_at is not None:
        size = abs(loop_filters.without_gain_at(loop).at(loop.gain_at.frequency))
        if not 0 < size < math.inf or loop.gain_at.magnitude == 0:
            problem = "the gain cannot be set where the filter is 0 or infinite, or to 0"
            yield Fault(f"{path}.gain_at", problem, "give another frequency or magnitude")
            return
    whole = loop_filters.controller_and_sensor(loop)
    zeros, poles = len(whole.zeros), len(whole.poles)
    if zeros <= poles or (loop.damper is not None and loop.sensor_response is None):
        return  # a damper acts on the velocity, which is known
    key = next(key for key in ("filter", "sensor_response", "zeros") if getattr(loop, key))
    what = "a filter" if loop.sensor_response is None else "a filter and sensor"
    problem = f"{what} with more zeros ({zeros}) than poles ({poles}) cannot be built"
    remedy = "add poles, or its gain grows with frequency without bound"
    yield fault_of(loop, path, key, problem, remedy)


def _check_noise_spectrum(noise: NoiseSpectrum, path: str) -> Iterator[Fault]:
    if isinstance(noise.asd, list) != (noise.frequency is not None):
        problem = "asd and frequency are lists of one length, or asd a number without frequency"
        yield Fault(path, problem, "give {asd, corner} or {frequency = [...], asd = [...]}")
    elif noise.frequency is not None and isinstance(noise.asd, list):
        if noise.corner is not None:
            value = f"{noise.corner:g}"
            yield Fault(f"{path}.corner", "conflicts with frequency", "remove it", value)
        if len(noise.frequency) != len(noise.asd):
            problem = f"has {len(noise.asd)} values for {len(noise.frequency)} frequencies"
            yield Fault(f"{path}.asd", problem, "give one per frequency")
        if not all(low < high for low, high in pairwise(noise.frequency)):
            remedy = "sort it, each frequency once"
            yield fault_of(noise, path, "frequency", "is not in ascending order", remedy)
        if min(noise.asd) <= 0:
            problem = "must be positive, as its logarithm is interpolated"
            yield fault_of(noise, path, "asd", problem, "give a small number instead of 0")


def _check_requirement(item: Requirement, path: str) -> Iterator[Fault]:
    if sum(limit is not None for limit in (item.band, item.below, item.above)) != 1:
        remedy = "give band = [least, largest], below = limit or above = limit"
        yield Fault(path, f"{item.quantity} must have one limit", remedy)
    if item.band is not None and not item.band[0] < item.band[1]:
        problem = "is reversed or empty, so that no build is in it"
        yield fault_of(item, path, "band", problem, "give [least, largest]")


def _check_tolerance(design: Design) -> Iterator[Fault]:
    if design.tolerance is None:
        return
    tables = [
        (kind, item, f"tolerance.{kind}.{n}")
        for kind in imperfections.PARTS
        for n, item in enumerate(getattr(design.tolerance, kind), 1)
    ]
    if not tables:
        remedy = f"add {' or '.join(f'[[tolerance.{part}]]' for part in imperfections.PARTS)}"
        yield Fault("tolerance", "has no distribution", remedy)
    for n, item in enumerate(design.tolerance.require, 1):
        yield from _check_requirement(item, f"tolerance.require.{n}")
    wires = _parts_of(design)["wire"]
    for kind, item, path in tables:
        if kind == "wire" and (item.stage is None) == (item.wire is None):
            remedy = 'give stage = "test" or wire = "test.1"'
            yield Fault(path, "must name a stage or one wire", remedy)
        yield from _check_scattered_stage(design, kind, item, path)
        if kind == "wire" and item.wire is not None and item.wire not in wires:
            yield fault_of(item, path, "wire", "names no wire", suggest(item.wire, wires))
        known = [row.spread for row in imperfections.scattered(kind)]
        given = {key: getattr(item, key) for key in known}
        spreads = {key: spread for key, spread in given.items() if spread is not None}
        if not spreads:
            yield Fault(path, "has no distribution", f"give {' or '.join(known)}")
        for key, spread in spreads.items():
            where, ways = f"{path}.{key}", {"normal": spread.normal, "uniform": spread.uniform}
            what = "normal (standard deviation) or uniform (half width)"
            yield from check_exactly_one(where, ways, what)
            if spread.truncate is not None and not (spread.normal and spread.truncate > 0):
                problem = "goes with a normal distribution and must be positive"
                yield fault_of(spread, where, "truncate", problem, "give normal too")
