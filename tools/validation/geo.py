"""GEO 600: the pendulums of Husman et al. (2000), quoted from Tables I and II."""

from __future__ import annotations

import csv

import numpy as np

from tools.tables import ROOT
from tools.validation.page import Section, percent, table

TABLES = {
    "table1": (
        "four single pendulums (Table I)",
        "inertias and radii of wires, one set for all 24 theory values",
    ),
    "table2": (
        "prototype of the triple pendulum (Table II)",
        "all lengths and inertias, from 18 theory values",
    ),
}
"""Title of each table, and what is inferred as the paper does not print it."""


def section() -> Section:
    """Summarise both tables."""
    result, rows = Section("GEO 600: the paper's pendulums"), []
    for name, (title, inferred) in TABLES.items():
        with (ROOT / "results" / f"{name}.csv").open(newline="") as stream:
            lines = list(csv.DictReader(stream))
        cells = [f"[{title}]({name}.md)"]
        for known in ("experiment", "theory"):
            error = np.array(
                [float(one["ours"]) / float(one[known]) - 1 for one in lines if one[known]]
            )
            worst = error[int(np.argmax(abs(error)))]
            cells += [str(len(error)), f"{100 * np.median(abs(error)):.1f} %", percent(worst)]
        rows.append([*cells, inferred])
    head = [
        "pendulums",
        "measured",
        "median",
        "worst",
        "paper's theory",
        "median",
        "worst",
        "inferred",
    ]
    result.lines += [
        "Modes measured in 2000 and the paper's own theory, beside the paper's force model. Inferred"
        " parameters make agreement with the theory fitted. The worst mode is vertical of the first"
        " pendulum; a compliant frame as its reason is a conjecture of the paper: no single frame"
        " explains all cases ([a compliant support](../docs/paper.md#a-compliant-support)).",
        *table(head, rows),
    ]
    return result
