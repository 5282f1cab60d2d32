"""Young's modulus from the measured frequencies of Table I of Husman et al. (2000): the paper's own story (section 4c), by `pendsus fit`.

With the handbook's 2.0e11 Pa theory lies too high; fitted to the vertical modes it "over corrects"; and with a frame that gives way?  All four cases
together, from `measured/husman2000/table1.toml`.  Writes `results/youngs-modulus.md`.  Run by `make modulus`.
"""

from __future__ import annotations

import msgspec
from tables import DOF, PAPER, ROOT

from suspension_cli.analysis import fit
from suspension_cli.conventions import WORDS
from suspension_cli.design import measured
from suspension_cli.design.measured import Free, Measured
from suspension_cli.results import write_bytes

FILE = ROOT / "measured" / "husman2000" / "table1.toml"
HANDBOOK = 2.0e11
"""Pa; what the authors began with."""
MODULUS = "materials.steel302.youngs_modulus"
INERTIA = [Free(name=f"stage.test.body.inertia.{n}", lower=0.03, upper=0.5) for n in (1, 2, 3)]
"""As free as E: where the search begins is all that the theory's values for them say."""
COLUMNS = {"vertical": ["vertical"], "tilt and rotation": ["tilt", "rotation"], "roll": ["roll"], "all six": PAPER["table1"]["columns"]}
DIRECTIONS = {"rigid": "", "z": "z", "z, roll": "z roll", "z, roll, y": "z roll y", "z, roll, y, pitch": "z roll y pitch"}
"""In what a frame may give way."""


def fitted(asked: Measured) -> fit.Fit:
    """What modes of `FILE` say of the four designs."""
    return fit.solve([(FILE.parent / item.design).read_text() for item in asked.experiment or ()], asked)


def chosen(columns: list[str] | None = None, parameters: list[Free] | None = None) -> Measured:
    """The file with some of its modes and other free parameters."""
    whole = measured.read(FILE)
    labels = [f"test {WORDS[DOF[name]]}" for name in columns or PAPER["table1"]["columns"]]
    experiments = [msgspec.structs.replace(item, mode=[mode for mode in item.mode if mode.label in labels]) for item in whole.experiment or ()]
    return msgspec.structs.replace(whole, experiment=experiments, parameter=parameters or whole.parameter)


def modulus(each: str | None = None) -> Free:
    """Young's modulus as the file has it, or of one case alone."""
    (found,) = [item for item in measured.read(FILE).parameter if item.name == MODULUS]
    return msgspec.structs.replace(found, experiments=None if each is None else [each])


def rigid(columns: list[str]) -> tuple[fit.Fit, fit.Fit]:
    """Young's modulus on rigid frames: of each case by itself, and one for all."""
    names = [item.title for item in measured.read(FILE).experiment or ()]
    return fitted(chosen(columns, [modulus(name) for name in names])), fitted(chosen(columns, [modulus()]))


def framed(directions: str, extra: list[Free] | None = None) -> fit.Fit:
    """Young's modulus on frames that give way in some directions only."""
    kept = [item for item in measured.read(FILE).parameter if item.name == MODULUS or item.name.rpartition(".")[2] in directions.split()]
    return fitted(chosen(parameters=kept + (extra or [])))


def told(found: fit.Fit, n: int = 0, unit: float = 1e11, digits: int = 2) -> str:
    """A number with its uncertainty."""
    return f"{found.value[n] / unit:.{digits}f} ± {found.sigma[n] / unit:.{digits}f}"


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """A table in Markdown."""
    return ["| " + " | ".join(head) + " |", "|---" + "|---:" * (len(head) - 1) + "|", *("| " + " | ".join(cells) + " |" for cells in rows), ""]


def chi(found: fit.Fit) -> str:
    """chi^2 over degrees of freedom."""
    return f"{found.chi_squared:.0f}/{found.freedom}"


def on_rigid_frames(value: float) -> fit.Fit:
    """The fit of Young's modulus alone from a value on: `before` are the frequencies with that."""
    return fitted(chosen(parameters=[msgspec.structs.replace(modulus(), start=value)]))


def frequencies(found: fit.Fit, vertical: float) -> list[str]:
    """Every mode: measured, the paper's theory, with the handbook's modulus, with that of the vertical modes, and with the frame."""
    rows, before = [], [on_rigid_frames(value).before for value in (HANDBOOK, vertical)]
    columns = PAPER["table1"]["columns"]
    for k, (case, name) in enumerate((case, name) for case in PAPER["table1"]["case"] for name in columns):
        assert found.modes[k] == f"case{case['case']}: test {WORDS[DOF[name]]}"
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
    """Write what was found."""
    lines = [
        "# Young's modulus from Table I",
        "",
        "All by `pendsus fit` from `measured/husman2000/table1.toml`: 24 frequencies, 0.1 Hz each; E in 1e11 Pa.",
        "",
    ]
    lines += ["## Rigid frames: E of each case by itself, and one E for all", ""]
    rows = []
    for name, columns in COLUMNS.items():
        each, one = rigid(columns)
        rows.append([name, *(told(each, n) for n in range(4)), chi(each), told(one), chi(one)])
    lines += table(["from", "case 1", "case 2", "case 3", "case 4", "χ²/dof", "one for all", "χ²/dof"], rows)
    lines += ["## Frames that give way: one E for all, all 24 frequencies", ""]
    rows = [[name, told(found, digits=3), chi(found)] for name, found in ((name, framed(some)) for name, some in DIRECTIONS.items())]
    free = framed("z roll y pitch", INERTIA)
    rows.append(["these, and the moments of inertia are free", told(free, digits=3), chi(free)])
    lines += table(["frame gives way in", "E", "χ²/dof"], rows)
    found = fitted(chosen())
    lines += ["The last frame but one, which is that of the file (cases 1 to 3 share y, roll and pitch):", ""]
    lines += table(["stiffness", "kN/m, kN m/rad"], [[name, told(found, n, 1e3, 1)] for n, name in enumerate(found.parameters) if n])
    one = ", ".join(f"{value:.4f} ± {sigma:.4f}" for value, sigma in zip(free.value[-3:], free.sigma[-3:], strict=True))
    lines += [f"Moments of inertia, where they are free: {one} kg m².", "", "## Frequencies (Hz)", ""]
    lines += frequencies(found, rigid(["vertical"])[1].value[0])
    text = "\n".join(lines)
    write_bytes(ROOT / "results" / "youngs-modulus.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
