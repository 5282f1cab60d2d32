"""Parameters missing from Tables I and II of the paper, inferred by `pendsus fit`.

The data are the paper's theoretical frequencies. Writes `results/table1-inference.md` and
`results/table2-inference.md`. Run by `make inference`.
"""

from __future__ import annotations

import numpy as np

from suspension_cli.analyses.fit import solve as fit
from suspension_cli.design import measured, reader
from suspension_cli.design.measured import Measured
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.models.registry import STRING
from suspension_cli.studies import parameters
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


def combinations(found: fit.Fitted) -> list[str]:
    """List the combinations of parameters that the modes alone determine, best first."""
    rows = []
    for n, (value, row) in enumerate(zip(found.singular, found.direction, strict=True), 1):
        largest = np.argsort(-np.abs(row))[:LISTED]
        parts = ", ".join(
            f"{row[k]:+.2f} {found.name[k].removeprefix('stage.')}"
            for k in largest
            if abs(row[k]) >= 0.1
        )
        rows.append([str(n), f"{100 / value:.2g} %", parts])
    return table(["", "known to", "combination of relative changes (largest parts)"], rows)


def table1() -> str:
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
    lines = ["# What Table I does not print", ""]
    lines += [
        (
            "`pendsus fit measured/husman2000/table1-theory.toml`: the 24 frequencies of the"
            " paper's theory, E = 1.7e11 Pa, one set for all four cases."
        ),
        "",
    ]
    lines += table(["number (SI)", "fit", "configs/husman2000", "apart (σ)"], rows)
    lines += [
        (
            f"χ² {found.chi_squared:.1f} for {found.freedom} degrees of freedom, with 1 % and the"
            " rounding of each printed value as its uncertainty."
        ),
        "",
    ]
    lines += ["IZ from rotation alone:", ""]
    rows = []
    for n, (text, item) in enumerate(zip(texts, data.experiment or (), strict=True)):
        yaw = Measured(
            mode=[mode for mode in item.mode if mode.label == "test yaw"],
            parameter=[data.parameter[2]],
        )
        alone = fit.solve([text], yaw, level=STRING.name)
        rows.append([str(n + 1), f"{alone.measured[0]:g}", f"{alone.value[0]:.4f}"])
    lines += table(["case", "rotation (Hz)", "IZ (kg m²)"], rows)
    lines += combinations(found)
    return "\n".join(lines)


def table2() -> str:
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
    lines = ["# What the paper does not say of Table II's triple pendulum", ""]
    more = f"the next best at {found.ends[same]:.1f}" if same < len(found.ends) else "and no other"
    lines += [
        "`pendsus fit configs/husman2000/table2.toml measured/husman2000/table2.toml --starts"
        f" {STARTS}`, on `string`."
    ]
    lines += [
        f"χ² {found.chi_squared:.1f} for {found.freedom} degrees of freedom (18 frequencies, 25"
        " hints, 28 numbers);"
    ]
    lines += [
        f"{same} of {len(found.ends)} searches ended there, {more}.",
        "",
        "## Numbers (SI)",
        "",
    ]
    lines += table(["number", "hint", "fit", "σ of the hint's", "table2.toml"], rows)
    lines += [
        "## Frequencies (Hz)",
        "",
        *_frequencies(found),
        "## What the 18 frequencies alone determine",
        "",
        *combinations(found),
    ]
    return "\n".join(lines)


def _frequencies(found: fit.Fitted) -> list[str]:
    """List all modes: measured, the paper's theory, and the fitted design in both models."""
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
    return table(
        [
            "mode",
            "experiment",
            "paper's theory",
            "fit, string",
            "fit - theory",
            "residual (σ)",
            "fit, force",
        ],
        rows,
    )


def main() -> None:
    """Write both pages."""
    for name, text in (("table1", table1()), ("table2", table2())):
        write_bytes(ROOT / "results" / f"{name}-inference.md", text.encode())
        print(text)


if __name__ == "__main__":
    main()
