"""Tables of the dimensions of a design, as rows of text and on a canvas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from suspension_cli.design.derive import set_geometry, with_bodies_above
from suspension_cli.design.imperfections import perturbed, perturbed_part
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.design.schema import Design, Stage
from suspension_cli.drawing.geometry import free_springs
from suspension_cli.drawing.labels import widest
from suspension_cli.drawing.parts import Canvas
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    format_significant,
    millimetres,
    shorten,
    single_line,
)
from suspension_cli.scene.scene import Scene

ROW = 0.15
"""Height of a row, in."""
SIZE = 5.6
"""Font size, points."""
MOST = 40
"""Most rows of a table; the design file has all."""
NONE = "–"
"""Entry where a dimension does not exist."""

KEY = (
    (
        "$l$ loaded length of a wire; $s$ half separation of the wires in x (upper / lower where"
        " they differ); $t_1$, $t_2$ half separation in y at the upper and lower end;"
    ),
    (
        "$d$ height of the lower ends above the COM of their mass; $d_u$ depth of the upper ends"
        " below the COM of the mass above; depth: of the COM below the suspension point."
    ),
)
"""Explanation of the symbols of Husman et al. (2000)."""
BLADES = (
    "Thick lines ending at wires: cantilever blades, which point outwards from their clamps; where"
    " the design gives no length, it is schematic."
)
FILTERS = "Thick arcs: blades of filters, schematic, which carry the keystones."
SPRINGS = "Zigzags: springs, each at its point; dotted, to the body (or support) that holds it."
LEGS = "Thick bars between thin flexures: legs of an inverted pendulum."
LINKS = (
    "Plain curves: links of curved wires, without their weight. Pistons: dampers. Hatched feet: the"
    " ground beside the support."
)

DAMPERS = "Small squares: masses of dampers on springs, above tips of blades and on wires."


@dataclass(frozen=True)
class Table:
    """Rows of text under headings; the first column is left-aligned."""

    title: str
    heads: tuple[str, ...]
    rows: list[tuple[str, ...]]

    @property
    def height(self) -> float:
        """Height including title and headings, in."""
        return ROW * (len(self.rows) + 2.2)


def key(design: Design, scene: Scene) -> list[str]:
    """Lines that explain the symbols in a drawing."""
    springs = scene.springs
    kinds = {springs.label[n].rsplit(".", 1)[1] for n in free_springs(scene)}
    shown = {
        BLADES: bool(scene.blades.label),
        FILTERS: "blades" in kinds,
        SPRINGS: bool(kinds - {"link", "damper", "blades"}),
        LEGS: bool(scene.struts.label),
        DAMPERS: any(
            table.dampers
            for stage in design.stage
            for table in (*stage.wire_tables, *stage.blade_tables)
        ),
        LINKS: bool(kinds & {"link", "damper"} or springs.grounded.any()),
    }
    return [*KEY, *(line for line, is_drawn in shown.items() if is_drawn)]


def listed(design: Design, scene: Scene) -> list[Table]:
    """Tables below a drawing: stages, wires outside symmetric sets, control, imperfections."""
    found = (_stages(design, scene), _wires(design, scene), _loops(design), _flaws(design))
    return [
        replace(
            table,
            title=f"{table.title}; the first {MOST} of {len(table.rows)}",
            rows=table.rows[:MOST],
        )
        if len(table.rows) > MOST and n
        else table
        for n, table in enumerate(found)
        if table.rows
    ]


def _stages(design: Design, scene: Scene) -> Table:
    """Table of stages: mass, the body above, and the dimensions of the symmetric set of wires."""
    tree = any(stage.hangs_from is not None for stage in design.stage)
    symbols = ("$l$", "$s$", "$t_1$", "$t_2$", "$d$", "$d_u$", "depth")
    heads = ["stage", *["hangs from"] * tree, "mass (kg)", "wires"]
    heads += [*(f"{symbol} (mm)" for symbol in symbols), "blades (N/m)"]
    rows = [
        (
            single_line(stage.name, 20),
            *[single_line(above, 16)] * tree,
            f"{float(scene.bodies.mass[n]):.4g}",
            *_set(stage),
            millimetres(-float(scene.bodies.position[n + 1, 2])),
            _blades(scene, stage),
        )
        for n, (stage, above) in enumerate(with_bodies_above(design))
    ]
    return Table("Stages", tuple(heads), rows)


def _set(stage: Stage) -> tuple[str, ...]:
    """Number of wires, l, s, t1, t2, d, d_upper; lengths in mm, of a ring its radii for t1, t2."""
    if stage.wires is None:
        return (str(len(stage.wire)), *(NONE,) * 6)
    shape = set_geometry(stage.wires)
    along = NONE
    across = (NONE, NONE)
    if shape.is_ring:
        across = f"r {millimetres(shape.ring_upper)}", f"r {millimetres(shape.ring_lower)}"
    elif shape.count > 1:
        across = millimetres(shape.t1), millimetres(shape.t2)
        along = separation(shape.s_upper, shape.s_lower) if shape.count == 4 else NONE
    ends = millimetres(shape.d), millimetres(shape.d_upper)
    return (str(shape.count), millimetres(shape.length), along, *across, *ends)


def separation(upper: float, lower: float) -> str:
    """Separation (m) at the upper and lower ends, mm; both where they differ."""
    return " / ".join(dict.fromkeys((millimetres(upper), millimetres(lower))))


def _blades(scene: Scene, stage: Stage) -> str:
    """Number and vertical stiffness (N/m) of the blades that carry a stage."""
    mine = [n for n, label in enumerate(scene.blades.label) if label.startswith(f"{stage.name}.")]
    stiffness = {f"{float(scene.blades.stiffness[n, 2]):.4g}" for n in mine}
    if len(stiffness) > 1:
        return f"{len(mine)}, various"
    return f"{len(mine)} × {stiffness.pop()}" if mine else NONE


def _wires(design: Design, scene: Scene) -> Table:
    """Table of the wires of stages without a symmetric set."""
    explicit = {stage.name for stage in design.stage if stage.wires is None}
    wires = scene.wires
    rows = []
    for n, label in enumerate(wires.label):
        stage, _, number = label.rpartition(".")
        if stage in explicit:
            lengths = (*wires.upper_point[n], *wires.lower_point[n], wires.length[n])
            shown = (millimetres(float(value)) for value in lengths)
            tension = format_significant(float(wires.tension[n]))
            rows.append((f"{single_line(stage, 16)}.{number}", *shown, tension))
    title = (
        "Wires given one by one; upper ends from the COM above (or the suspension point), lower"
        " ends from the stage's own COM"
    )
    ends = (f"{end} {axis} (mm)" for end in ("upper", "lower") for axis in "xyz")
    return Table(title, ("wire", *ends, "length (mm)", "tension (N)"), rows)


def _loops(design: Design) -> Table:
    """Table of the control loops of a design."""
    rows = []
    for sensor in design.control.sensor if design.control else ():
        read = sensor.motions or [one.sensor or f"force of {one.drive}" for one in sensor.inputs]
        law = "blend" if sensor.blend else "sum of filters" if sensor.inputs else "sensor"
        rows.append((single_line(sensor.name, 20), single_line(", ".join(read), 30), "", law))
    for loop in design.control.loop if design.control else ():
        unit = "N m s/rad" if "torque" in loop.actuator else "N s/m"
        law = "filter" if loop.damper is None else f"damper, {loop.damper:.4g} {unit}"
        ends = (single_line(text, 30) for text in (loop.sensor, loop.actuator))
        rows.append((single_line(loop.name, 20), *ends, law.replace("-", "−")))
    return Table("Local control (not drawn)", ("loop", "sensor", "actuator", "law"), rows)


def _flaws(design: Design) -> Table:
    """Table of the imperfections of a design."""
    rows = []
    for item in design.perturbation:
        part, name = perturbed_part(item)
        for kind in perturbed(part):
            value = getattr(item, kind.name)
            if value is None:
                continue
            quantity = f"factor on {kind.quantity}" if kind.relative else kind.quantity
            unit, per = ("", 1.0) if kind.relative else DISPLAYED[kind.unit]
            numbers = [f"{per * one:.4g}" for one in np.atleast_1d(value)]
            text = f"({', '.join(numbers)})" if len(numbers) > 1 else numbers[0]
            text = f"{text} {unit}".rstrip().replace("-", "−")
            rows.append((single_line(name, 20), quantity, text))
        if item.wire is not None and item.hold == "natural-length":
            rows.append((item.wire, "unstretched length", "as designed, not trimmed"))
    title = "Imperfections (offsets and rotations along and about x, y, z)"
    return Table(title, ("part", "imperfection", "value"), rows)


def write(
    canvas: Canvas, left: float, top: float, width: float, table: Table, colours: Sequence[str] = ()
) -> None:
    """Write a table on a canvas from its upper left corner, in; `colours` of the first column."""
    look = {"fontsize": SIZE, "va": "center"}
    title = shorten(table.title, 170)
    canvas.text(left, top - 0.5 * ROW, title, fontweight="bold", **look)
    for line in (1.0, 2.05, 2.15 + len(table.rows)):
        canvas.line([[left, top - line * ROW], [left + width, top - line * ROW]], PALE, 0.6, 1)
    lines = [table.heads, *table.rows]
    needed = np.array([widest(column, SIZE) for column in zip(*lines, strict=True)])
    edges = left + np.cumsum(needed + (width - needed.sum()) / len(needed))
    for row, cells in enumerate(lines):
        y = top - ROW * (1.52 + row + (0.1 if row else 0.0))
        weight = "bold" if row else "normal"
        colour = INK if row else NOTE
        first = colours[row - 1] if row and colours else colour
        canvas.text(left + 0.03, y, cells[0], color=first, fontweight=weight, **look)
        for edge, cell in zip(edges[1:].tolist(), cells[1:], strict=True):
            canvas.text(edge - 0.06, y, cell, color=colour, ha="right", **look)
