"""Tables I and II of Husman et al. (2000), rebuilt from the designs in `configs/husman2000`.

Writes `results/table1.md`, `.csv`, `results/table2.md`, `.csv`. Run by `make tables`.
"""

from __future__ import annotations

import csv
import io
import statistics
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from suspension_cli.design.reader import read
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "results"
PAPER = tomllib.loads((ROOT / "tools" / "paper.toml").read_text())
DOF = {
    "longitudinal": "x",
    "sideways": "y",
    "vertical": "z",
    "roll": "roll",
    "tilt": "pitch",
    "rotation": "yaw",
}
"""Coordinate of each name in Husman et al. (2000)."""
FAMILIES = {
    "tilt_longitudinal": ("x", "pitch"),
    "sideways_roll": ("y", "roll"),
    "rotation": ("yaw",),
    "vertical": ("z",),
}

Row = dict[str, Any]


def solved(name: str, level: str = "auto") -> eigenmodes.Modes:
    """Solve for the modes of one of the paper's designs."""
    design = read(ROOT / "configs" / "husman2000" / f"{name}.toml").design
    return eigenmodes.solve(registry.by_name(registry.choose(design, level).level).system(design))


def table1() -> list[Row]:
    """Compare experiment, the paper's theory and ours for the single pendulums."""
    columns = PAPER["table1"]["columns"]
    rows = []
    for case in PAPER["table1"]["case"]:
        ours = solved(f"table1-case{case['case']}")
        for n, word in enumerate(columns):
            (frequency,) = ours.of(DOF[word])
            theory = case["theory"][n]
            rows.append(
                {
                    "case": case["case"],
                    "mode": word,
                    "experiment": case["experimental"][n],
                    "theory": theory,
                    "ours": frequency,
                    "difference": frequency / theory - 1,
                }
            )
    return rows


def table2() -> list[Row]:
    """Compare experiment, the paper's theory and ours (two models) for the prototype triple."""
    force, string = solved("table2", "force"), solved("table2", "string")
    rows = []
    for family, dofs in FAMILIES.items():
        theory = sorted(PAPER["table2"]["theory"][family], reverse=True)
        ours = [
            sorted((f for dof in dofs for f in found.of(dof)), reverse=True)
            for found in (force, string)
        ]
        seen = matched(theory, PAPER["table2"]["experimental"][family])
        for n, value in enumerate(theory):
            row = {
                "family": family.replace("_", "/"),
                "experiment": seen[n],
                "theory": value,
                "ours": ours[0][n],
                "difference": ours[0][n] / value - 1,
            }
            rows.append(row | {"string": ours[1][n], "series": ours[0][n] / ours[1][n] - 1})
    return rows


def matched(theory: Sequence[float], measured: Sequence[float]) -> list[float | None]:
    """Match each measured frequency to the nearest theory (in the logarithm), one to one."""
    import numpy as np
    from scipy.optimize import linear_sum_assignment

    cost = np.abs(np.log(np.array(theory)[:, None] / np.array(measured)[None, :]))
    result: list[float | None] = [None] * len(theory)
    for row, column in zip(*linear_sum_assignment(cost), strict=True):
        result[row] = measured[column]
    return result


def markdown(title: str, notes: str, rows: list[Row], heads: dict[str, str]) -> str:
    """Format a Markdown table with aligned columns, and the summary below it."""
    cells = [list(heads.values())] + [[shown(key, row[key]) for key in heads] for row in rows]
    widths = [max(len(line[n]) for line in cells) for n in range(len(heads))]
    lines = [
        "| "
        + " | ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        + " |"
        for line in cells
    ]
    rule = "|" + "|".join("-" * (width + 1) + ":" for width in widths) + "|"
    worst, middle = extremes(rows)
    summary = (
        f"Difference between ours and the paper's theory: at most {worst:.1%}, median {middle:.1%}."
    )
    return "\n".join([f"# {title}", "", notes, "", lines[0], rule, *lines[1:], "", summary, ""])


def shown(key: str, value: Any) -> str:
    """Format one cell."""
    if value is None:
        return "–"
    if key in ("difference", "series"):
        return f"{100 * value:+.2f}"
    if key in ("ours", "string"):
        return f"{value:#.4g}"
    return str(value)


def extremes(rows: list[Row]) -> tuple[float, float]:
    """Largest and median relative difference from the paper's theory."""
    sizes = [abs(row["difference"]) for row in rows]
    return max(sizes), statistics.median(sizes)


def save(name: str, text: str, rows: list[Row]) -> None:
    """Write the Markdown and the CSV of one table."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    # to 1e-8, below which digits of differences are those of one machine
    writer.writerows(
        {k: f"{round(v, 8) + 0.0:.6g}" if isinstance(v, float) else v for k, v in row.items()}
        for row in rows
    )
    RESULTS.mkdir(exist_ok=True)
    write_bytes(RESULTS / f"{name}.md", text.encode())
    write_bytes(RESULTS / f"{name}.csv", stream.getvalue().encode())
    print(text)


def main() -> None:
    """Rebuild both tables."""
    first, second = table1(), table2()
    heads = {
        "experiment": "experiment (Hz)",
        "theory": "paper's theory (Hz)",
        "ours": "ours (Hz)",
        "difference": "ours - theory (%)",
    }
    notes = (
        "Single pendulums on four wires, 20 kg. Moments of inertia and wire radius are not in the"
        " paper: one set was fitted to the\n24 theory values (`docs/paper.md`). The captions of"
        " cases 1 and 2 are swapped in print. The paper says that cases 1 to 3 were measured\non a"
        " frame that was not rigid; that this explains their vertical frequencies is a conjecture."
    )
    save(
        "table1",
        markdown(
            "Table I: single pendulum", notes, first, {"case": "case", "mode": "mode"} | heads
        ),
        first,
    )
    notes = (
        "The prototype triple pendulum of GEO 600. Its parameters are not in the paper: a plausible"
        " set was fitted to these modes (`docs/paper.md`;\n`configs/husman2000/table2.toml` marks"
        " what is given). *Ours* is the force model, which like the paper's takes blades in series"
        " with the wires;\n*string* has the blade tips as coordinates."
    )
    heads |= {"string": "string (Hz)", "series": "force - string (%)"}
    save(
        "table2",
        markdown("Table II: prototype triple pendulum", notes, second, {"family": "modes"} | heads),
        second,
    )


if __name__ == "__main__":
    main()
