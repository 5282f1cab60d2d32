"""Tables of the dimensions of a design, as rows of text and on a canvas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from suspension_cli.conventions import SUPPORT
from suspension_cli.design.derive import SetGeometry, set_geometry
from suspension_cli.design.imperfections import perturbed, perturbed_part
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.design.schema import Design, Stage
from suspension_cli.drawing.canvas import Canvas
from suspension_cli.drawing.geometry import free_springs
from suspension_cli.drawing.labels import widest
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
MOST_WIRES = 40
"""Most rows of single wires that are shown; the design file has all."""
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


def key(scene: Scene) -> list[str]:
    """Lines that explain the symbols in a drawing."""
    springs = scene.springs
    kinds = {springs.label[n].rsplit(".", 1)[1] for n in free_springs(scene)}
    others = bool(kinds & {"link", "damper"} or springs.grounded.any())
    shown = (
        (BLADES, bool(scene.blades.label)),
        (FILTERS, "blades" in kinds),
        (SPRINGS, bool(kinds - {"link", "damper", "blades"})),
        (LEGS, bool(scene.struts.label)),
        (LINKS, others),
    )
    return [*KEY, *(line for line, is_drawn in shown if is_drawn)]


def listed(design: Design, scene: Scene) -> list[Table]:
    """Tables below a drawing: stages, wires outside symmetric sets, control, imperfections."""
    found = (stages(design, scene), wires(design, scene), loops(design), flaws(design))
    return [table for table in found if table is not None]


def stages(design: Design, scene: Scene) -> Table:
    """Table of stages: mass, the body above, and the dimensions of the symmetric set of wires."""
    tree = any(stage.hangs_from is not None for stage in design.stage)
    symbols = ("$l$", "$s$", "$t_1$", "$t_2$", "$d$", "$d_u$", "depth")
    heads = ["stage", *["hangs from"] * tree, "mass (kg)", "wires"]
    heads += [*(f"{symbol} (mm)" for symbol in symbols), "blades (N/m)"]
    rows = []
    for n, stage in enumerate(design.stage):
        above = stage.hangs_from or (design.stage[n - 1].name if n else SUPPORT)
        rows.append(
            (
                single_line(stage.name, 20),
                *((single_line(above, 16),) if tree else ()),
                f"{float(scene.bodies.mass[n]):.4g}",
                *_set(stage),
                millimetres(-float(scene.bodies.position[n + 1, 2])),
                _blades(scene, stage),
            )
        )
    return Table("Stages", tuple(heads), rows)


def _set(stage: Stage) -> tuple[str, ...]:
    """Number of wires, l, s, t1, t2, d, d_upper; lengths in mm."""
    if stage.wires is None:
        return (str(len(stage.wire)), *(NONE,) * 6)
    shape = set_geometry(stage.wires)
    across = (millimetres(shape.t1), millimetres(shape.t2)) if shape.count > 1 else (NONE, NONE)
    along = separation(shape) if shape.count == 4 else NONE
    if shape.is_ring:
        radii = (millimetres(shape.ring_upper), millimetres(shape.ring_lower))
        along, across = NONE, (f"r {radii[0]}", f"r {radii[1]}")
    return (
        str(shape.count),
        millimetres(shape.length),
        along,
        *across,
        millimetres(shape.d),
        millimetres(shape.d_upper),
    )


def separation(shape: SetGeometry) -> str:
    """Half separation in x, mm; upper / lower where they differ."""
    upper, lower = millimetres(shape.s_upper), millimetres(shape.s_lower)
    return upper if upper == lower else f"{upper} / {lower}"


def _blades(scene: Scene, stage: Stage) -> str:
    """Number and vertical stiffness (N/m) of the blades that carry a stage."""
    mine = [n for n, label in enumerate(scene.blades.label) if label.startswith(f"{stage.name}.")]
    if not mine:
        return NONE
    stiffness = {f"{float(scene.blades.stiffness[n, 2]):.4g}" for n in mine}
    return f"{len(mine)} × {stiffness.pop()}" if len(stiffness) == 1 else f"{len(mine)}, various"


def wires(design: Design, scene: Scene) -> Table | None:
    """Table of the wires of stages without a symmetric set; None if there are none."""
    explicit = {stage.name for stage in design.stage if stage.wires is None}
    wires, rows = scene.wires, []
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
    heads = ("wire", *ends, "length (mm)", "tension (N)")
    return _first_rows(title, heads, rows)


def loops(design: Design) -> Table | None:
    """Table of the control loops of a design; None if there are none."""
    rows = []
    for loop in design.control.loop if design.control else ():
        unit = "N m s/rad" if "torque" in loop.actuator else "N s/m"
        law = "filter" if loop.damper is None else f"damper, {loop.damper:.4g} {unit}"
        ends = (single_line(text, 30) for text in (loop.sensor, loop.actuator))
        rows.append((single_line(loop.name, 20), *ends, law.replace("-", "−")))
    return _first_rows("Local control (not drawn)", ("loop", "sensor", "actuator", "law"), rows)


def flaws(design: Design) -> Table | None:
    """Table of the imperfections of a design; None if there are none."""
    rows = []
    for item in design.perturbation:
        part, name = perturbed_part(item)
        for kind in perturbed(part):
            value = getattr(item, kind.name)
            if value is not None:
                quantity = f"factor on {kind.quantity}" if kind.relative else kind.quantity
                unit, per = ("", 1.0) if kind.relative else DISPLAYED[kind.unit]
                numbers = [f"{per * one:.4g}" for one in np.atleast_1d(value)]
                text = f"({', '.join(numbers)})" if len(numbers) > 1 else numbers[0]
                text = f"{text} {unit}".rstrip().replace("-", "−")
                rows.append((single_line(name, 20), quantity, text))
        if item.wire is not None and item.hold == "natural-length":
            rows.append((item.wire, "unstretched length", "as designed, not trimmed"))
    title = "Imperfections (offsets and rotations along and about x, y, z)"
    return _first_rows(title, ("part", "imperfection", "value"), rows)


def _first_rows(title: str, heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> Table | None:
    """Table of the first rows, with their number in the title; None if there are none."""
    if len(rows) > MOST_WIRES:
        title += f"; the first {MOST_WIRES} of {len(rows)}"
    return Table(title, heads, rows[:MOST_WIRES]) if rows else None


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
        first = NOTE if row == 0 else colours[row - 1] if colours else INK
        canvas.text(left + 0.03, y, cells[0], color=first, fontweight=weight, **look)
        for edge, cell in zip(edges[1:].tolist(), cells[1:], strict=True):
            canvas.text(edge - 0.06, y, cell, color=INK if row else NOTE, ha="right", **look)
