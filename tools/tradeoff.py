"""Time and error of all models and methods, for the paper's designs and other examples.

Writes `results/tradeoff.md`, `results/tradeoff.png` (the fused-silica triple: which model to use),
`tradeoff_models.png`, `tradeoff_methods_once.png` and `tradeoff_methods_batch.png` (all its
comparisons), and the same for a single, a double and a quadruple
pendulum. Run by `make tradeoff`.
"""

from __future__ import annotations

import platform
import sys
import time

import numpy as np
import scipy

from suspension_cli.analyses.tradeoff import headline, picture, summary
from suspension_cli.analyses.tradeoff import solve as run
from suspension_cli.analyses.tradeoff.result import (
    COUNTS,
    KINDS,
    Entry,
    Panel,
    ResponseTimes,
    Tradeoff,
    View,
    format_error,
    format_time,
)
from suspension_cli.analyses.tradeoff.subject import MODEL_NAMES
from suspension_cli.design.reader import read
from suspension_cli.drawing.style import save
from suspension_cli.files.atomic import write_bytes
from tools.tables import ROOT

DESIGNS = [
    *sorted((ROOT / "configs" / "husman2000").glob("*.toml")),
    *(ROOT / "configs" / f"{name}.toml" for name in ("double", "geo-silica-triple", "quadruple")),
]
CHARTS = {
    "husman2000-table1-case3": "tradeoff_single",
    "double": "tradeoff_double",
    "geo-silica-triple": "tradeoff",
    "quadruple": "tradeoff_quadruple",
}
"""Designs that are shown in full, and the names of their pictures."""
REPEAT = 7
COMPARES = {"models": "models", "methods": "methods"}
BUDGET = 0.2
"""Processor time for the samples of a time, s; more than by default in `pendsus tradeoff`."""


def main() -> None:
    """Measure all designs."""
    found, folder, began = {}, ROOT / "results", time.monotonic()
    for file in DESIGNS:
        design = read(file).design
        name = design.design.name
        print(name, file=sys.stderr)
        found[name] = run.measure(design, repeat=REPEAT, budget=BUDGET)
        if name in CHARTS:
            draw(found[name], name, design.design.title or name)
    text = document(found)
    write_bytes(folder / "tradeoff.md", text.encode())
    print(f"{len(found)} designs in {time.monotonic() - began:.0f} s: {folder / 'tradeoff.md'}")


def draw(found: Tradeoff, name: str, title: str) -> None:
    """Draw the advice and the pages of all comparisons of a design."""
    folder = ROOT / "results"
    save(headline.draw(found, title), folder / f"{CHARTS[name]}.png")
    for end, page in picture.draw(found, title).items():
        save(page, folder / name_page(name, end))


def name_page(name: str, end: str) -> str:
    """Name the file of a page of comparisons: ``tradeoff_methods_once.png``."""
    return f"{CHARTS[name]}{end.replace('-', '_')}.png"


def document(found: dict[str, Tradeoff]) -> str:
    """Format the page in Markdown."""
    machine = (
        f"{platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}, scipy"
        f" {scipy.__version__}"
    )
    threads = next(iter(found.values())).threads
    lines = [
        "# Speed against accuracy",
        "",
        (
            f"Made by `make tradeoff` in one run with {threads or 'an unknown number of'}"
            f" thread{'s' if threads != 1 else ''} of linear algebra ({machine}). Times are the"
            f" processor's, medians of up to {REPEAT} samples that all methods take in turns,"
            " relative to the fastest for that design. Errors are relative, 0 if below the last"
            " digit of a double. [docs/tradeoff.md](../docs/tradeoff.md) says how this is measured,"
            " and what to use when."
        ),
        "",
        "![Which model to use for a fused-silica triple](tradeoff.png)",
        "",
        (
            "For each of four questions: every model with its time and error, and the one to use."
            " All comparisons, of methods too, and other designs follow below."
        ),
        "",
        "## All designs",
        "",
        (
            "Largest error · time for one evaluation / for one item of a batch. Bold: no other is"
            " both faster (either way) and more accurate. A dash: it is not valid for this design,"
            " or there is nothing to compare."
        ),
        "",
    ]
    keys = list(
        dict.fromkeys(
            (panel.key, view.title)
            for one in found.values()
            for panel in one.panels
            for view in panel.views
        )
    )
    for key, title in keys:
        lines += overview(key, title, found)
    for name in CHARTS:
        lines += [
            f"## {name}",
            "",
            f"![Which model to use]({CHARTS[name]}.png)",
            "",
            *(
                line
                for end, (compares, _) in picture.PAGES.items()
                for line in (f"![Error of all {compares} against time]({name_page(name, end)})", "")
            ),
            "```text",
            summary.text(found[name]),
            "```",
            "",
            *(line for each in found[name].waits for line in responses(each)),
            *(line for panel in found[name].panels for line in full(panel)),
        ]
    return "\n".join(lines).rstrip() + "\n"


def overview(key: str, title: str, found: dict[str, Tradeoff]) -> list[str]:
    """Tabulate one view of a comparison for all designs."""
    panels = {
        name: next(panel for panel in one.panels if panel.key == key) for name, one in found.items()
    }
    compares = next(iter(panels.values())).compares
    if compares == "models":
        found_on = {entry.model for panel in panels.values() for entry in panel.entries}
        every = [model for model in MODEL_NAMES if model in found_on]
    else:
        every = list(
            dict.fromkeys(entry.method for panel in panels.values() for entry in panel.entries)
        )
    lines = [
        f"### {title}: {COMPARES[compares]}",
        "",
        f"| design | {' | '.join(every)} |",
        "|---|" + "---|" * len(every),
    ]
    for name, panel in panels.items():
        view = next((view for view in panel.views if view.title == title), None)
        cells = (
            {}
            if view is None
            else {
                entry.name(compares): cell(panel, view, n) for n, entry in enumerate(panel.entries)
            }
        )
        lines.append(f"| {name} | {' | '.join(cells.get(one, '–') for one in every)} |")
    return [*lines, ""]


def cell(panel: Panel, view: View, n: int) -> str:
    """Format error and times: ``1.5e-01 · 1 / 25``."""
    times = (number(panel.entries[n].time(kind) / panel.fastest(kind)) for kind in KINDS)
    text = f"{format_error(panel.worst(view)[n])} · {' / '.join(times)}"
    return f"**{text}**" if any(n in panel.front(kind, view) for kind in KINDS) else text


def full(panel: Panel) -> list[str]:
    """Tabulate one comparison of one design."""
    lines = [f"### {panel.title}: {COMPARES[panel.compares]}", ""]
    if panel.entries:
        once, batch = (panel.fastest(kind) for kind in KINDS)
        lines += [
            (
                f"Error against {panel.reference}. Time {panel.start}: 1 is {format_time(once)},"
                f" {format_time(batch)} a {panel.item} in a batch of {panel.count}."
            ),
            "",
        ]
        lines.append(
            f"| {COMPARES[panel.compares][:-1]} | one evaluation | in a batch |"
            f" {' | '.join(panel.component)} |"
        )
        lines.append("|---|" + "---:|" * (2 + len(panel.component)))
        on = {kind: {n for view in panel.views for n in panel.front(kind, view)} for kind in KINDS}
        for n, entry in enumerate(panel.entries):
            times = (
                marked(entry, kind, fastest, n in on[kind])
                for kind, fastest in zip(KINDS, (once, batch), strict=True)
            )
            lines.append(
                f"| {entry.label} | {' | '.join(times)} |"
                f" {' | '.join(format_error(error) for error in entry.error)} |"
            )
        lines.append("")
    left = panel.left_out.items()
    lines += [f"Left out: {', '.join(names)} ({reason})." for reason, names in left]
    return [*lines, ""] if left else lines


def responses(each: ResponseTimes) -> list[str]:
    """Tabulate the times of a first response and the next ones."""
    models = each.compares == "models"
    heads = [f"{count:,} frequencies" for count in COUNTS] + ([] if models else ["error"])
    lines = [
        f"### First and next responses: {'models' if models else 'methods'}",
        "",
        (
            f"The first {each.start} / the next on the same frequencies / the next on others"
            f"{'' if models else '; largest error over 200 frequencies from 0.1 Hz to 1 kHz'}."
        ),
        "",
        f"| | {' | '.join(heads)} |",
        "|---|" + "---:|" * len(heads),
    ]
    for entry in each.entries:
        cells = [
            " / ".join("–" if np.isnan(t) else format_time(t) for t in entry.time[:, n, 1])
            for n in range(len(COUNTS))
        ]
        cells += [] if models else [format_error(entry.error)]
        lines.append(f"| {entry.model if models else entry.method} | {' | '.join(cells)} |")
    return [*lines, ""]


def marked(entry: Entry, kind: str, fastest: float, best: bool) -> str:
    """Format relative time with quartiles; bold on the front, ○ where a batch is a loop."""
    low, middle, high = map(number, getattr(entry, kind) / fastest)
    text = f"**{middle}**" if best else middle
    return f"{text} ({low}–{high}){' ○' if kind == 'batch' and not entry.vectorised else ''}"


def number(value: float) -> str:
    """Format to three digits: ``1.88``, ``24,800``."""
    return f"{value:.3g}" if value < 999.5 else f"{float(f'{value:.3g}'):,.0f}"


if __name__ == "__main__":
    main()
