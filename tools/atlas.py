"""Stability atlas: where numerical methods fail, and the errors of the program there.

Writes `results/stability.md`, an overview `stability.png` and pages of panels
`stability_1.png`, ... Run by `make stability`.
"""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable
from dataclasses import replace

from suspension_cli.drawing.style import house_style, save
from suspension_cli.files.whole_files import write_bytes
from tests.support.paths import ROOT
from tools.stability import (
    beams,
    blades,
    couplings,
    frequency,
    geometry,
    map_errors,
    maps,
    masses,
    modal,
)
from tools.stability.draw import count_pages, draw_pages
from tools.stability.overview import draw_overview
from tools.stability.row import BROKEN, SHIPPED, Row

ROWS: dict[str, Callable[[], Row]] = {
    "roll-off": frequency.roll_off,
    "long-chain": frequency.long_chain,
    "beam-functions": beams.row,
    "tiny-couplings": couplings.tiny,
    "large-perturbations": couplings.large,
    "equal-modes": modal.equal_modes,
    "rigid-wires": modal.rigid_wires,
    "rigid-chain": modal.graded_chain,
    "soft-blades": blades.row,
    "soft-pitch": geometry.soft_pitch,
    "slack": geometry.nearly_slack,
    "quality": modal.quality,
    "masses": masses.row,
    "short-sections": beams.short_sections,
    "maps": maps.compute,
}
"""Rows of the atlas, in order."""
REAL: dict[str, tuple[float, float]] = {
    "roll-off": (0.01, 1e3),
    "long-chain": (1, 12),
    "beam-functions": (5, 2e3),
    "tiny-couplings": (1e-5, 2e-3),
    "large-perturbations": (1e-5, 2e-3),
    "equal-modes": (1e-6, 1.0),
    "rigid-wires": (100, 1e4),
    "rigid-chain": (100, 1e4),
    "soft-blades": (10, 1e4),
    "soft-pitch": (1e-2, 1e3),
    "slack": (0.05, 1.0),
    "quality": (1.0, 1e9),
    "masses": (0.05, 1e3),
    "short-sections": (0.02, 10),
    "maps": (0.01, 0.5),
}
"""Ranges of the parameters in suspensions that were built, by row: from the designs in configs/.

Bodies from KAGRA's junction box (0.08 kg) to its top filters, strains of wires from 0.01 to 1 %,
blades from a tenth to a ten-thousandth of the stiffness of their wires, silica fibres of LIGO.
"""

HEAD = f"""# Where methods fail

Each row drives one parameter to where methods are known to fail, against closed forms or 50 digits and more. A method breaks
where its error exceeds {100 * BROKEN:g} % and stays there. ε is the rounding of double precision, 1.1 × 10⁻¹⁶. Methods that fail are written as
people write them (`tools/stability/naive.py`). *Academic*: no method breaks within the range of built suspensions (grey in the picture).

![How far each trouble can be driven before a method breaks](stability.png)

| | driven by | built | other methods break at | largest error of pendsus | its limit, and what it says there |
|---|---|---|---|---|---|
"""


def compact(value: float) -> str:
    """Format a number for the table: plain from 1e-3 to 1e4, otherwise with an exponent.

    >>> compact(0.00153), compact(4.14e-16)
    ('0.00153', '4.1e-16')
    """
    digits = ".3g" if 1e-3 <= value < 1e4 else ".1e"
    return f"{float(format(value, digits)):g}"


def table_row(row: Row) -> str:
    """Format one line of the table."""
    breaks = [
        f"{name}: {compact(at)}" for name in row.others if (at := row.broken_at(name)) is not None
    ]
    holds = [
        f"{name}: {_describe_valid(row, name)}"
        for name in row.others
        if row.broken_at(name) is None
    ]
    own = [_describe_own(row, name) for name in row.shipped]
    cells = (
        f"**{row.title}**",
        row.driver.replace("|", r"\|"),
        _describe_real(row),
        "<br>".join(breaks + holds),
        "<br>".join(own),
        row.limit,
    )
    return "| " + " | ".join(cells) + " |"


def _describe_real(row: Row) -> str:
    """Describe the range of real suspensions, and whether a method breaks in it."""
    if not row.real:
        return ""
    text = " to ".join(map(compact, row.real))
    return (
        text
        if any(row.is_real(row.broken_at(name)) for name in row.others)
        else f"{text}: academic"
    )


def _describe_valid(row: Row, name: str) -> str:
    """Describe a method that is right at the last value: always, or beyond some value."""
    worst = int(row.error[name].argmax())
    return (
        "right"
        if row.worst(name) <= BROKEN
        else f"off by {compact(row.worst(name))} at {compact(float(row.value[worst]))}, correct above"
    )


def _describe_own(row: Row, name: str) -> str:
    """Describe one of the program's methods: its largest error, or where it breaks."""
    at, label = (
        row.broken_at(name),
        name.removeprefix(SHIPPED).removeprefix(":").removeprefix(",").strip(),
    )
    value = compact(row.worst(name)) if at is None else f"breaks at {compact(at)}"
    return f"{label}: {value}" if label else value


def report(rows: list[Row], on_maps: str) -> str:
    """Format the whole page: rows, panels, and the errors of maps."""
    sentences = [f"**{row.title}** ({row.quantity}). {row.finding}" for row in rows]
    panels = [
        f"![Relative errors, page {number}](stability_{number}.png)"
        for number in range(1, count_pages(rows) + 1)
    ]
    table = "\n".join(table_row(row) for row in rows)
    return HEAD + "\n\n".join([table, *panels, *sentences, on_maps]) + "\n"


def main() -> None:
    """Compute all rows, write the page and draw the chart."""
    rows = []
    for name, make in ROWS.items():
        start = time.perf_counter()
        rows.append(replace(make(), real=REAL[name]))
        print(f"{name:20} {time.perf_counter() - start:5.1f} s", flush=True)
    errors = {trouble: map_errors.compare(make()) for trouble, make in map_errors.TROUBLES.items()}
    text = report(rows, map_errors.summary(errors))
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows([map_errors.HEAD, *map_errors.rows(errors)])
    (ROOT / "results").mkdir(exist_ok=True)
    write_bytes(ROOT / "results" / "stability.md", text.encode())
    write_bytes(ROOT / "results" / "stability_maps.csv", stream.getvalue().encode())
    with house_style():
        save(draw_overview(rows), ROOT / "results" / "stability.png")
        for number, page in enumerate(draw_pages(rows), 1):
            save(page, ROOT / "results" / f"stability_{number}.png")


if __name__ == "__main__":
    main()
