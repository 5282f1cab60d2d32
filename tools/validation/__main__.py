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
from tools.validation.comparison import MODES_HEAD, Comparison
from tools.validation.page import Section, percent, table

SECTIONS = [kagra, kagra_measured, ligo, measured_losses, geo]
PARTS: dict[str, Callable[[], list[str]]] = {
    "ligo-quad-2005": ligo.quadruple_of_2005,
    "ligo-bounce": lambda: ligo.part("bounce"),
    "ligo-fibres": lambda: ligo.part("fibres"),
    "ligo-initial": lambda: ligo.part("initial"),
    "caltech-40m": lambda: ligo.part("caltech-40m"),
    "kagra-measured": lambda: kagra_measured.section().lines,
    "measured-losses": lambda: measured_losses.section().lines,
    "geo": lambda: geo.section().lines,
    "counter-tests": lambda: table(counter_tests.HEAD, counter_tests.rows(), left=3),
}
"""Parts of the page by name."""


def modes(one: Comparison) -> list[str]:
    """All modes of a design beside those of the other program."""
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
    return [f"{one.title}: {one.within}", *table(head, rows)]


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
        " `measured/`, each with its source. `make validation` computes the page without a network"
        " (fits and pictures of KAGRA's measured functions: `tools/validation/kagra_measured.py`);"
        " `python -m tools.validation NAME` prints the modes of one design. All modes are in"
        " [validation_modes.csv](validation_modes.csv), without damping and links, unlike those of"
        " `pendsus modes`.",
        "",
    ]
    for kind in evidence.KINDS:
        lines += ["", *evidence.marked(kind, "short")]
    for part in sections:
        lines += ["", f"## {part.title}", "", *part.lines]
    text = "\n".join(lines).replace("\n\n\n", "\n\n").rstrip("\n") + "\n"
    write_bytes(ROOT / "results" / "validation.md", text.encode())
    stream = io.StringIO()
    rows = [row for part in sections for row in part.modes]
    csv.writer(stream, lineterminator="\n").writerows([MODES_HEAD, *rows])
    write_bytes(ROOT / "results" / "validation_modes.csv", stream.getvalue().encode())
    evidence.renew()
    print("results/validation.md")


if __name__ == "__main__":
    if sys.argv[1:]:
        for argument in sys.argv[1:]:
            show(argument)
    else:
        write([module.section() for module in SECTIONS])
