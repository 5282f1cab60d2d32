"""Figure 5 of Husman et al. (2000): longitudinal transfer function of the prototype triple.

From the top point of the suspension to 1 mm above the centre of mass of the test mass, on the
paper's axes. Writes `results/figure5.png` and `.h5`. Run by `make fig5`.
"""

from __future__ import annotations

import numpy as np

from suspension_cli.analyses.response import file as files
from suspension_cli.analyses.response.picture import draw_magnitude
from suspension_cli.design.reader import read
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure, save
from suspension_cli.files.hdf5 import Provenance, write
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from tools.tables import PAPER, ROOT

POINTS = 4000


def solved() -> tuple[response.Response, eigenmodes.Modes, Provenance]:
    """Compute the transfer function on the paper's frequency axis, and the modes."""
    source = read(ROOT / "configs" / "husman2000" / "table2.toml")
    choice = registry.choose(source.design)
    model = registry.by_name(choice.level).system(source.design)
    low, high = PAPER["figure5"]["x_range"]
    known = signals.bodies_with_signals(model)
    answer = response.solve(
        model,
        np.geomspace(low, high, POINTS),
        [signals.parse_input("support.x", known)],
        [signals.parse_output("test.x@0,0,0.001", known)],
    )
    return (
        answer,
        eigenmodes.solve(model),
        Provenance(source.text, "make fig5", choice.level, choice.reason),
    )


def slope(answer: response.Response, above: float = 30.0) -> float:
    """Exponent of the roll-off above a frequency (Hz), by least squares of logarithms."""
    tail = answer.frequency > above
    return float(
        np.polyfit(np.log(answer.frequency[tail]), np.log(np.abs(answer.value[tail, 0, 0])), 1)[0]
    )


def main() -> None:
    """Draw the figure."""
    answer, found, origin = solved()
    folder = ROOT / "results"
    folder.mkdir(exist_ok=True)
    write(
        folder / "figure5.h5",
        origin,
        lambda file: files.fill(file.create_group("response"), answer),
    )
    with house_style():
        figure = new_figure(5.2, 4.0)
        axes = figure.subplots()
        draw_magnitude(axes, answer.frequency, answer.value[:, 0, 0], "db", PALETTE[0], "")
        guide = answer.frequency > 20
        reference = 20 * np.log10(np.abs(answer.value[-1, 0, 0])) - 120 * np.log10(
            answer.frequency[guide] / answer.frequency[-1]
        )
        axes.plot(
            answer.frequency[guide], reference + 12, color=NOTE, linestyle="--", linewidth=0.8
        )
        axes.annotate(
            "$1/f^{6}$",
            (45, reference[np.searchsorted(answer.frequency[guide], 45)] + 12),
            xytext=(6, 2),
            textcoords="offset points",
            color=NOTE,
        )
        axes.set(
            xscale="log",
            xlim=PAPER["figure5"]["x_range"],
            ylim=PAPER["figure5"]["y_range"],
            xlabel="frequency (Hz)",
            ylabel="transmissibility (dB)",
        )
        axes.set_title(
            "Top point to 1 mm above the COM of the test mass, longitudinal", loc="left", fontsize=8
        )
        axes.grid(visible=True, color=PALE, linewidth=0.4)
        figure.tight_layout()
        save(figure, folder / "figure5.png")
    print(
        f"results/figure5.png: falls as f^{slope(answer):.3f} above 30 Hz (the paper:"
        f" f^{PAPER['figure5']['asymptote']})"
    )
    here = sorted(f for dof in ("x", "pitch") for f in found.of(dof))
    print("longitudinal and tilt modes (Hz): " + ", ".join(f"{f:.4g}" for f in here))


if __name__ == "__main__":
    main()
