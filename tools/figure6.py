"""Figure 6 of Husman et al. (2000): cross-coupling at 50 Hz of a stage with one imperfect wire.

|horizontal output / vertical output| for vertical input, 1 mm below the centre of mass, against
k/k0 of one wire for five offsets of its upper end. The paper does not say which length is constant
while k changes: both conventions are shown, on the paper's axes. Writes `results/figure6.png` and
`.md`. Run by `make fig6`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.analyses.xcouple.solve import CouplingRequest, Sweep
from suspension_cli.design.reader import read
from suspension_cli.drawing.style import PALE, PALETTE, house_style, new_figure, save
from suspension_cli.files.atomic import write_bytes
from suspension_cli.grids import parse_grid
from suspension_cli.linear import signals
from suspension_cli.studies.axes import Axis
from tools.tables import PAPER, ROOT

HOLDS = ("loaded-length", "natural-length")


def ratios(hold: str) -> tuple[Sweep, Any]:
    """Compute the sweep of the figure and |ratio| (k, offset), for one convention of `hold`."""
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
    job = Sweep(source.text, axes, question)
    return job, np.abs(job.compute(0, job.count)["ratio"][:, 0]).reshape(job.shape)


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
    with house_style():
        figure = new_figure(7.2, 3.6)
        for axes, hold in zip(figure.subplots(1, 2, sharey=True), HOLDS, strict=True):
            job, ratio = ratios(hold)
            for n, offset in enumerate(job.axes[1].values):
                axes.plot(
                    job.axes[0].values,
                    ratio[:, n],
                    color=PALETTE[n],
                    label=f"{1e3 * offset:+.0f} mm" if offset else "0 mm",
                )
            axes.set(xlim=printed["k_over_k0"], ylim=printed["y_range"], xlabel="$k/k_0$")
            axes.set_title(f"{hold.replace('-', ' ')} held", loc="left", fontsize=8)
            axes.grid(visible=True, color=PALE, linewidth=0.4)
            k, at = np.unravel_index(int(ratio.argmax()), ratio.shape)
            lines.append(
                f"| {hold.replace('-', ' ')} | {ratio.max():.3e} | {job.axes[0].values[k]:.2g} |"
                f" {1e3 * job.axes[1].values[at]:+.2g} |"
            )
        figure.axes[0].set_ylabel("horizontal to vertical ratio")
        figure.axes[0].ticklabel_format(axis="y", style="sci", scilimits=(0, 0))
        figure.axes[1].legend(
            title="offset of upper end of wire", title_fontsize=7, loc="upper center"
        )
        figure.tight_layout()
        (ROOT / "results").mkdir(exist_ok=True)
        save(figure, ROOT / "results" / "figure6.png")
    text = "\n".join([*lines, "", f"The paper's axis ends at {printed['y_range'][1]:g}.", ""])
    write_bytes(ROOT / "results" / "figure6.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
