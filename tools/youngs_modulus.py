"""Young's modulus from the measured frequencies of Table I of Husman et al. (2000).

The question of its section 4c, by `pendsus fit`: with the handbook's 2.0e11 Pa theory lies too
high, and a fit to the vertical modes "over corrects". Here all four cases are fitted together, on
rigid and on compliant frames, from `measured/husman2000/table1.toml`. Writes
`results/youngs-modulus.md`. Run by `make modulus`.
"""

from __future__ import annotations

import msgspec

from suspension_cli.analyses.fit import solve as fit
from suspension_cli.conventions import DOF_NAMES
from suspension_cli.design import measured
from suspension_cli.design.measured import Free, Measured
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.models.registry import STRING
from tools.tables import DOF, PAPER, ROOT

FILE = ROOT / "measured" / "husman2000" / "table1.toml"
HANDBOOK = 2.0e11
"""Pa, the authors' first value."""
MODULUS = "materials.steel302.youngs_modulus"
INERTIA = [Free(name=f"stage.test.body.inertia.{n}", lower=0.03, upper=0.5) for n in (1, 2, 3)]
"""Moments of inertia as free parameters, kg m^2; only their start values come from theory."""
COLUMNS = {
    "vertical": ["vertical"],
    "tilt and rotation": ["tilt", "rotation"],
    "roll": ["roll"],
    "all six": PAPER["table1"]["columns"],
}
DIRECTIONS = {
    "rigid": "",
    "z": "z",
    "z, roll": "z roll",
    "z, roll, y": "z roll y",
    "z, roll, y, pitch": "z roll y pitch",
}
"""Directions in which a frame is compliant."""


def fitted(data: Measured) -> fit.Fitted:
    """Fit the four designs to modes of `FILE`."""
    return fit.solve(
        [(FILE.parent / item.design).read_text() for item in data.experiment or ()],
        data,
        level=STRING.name,
    )


def chosen(columns: list[str] | None = None, parameters: list[Free] | None = None) -> Measured:
    """Select modes of `FILE` and replace its free parameters."""
    whole = measured.read(FILE)
    labels = [f"test {DOF_NAMES[DOF[name]]}" for name in columns or PAPER["table1"]["columns"]]
    experiments = [
        msgspec.structs.replace(item, mode=[mode for mode in item.mode if mode.label in labels])
        for item in whole.experiment or ()
    ]
    return msgspec.structs.replace(
        whole, experiment=experiments, parameter=parameters or whole.parameter
    )


def modulus(each: str | None = None) -> Free:
    """Young's modulus as a free parameter, of all cases or of one experiment."""
    (found,) = [item for item in measured.read(FILE).parameter if item.name == MODULUS]
    return msgspec.structs.replace(found, experiments=None if each is None else [each])


def rigid(columns: list[str]) -> tuple[fit.Fitted, fit.Fitted]:
    """Fit Young's modulus on rigid frames: one per case, and one for all."""
    names = [item.title for item in measured.read(FILE).experiment or ()]
    return fitted(chosen(columns, [modulus(name) for name in names])), fitted(
        chosen(columns, [modulus()])
    )


def framed(directions: str, extra: list[Free] | None = None) -> fit.Fitted:
    """Fit Young's modulus on frames that are compliant in some directions only."""
    kept = [
        item
        for item in measured.read(FILE).parameter
        if item.name == MODULUS or item.name.rpartition(".")[2] in directions.split()
    ]
    return fitted(chosen(parameters=kept + (extra or [])))


def with_uncertainty(found: fit.Fitted, n: int = 0, unit: float = 1e11, digits: int = 2) -> str:
    """Format a value with its uncertainty."""
    sigma = found.sigma[n] / found.scale  # as the uncertainties imply, in a misfit too
    return f"{found.value[n] / unit:.{digits}f} ± {sigma / unit:.{digits}f}"


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """Format a Markdown table."""
    return [
        "| " + " | ".join(head) + " |",
        "|---" + "|---:" * (len(head) - 1) + "|",
        *("| " + " | ".join(cells) + " |" for cells in rows),
        "",
    ]


def chi(found: fit.Fitted) -> str:
    """Format chi^2 over degrees of freedom."""
    return f"{found.chi_squared:.0f}/{found.freedom}"


def on_rigid_frames(value: float) -> fit.Fitted:
    """Fit Young's modulus alone from a start value, at which `before` holds the frequencies."""
    return fitted(chosen(parameters=[msgspec.structs.replace(modulus(), start=value)]))


def frequencies(found: fit.Fitted, vertical: float) -> list[str]:
    """List all modes: measured, the paper's theory, and the three fits by modulus and frame."""
    rows, before = [], [on_rigid_frames(value).before for value in (HANDBOOK, vertical)]
    columns = PAPER["table1"]["columns"]
    for k, (case, name) in enumerate(
        (case, name) for case in PAPER["table1"]["case"] for name in columns
    ):
        assert found.modes[k] == f"case{case['case']}: test {DOF_NAMES[DOF[name]]}"
        printed = [f"{found.measured[k]:g}", f"{case['theory'][columns.index(name)]:g}"]
        ours = [f"{values[k]:.2f}" for values in (*before, found.after)]
        rows.append([f"{case['case']} {name}", *printed, *ours, f"{found.residual[k]:+.1f}"])
    head = [
        "case, mode",
        "measured",
        "paper's theory",
        "E = 2.0, rigid",
        f"E = {vertical / 1e11:.2f}, rigid",
        f"E = {found.value[0] / 1e11:.2f}, frame",
        "residual (σ)",
    ]
    return table(head, rows)


def main() -> None:
    """Write the page."""
    lines = [
        "# Young's modulus from Table I",
        "",
        (
            "All by `pendsus fit` from `measured/husman2000/table1.toml`: 24 frequencies, 0.1 Hz"
            " each; E in 1e11 Pa."
        ),
        "",
    ]
    lines += ["## Rigid frames: E of each case alone, and one E for all", ""]
    rows = []
    for name, columns in COLUMNS.items():
        each, one = rigid(columns)
        rows.append(
            [
                name,
                *(with_uncertainty(each, n) for n in range(4)),
                chi(each),
                with_uncertainty(one),
                chi(one),
            ]
        )
    lines += table(
        ["from", "case 1", "case 2", "case 3", "case 4", "χ²/dof", "one for all", "χ²/dof"], rows
    )
    lines += ["## Frames that give way: one E for all, all 24 frequencies", ""]
    rows = [
        [name, with_uncertainty(found, digits=3), chi(found)]
        for name, found in ((name, framed(some)) for name, some in DIRECTIONS.items())
    ]
    free = framed("z roll y pitch", INERTIA)
    rows.append(
        ["these, and the moments of inertia are free", with_uncertainty(free, digits=3), chi(free)]
    )
    lines += table(["frame gives way in", "E", "χ²/dof"], rows)
    found = fitted(chosen())
    lines += [
        "The last frame but one, which is that of the file (cases 1 to 3 share y, roll and pitch):",
        "",
    ]
    lines += table(
        ["stiffness", "kN/m, kN m/rad"],
        [
            [name, with_uncertainty(found, n, 1e3, 1)]
            for n, name in enumerate(found.parameters)
            if n
        ],
    )
    one = ", ".join(
        f"{value:.4f} ± {sigma:.4f}"
        for value, sigma in zip(free.value[-3:], free.sigma[-3:], strict=True)
    )
    lines += [
        f"Moments of inertia, where they are free: {one} kg m².",
        "",
        "## Frequencies (Hz)",
        "",
    ]
    lines += frequencies(found, rigid(["vertical"])[1].value[0])
    text = "\n".join(lines)
    write_bytes(ROOT / "results" / "youngs-modulus.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
