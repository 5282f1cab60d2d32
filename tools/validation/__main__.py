"""Write `results/validation.md`, its table of modes and its pictures. Run by `make validation`.

`python -m tools.validation NAME` prints one part instead: a design of `measured/sumcon/`,
`ligo-quad`, or a name in `PARTS`.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Callable

from suspension_cli.files.whole_files import write_bytes
from tools.tables import ROOT
from tools.validation import (
    counter_tests,
    evidence,
    geo,
    kagra,
    kagra_measured,
    ligo,
    ligo_production,
    measured_losses,
)
from tools.validation.comparison import HEAD, MODES_HEAD, Comparison, row
from tools.validation.page import Section, percent, table

SECTIONS = [kagra, kagra_measured, ligo, measured_losses, geo]
PARTS: dict[str, Callable[[], list[str]]] = {
    "ligo-quad-2005": ligo.quadruple_of_2005,
    "ligo-bounce": lambda: ligo.part("bounce"),
    "ligo-fibres": lambda: ligo.part("fibres"),
    "ligo-initial": lambda: ligo.part("initial"),
    "caltech-40m": lambda: ligo.part("caltech-40m"),
    "kagra-measured": kagra_measured.printed,
    "kagra-saves": kagra.survey,
    "measured-losses": lambda: measured_losses.section().lines,
    "geo": geo.summary,
    "counter-tests": lambda: table(counter_tests.HEAD, counter_tests.rows(), left=3),
}
"""Parts of the page by name."""


def modes(one: Comparison) -> list[str]:
    """All modes and responses of a design beside those of the other program."""
    head = ["mode", f"{one.peer} (Hz)", "string (Hz)", "", "beam (Hz)", ""]
    rows = [
        [label, f"{float(known):.5g}"]
        + [
            cell
            for value, error in ((string, string_off), (beam, beam_off))
            for cell in (f"{float(value):.5g}", percent(float(error)))
        ]
        for _, label, known, string, string_off, beam, beam_off in one.modes()
    ]
    responses = [
        [name, f"{abs(ours[-1] / known[-1]):.4g}"] for name, (known, ours) in one.responses.items()
    ]
    ratio = f"string over {one.peer} at {one.frequency[-1]:g} Hz"
    return [
        f"{one.title}: {one.within}",
        *table(head, rows),
        *table(["response", ratio], responses),
        *table(HEAD, [row(one)]),
    ]


def show(name: str) -> None:
    """Print one part of the page."""
    if name in kagra.SUSPENSIONS:
        lines = modes(kagra.compare_with_sumcon(name))
    elif name == "ligo-quad":
        lines = modes(ligo_production.compare_with_production_model())
    elif name in PARTS:
        lines = PARTS[name]()
    else:
        known = [*kagra.SUSPENSIONS, "ligo-quad", *PARTS]
        sys.exit(f"{name}: no such part; give one of {', '.join(known)}")
    print("\n".join(lines))


def write(sections: list[Section]) -> None:
    """Write the page and the table of modes, and the tables of evidence into all pages."""
    lines = [
        "# Comparison with suspensions that were built",
        "",
        "Designs in `configs/built/` against measurements and other programs, whose numbers are in"
        " `measured/`, each with its source. `make validation` computes the page without a network;"
        " `python -m tools.validation NAME` prints one part, with the names below. [All"
        " modes](validation_modes.csv) are without losses, dampers and links, as in the matrices"
        f" that they are compared with. `pendsus modes` includes these: {kagra.effect_of_losses()}.",
        "",
    ]
    for kind in evidence.KINDS:
        lines += ["", *evidence.marked(kind, "short")]
    for part in sections:
        lines += ["", f"## {part.title}", "", *part.lines]
    text = "\n".join(lines).replace("\n\n\n", "\n\n").rstrip("\n") + "\n"
    write_bytes(ROOT / "results" / "validation.md", text.encode())
    modes = [row for part in sections for row in part.modes]
    files = {"validation_modes.csv": [MODES_HEAD, *modes]}
    for part in sections:
        files |= part.files
    for name, rows in files.items():
        stream = io.StringIO()
        csv.writer(stream, lineterminator="\n").writerows(rows)
        write_bytes(ROOT / "results" / name, stream.getvalue().encode())
    evidence.renew()
    print("results/validation.md")


if __name__ == "__main__":
    if sys.argv[1:]:
        for argument in sys.argv[1:]:
            show(argument)
    else:
        write([module.section() for module in SECTIONS])
