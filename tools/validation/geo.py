"""GEO 600: the pendulums of Husman et al. (2000), quoted from Tables I and II."""

from __future__ import annotations

import csv

import numpy as np

from tools.tables import ROOT
from tools.validation.page import Section, number_of_percent, table

TABLES = {
    "table1": (
        "four single pendulums (Table I)",
        "one set of inertias and radii, from 24 theory values",
    ),
    "table2": (
        "prototype of the triple pendulum (Table II)",
        "all lengths and inertias, from 18 theory values",
    ),
}
"""Title of each table, and what is inferred as the paper does not print it."""


def section() -> Section:
    """Name both tables; the tables of evidence have their numbers."""
    linked = " and ".join(f"[{title}]({name}.md)" for name, (title, _) in TABLES.items())
    lines = [
        f"The force model against the {linked}: modes measured in 2000, and the paper's own theory, to"
        " which parameters were fitted (`geo`). A compliant frame as the reason of the worst mode is a"
        " conjecture of the paper: [no single frame explains all"
        " cases](../docs/paper.md#a-compliant-support).",
    ]
    return Section("GEO 600: the paper's pendulums", lines)


def summary() -> list[str]:
    """Summarise both tables."""
    rows = []
    for name, (title, inferred) in TABLES.items():
        with (ROOT / "results" / f"{name}.csv").open(newline="") as stream:
            lines = list(csv.DictReader(stream))
        cells = [title]
        for known in ("experiment", "theory"):
            error = np.array(
                [float(one["ours"]) / float(one[known]) - 1 for one in lines if one[known]]
            )
            worst = error[int(np.argmax(abs(error)))]
            median = f"{100 * np.median(abs(error)):.1f}"
            cells += [str(len(error)), median, number_of_percent(worst)]
        rows.append([*cells, inferred])
    head = [
        "pendulums",
        "measured",
        "median (%)",
        "worst (%)",
        "theory",
        "median (%)",
        "worst (%)",
        "inferred",
    ]
    return table(head, rows)
