"""Checks of a design that its types cannot express: which keys go together, which names exist.

Each function yields the faults of one kind of table; `check_design` collects them all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
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
from suspension_cli.design.body_checks import LEAST_MASS, check_exactly_one
from suspension_cli.design.derive import SetGeometry, is_ring, set_geometry
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.filters import SUFFIX, check_filter
from suspension_cli.design.inverted_pendulum import check_legs, leg_count
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
from suspension_cli.design.wires import BladeSet, Wire, WireSet
from suspension_cli.errors import Fault, format_key, format_value

BLADES_FOR_WIRES = {1: (1,), 2: (1, 2), 4: (2, 4)}
"""Numbers of blades that can carry a symmetric set, by its number of wires."""
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


def check_design(design: Design) -> list[Fault]:
    """Check a design whose single values are valid; return all faults."""
    found = [*_check_names(design), *_check_materials(design)]
    for stage in design.stage:
        path = f"stage.{stage.name}"
        found += body_checks.check_body(stage.body, f"{path}.body")
        found += _check_suspension(design, stage, path)
        for number, spring in enumerate(stage.spring, 1):
            found += _check_spring(spring, f"{path}.spring.{number}")
            found += _check_spring_material(design, spring, f"{path}.spring.{number}")
    if not found:
        for number, perturbation in enumerate(design.perturbation, 1):
            found += _check_perturbation(design, perturbation, f"perturbation.{number}")
    found += link_checks.check_links(design, placed=not found)
    found += [*_check_gravity(design), *_check_control(design), *_check_tolerance(design)]
    if design.support is not None:
        found += _check_frame(design.support)
    for command in design.analysis:
        if command not in (*ANALYSES, "info"):
            found.append(
                Fault(
                    f"analysis.{format_key(command)}",
                    "unknown command",
                    suggest(command, [*ANALYSES, "info"]),
                )
            )
    return found


def _check_gravity(design: Design) -> Iterator[Fault]:
    gravity, gradient = design.constants.gravity, design.constants.gravity_gradient
    if isinstance(gravity, list) and not gravity[2] < 0:
        yield Fault(
            "constants.gravity",
            "does not point down, so that nothing hangs",
            "give [x, y, z] with z below 0: [0.0, 0.0, -9.81]",
            format_value(gravity),
        )
    if not isinstance(gradient, list):
        return
    if len(gradient) != 3:
        yield Fault(
            "constants.gravity_gradient",
            f"has {len(gradient)} rows",
            "give one number dg_z/dz, or three rows of three",
            format_value(gradient),
        )
    elif any(gradient[i][j] != gradient[j][i] for i in range(3) for j in range(i)):
        yield Fault(
            "constants.gravity_gradient",
            "is not symmetric, but gravity is conservative",
            "give dg_i/dx_j = dg_j/dx_i",
            format_value(gradient),
        )


def _check_names(design: Design) -> Iterator[Fault]:
    above: list[str] = [SUPPORT]
    for stage in design.stage:
        path = f"stage.{stage.name}"
        if stage.name in above:
            taken = (
                "is the name of the suspension point"
                if stage.name == SUPPORT
                else "is also the name of an earlier stage"
            )
            yield fault_of(stage, path, "name", taken, "give each stage a name of its own")
        if stage.name == FRAME and design.support is not None:
            yield fault_of(
                stage,
                path,
                "name",
                "is the name of the support structure that [support] describes",
                "give the stage another name",
            )
        if stage.hangs_from is not None and stage.hangs_from not in above:
            yield fault_of(
                stage,
                path,
                "hangs_from",
                "names no earlier stage",
                suggest(stage.hangs_from, above),
            )
        against = None if stage.damping is None else stage.damping.against
        if against is not None and against not in above:
            yield Fault(
                f"{path}.damping.against",
                "names no earlier stage",
                suggest(against, above),
                format_value(against),
            )
        above.append(stage.name)
        if stage.filter is not None:
            above.append(stage.name + SUFFIX)


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
        yield Fault(
            f"{path}.wire", "conflicts with a symmetric set [stage.wires]", "keep one of the two"
        )
    legs = stage.inverted_pendulum
    if stage.wires is None and not stage.wire and not stage.spring and legs is None:
        yield Fault(
            path,
            "has neither wires nor springs",
            "add [stage.wires], [[stage.wire]], [[stage.spring]] or [stage.inverted_pendulum]",
        )
    yield from _check_tower(stage, path)
    if stage.wires is None and stage.position is None and legs is None:
        yield Fault(
            f"{path}.position", "missing", "give the nominal COM from the COM above, [x, y, z] in m"
        )
    if stage.wires is not None:
        yield from _check_wire_set(design, stage.wires, f"{path}.wires")
        if stage.position is not None:
            yield fault_of(
                stage, path, "position", "a symmetric set implies the position", "remove it"
            )
    if stage.blades is not None:
        yield from _check_blade_set(design, stage, stage.blades, f"{path}.blades")
    for number, wire in enumerate(stage.wire, 1):
        yield from _check_wire(design, stage, wire, f"{path}.wire.{number}")
    names: list[str] = []
    for blade in stage.blade:
        where = f"{path}.blade.{blade.name}"
        if blade.name in names:
            yield fault_of(
                blade,
                where,
                "name",
                "is the name of another blade of this stage",
                "give each blade a name of its own",
            )
        names.append(blade.name)
        yield from wire_checks.check_blade(design, blade, where)
        if not any(wire.blade == blade.name for wire in stage.wire):
            yield Fault(where, "carries no wire", f'name it in a wire: blade = "{blade.name}"')


def _check_tower(stage: Stage, path: str) -> Iterator[Fault]:
    legs = stage.inverted_pendulum
    if legs is not None:
        if stage.wires is not None or stage.wire:
            yield Fault(
                f"{path}.inverted_pendulum",
                "conflicts with wires: a stage either stands on legs or hangs on wires",
                "keep one of the two",
            )
        yield from check_legs(legs, f"{path}.inverted_pendulum")
    if stage.filter is not None:
        yield from check_filter(stage.filter, f"{path}.filter")


def _check_wire_set(design: Design, wires: WireSet, path: str) -> Iterator[Fault]:
    yield from wire_checks.check_wire(design, wires, path)
    if is_ring(wires):
        yield from _check_ring(wires, path)
        return
    if wires.count not in BLADES_FOR_WIRES:
        yield fault_of(
            wires,
            path,
            "count",
            "is not 1, 2 or 4",
            "give one of these, or ring (the radius in m of the circle of the ends)",
        )
        return
    if wires.phase:
        remedy = "give ring in m too, or remove it"
        yield fault_of(wires, path, "phase", "goes with a ring", remedy)
    halves = (wires.s_upper, wires.s_lower)
    if wires.s is not None and halves != (None, None):
        yield fault_of(
            wires,
            path,
            "s",
            "conflicts with s_upper or s_lower",
            "give s alone, or s_upper and s_lower",
        )
    elif wires.s is None and halves.count(None) == 1:
        yield Fault(path, "s_upper and s_lower go together", "give both, or s alone")
    elif wires.count == 4 and wires.s is None and None in halves:
        yield Fault(f"{path}.s", "missing", "give the half separation in x, m")
    for key in ("t1", "t2"):
        if wires.count > 1 and getattr(wires, key) is None:
            yield Fault(f"{path}.{key}", "missing", "give the half separation in y, m")
    forbidden = {1: ("s", "s_upper", "s_lower", "t1", "t2"), 2: ("s", "s_upper", "s_lower"), 4: ()}[
        wires.count
    ]
    for key in forbidden:
        if getattr(wires, key):
            yield fault_of(
                wires,
                path,
                key,
                f"must be 0 for {wires.count} wire{'s' * (wires.count > 1)}",
                "remove it or change count",
            )
    shape = set_geometry(wires)
    span = (shape.s_lower - shape.s_upper, shape.t2 - shape.t1)
    yield from _check_set_length(wires, shape, span, path)


def _check_ring(wires: WireSet, path: str) -> Iterator[Fault]:
    for key in ("s", "s_upper", "s_lower", "t1", "t2"):
        if getattr(wires, key) is not None:
            value = format_value(getattr(wires, key))
            yield Fault(f"{path}.{key}", "conflicts with a ring", "keep one of the two", value)
    halves = (wires.ring_upper, wires.ring_lower)
    if wires.ring is not None and halves != (None, None):
        yield fault_of(
            wires,
            path,
            "ring",
            "conflicts with ring_upper or ring_lower",
            "give ring alone, or ring_upper and ring_lower",
        )
    elif wires.ring is None and None in halves:
        yield Fault(path, "ring_upper and ring_lower go together", "give both, or ring alone")
    else:
        shape = set_geometry(wires)
        (a, b), (c, d) = shape.ring_ends(0)
        yield from _check_set_length(wires, shape, (c - a, d - b), path)


def _check_set_length(
    wires: WireSet, shape: SetGeometry, across: tuple[float, float], path: str
) -> Iterator[Fault]:
    """Check that the wires of a set are longer than their horizontal span, and what they carry."""
    if shape.height_squared <= 1e-12 * wires.l**2:
        span = math.hypot(*across)
        remedy = "give a longer wire or a smaller span" + (
            " (did you mean mm?)" if span > 1.0 and wires.l > 5e-4 * span else ""
        )
        yield fault_of(
            wires,
            path,
            "l",
            f"the wire is not longer than its horizontal span of {span:g} m",
            remedy,
        )
        return
    yield from wire_checks.check_span(wires, (*across, -shape.height), path)


def _check_wire(design: Design, stage: Stage, wire: Wire, path: str) -> Iterator[Fault]:
    yield from wire_checks.check_wire(design, wire, path)
    if wire.natural_length is not None and wire.tension is not None:
        yield fault_of(wire, path, "tension", "conflicts with natural_length", "give one of them")
    if wire.blade is not None and wire.blade not in [blade.name for blade in stage.blade]:
        yield fault_of(
            wire,
            path,
            "blade",
            "names no [[stage.blade]]",
            suggest(wire.blade, [blade.name for blade in stage.blade]),
        )
    if stage.position is not None:
        x, y, z = (
            p + q - u for p, q, u in zip(stage.position, wire.lower, wire.upper, strict=True)
        )
        if math.hypot(x, y, z) < 1e-9:
            yield fault_of(
                wire,
                path,
                "lower",
                "both ends of the wire are at one point",
                "check upper, lower and position",
            )
            return
        yield from wire_checks.check_span(wire, (x, y, z), path)


def _check_blade_set(design: Design, stage: Stage, blades: BladeSet, path: str) -> Iterator[Fault]:
    yield from wire_checks.check_blade(design, blades, path)
    if stage.wires is None:
        yield Fault(
            path,
            "goes with a symmetric set [stage.wires]",
            "use [[stage.blade]] and name the blade in each wire",
        )
    elif blades.count not in (
        allowed := (1, stage.wires.count)
        if is_ring(stage.wires)
        else BLADES_FOR_WIRES.get(stage.wires.count, (blades.count,))
    ):
        fits = " or ".join(str(n) for n in allowed)
        yield fault_of(
            blades, path, "count", f"cannot carry {stage.wires.count} wires", f"give {fits}"
        )


def _check_spring_material(design: Design, spring: Spring, path: str) -> Iterator[Fault]:
    if spring.material is not None:
        yield from wire_checks.check_material(design, spring.material, f"{path}.material")
    elif spring.thickness is not None:
        yield fault_of(
            spring, path, "thickness", "has no effect without a material", "name the material too"
        )


def _check_spring(spring: Spring, path: str) -> Iterator[Fault]:
    for key in ("stiffness", "damping"):
        matrix = getattr(spring, key)
        if matrix is None:
            continue
        rows = [isinstance(row, list) for row in matrix]
        if any(rows) and not all(rows):
            yield Fault(
                f"{path}.{key}",
                "mixes numbers and rows",
                "give six numbers or six rows of six",
                format_value(matrix),
            )
        elif all(rows) and any(matrix[i][j] != matrix[j][i] for i in range(6) for j in range(i)):
            yield Fault(
                f"{path}.{key}",
                "is not symmetric",
                "make element (i, j) equal to (j, i)",
                format_value(matrix),
            )


def _parts_of(design: Design) -> dict[str, list[str]]:
    """List the names of all parts that have imperfections."""
    blades = [
        f"{stage.name}.{name}"
        for stage in design.stage
        for name in (
            [f"blade{n}" for n in range(1, stage.blades.count + 1)]
            if stage.blades is not None
            else [blade.name for blade in stage.blade]
        )
    ]
    return {
        "wire": _wires_of(design),
        "body": _names_of_bodies(design),
        "blade": [*blades, *(stage.name for stage in design.stage if stage.filter is not None)],
        "leg": [
            f"{stage.name}.leg{n}"
            for stage in design.stage
            if stage.inverted_pendulum is not None
            for n in range(1, leg_count(stage.inverted_pendulum) + 1)
        ],
        "link": [link.name for link in design.link],
    }


def _check_perturbation(design: Design, item: Perturbation, path: str) -> Iterator[Fault]:
    parts = [part for part in imperfections.PARTS if getattr(item, part) is not None]
    if len(parts) != 1:
        yield Fault(
            path,
            "must name one wire, body, blade, leg or link",
            'give wire = "test.1" or body = "test"',
        )
        return
    part = parts[0]
    known = [row.name for row in imperfections.perturbed(part)]
    every = dict.fromkeys(
        row.name for one in imperfections.PARTS for row in imperfections.perturbed(one)
    )
    for key in every:
        if key not in known and getattr(item, key) is not None:
            yield fault_of(
                item, path, key, f"is not for a {part}", f"known here: {', '.join(known)}"
            )
    if all(getattr(item, key) is None for key in known):
        yield Fault(path, "changes nothing", f"give {' or '.join(known)}")
    if part == "link":
        yield from _check_no_table(design, item.link, f"{path}.link")
    names, given = _parts_of(design)[part], getattr(item, part)
    if given not in names:
        called = "stage" if part == "body" else part
        yield Fault(
            f"{path}.{part}", f"names no {called}", suggest(given, names), format_value(given)
        )


def _check_no_table(design: Design, name: str, path: str) -> Iterator[Fault]:
    if any(link.name == name and link.table is not None for link in design.link):
        yield Fault(
            path,
            "names a link given by a table, whose stiffness cannot differ from build to build",
            f"vary link.{name}.table.factor with --set or sweep",
            format_value(name),
        )


def _check_scattered_stage(design: Design, kind: str, item: Any, path: str) -> Iterator[Fault]:
    """Check the stage or link of a table of `[tolerance]`."""
    known = _parts_of(design)[kind]
    key, called, names = "stage", "stage", known
    if kind == "link":
        key = called = "link"
    elif kind != "body":
        names = list(dict.fromkeys(name.split(".", 1)[0] for name in known))
        called = f"stage with {kind}s"
    given = getattr(item, key)
    if kind == "link":
        yield from _check_no_table(design, given, f"{path}.link")
    if given is not None and given not in names:
        yield Fault(
            f"{path}.{key}", f"names no {called}", suggest(given, names), format_value(given)
        )


def _check_frame(support: Support) -> Iterator[Fault]:
    if all(getattr(support.stiffness, dof) is None for dof in DOFS):
        yield Fault(
            "support.stiffness",
            "leaves the support rigid in every direction",
            "give z = ... (N/m), or leave [support] out",
        )
        return
    for dof in DOFS:
        if getattr(support.damping, dof) and getattr(support.stiffness, dof) is None:
            yield Fault(
                f"support.damping.{dof}",
                "damps a rigid direction",
                f"give support.stiffness.{dof} too",
                format_value(getattr(support.damping, dof)),
            )
    if 0 < support.mass < LEAST_MASS:
        yield Fault(
            "support.mass",
            "is too small for its motion to be computed",
            f"give 0, or at least {LEAST_MASS:g} kg",
            format_value(support.mass),
        )
    if any(0 < moment < LEAST_MASS for moment in support.inertia):
        yield Fault(
            "support.inertia",
            "is too small for its motion to be computed",
            f"give 0, or at least {LEAST_MASS:g} kg m^2",
            format_value(support.inertia),
        )


def _check_control(design: Design) -> Iterator[Fault]:
    names: list[str] = []
    for loop in design.control.loop if design.control is not None else ():
        path = f"control.loop.{loop.name}"
        if loop.name in names:
            yield fault_of(
                loop,
                path,
                "name",
                "is the name of another loop",
                "give each loop a name of its own",
            )
        names.append(loop.name)
        yield from _check_filter(loop, path)
        yield from _check_noise_spectrum(loop.sensor_noise, f"{path}.sensor_noise")


def _check_filter(loop: Loop, path: str) -> Iterator[Fault]:
    """Check that a loop has one filter, which can be built together with its sensor."""
    gain_at = None if loop.filter is not None else loop.gain_at
    found = [
        *check_exactly_one(
            path,
            {"damper": loop.damper, "gain": loop.gain, "filter": loop.filter, "gain_at": gain_at},
            "damper, or gain (or gain_at) with zeros and poles, or filter",
        )
    ]
    for key in ("filter", "sensor_response"):
        text = getattr(loop, key)
        try:
            if text is not None:
                foton.parse(text)
        except foton.FotonError as error:
            found.append(Fault(f"{path}.{key}", error.problem, error.remedy, format_value(text)))
    if (loop.damper is not None or loop.filter is not None) and (loop.zeros or loop.poles):
        key, other = "zeros" if loop.zeros else "poles", "damper"
        problem = "a damper has no filter"
        if loop.damper is None:
            problem, other = "conflicts with filter, which has its own roots", "filter"
        found.append(fault_of(loop, path, key, problem, f"give gain instead of {other}"))
    yield from found or _check_order(loop, path)


def _check_order(loop: Loop, path: str) -> Iterator[Fault]:
    """Check that the gain of a filter can be set, and that it does not grow without bound."""
    if loop.gain_at is not None:
        size = abs(loop_filters.without_gain_at(loop).at(loop.gain_at.frequency))
        if not 0 < size < math.inf or loop.gain_at.magnitude == 0:
            yield Fault(
                f"{path}.gain_at",
                "the gain cannot be set where the filter is 0 or infinite, or to 0",
                "give another frequency or magnitude",
            )
            return
    whole = loop_filters.whole(loop)
    zeros, poles = len(whole.zeros), len(whole.poles)
    if zeros <= poles or (loop.damper is not None and loop.sensor_response is None):
        return  # a damper acts on the velocity, which is known
    keys = {"filter": loop.filter, "sensor_response": loop.sensor_response, "zeros": loop.zeros}
    key = next(key for key, value in keys.items() if value)
    what = "a filter" if loop.sensor_response is None else "a filter and sensor"
    yield Fault(
        f"{path}.{key}",
        f"{what} with more zeros ({zeros}) than poles ({poles}) cannot be built",
        "add poles, or its gain grows with frequency without bound",
        format_value(keys[key]),
    )


def _check_noise_spectrum(noise: float | NoiseSpectrum, path: str) -> Iterator[Fault]:
    if not isinstance(noise, NoiseSpectrum):
        return
    if isinstance(noise.asd, list) != (noise.frequency is not None):
        yield Fault(
            path,
            "asd and frequency are lists of one length, or asd a number without frequency",
            "give {asd, corner} or {frequency = [...], asd = [...]}",
        )
    elif noise.frequency is not None and isinstance(noise.asd, list):
        if noise.corner is not None:
            yield Fault(
                f"{path}.corner", "conflicts with frequency", "remove it", f"{noise.corner:g}"
            )
        if len(noise.frequency) != len(noise.asd):
            yield Fault(
                f"{path}.asd",
                f"has {len(noise.asd)} values for {len(noise.frequency)} frequencies",
                "give one per frequency",
            )
        pairs = zip(noise.frequency, noise.frequency[1:], strict=False)
        if not all(low < high for low, high in pairs):
            yield fault_of(
                noise,
                path,
                "frequency",
                "is not in ascending order",
                "sort it, each frequency once",
            )
        if min(noise.asd) <= 0:
            yield fault_of(
                noise,
                path,
                "asd",
                "must be positive, as its logarithm is interpolated",
                "give a small number instead of 0",
            )


def _check_requirement(item: Requirement, path: str) -> Iterator[Fault]:
    if sum(limit is not None for limit in (item.band, item.below, item.above)) != 1:
        yield Fault(
            path,
            f"{item.quantity} must have one limit",
            "give band = [least, largest], below = limit or above = limit",
        )
    if item.band is not None and not item.band[0] < item.band[1]:
        yield fault_of(
            item,
            path,
            "band",
            "is reversed or empty, so that no build is in it",
            "give [least, largest]",
        )


def _check_tolerance(design: Design) -> Iterator[Fault]:
    if design.tolerance is None:
        return
    tables = [
        (kind, n, item)
        for kind in imperfections.PARTS
        for n, item in enumerate(getattr(design.tolerance, kind), 1)
    ]
    if not tables:
        yield Fault(
            "tolerance",
            "has no distribution",
            f"add {' or '.join(f'[[tolerance.{part}]]' for part in imperfections.PARTS)}",
        )
    for n, item in enumerate(design.tolerance.require, 1):
        yield from _check_requirement(item, f"tolerance.require.{n}")
    for kind, n, item in tables:
        path = f"tolerance.{kind}.{n}"
        if kind == "wire" and (item.stage is None) == (item.wire is None):
            yield Fault(
                path, "must name a stage or one wire", 'give stage = "test" or wire = "test.1"'
            )
        yield from _check_scattered_stage(design, kind, item, path)
        if kind == "wire" and item.wire is not None and item.wire not in _wires_of(design):
            yield fault_of(
                item, path, "wire", "names no wire", suggest(item.wire, _wires_of(design))
            )
        known = [row.spread for row in imperfections.scattered(kind)]
        given = {key: getattr(item, key) for key in known}
        spreads = {key: spread for key, spread in given.items() if spread is not None}
        if not spreads:
            yield Fault(path, "has no distribution", f"give {' or '.join(known)}")
        for key, spread in spreads.items():
            yield from check_exactly_one(
                f"{path}.{key}",
                {"normal": spread.normal, "uniform": spread.uniform},
                "normal (standard deviation) or uniform (half width)",
            )
            if spread.truncate is not None and not (spread.normal and spread.truncate > 0):
                yield Fault(
                    f"{path}.{key}.truncate",
                    "goes with a normal distribution and must be positive",
                    "give normal too",
                    format_value(spread.truncate),
                )


def _names_of_bodies(design: Design) -> list[str]:
    """List the names of all stages and keystones."""
    return [
        name
        for stage in design.stage
        for name in (stage.name, *([stage.name + SUFFIX] if stage.filter is not None else []))
    ]


def _wires_of(design: Design) -> list[str]:
    """List the names of all wires."""
    return [
        f"{s.name}.{n}"
        for s in design.stage
        for n in range(1, (s.wires.count if s.wires else len(s.wire)) + 1)
    ]
