"""Parameters missing from Tables I and II of the paper, inferred by `pendsus fit`.

The data are the paper's theoretical frequencies. Writes tables of docs/paper.md and, in results/,
`table1-combinations.csv`, `table2-inference.csv`, `table2-modes.csv` and `table2-combinations.csv`.
Run by `make inference`.
"""

from __future__ import annotations

import numpy as np

from suspension_cli.analyses.fit import solve as fit
from suspension_cli.design import measured, reader
from suspension_cli.design.measured import Measured
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.models.registry import STRING
from suspension_cli.studies import parameters
from tools.appendix import write_block, write_csv
from tools.tables import FAMILIES, PAPER, ROOT, matched
from tools.youngs_modulus import table

FOLDER = ROOT / "measured" / "husman2000"
STARTS = 16
TRIPLE = ROOT / "configs" / "husman2000" / "table2.toml"
LISTED = 5
"""Number of parameters listed per combination."""


def with_uncertainty(value: float, sigma: float) -> str:
    """Format a value to the digits that its uncertainty leaves."""
    scale = 10.0 ** (np.floor(np.log10(sigma)) - 1)
    digits = max(0, int(-np.log10(scale) + 0.5))
    return (
        f"{value:.{digits}f} ± {sigma:.{digits}f}"
        if digits < 7
        else f"{1e6 * value:.1f}e-6 ± {1e6 * sigma:.1f}e-6"
    )


def combinations(found: fit.Fitted) -> list[list[str]]:
    """Rows of the combinations of parameters that the modes alone determine, best first."""
    rows = []
    for n, (value, row) in enumerate(zip(found.singular, found.direction, strict=True), 1):
        largest = np.argsort(-np.abs(row))[:LISTED]
        parts = ", ".join(
            f"{row[k]:+.2f} {found.name[k].removeprefix('stage.')}"
            for k in largest
            if abs(row[k]) >= 0.1
        )
        rows.append([str(n), f"{100 / value:.2g} %", parts])
    return rows


COMBINATION = ["number", "known_to", "combination"]
"""Columns of files of combinations of relative changes, with their largest parts."""


def table1() -> None:
    """Infer the moments of inertia and the wire radius of Table I."""
    data = measured.read(FOLDER / "table1-theory.toml")
    texts = [(FOLDER / item.design).read_text() for item in data.experiment or ()]
    found = fit.solve(texts, data, level=STRING.name)
    rows = [
        [name, with_uncertainty(value, sigma), f"{used:g}", f"{(used - value) / sigma:+.1f}"]
        for name, value, sigma, used in zip(
            found.name, found.value, found.sigma, found.start, strict=True
        )
    ]
    lines: list[str] = []
    lines += table(["number (SI)", "fit", "configs/husman2000", "apart (σ)"], rows)
    lines += [
        (
            f"χ² {found.chi_squared:.1f} for {found.freedom} degrees of freedom, with 1 % and the"
            " rounding of each printed value as its uncertainty."
        ),
        "",
    ]
    alone = []
    for text, item in zip(texts, data.experiment or (), strict=True):
        yaw = Measured(
            mode=[mode for mode in item.mode if mode.label == "test yaw"],
            parameter=[data.parameter[2]],
        )
        alone.append(fit.solve([text], yaw, level=STRING.name).value[0])
    values = ", ".join(f"{value:.4f}" for value in alone)
    lines.append(f"IZ from rotation alone is {values} kg m² in cases 1 to 4.")
    write_block("inference-1", lines)
    write_csv("table1-combinations", COMBINATION, combinations(found))


def table2() -> None:
    """Infer all unknown parameters of Table II's triple pendulum."""
    data, text = measured.read(FOLDER / "table2.toml"), TRIPLE.read_text()
    found = fit.solve([text], data, level=STRING.name, starts=STARTS)
    used = {item.name: item.value for item in parameters.every(text)}
    rows = []
    for n, item in enumerate(data.parameter):
        hint = (
            ""
            if item.prior is None or item.uncertainty is None
            else f"{item.prior:g} ± {item.uncertainty:g}"
        )
        gained = "" if item.uncertainty is None else f"{found.sigma[n] / item.uncertainty:.2f}"
        rows.append(
            [
                item.name.removeprefix("stage."),
                hint,
                with_uncertainty(found.value[n], found.sigma[n]),
                gained,
                f"{used[item.name]:g}",
            ]
        )
    same = int((found.ends <= 1.001 * found.ends[0]).sum())
    more = f"the next best at {found.ends[same]:.1f}" if same < len(found.ends) else "and no other"
    block = [
        f"χ² is {found.chi_squared:.1f} for {found.freedom} degrees of freedom (18 frequencies, 25"
        f" hints of the text, 28 parameters); {same} of {len(found.ends)} searches ended there,"
        f" {more}.",
    ]
    write_block("inference-2", block)
    write_csv("table2-inference", ["parameter", "hint", "fit", "sigma_ratio", "design"], rows)
    write_csv("table2-modes", MODES, _frequencies(found))
    write_csv("table2-combinations", COMBINATION, combinations(found))


MODES = ["mode", "experiment_hz", "theory_hz", "string_hz", "difference", "residual", "force_hz"]
"""Columns of `results/table2-modes.csv`."""


def _frequencies(found: fit.Fitted) -> list[list[str]]:
    """Rows of all modes: measured, the paper's theory, and the fitted design in both models."""
    design = reader.parse(found.toml[0])
    force = eigenmodes.solve(registry.FORCE.system(design))
    rows, start = [], 0
    for family, dofs in FAMILIES.items():
        theory = PAPER["table2"]["theory"][family]
        observed = matched(theory, PAPER["table2"]["experimental"][family])
        series = np.array(sorted(f for dof in dofs for f in force.of(dof)))[
            np.argsort(np.argsort(theory))
        ]
        for n, value in enumerate(theory):
            k = start + n
            assert found.measured[k] == value
            ours = [
                f"{found.after[k]:#.4g}",
                f"{100 * (found.after[k] / value - 1):+.1f} %",
                f"{found.residual[k]:+.1f}",
                f"{series[n]:#.4g}",
            ]
            rows.append(
                [
                    f"{family.replace('_', '/')}: {found.label[k]}",
                    "–" if observed[n] is None else f"{observed[n]:g}",
                    f"{value:g}",
                    *ours,
                ]
            )
        start += len(theory)
    return rows


def main() -> None:
    """Infer both."""
    table1()
    table2()


if __name__ == "__main__":
    main()
