"""What the paper does not print of the suspensions of Tables I and II, inferred from its theoretical frequencies by `pendsus fit`.

Writes `results/table1-inference.md` and `results/table2-inference.md`.  Run by `make inference`.
"""

from __future__ import annotations

import numpy as np
from tables import FAMILIES, PAPER, ROOT, matched
from youngs_modulus import table

from suspension_cli.analysis import fit, modes, parameters
from suspension_cli.design import measured, reader
from suspension_cli.design.measured import Measured
from suspension_cli.models import fidelity
from suspension_cli.results import write_bytes

FOLDER = ROOT / "measured" / "husman2000"
STARTS = 16
TRIPLE = ROOT / "configs" / "husman2000" / "table2.toml"
TOLD = 5
"""Numbers told of a combination."""


def told(value: float, sigma: float) -> str:
    """A number to the digits that its uncertainty leaves."""
    scale = 10.0 ** (np.floor(np.log10(sigma)) - 1)
    digits = max(0, int(-np.log10(scale) + 0.5))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}" if digits < 7 else f"{1e6 * value:.1f}e-6 ± {1e6 * sigma:.1f}e-6"


def combinations(found: fit.Fit) -> list[str]:
    """What the modes by themselves tell of the numbers, from best to worst."""
    rows = []
    for n, (value, row) in enumerate(zip(found.singular, found.direction, strict=True), 1):
        largest = np.argsort(-np.abs(row))[:TOLD]
        parts = ", ".join(f"{row[k]:+.2f} {found.name[k].removeprefix('stage.')}" for k in largest if abs(row[k]) >= 0.1)
        rows.append([str(n), f"{100 / value:.2g} %", parts])
    return table(["", "known to", "combination of relative changes (largest parts)"], rows)


def table1() -> str:
    """Moments of inertia and radius of Table I."""
    asked = measured.read(FOLDER / "table1-theory.toml")
    texts = [(FOLDER / item.design).read_text() for item in asked.experiment or ()]
    found = fit.solve(texts, asked)
    rows = [
        [name, told(value, sigma), f"{used:g}", f"{(used - value) / sigma:+.1f}"]
        for name, value, sigma, used in zip(found.name, found.value, found.sigma, found.start, strict=True)
    ]
    lines = ["# What Table I does not print", ""]
    lines += ["`pendsus fit measured/husman2000/table1-theory.toml`: the 24 frequencies of the paper's theory, E = 1.7e11 Pa, one set for all four cases.", ""]
    lines += table(["number (SI)", "fit", "configs/husman2000", "apart (σ)"], rows)
    lines += [f"χ² {found.chi_squared:.1f} for {found.freedom} degrees of freedom, with 1 % and the rounding of each printed value as its uncertainty.", ""]
    lines += ["What rotation by itself asks of IZ:", ""]
    rows = []
    for n, (text, item) in enumerate(zip(texts, asked.experiment or (), strict=True)):
        yaw = Measured(mode=[mode for mode in item.mode if mode.label == "test yaw"], parameter=[asked.parameter[2]])
        alone = fit.solve([text], yaw)
        rows.append([str(n + 1), f"{alone.measured[0]:g}", f"{alone.value[0]:.4f}"])
    lines += table(["case", "rotation (Hz)", "IZ (kg m²)"], rows)
    lines += combinations(found)
    return "\n".join(lines)


def table2() -> str:
    """Everything that is open of Table II's triple pendulum."""
    asked, text = measured.read(FOLDER / "table2.toml"), TRIPLE.read_text()
    found = fit.solve([text], asked, starts=STARTS)
    used = {item.name: item.value for item in parameters.every(text)}
    rows = []
    for n, item in enumerate(asked.parameter):
        hint = "" if item.prior is None or item.uncertainty is None else f"{item.prior:g} ± {item.uncertainty:g}"
        gained = "" if item.uncertainty is None else f"{found.sigma[n] / item.uncertainty:.2f}"
        rows.append([item.name.removeprefix("stage."), hint, told(found.value[n], found.sigma[n]), gained, f"{used[item.name]:g}"])
    same = int((found.ends <= 1.001 * found.ends[0]).sum())
    lines = ["# What the paper does not say of Table II's triple pendulum", ""]
    more = f"the next best at {found.ends[same]:.1f}" if same < len(found.ends) else "and no other"
    lines += [f"`pendsus fit configs/husman2000/table2.toml measured/husman2000/table2.toml --starts {STARTS}`, on `string`."]
    lines += [f"χ² {found.chi_squared:.1f} for {found.freedom} degrees of freedom (18 frequencies, 25 hints, 28 numbers);"]
    lines += [f"{same} of {len(found.ends)} searches ended there, {more}.", "", "## Numbers (SI)", ""]
    lines += table(["number", "hint", "fit", "σ of the hint's", "table2.toml"], rows)
    lines += ["## Frequencies (Hz)", "", *_frequencies(found), "## What the 18 frequencies by themselves tell apart", "", *combinations(found)]
    return "\n".join(lines)


def _frequencies(found: fit.Fit) -> list[str]:
    """Every mode: measured, the paper's theory, and the fitted design on both rungs."""
    design = reader.parse(found.design[0])
    force = modes.solve(fidelity.linear_model(design, "force"))
    rows, start = [], 0
    for family, dofs in FAMILIES.items():
        theory = PAPER["table2"]["theory"][family]
        seen = matched(theory, PAPER["table2"]["experimental"][family])
        series = np.array(sorted(f for dof in dofs for f in force.of(dof)))[np.argsort(np.argsort(theory))]
        for n, value in enumerate(theory):
            k = start + n
            assert found.measured[k] == value
            ours = [f"{found.after[k]:#.4g}", f"{100 * (found.after[k] / value - 1):+.1f} %", f"{found.residual[k]:+.1f}", f"{series[n]:#.4g}"]
            rows.append([f"{family.replace('_', '/')}: {found.label[k]}", "–" if seen[n] is None else f"{seen[n]:g}", f"{value:g}", *ours])
        start += len(theory)
    return table(["mode", "experiment", "paper's theory", "fit, string", "fit - theory", "residual (σ)", "fit, force"], rows)


def main() -> None:
    """Write both."""
    for name, text in (("table1", table1()), ("table2", table2())):
        write_bytes(ROOT / "results" / f"{name}-inference.md", text.encode())
        print(text)


if __name__ == "__main__":
    main()
