"""Figure 6 of Husman et al. (2000): cross-coupling at 50 Hz of a stage with one imperfect wire.

|horizontal output / vertical output| for vertical input, 1 mm below the centre of mass, against
k/k0 of one wire for five offsets of its upper end. The paper does not say which length is constant
while k changes: both conventions are shown, on the paper's axes. Writes `results/figure6.png` and
`.md`. Run by `make fig6`.
"""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.analyses.xcouple.picture import COLOURS, interpolate
from suspension_cli.design.reader import read
from suspension_cli.drawing.curves import rule
from suspension_cli.drawing.labels import label_ends
from suspension_cli.drawing.panels import HEAD
from suspension_cli.drawing.style import (
    NOTE,
    house_style,
    new_figure,
    save,
    write_heading,
    write_text,
)
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.grids import parse_grid
from suspension_cli.linear import signals
from suspension_cli.physics.couplings import CouplingRequest
from suspension_cli.studies.job import Axis
from tools.margins import set_margins
from tools.tables import PAPER, ROOT

AXES = "1 mm below the COM, axes as printed in the paper; labels: offset of the wire's upper end"
ASSUMED = "The paper assumes 10 × 10⁻⁴ (0.1 %) for all causes together, above these axes."
FIRST, LAST = 0.0, 0.85
"""Part of the colour map that is used."""
HOLDS = ("loaded-length", "natural-length")


def ratios(hold: str) -> tuple[ImperfectBuilds, Any]:
    """Compute the sweep of the figure and the ratio (k, offset), for one convention of `hold`."""
    source = read(ROOT / "configs" / "husman2000" / "figure6.toml")
    given = source.design.analysis["xcouple"]
    known = ("support", "test")
    over, under = (
        signals.parse_output(f"test.{dof}@{given['observe'].partition('@')[2]}", known)
        for dof in "xz"
    )
    question = CouplingRequest(
        0, 1, hold, signals.parse_input("support.z", known), over, under, (given["frequency"],)
    )
    axes = tuple(Axis(name, tuple(parse_grid(given[name], name))) for name in ("k", "offset"))
    job = ImperfectBuilds(source.text, axes, question)
    return job, job.compute(0, job.count)["ratio"][:, 0].reshape(job.shape)


def draw(found: list[tuple[str, ImperfectBuilds, Any]]) -> Figure:
    """Draw both conventions on the paper's axes, a line per offset of the upper end."""
    printed = PAPER["figure6"]
    figure = new_figure(7.2, 3.8)
    write_heading(figure, "Horizontal over vertical motion at 50 Hz with one imperfect wire", AXES)
    write_text(figure, 0.1, 0.43, ASSUMED, 7.5, NOTE)
    panels = figure.subplots(1, 2, sharey=True)
    set_margins(figure, left=0.6, right=0.62, top=HEAD + 0.42, bottom=0.5, wspace=0.32)
    for axes, (hold, job, ratio) in zip(panels, found, strict=True):
        axes.set(xlim=printed["k_over_k0"], xlabel="stiffness of the wire, $k/k_0$")
        axes.set_ylim(0, 1e4 * printed["y_range"][1])
        rule(axes)
        k, offsets = (np.array(axis.values) for axis in job.axes)
        ends = []
        for n, offset in enumerate(offsets):
            place = FIRST + (LAST - FIRST) * n / max(len(offsets) - 1, 1)
            colour = to_hex(matplotlib.colormaps[COLOURS](place))
            at, size = interpolate(k, ratio[:, n])
            axes.plot(at, 1e4 * size, color=colour, linewidth=1.3)
            name = f"{1e3 * offset:+.0f} mm".replace("-", "−") if offset else "0 mm"
            ends.append((at, 1e4 * size, name, colour))
        label_ends(axes, ends)
        largest = 1e4 * float(np.abs(ratio).max())
        title = f"{hold.replace('-', ' ')} held: up to {largest:.1f} × 10⁻⁴"
        axes.set_title(title, loc="left", fontsize=8.5)
    panels[0].set_ylabel("horizontal / vertical motion (10⁻⁴)")
    return figure


def main() -> None:
    """Draw the figure and write its largest ratios."""
    printed = PAPER["figure6"]
    lines = [
        "# Figure 6",
        "",
        "Largest |x / z| at 50 Hz on the figure's grid, 1 mm below the centre of mass.",
        "",
        "| held | largest | at k/k0 | at offset (mm) |",
        "|---|---:|---:|---:|",
    ]
    found = [(hold, *ratios(hold)) for hold in HOLDS]
    for hold, job, values in found:
        ratio = np.abs(values)
        k, at = np.unravel_index(int(ratio.argmax()), ratio.shape)
        lines.append(
            f"| {hold.replace('-', ' ')} | {ratio.max():.3e} | {job.axes[0].values[k]:.2g} |"
            f" {1e3 * job.axes[1].values[at]:+.2g} |"
        )
    with house_style():
        (ROOT / "results").mkdir(exist_ok=True)
        save(draw(found), ROOT / "results" / "figure6.png")
    text = "\n".join([*lines, "", f"The paper's axis ends at {printed['y_range'][1]:g}.", ""])
    write_bytes(ROOT / "results" / "figure6.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
