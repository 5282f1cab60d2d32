"""What the types of the file format cannot say: which keys go together, which names exist.

Each function yields the faults of one kind of table; `of_design` gathers them all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import bodies, hanging, materials
from suspension_cli.design.bodies import LEAST_MASS, exclusive
from suspension_cli.design.derive import set_geometry
from suspension_cli.design.faults import suggestion
from suspension_cli.design.schema import Design, Distribution, Perturbation, Spring, Stage, Support
from suspension_cli.design.wires import BladeSet, Wire, WireSet
from suspension_cli.errors import Fault, key_shown, shown

ANALYSES = ("modes", "response", "thermal", "xcouple", "tolerance", "sweep", "sensitivity", "fit", "optimise", "tradeoff", "damp", "export", "info")
"""Commands that take defaults from a design's `[analysis]` table."""

BLADES_FOR_WIRES = {1: (1,), 2: (1, 2), 4: (2, 4)}
"""Number of wires in a symmetric set to the numbers of blades that can carry it."""
FRAME = "frame"
"""What results call the motion of a support structure that is not rigid."""
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


def of_design(design: Design) -> list[Fault]:
    """All faults between the tables of a design whose single values are good."""
    found = [*_names(design), *_materials(design)]
    for stage in design.stage:
        path = f"stage.{stage.name}"
        found += bodies.of_body(stage.body, f"{path}.body")
        found += _suspension(design, stage, path)
        for number, spring in enumerate(stage.spring, 1):
            found += _spring(spring, f"{path}.spring.{number}")
    if not found:
        for number, perturbation in enumerate(design.perturbation, 1):
            found += _perturbation(design, perturbation, f"perturbation.{number}")
    found += [*_control(design), *_tolerance(design)]
    if design.support is not None:
        found += _frame(design.support)
    for command in design.analysis:
        if command not in ANALYSES:
            found.append(Fault(f"analysis.{key_shown(command)}", "unknown command", suggestion(command, list(ANALYSES))))
    return found


def _names(design: Design) -> Iterator[Fault]:
    above: list[str] = [SUPPORT]
    for stage in design.stage:
        path = f"stage.{stage.name}"
        if stage.name in above:
            taken = "is the name of the suspension point" if stage.name == SUPPORT else "is the name of an earlier stage too"
            yield Fault(f"{path}.name", taken, "give each stage a name of its own", shown(stage.name))
        if stage.name == FRAME and design.support is not None:
            yield Fault(f"{path}.name", "is the name of the support structure that [support] describes", "give the stage another name", shown(stage.name))
        if stage.hangs_from is not None and stage.hangs_from not in above:
            yield Fault(f"{path}.hangs_from", "names no earlier stage", suggestion(stage.hangs_from, above), shown(stage.hangs_from))
        against = None if stage.damping is None else stage.damping.against
        if against is not None and against not in above:
            yield Fault(f"{path}.damping.against", "names no earlier stage", suggestion(against, above), shown(against))
        above.append(stage.name)


def _materials(design: Design) -> Iterator[Fault]:
    for name in design.materials:
        if not NAME.fullmatch(name):
            yield Fault(f"materials.{key_shown(name)}", "no wire can name this material", "call it by letters, digits, _ and -, starting with a letter")
        elif materials.resolve(design, name).youngs_modulus is None:
            yield Fault(f"materials.{name}.youngs_modulus", "missing", "give Young's modulus in Pa")
        yield from hanging.of_material(design.materials[name], f"materials.{key_shown(name)}")


def _suspension(design: Design, stage: Stage, path: str) -> Iterator[Fault]:
    if stage.wires is not None and stage.wire:
        yield Fault(f"{path}.wire", "stands beside a symmetric set [stage.wires]", "keep one of the two")
    if stage.wires is None and not stage.wire and not stage.spring:
        yield Fault(path, "hangs on nothing", "add [stage.wires], [[stage.wire]] or [[stage.spring]]")
    if stage.wires is None and stage.position is None:
        yield Fault(f"{path}.position", "missing", "give the nominal COM from the COM above, [x, y, z] in m")
    if stage.wires is not None:
        yield from _wire_set(design, stage.wires, f"{path}.wires")
        if stage.position is not None:
            yield Fault(f"{path}.position", "a symmetric set implies the position", "remove it", shown(stage.position))
    if stage.blades is not None:
        yield from _blade_set(design, stage, stage.blades, f"{path}.blades")
    for number, wire in enumerate(stage.wire, 1):
        yield from _wire(design, stage, wire, f"{path}.wire.{number}")
    names: list[str] = []
    for blade in stage.blade:
        where = f"{path}.blade.{blade.name}"
        if blade.name in names:
            yield Fault(f"{where}.name", "is the name of another blade of this stage", "give each blade a name of its own", shown(blade.name))
        names.append(blade.name)
        yield from hanging.of_blade(design, blade, where)
        if not any(wire.blade == blade.name for wire in stage.wire):
            yield Fault(where, "carries no wire", f'name it in a wire: blade = "{blade.name}"')


def _wire_set(design: Design, wires: WireSet, path: str) -> Iterator[Fault]:
    yield from hanging.of_wire(design, wires, path)
    halves = (wires.s_upper, wires.s_lower)
    if wires.s is not None and halves != (None, None):
        yield Fault(f"{path}.s", "stands beside s_upper or s_lower", "give s alone, or s_upper and s_lower", shown(wires.s))
    elif wires.s is None and halves.count(None) == 1:
        yield Fault(path, "s_upper and s_lower go together", "give both, or s alone")
    elif wires.count == 4 and wires.s is None and None in halves:
        yield Fault(f"{path}.s", "missing", "give the half separation in x, m")
    for key in ("t1", "t2"):
        if wires.count > 1 and getattr(wires, key) is None:
            yield Fault(f"{path}.{key}", "missing", "give the half separation in y, m")
    forbidden = {1: ("s", "s_upper", "s_lower", "t1", "t2"), 2: ("s", "s_upper", "s_lower"), 4: ()}[wires.count]
    for key in forbidden:
        if getattr(wires, key):
            yield Fault(f"{path}.{key}", f"must be 0 for {wires.count} wire{'s' * (wires.count > 1)}", "remove it or change count", shown(getattr(wires, key)))
    shape = set_geometry(wires)
    if shape.height_squared <= 1e-12 * wires.l**2:
        span = math.hypot(shape.t2 - shape.t1, shape.s_lower - shape.s_upper)
        remedy = "give a longer wire or a smaller span" + (" (did you mean mm?)" if span > 1.0 and wires.l > 5e-4 * span else "")
        yield Fault(f"{path}.l", f"the wire is not longer than its horizontal span of {span:g} m", remedy, shown(wires.l))
        return
    yield from hanging.along(wires, (shape.s_lower - shape.s_upper, shape.t2 - shape.t1, -shape.height), path)


def _wire(design: Design, stage: Stage, wire: Wire, path: str) -> Iterator[Fault]:
    yield from hanging.of_wire(design, wire, path)
    if wire.natural_length is not None and wire.tension is not None:
        yield Fault(f"{path}.tension", "stands beside natural_length", "give one of them", shown(wire.tension))
    if wire.blade is not None and wire.blade not in [blade.name for blade in stage.blade]:
        yield Fault(f"{path}.blade", "names no [[stage.blade]]", suggestion(wire.blade, [blade.name for blade in stage.blade]), shown(wire.blade))
    if stage.position is not None:
        x, y, z = (p + q - u for p, q, u in zip(stage.position, wire.lower, wire.upper, strict=True))
        if math.hypot(x, y, z) < 1e-9:
            yield Fault(f"{path}.lower", "both ends of the wire are at one point", "check upper, lower and position", shown(wire.lower))
            return
        yield from hanging.along(wire, (x, y, z), path)


def _blade_set(design: Design, stage: Stage, blades: BladeSet, path: str) -> Iterator[Fault]:
    yield from hanging.of_blade(design, blades, path)
    if stage.wires is None:
        yield Fault(path, "goes with a symmetric set [stage.wires]", "use [[stage.blade]] and name the blade in each wire")
    elif blades.count not in BLADES_FOR_WIRES[stage.wires.count]:
        fits = " or ".join(str(n) for n in BLADES_FOR_WIRES[stage.wires.count])
        yield Fault(f"{path}.count", f"cannot carry {stage.wires.count} wires", f"give {fits}", shown(blades.count))


def _spring(spring: Spring, path: str) -> Iterator[Fault]:
    for key in ("stiffness", "damping"):
        matrix = getattr(spring, key)
        if matrix is None:
            continue
        rows = [isinstance(row, list) for row in matrix]
        if any(rows) and not all(rows):
            yield Fault(f"{path}.{key}", "mixes numbers and rows", "give six numbers or six rows of six", shown(matrix))
        elif all(rows) and any(matrix[i][j] != matrix[j][i] for i in range(6) for j in range(i)):
            yield Fault(f"{path}.{key}", "is not symmetric", "make element (i, j) equal to (j, i)", shown(matrix))


_OF_WIRE = ("k_factor", "upper_offset", "lower_offset", "length_change")
_OF_BODY = ("com_offset", "rotation")


def _perturbation(design: Design, item: Perturbation, path: str) -> Iterator[Fault]:
    if (item.wire is None) == (item.body is None):
        yield Fault(path, "must name one wire or one body", 'give wire = "test.1" or body = "test"')
        return
    wanted, other = (_OF_WIRE, _OF_BODY) if item.wire is not None else (_OF_BODY, _OF_WIRE)
    for key in other:
        if getattr(item, key) is not None:
            yield Fault(f"{path}.{key}", f"is not for a {'wire' if item.wire else 'body'}", f"known here: {', '.join(wanted)}", shown(getattr(item, key)))
    if all(getattr(item, key) is None for key in wanted):
        yield Fault(path, "changes nothing", f"give {' or '.join(wanted)}")
    names = [stage.name for stage in design.stage]
    if item.body is not None and item.body not in names:
        yield Fault(f"{path}.body", "names no stage", suggestion(item.body, names), shown(item.body))
    if item.wire is not None:
        wires = _wires_of(design)
        if item.wire not in wires:
            yield Fault(f"{path}.wire", "names no wire", suggestion(item.wire, wires), shown(item.wire))


def _frame(support: Support) -> Iterator[Fault]:
    if all(getattr(support.stiffness, dof) is None for dof in DOFS):
        yield Fault("support.stiffness", "is rigid in every direction", "give z = ... (N/m), or leave [support] out")
        return
    for dof in DOFS:
        if getattr(support.damping, dof) and getattr(support.stiffness, dof) is None:
            yield Fault(f"support.damping.{dof}", "damps a rigid direction", f"give support.stiffness.{dof} too", shown(getattr(support.damping, dof)))
    if 0 < support.mass < LEAST_MASS:
        yield Fault("support.mass", "is too small for its motion to be computed", f"give 0, or at least {LEAST_MASS:g} kg", shown(support.mass))
    if any(0 < moment < LEAST_MASS for moment in support.inertia):
        yield Fault("support.inertia", "is too small for its motion to be computed", f"give 0, or at least {LEAST_MASS:g} kg m^2", shown(support.inertia))


def _control(design: Design) -> Iterator[Fault]:
    names: list[str] = []
    for loop in design.control.loop if design.control is not None else ():
        path = f"control.loop.{loop.name}"
        if loop.name in names:
            yield Fault(f"{path}.name", "is the name of another loop", "give each loop a name of its own", shown(loop.name))
        names.append(loop.name)
        yield from exclusive(path, {"damper": loop.damper, "gain": loop.gain}, "damper, or gain with zeros and poles")
        if loop.damper is not None and (loop.zeros or loop.poles):
            key = "zeros" if loop.zeros else "poles"
            yield Fault(f"{path}.{key}", "a damper has no filter", "give gain instead of damper", shown(getattr(loop, key)))
        zeros, poles = (sum(2 if isinstance(root, list) else 1 for root in roots) for roots in (loop.zeros, loop.poles))
        if zeros > poles and loop.damper is None:
            yield Fault(f"{path}.zeros", f"{zeros} zeros on {poles} poles is no filter that can be built", "add poles", shown(loop.zeros))


def _tolerance(design: Design) -> Iterator[Fault]:
    if design.tolerance is None:
        return
    names = [stage.name for stage in design.stage]
    tables = [(kind, n, item) for kind in ("wire", "body", "blade") for n, item in enumerate(getattr(design.tolerance, kind), 1)]
    if not tables:
        yield Fault("tolerance", "holds no distribution", "add [[tolerance.wire]], [[tolerance.body]] or [[tolerance.blade]]")
    for kind, n, item in tables:
        path = f"tolerance.{kind}.{n}"
        if kind == "wire" and (item.stage is None) == (item.wire is None):
            yield Fault(path, "must name a stage or one wire", 'give stage = "test" or wire = "test.1"')
        if item.stage is not None and item.stage not in names:
            yield Fault(f"{path}.stage", "names no stage", suggestion(item.stage, names), shown(item.stage))
        if kind == "wire" and item.wire is not None and item.wire not in _wires_of(design):
            yield Fault(f"{path}.wire", "names no wire", suggestion(item.wire, _wires_of(design)), shown(item.wire))
        spreads = {key: getattr(item, key) for key in item.__struct_fields__ if isinstance(getattr(item, key), Distribution)}
        if not spreads:
            yield Fault(path, "scatters nothing", "give a distribution")
        for key, spread in spreads.items():
            yield from exclusive(f"{path}.{key}", {"normal": spread.normal, "uniform": spread.uniform}, "normal (standard deviation) or uniform (half width)")
            if spread.truncate is not None and not (spread.normal and spread.truncate > 0):
                yield Fault(f"{path}.{key}.truncate", "goes with a normal distribution and must be positive", "give normal too", shown(spread.truncate))


def _wires_of(design: Design) -> list[str]:
    """Names of all wires."""
    return [f"{s.name}.{n}" for s in design.stage for n in range(1, (s.wires.count if s.wires else len(s.wire)) + 1)]
