"""Young's modulus from the measured frequencies of Table I of Husman et al. (2000): the paper's own story (section 4c), by `pendsus fit`.

With the handbook's 2.0e11 Pa theory lies too high; fitted to the vertical modes it "over corrects"; and with a support that gives way vertically and in roll?
Writes `results/youngs-modulus.md`.  Run by `make modulus`.
"""

from __future__ import annotations

import numpy as np
from tables import DOF, PAPER, ROOT

from suspension_cli.analysis import fit
from suspension_cli.conventions import WORDS
from suspension_cli.design.measured import Free, Measured, Mode
from suspension_cli.results import write_bytes

ERROR = 0.1
"""Hz; the paper's experimental error."""
MODULUS, FRAME = "materials.steel302.youngs_modulus", ("support.stiffness.z", "support.stiffness.roll")
RIGID = 1e9
"""N/m and N m/rad; as good as rigid."""
COLUMNS = PAPER["table1"]["columns"]


def measured(row: dict, columns: list[str], free: list[Free]) -> Measured:
    """The measured modes of one case."""
    modes = [Mode(frequency=row["experimental"][n], uncertainty=ERROR, label=f"test {WORDS[DOF[name]]}") for n, name in enumerate(COLUMNS) if name in columns]
    return Measured(mode=modes, parameter=free)


def fitted(row: dict, columns: list[str], *, frame: bool = False) -> fit.Fit:
    """Young's modulus (and the frame's stiffnesses) from some modes of one case, from the handbook's value on."""
    free = [Free(name=MODULUS, start=2.0e11, lower=1e10, upper=1e12)]
    if frame:
        free += [Free(name=FRAME[0], start=1e6, lower=1e4, upper=RIGID), Free(name=FRAME[1], start=3e4, lower=1e3, upper=RIGID)]
    text = (ROOT / "configs" / "husman2000" / f"table1-case{row['case']}.toml").read_text()
    return fit.solve(text, measured(row, columns, free))


def told(found: fit.Fit, n: int = 0, unit: float = 1e11, digits: int = 2) -> str:
    """A number with its uncertainty."""
    return f"{found.value[n] / unit:.{digits}f} ± {found.sigma[n] / unit:.{digits}f}"


def rows() -> list[list[str]]:
    """One row a case."""
    table = []
    for row in PAPER["table1"]["case"]:
        alone, tilt, roll, every = (fitted(row, columns) for columns in (["vertical"], ["tilt", "rotation"], ["roll"], COLUMNS))
        cells = [str(row["case"]), told(alone), told(tilt), told(roll), told(every), f"{every.chi_squared:.0f}/{every.freedom}"]
        both = fitted(row, COLUMNS, frame=True)
        stiff = ["rigid" if both.value[n] > RIGID / 10 else "no effect" if np.isinf(both.sigma[n]) else told(both, n, unit) for n, unit in ((1, 1e6), (2, 1e3))]
        cells += [told(both), *stiff, f"{both.chi_squared:.0f}/{both.freedom}"]
        table.append(cells)
    return table


def main() -> None:
    """Write the table."""
    head = [
        "case",
        "E from vertical",
        "from tilt and rotation",
        "from roll",
        "from all six",
        "χ²/dof",
        "E with a frame",
        "frame z (MN/m)",
        "frame roll (kN m/rad)",
        "χ²/dof",
    ]
    lines = ["# Young's modulus from Table I", "", "E in 1e11 Pa, from the measured frequencies with 0.1 Hz each.", ""]
    lines += ["| " + " | ".join(head) + " |", "|" + "---:|" * len(head)]
    lines += ["| " + " | ".join(cells) + " |" for cells in rows()]
    text = "\n".join([*lines, ""])
    write_bytes(ROOT / "results" / "youngs-modulus.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
