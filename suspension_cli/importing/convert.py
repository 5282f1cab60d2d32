"""A design from the bodies, wires, springs, legs, links and dampers of a save."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.files import whole_files
from suspension_cli.importing.imported import Imported, plain, table, with_notes, word
from suspension_cli.importing.save import (
    GRAVITY,
    Body,
    Tables,
    Wire,
    hinge_notes,
    names_of,
    order,
    read_bodies,
    read_tables,
    symmetric,
    turned,
    turned_matrix,
)

RIGID = 1e9
"""Stiffness of what SUMCON takes as rigid, N/m or N m/rad."""
SAG = 1e-4
"""Sag of a vertical spring that is not written, m."""


def read(
    file: Path,
    name: str,
    reference: str = "",
    *,
    tables: Path | None = None,
    bending_points: bool = False,
) -> Imported:
    """Read a save and convert it into a design of the given name.

    `reference` says where the save comes from (default its file name). `tables` is the folder of
    the stiffness tables of heat links, NAME.txt; default the folder HeatLink beside the save or in
    one of the four folders above. With `bending_points` wires end at SUMCON's hinges, with the
    tensions that it takes for them, instead of at their clamps. Raises `InputError` if the file is
    no save, is damaged, or gives no valid design.
    """
    with attribute_faults_to(str(file)):
        text = whole_files.read_text(file, whole_files.TEXT, "a save of SUMCON (.m)")
        near = [folder / "HeatLink" for folder in file.resolve().parents[:5]]
        folder = tables or next((one for one in near if one.is_dir()), file.parent)
        save = read_tables(text)
        title = re.search(r'^save\$FileName[ \t]*=\s*"(?:[^"\n]*[\\/])?([^"\n]*)"', text, re.M)
        head = {
            "name": name,
            "title": f"Suspension {plain(title[1]) if title else name} of SUMCON",
            "reference": plain(reference or file.name, 300),
        }
        found = _convert(save, head, lambda one: read_columns(folder, one), bending_points)
        found.source()
    return found


def read_columns(folder: Path, name: str) -> np.ndarray:
    """Read a stiffness table of SUMCON: (frequency in Hz, real and imaginary part in N/m; row)."""
    key = f"stiffness table {plain(name)}"
    file = folder / f"{name}.txt"
    if not re.fullmatch(r"\w{1,60}", name, re.ASCII) or not file.exists():
        problem = "is not in a folder HeatLink near the save"
        raise InputError.of(key, problem, "name its folder with --tables")
    lines = whole_files.read_text(file, whole_files.TOML, "a stiffness table").splitlines()
    try:
        columns = np.array([line.split() for line in lines if line.strip()], dtype=float).T
    except ValueError:
        columns = np.empty((0, 0))
    good = columns.shape[0] == 3 and np.isfinite(columns).all()
    if not good or np.diff(columns[0], prepend=0).min() <= 0:
        remedy = "give lines of frequency (ascending), real and imaginary part"
        raise InputError.of(key, "is not a table of three columns", remedy)
    return columns


def _convert(
    tables: Tables, head: dict[str, str], columns: Callable[[str], np.ndarray], bending_points: bool
) -> Imported:
    notes: list[str] = []
    files: dict[str, str] = {}
    bodies = read_bodies(tables, bending_points, notes)
    lines: list[str] = []
    before: Body | None = None
    used = {wire.material for body in bodies for wire in body.wires}
    for number in sorted(used):
        lines += _material(tables["mat"][number])
    for body in order(bodies):
        lines += _stage(body, before, tables, notes)
        before = body
    for row in tables["damp"]:
        lines += _damper(row, bodies, notes)
    for row in tables["HL"]:
        lines += _link(row, bodies, columns, files, notes)
    origin = "from a save of SUMCON, whose x, y, z are y, z, x here."
    heading = "Otherwise than in SUMCON, or not taken over:"
    text = with_notes(origin, heading, notes, [*table("design", head), *lines])
    return Imported(text, notes, files, "modes {file} --fidelity string")


def _material(row: list[Any]) -> list[str]:
    name, density, modulus, poisson, digits, power, source = row[:7]
    keys: dict[str, Any] = {"youngs_modulus": modulus * 1e9, "poisson_ratio": poisson}
    keys |= {"density": density * 1e3, "loss_angle": digits * 10.0 ** min(power, 9.0)}
    keys |= {"source": plain(source, 300)} if source else {}
    return table(f"materials.{_material_name(row)}", keys, f"SUMCON: {plain(name)}")


def _material_name(row: list[Any]) -> str:
    return word(row[0].lower(), "material")


def _stage(body: Body, before: Body | None, tables: Tables, notes: list[str]) -> Iterator[str]:
    above = body.above
    assert above is not None
    on_keystone = above.blades_for is not None and above.blades_for is next(iter(body.wires), None)
    holder = "support" if above.ground else above.name + "-keystone" * on_keystone
    usual = "support"
    if before is not None:
        usual = before.name + "-keystone" * (before.blades_for is not None)
    start = body.offset.copy()
    if on_keystone:
        start[2] -= body.wires[0].top[2]
    keys: dict[str, Any] = {"name": body.name}
    keys |= {"hangs_from": holder} if holder != usual else {}
    keys |= {"mirror": True} if body.name == "TM" and not body.below else {}
    keys |= {"position": start} if body.wires and body.set_keys is None else {}
    diagonal = body.inertia.diagonal()
    inertia = diagonal if (body.inertia == np.diag(diagonal)).all() else body.inertia
    yield from table("[stage]", keys | {"body": {"mass": body.mass, "inertia": inertia}})
    notes += hinge_notes(body)
    springs = [wire.spring for wire in body.wires if wire.spring and wire.spring[4]]
    if springs and not on_keystone:
        names = ", ".join(plain(row[7]) for row in springs)
        notes.append(f"spring {names}: its inertia ({springs[0][5]:g} dB) is left out")
    if body.legs is not None:
        yield from _legs(body, notes)
    if body.set_keys is not None:
        yield from _wire_set(body, on_keystone, tables)
    else:
        for wire in body.wires:
            yield from _wire(wire, above.place if above.ground else np.zeros(3), body, tables)
    if body.blades_for is not None:
        yield from _filter(body, body.blades_for)


def _wire_set(body: Body, on_keystone: bool, tables: Tables) -> Iterator[str]:
    wire = body.wires[0]
    shape = dict(body.set_keys or {})
    count = len(body.wires)
    if on_keystone:
        shape.pop("d_upper", None)
    keys = {"count": count, "l": body.length} | shape | _elastic(wire, tables)
    yield from table("stage.wires", keys, f"SUMCON: {names_of(body.wires)}")
    if wire.spring is not None and not on_keystone:
        names = ", ".join(plain(one.spring[7]) for one in body.wires if one.spring)
        keys = {"count": count} | _blade(wire.spring, body)
        yield from table("stage.blades", keys, f"SUMCON: {names}")


def _wire(wire: Wire, start: np.ndarray, body: Body, tables: Tables) -> Iterator[str]:
    keys: dict[str, Any] = {"upper": wire.top + start, "lower": wire.bottom}
    if len(body.wires) > 1 or wire.bottom[:2].any() or body.below:
        keys["natural_length"] = wire.natural
    if wire.spring is not None:
        keys["blade"] = word(wire.spring[7], "blade")
    keys |= _elastic(wire, tables)
    yield from table("[stage.wire]", keys, f"SUMCON: {wire.name}")
    if wire.spring is not None:
        yield from table("[stage.blade]", {"name": keys["blade"]} | _blade(wire.spring, body))


def _elastic(wire: Wire, tables: Tables) -> dict[str, Any]:
    keys: dict[str, Any] = {"material": _material_name(tables["mat"][wire.material])}
    ends = {"length": wire.end_length, "radius": wire.end_diameter / 2}
    if 0 < 2 * wire.end_length < wire.natural and wire.end_diameter != wire.diameter:
        keys["sections"] = [ends, {"radius": wire.diameter / 2}, ends]
    else:
        keys["radius"] = wire.diameter / 2
    bends = {"clamp": "bending-point"} if wire.bend else {"bending": "hinged"}
    return keys | {"k": wire.k, "torsion": wire.torsion} | bends


def _blade(spring: list[Any], body: Body) -> dict[str, float]:
    _, _, stiffness, load, *_, q = spring[:9]
    keys = {"stiffness": stiffness}
    if abs(load - body.share) > SAG * stiffness or body.set_keys is None:
        keys["load"] = load + (_hanging(body) - body.load) * GRAVITY / len(body.wires)
    return keys | ({"loss_angle": 1 / q} if q > 1 else {})


def _keystone(wire: Wire) -> tuple[float, float]:
    """Mass of a keystone and the inertia of the blades that couples both bodies, kg.

    SUMCON has that inertia and no keystone: this is little more than the lightest that can have it.
    """
    assert wire.spring is not None
    _, _, _, load, counts, decibel, *_ = wire.spring
    coupling = 10 ** (decibel / 20) * load / GRAVITY if counts and decibel < -6 else 0.0
    return max(1.1 * coupling, 1e-4 * load / GRAVITY), coupling


def _hanging(body: Body) -> float:
    """Mass of a body and all below, with keystones, kg."""
    own = _keystone(body.blades_for)[0] if body.blades_for else 0.0
    return body.mass + own + sum(map(_hanging, body.below))


def _filter(body: Body, wire: Wire) -> Iterator[str]:
    assert wire.spring is not None
    _, _, stiffness, load, _, decibel, _, name, q = wire.spring[:9]
    hung = next(one for one in body.below if one.number == wire.lower)
    mass, coupling = _keystone(wire)
    keys: dict[str, Any] = {"at": [0.0, 0.0, float(wire.top[2])], "stiffness": stiffness}
    if abs(load - hung.load * GRAVITY) > SAG * stiffness:
        keys["load"] = load + (_hanging(hung) - hung.load + mass) * GRAVITY
    keys |= {"keystone": {"mass": mass}, "mass_coupling": coupling}
    keys |= ({"q": q} if q > 1 else {}) | {"lateral_stiffness": RIGID, "tilt_stiffness": RIGID}
    yield from table(
        "stage.filter",
        keys,
        f"SUMCON: {plain(name)}",
        keystone="not in SUMCON: as light as mass_coupling allows",
        mass_coupling=f"{decibel:g} dB",
        lateral_stiffness="rigid, as in SUMCON",
    )


def _legs(body: Body, notes: list[str]) -> Iterator[str]:
    assert body.legs is not None
    _, _, places, stiffness, q, name, length, decibel, negative, load, counts = body.legs[:11]
    name = plain(name)
    lateral = sum(stiffness[:3])
    yaw = stiffness[3]
    if lateral <= 0 or length <= 0:
        problem = f"has no stiffness or length ({name})"
        raise InputError.of("save$IP", problem, "correct it in SUMCON")
    tops = [turned((x, 0.0, z)) for x, z in places]
    ring = symmetric(tops, tops) or {}
    keys: dict[str, Any] = {"points": tops}
    if "ring" in ring:
        keys = {"count": 3, "radius": ring["ring"], "phase": ring.get("phase", 0.0)}
    coupling = 10 ** (decibel / 20) * load / 3 if counts else 0.0
    mass = _hanging(body)
    ballast: dict[str, Any] = {}
    if coupling and negative:  # -m (b/L) (1 + b/L) couples foot and top, m (b/L)^2 is at the top
        ballast["counterweight"] = {"mass": coupling / 0.75, "below": length / 2}
        mass += 3 * coupling / 0.75 / 4
    elif coupling:  # a thin rod couples m/6, m/3 is at the top
        ballast["leg_mass"] = 6 * coupling
        mass += 3 * 2 * coupling
    keys |= {"length": length, "frequency": math.sqrt(lateral / mass) / math.tau}
    keys |= {"axial_stiffness": RIGID, "yaw_stiffness": 0.0, "q": q[0]} | ballast
    if max(stiffness[:3]) > 1.001 * min(stiffness[:3]) or len(set(q[:3])) > 1:
        notes.append(f"legs {name}: a third of the sum of their stiffnesses each, Q of the first")
    if abs(load - body.load) > 0.01 * body.load:
        notes.append(
            f"legs {name}: in SUMCON the ground tilts them under {load:.5g} kg, they carry"
            f" {body.load:.5g} kg"
        )
    beside = dict.fromkeys(ballast, f"stands for the {decibel:g} dB of SUMCON")
    yield from table(
        "stage.inverted_pendulum",
        keys,
        f"SUMCON: {name}",
        frequency=f"{lateral:.6g} N/m under {body.load:.6g} kg",
        axial_stiffness="rigid, as in SUMCON",
        yaw_stiffness="a spring with a loss of its own, below" if yaw else "",
        **beside,
    )
    if yaw:
        keys = {"stiffness": [0.0] * 5 + [yaw]} | ({"loss_angle": 1 / q[3]} if q[3] > 1 else {})
        yield from table("[stage.spring]", keys, "yaw of the legs")


def _joined(
    kind: str, name: str, row: list[Any], bodies: list[Body], notes: list[str]
) -> dict[str, Any] | None:
    """Name, bodies and point of a damper or link; None, with a note, if it joins two grounds.

    `row` has two numbers of bodies and the points. One point stands for both: that of the body if
    the other is ground, else half-way.
    """
    first, second = (bodies[n] for n in row[:2])
    ends = [turned(at) + body.place for at, body in zip(row[2:4], (first, second), strict=True)]
    if first.ground and second.ground:
        notes.append(f"{kind} {name} is left out: it joins two grounds")
        return None
    point = (ends[0] + ends[1]) / 2
    other = second.name
    if first.ground or second.ground:
        ground = first if first.ground else second
        point = ends[1] if first.ground else ends[0]
        first = second if first.ground else first
        is_support = ground is next(one for one in bodies if one.ground)
        other = "support" if is_support else "ground"
    if (apart := math.dist(*ends)) > 1e-3:
        notes.append(f"{kind} {name} acts at one point; its two in SUMCON are {apart:.3g} m apart")
    return {"name": name, "between": [first.name, other], "at": point - first.place}


def _six(matrix: np.ndarray) -> np.ndarray:
    return matrix.diagonal() if (matrix == np.diag(matrix.diagonal())).all() else matrix


def _damper(row: list[Any], bodies: list[Body], notes: list[str]) -> list[str]:
    name = word(row[0], "damper")
    damping = turned_matrix(row[5])
    if not damping.any():
        notes.append(f"damper {name} is left out: all its numbers are 0")
        return []
    keys = _joined("damper", name, row[1:5], bodies, notes)
    return table("[damper]", keys | {"damping": _six(damping)}) if keys else []


def _link(
    row: list[Any],
    bodies: list[Body],
    columns: Callable[[str], np.ndarray],
    files: dict[str, str],
    notes: list[str],
) -> list[str]:
    *_, span, _, q, matrix, names, name = row[:10]
    name = word(name, "link")
    matrix = np.array(matrix)
    loss = 1 / q if q > 1 else 0.0
    if not any(map(any, names)) and not matrix.any():
        notes.append(f"heat link {name} is left out: it has no stiffness")
        return []
    keys = _joined("heat link", name, row[:4], bodies, notes)
    if keys is None:
        return []
    angle = math.atan(-span[2] / span[0]) if span[0] else math.copysign(math.pi / 2, -span[2])
    if not any(map(any, names)):
        keys["stiffness"] = _six(turned_matrix(_along(matrix, angle)))
        keys |= {"loss_angle": loss} if loss else {}
        return table("[link]", keys)
    file_of = np.diag(np.array(names, object))
    constant = matrix.diagonal() * (1 + 1j * loss)
    own = [columns(a) if a else b for a, b in zip(file_of, constant, strict=True)]
    if any(names[a][b] for a in range(6) for b in range(6) if a != b):
        notes.append(f"heat link {name}: tables beside the diagonal are left out")
    if abs(math.sin(2 * angle)) > 1e-9 and names[0][0] != names[2][2]:
        notes.append(f"heat link {name}: x and y are not coupled by its direction")
    if any(np.ndim(one) and one[2].min() < 0 for one in own):
        notes.append(f"heat link {name}: negative imaginary parts of its tables are 0 here")
    text = _table_file(own, math.sin(angle) ** 2)
    # links of equal stiffness share a file
    file = next((one for one, known in files.items() if known == text), f"{name}.csv")
    files[file] = text
    return table("[link]", keys) + table("link.table", {"file": file})


def _along(matrix: np.ndarray, angle: float) -> np.ndarray:
    """Turn the stiffness of a link into its direction, in SUMCON's axes; rounding errors are 0."""
    turn = np.eye(6)
    cosine = math.cos(angle)
    sine = math.sin(angle)
    turn[:3, :3] = [[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]
    whole = turn @ matrix @ turn.T
    return np.where(abs(whole) < 1e-12 * abs(whole).max(), 0.0, (whole + whole.T) / 2)


def _table_file(own: list[Any], turned_part: float) -> str:
    """CSV of the stiffness of a heat link whose x axis is turned by an angle of squared sine.

    `own` has a table as of `read_columns` or a number for each of SUMCON's axes. Between the lines
    of a table its parts are linear in the logarithm of frequency.
    """
    frequency = next(one[0] for one in own if np.ndim(one))
    parts = []
    for one in own:
        if np.ndim(one):
            at = [np.interp(np.log(frequency), np.log(one[0]), part) for part in one[1:]]
            one = at[0] + 1j * np.maximum(at[1], 0.0)
        parts.append(one + np.zeros(len(frequency), complex))
    # mix the stiffnesses along and across the link
    x = parts[0]
    z = parts[2]
    parts[0] = x + (z - x) * turned_part
    parts[2] = z + (x - z) * turned_part
    axes = [parts[n] for n in (2, 0, 1, 5, 3, 4)]
    rows = np.column_stack([frequency, *(part for one in axes for part in (one.real, one.imag))])
    head = "# frequency in Hz; real and imaginary part of x, y, z, roll, pitch, yaw"
    return "\n".join([head, *(",".join(f"{v:.6g}" for v in row) for row in rows), ""])
