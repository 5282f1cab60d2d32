"""What every rung and method costs and gets wrong, over the paper's designs and examples of every length.

Writes `results/tradeoff.md`, `results/tradeoff.png` (the fused-silica triple) and `results/NAME-tradeoff.png` of every design.  Run by `make tradeoff`.
"""

from __future__ import annotations

import platform
import shutil
import sys

import numpy as np
import scipy
from tables import ROOT

from suspension_cli.analysis.tradeoff import run
from suspension_cli.analysis.tradeoff.result import Entry, Panel, Tradeoff, spell
from suspension_cli.design.reader import read
from suspension_cli.plots import tradeoff as picture
from suspension_cli.plots.style import save
from suspension_cli.results import write_bytes

DESIGNS = [
    *sorted((ROOT / "configs" / "husman2000").glob("*.toml")),
    *(ROOT / "configs" / f"{name}.toml" for name in ("double", "geo-silica-triple", "quadruple")),
]
SHOWN = "geo-silica-triple"
"""Whose chart stands for all."""


def table(panel: Panel) -> list[str]:
    """One quantity in Markdown."""
    lines = [f"### {panel.title}", ""]
    if panel.entries:
        once, batch = panel.fastest("once"), panel.fastest("batch")
        lines += [f"Time {panel.start}: 1 is {spell(once)}, in a batch of {panel.count} {spell(batch)} a {panel.item}. Error against {panel.reference}.", ""]
        lines.append(f"| method | one evaluation | in a batch | {' | '.join(panel.component)} |")
        lines.append("|---|" + "---:|" * (2 + len(panel.component)))
        on = {kind: {n for view in panel.views for n in panel.front(kind, view)} for kind in ("once", "batch")}
        for n, entry in enumerate(panel.entries):
            times = [marked(entry, kind, fastest, n in on[kind]) for kind, fastest in (("once", once), ("batch", batch))]
            lines.append(f"| {entry.label} | {' | '.join(times)} | {' | '.join(shown(error) for error in entry.error)} |")
        lines.append("")
    reasons: dict[str, list[str]] = {}
    for item in panel.left:
        reasons.setdefault(item.reason, []).append(f"{item.rung}, {item.method}")
    lines += [f"Left out: {'; '.join(names)} ({reason})." for reason, names in reasons.items()]
    return [*lines, ""] if panel.left else lines


def marked(entry: Entry, kind: str, fastest: float, best: bool) -> str:
    """Relative time with its quartiles; bold on the front; a circle where a batch is done one by one."""
    low, middle, high = getattr(entry, kind) / fastest
    text = f"**{middle:.3g}**" if best else f"{middle:.3g}"
    return f"{text} ({low:.3g}–{high:.3g}){' ○' if kind == 'batch' and not entry.vectorised else ''}"


def shown(error: float) -> str:
    """A relative error; a dash where it is none at all."""
    return f"{error:.1e}" if error > 0 else "0"


def document(found: dict[str, Tradeoff]) -> str:
    """All of it in Markdown."""
    machine = f"{platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    repeat = next(iter(found.values())).repeat
    lines = [
        "# Speed against accuracy",
        "",
        f"Made by `make tradeoff` in one run on one core ({machine}). Times are the processor's, relative to the fastest: medians of {repeat} samples,",
        "all methods in turns, with quartiles. Bold: no other method is both faster and more accurate. ○: it takes no arrays, so a batch is done one by",
        "one. Errors are relative. [docs/choosing.md](../docs/choosing.md) says what to use when.",
        "",
        f"![Error against time, {SHOWN}](tradeoff.png)",
        "",
    ]
    for name, one in found.items():
        lines += [f"## {name}", "", *(line for panel in one.panels for line in table(panel))]
    return "\n".join(lines)


def main() -> None:
    """Measure all designs."""
    found, folder = {}, ROOT / "results"
    for file in DESIGNS:
        design = read(file).design
        name = design.design.name
        print(name, file=sys.stderr)
        found[name] = run.measured(design)
        path = folder / f"{name}-tradeoff.png"
        save(picture.draw(found[name], design.design.title or name), path)
        if name == SHOWN:
            shutil.copyfile(path, folder / "tradeoff.png")
    text = document(found)
    write_bytes(folder / "tradeoff.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
