"""Effect of a compliant support on the vertical frequencies of Table I of Husman et al. (2000).

Cases 1 to 3 were measured on a frame that "still couples with the pendulum to give a lower
frequency" (section 4c). Here the suspension point stands on a vertical spring, with and without
mass, whose stiffness is fitted to each measured frequency. Writes the table of docs/paper.md and
`results/support.png`. Run by `make support`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.design import materials
from suspension_cli.design.bodies import body_mass
from suspension_cli.design.derive import set_geometry
from suspension_cli.design.reader import parse_with_overrides
from suspension_cli.design.schema import Design
from suspension_cli.drawing import curves, labels
from suspension_cli.drawing.style import PALETTE, house_style, new_figure, save, write_heading
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from tools.appendix import write_block
from tools.margins import set_margins
from tools.tables import PAPER, ROOT

CASES = (1, 2, 3, 4)
COMPLIANT = (1, 2, 3)
"""Cases on the frame that was not rigid."""
ERROR = 0.1
"""Hz; the paper's experimental error."""
FRAME_MASS = 50.0
"""kg, not given in the paper: typical of a bench-top frame for 20 kg."""
RANGE = (5e4, 1e7)
TEXTS = {
    case: (ROOT / "configs" / "husman2000" / f"table1-case{case}.toml").read_text()
    for case in CASES
}
MEASURED = {
    row["case"]: row["experimental"][PAPER["table1"]["columns"].index("vertical")]
    for row in PAPER["table1"]["case"]
}


def vertical(case: int, stiffness: float = math.inf, mass: float = 0.0) -> float:
    """Compute the lowest vertical frequency (Hz) on a frame of stiffness (N/m) and mass (kg)."""
    frame = (
        (f"support.stiffness.z={float(stiffness)!r}", f"support.mass={float(mass)!r}")
        if math.isfinite(stiffness)
        else ()
    )
    design = parse_with_overrides(TEXTS[case], frame)
    return eigenmodes.solve(registry.by_name(registry.choose(design).level).system(design)).of("z")[
        0
    ]


def frame_stiffness(case: int, frequency: float, mass: float = 0.0) -> float:
    """Find the frame stiffness (N/m) for a frequency (Hz); infinite if a rigid frame gives less."""
    from scipy.optimize import brentq

    if vertical(case) <= frequency:
        return math.inf
    root: Any = brentq(
        lambda log: vertical(case, math.exp(log), mass) - frequency,
        math.log(RANGE[0]),
        math.log(1e12),
        xtol=1e-12,
    )
    return math.exp(root)


def wires(design: Design) -> tuple[float, float]:
    """Vertical stiffness of the four wires together (N/m) and the mass (kg), in closed form.

    Each wire of stiffness k = E pi r^2 / l at an angle Omega carries T = m g / (4 cos Omega) and
    contributes k cos^2(Omega) + (T / l) sin^2(Omega).
    """
    stage = design.stage[0]
    assert (
        stage.wires is not None
        and stage.wires.radius is not None
        and stage.wires.material is not None
    )
    shape, mass = set_geometry(stage.wires), body_mass(stage.body)
    modulus = materials.resolve(design, stage.wires.material).youngs_modulus
    assert modulus is not None
    k = modulus * math.pi * stage.wires.radius**2 / shape.length
    sine = (shape.t2 - shape.t1) / shape.length
    cosine = math.sqrt(1 - sine**2)
    return (
        4 * k * cosine**2 + mass * design.constants.gravity * sine**2 / (shape.length * cosine),
        mass,
    )


def by_hand(case: int) -> tuple[float, float]:
    """Stiffness of the wires and of a massless frame in series (N/m), in closed form.

    1 / k_frame = 1 / (m omega^2) - 1 / k_wires with the measured omega.
    """
    stiffness, mass = wires(parse_with_overrides(TEXTS[case], ()))
    seen = mass * (2 * math.pi * MEASURED[case]) ** 2
    return stiffness, 1 / (1 / seen - 1 / stiffness)


def compromise(*, massive: bool) -> tuple[float, float]:
    """Fit stiffness (N/m) and mass (kg) of one frame to all three measured frequencies."""
    from scipy.optimize import minimize

    def misfit(log: Any) -> float:
        frame = (math.exp(log[0]), math.exp(log[1]) if massive else 0.0)
        return sum((vertical(case, *frame) - MEASURED[case]) ** 2 for case in COMPLIANT)

    start = [math.log(1.5e6), math.log(200.0)] if massive else [math.log(4e5)]
    log = minimize(misfit, start, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-7}).x
    return math.exp(log[0]), math.exp(log[1]) if massive else 0.0


def mega(stiffness: float) -> str:
    """Format a stiffness in MN/m."""
    return f"{1e-6 * stiffness:#.3g}" if math.isfinite(stiffness) else "any above"


def report() -> str:
    """Format the tables."""
    rows = []
    for case in CASES:
        springs, series = by_hand(case)
        low, exact, high = (
            frame_stiffness(case, MEASURED[case] + step) for step in (-ERROR, 0.0, ERROR)
        )
        heavy = frame_stiffness(case, MEASURED[case], FRAME_MASS)
        cells = (
            case,
            MEASURED[case],
            f"{vertical(case):.2f}",
            f"{1e-3 * springs:.1f}",
            mega(exact),
            mega(series),
            f"{mega(low)} to {mega(high)}",
            mega(heavy),
        )
        rows.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    shared = []
    for name, massive in (("without mass", False), ("with the best mass", True)):
        stiffness, mass = compromise(massive=massive)
        found = [vertical(case, stiffness, mass) for case in COMPLIANT]
        cells = [
            f"{f:.2f} ({f - MEASURED[case]:+.2f})" for f, case in zip(found, COMPLIANT, strict=True)
        ]
        shared.append(f"| {name} | {mega(stiffness)} | {mass:.0f} | " + " | ".join(cells) + " |")
    return WORDS.format(rows="\n".join(rows), shared="\n".join(shared), mass=FRAME_MASS)


WORDS = """
| case | measured (Hz) | rigid frame (Hz) | wires (kN/m) | frame, model | by hand | measured ± 0.1 Hz | frame of {mass:.0f} kg |
|---:|---:|---:|---:|---:|---:|---:|---:|
{rows}

| one frame for cases 1 to 3 | stiffness (MN/m) | mass (kg) | case 1 (Hz) | case 2 (Hz) | case 3 (Hz) |
|---|---:|---:|---:|---:|---:|
{shared}
"""


def draw(stiffness: Array) -> Figure:
    """Draw frequencies against the stiffness of the frame, with those measured."""
    figure = new_figure(5.0, 4.0)
    axes = figure.subplots()
    set_margins(figure, right=labels.room_for(["case 1"]), bottom=0.45)
    ends = []
    for case, colour in zip(COMPLIANT, PALETTE, strict=False):
        for mass, line in ((0.0, "-"), (FRAME_MASS, "--")):
            frequency = [vertical(case, k, mass) for k in stiffness]
            axes.plot(stiffness, frequency, line, color=colour)
            axes.plot(
                frame_stiffness(case, MEASURED[case], mass),
                MEASURED[case],
                "o",
                color=colour,
                markersize=4,
                fillstyle="full" if mass == 0 else "none",
            )
            if mass == 0:
                ends.append((stiffness, frequency, f"case {case}", colour))
        band = MEASURED[case] - ERROR, MEASURED[case] + ERROR
        axes.axhspan(*band, color=colour, alpha=0.15, linewidth=0)
    axes.set(
        xscale="log",
        xlim=RANGE,
        ylim=(4, 15),
        xlabel="vertical stiffness of the frame (N/m)",
        ylabel="vertical frequency (Hz)",
    )
    curves.rule(axes)
    labels.label_ends(axes, ends)
    write_heading(
        figure,
        "No one frame explains all three vertical frequencies",
        f"bands, dots: measured ± {ERROR:g} Hz; solid: frame without mass, dashed: of"
        f" {FRAME_MASS:.0f} kg",
    )
    return figure


def main() -> None:
    """Write the page and draw the figure."""
    write_block("support", report().splitlines())
    stiffness = np.geomspace(*RANGE, 81)
    with house_style():
        save(draw(stiffness), ROOT / "results" / "support.png")


if __name__ == "__main__":
    main()
