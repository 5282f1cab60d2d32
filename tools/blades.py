"""Error of blades in series with angled wires: force model against string model.

The stage of the paper's figures 3 and 4 (6 kg on four wires, one blade of 1.3 kN/m per wire), with
t2 fixed and t1 reduced. Writes `results/blades.md`. Run by `make blades`.
"""

from __future__ import annotations

import math

from suspension_cli.conventions import DOF_NAMES
from suspension_cli.design.reader import parse
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tools.tables import PAPER, ROOT

STAGE = PAPER["figure3"] | PAPER["figure4"]
DESIGN = """
[design]
name = "blades"
[[stage]]
name = "test"
body = {{ shape = "cylinder", axis = "x", radius = {radius}, length = {length}, mass = {mass} }}
[stage.wires]
count = 4
l = {l}
s = {s}
t1 = {t1}
t2 = {t2}
d = {d}
material = "steel302"
radius = {wire_radius}
[stage.blades]
count = 4
stiffness = {blade_stiffness}
"""


def differences(t1: float) -> tuple[float, dict[str, tuple[float, float]]]:
    """Compare the two models for one t1 (m).

    Returns the angle of the wires in degrees and, by mode, the frequency of the string model (Hz)
    with the relative difference of the force model.
    """
    design = parse(DESIGN.format(**(STAGE | {"t1": t1})))
    force, string = (
        eigenmodes.solve(registry.by_name(level).system(design)) for level in ("force", "string")
    )
    angle = math.degrees(math.asin((STAGE["t2"] - t1) / STAGE["l"]))
    families = {"x": ("x",), "y": ("y", "roll"), "z": ("z",), "pitch": ("pitch",), "yaw": ("yaw",)}
    result = {}
    for name, dofs in families.items():
        both = [sorted(f for dof in dofs for f in found.of(dof)) for found in (force, string)]
        for n, (ours, exact) in enumerate(zip(*both, strict=True)):
            label = DOF_NAMES[name] if len(both[0]) == 1 else f"transverse/roll {n + 1}"
            result[label] = (exact, ours / exact - 1)
    return angle, result


def main() -> None:
    """Write the table."""
    rows = [differences(t1) for t1 in (0.095, 0.09, 0.08, 0.06, 0.04, 0.02, 0.0)]
    names = list(rows[0][1])
    lines = [
        "# Blades in series with angled wires",
        "",
        (
            "Frequency with the blade tips as coordinates (`string`, Hz), and in brackets how far"
            " the paper's series springs (`force`) are from it in %."
        ),
        "",
        "| angle of the wires | " + " | ".join(names) + " |",
        "|---:|" + "---:|" * len(names),
    ]
    lines += [
        f"| {angle:.1f}° | "
        + " | ".join(f"{row[n][0]:.4g} ({round(100 * row[n][1], 2) + 0.0:+.2f})" for n in names)
        + " |"
        for angle, row in rows
    ]
    text = "\n".join([*lines, ""])
    write_bytes(ROOT / "results" / "blades.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
