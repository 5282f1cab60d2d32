"""Make the picture and the page on speed against accuracy from the stored measurements.

Writes `results/tradeoff.png` and `tradeoff.md`; `make tradeoff` measures before.
"""

from __future__ import annotations

from collections.abc import Sequence

from suspension_cli.analyses.tradeoff.measure import format_time
from suspension_cli.drawing.style import save
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.models.choice import percent
from tests.support.paths import ROOT
from tools.tradeoff import many, methods, peers
from tools.tradeoff.measurement import Measurement, read_table, select
from tools.tradeoff.picture import by_method, draw

FOLDER = ROOT / "results"
TABLE = FOLDER / "tradeoff.csv"
LISTED = ("husman2000-table1-case3", "double", "geo-silica-triple", "quadruple")
"""Designs in the table of methods."""


def _row(*cells: str) -> str:
    """One line of a table."""
    return f"| {' | '.join(cells)} |"


def _head(*cells: str) -> list[str]:
    """Both lines of the head of a table."""
    return [_row(*cells), "|---" * len(cells) + "|"]


def tabulate_methods(rows: Sequence[Measurement]) -> list[str]:
    """Tabulate errors and times of the methods for a response, a row per design."""
    lines = _head("design", *methods.METHODS)
    for design in LISTED:
        cells = []
        for name in methods.METHODS:
            few, many_times = select(rows, methods.WORK, design=design, method=name)
            times = f"{format_time(few.time)} · {format_time(many_times.time)}"
            cells.append(f"{few.error:.0e} · {times}")
        lines.append(_row(design, *cells))
    return [*lines, ""]


def tabulate_peers(rows: Sequence[Measurement], work: str) -> list[str]:
    """Tabulate the times of programs for one piece of work."""
    own = select(rows, work)
    lines = _head(
        f"{work}, {own[0].size:,} frequencies", "time", "over that of pendsus", "largest difference"
    )
    for row in own:
        apart = "another design" if row.error is None else f"{row.error:.0e}"
        apart = "–" if row is own[0] else apart
        ratio = f"{row.time / own[0].time:.2g}"
        lines.append(_row(row.method, format_time(row.time), ratio, apart))
    return [*lines, ""]


def tabulate_maps(rows: Sequence[Measurement]) -> list[str]:
    """Tabulate the maps of a million points, a row per design."""
    lines = _head("design", "points solved: time, error", many.EVERY_POINT, many.ALONE)
    own = select(rows, many.MAP)
    for design in dict.fromkeys(row.design for row in own):
        methods_of = by_method([row for row in own if row.design == design])
        solved = [
            f"{row.size:,}: {format_time(row.time)}, {row.error:.0e}"
            for row in methods_of[many.INTERPOLATED]
        ]
        full, alone = (
            format_time(methods_of[name][0].time) for name in (many.EVERY_POINT, many.ALONE)
        )
        lines.append(_row(design, "<br>".join(solved), full, alone))
    return [*lines, ""]


def tabulate_builds(rows: Sequence[Measurement]) -> list[str]:
    """Tabulate standard errors and times of random builds."""
    lines = _head("builds", many.PLAIN, many.CONTROLLED)
    own = by_method(select(rows, many.MEAN))
    for pair in zip(*own.values(), strict=True):
        cells = [f"{percent(row.error or 0.0)}, {format_time(row.time)}" for row in pair]
        lines.append(_row(f"{pair[0].size:,}", *cells))
    return [*lines, ""]


def document(rows: Sequence[Measurement]) -> str:
    """Format the page."""
    [start] = select(rows, many.START)
    low, high = methods.BAND
    lines = [
        "# Speed against accuracy",
        "",
        "![Error against time of models, methods, maps, random builds and other programs]"
        "(tradeoff.png)",
        "",
        f"`make tradeoff`, on one thread ({start.method}): processor times, medians of samples that"
        " all models or methods take in turns. [All measurements](tradeoff.csv); [what to use"
        " when](../docs/choosing.md#by-hand-speed-against-accuracy).",
        "",
        "## Models",
        "",
        "Largest error against the `violin` model, and time of one result, design or build; of"
        " modes, against the most complete model that lists them in seconds. `pendsus tradeoff"
        " DESIGN` measures any design.",
        "",
        "## Methods for a response",
        "",
        f"Largest error of up to {len(methods.ENDS)} responses of the mirror, {low:g} to {high:g}"
        " Hz, against 50 digits on the same matrices, and time of one at"
        f" {methods.FEW} and at {methods.MANY:,} frequencies, from the matrices on. Body by"
        " body, as `pendsus` solves, takes longest to begin. That buys the most digits,"
        " where a sum over modes keeps none of a quadruple; many frequencies in a tenth of the time"
        " of a dense solve; losses and wires with mass, which state space and zpk do not take; and"
        " zeros that are exactly 0.",
        "",
        *tabulate_methods(rows),
        "## Other programs",
        "",
        *tabulate_peers(rows, peers.RESPONSE),
        *tabulate_peers(rows, peers.NOISE),
        "The responses are of one model (`force`) and one motion. pygwinc computes a quadruple as a"
        " chain of springs along the beam, and another one vertically; pendsus has all six motions"
        " of each body, with continuous wires (`violin`).",
        "",
        "## A map of a million points",
        "",
        "Longitudinal over vertical motion at 50 Hz against stiffness and place of a wire; largest"
        f" difference from full solutions at {many.COMPARED} random points. In the second design a"
        " mode crosses the frequency within the map. The last two columns are the times of some"
        f" thousand points, and of {many.DESIGNS_ALONE} designs, in proportion.",
        "",
        *tabulate_maps(rows),
        "## Random builds",
        "",
        "Standard error of the mean magnitude of the coupling of `triple-tolerance`, relative. The"
        " time with control variates is that of a whole call, with the statistics of all modes and"
        " poses; the other that of the builds alone.",
        "",
        *tabulate_builds(rows),
    ]
    return "\n".join(lines).rstrip() + "\n"


def main() -> None:
    """Write the picture and the page."""
    rows = read_table(TABLE)
    save(draw(rows), FOLDER / "tradeoff.png")
    write_bytes(FOLDER / "tradeoff.md", document(rows).encode())


if __name__ == "__main__":
    main()
