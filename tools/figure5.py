"""Figure 5 of Husman et al. (2000): longitudinal transfer function of the prototype triple.

From the top point of the suspension to 1 mm above the centre of mass of the test mass, on the
paper's axes. Writes `results/figure5.png` and `.h5`. Run by `make fig5`.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from suspension_cli.design.reader import read
from suspension_cli.drawing.curves import label_plainly, rule
from suspension_cli.drawing.labels import label_peaks
from suspension_cli.drawing.panels import HEAD, PEAKS
from suspension_cli.drawing.style import NOTE, PALETTE, house_style, new_figure, save, write_heading
from suspension_cli.files import stored
from suspension_cli.files.hdf5 import Provenance, write
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from tools.margins import set_margins
from tools.tables import PAPER, ROOT

POINTS = 4000
AXES = "from the top point to 1 mm above the COM of the test mass, no damping; axes of the paper"
ROOM = 12.0
"""Room above the paper's axis, dB."""


def solved() -> tuple[response.Response, eigenmodes.Modes, Provenance]:
    """Compute the transfer function on the paper's frequency axis, and the modes."""
    source = read(ROOT / "configs" / "husman2000" / "table2.toml")
    choice = registry.choose(source.design)
    model = registry.by_name(choice.level).system(source.design)
    low, high = PAPER["figure5"]["x_range"]
    known, modes = signals.bodies_with_signals(model), eigenmodes.solve(model)
    coupled = np.concatenate([modes.of(dof) for dof in ("x", "pitch")])
    # beside the poles, where the response without losses has no end
    beside = np.outer(coupled, 1 + np.array([-1e-4, -1e-6, -1e-8, 1e-8, 1e-6, 1e-4]))
    answer = response.solve(
        model,
        np.union1d(np.geomspace(low, high, POINTS), beside),
        [signals.parse_input("support.x", known)],
        [signals.parse_output("test.x@0,0,0.001", known)],
    )
    return (
        answer,
        modes,
        Provenance(source.text, "make fig5", choice.level, choice.reason),
    )


def slope(answer: response.Response, above: float = 30.0) -> float:
    """Exponent of the roll-off above a frequency (Hz), by least squares of logarithms."""
    tail = answer.frequency > above
    return float(
        np.polyfit(np.log(answer.frequency[tail]), np.log(np.abs(answer.value[tail, 0, 0])), 1)[0]
    )


def pair_modes(found: eigenmodes.Modes) -> list[tuple[float, float]]:
    """Pair our longitudinal and tilt modes with those of Table II's theory, Hz."""
    ours = sorted(f for dof in ("x", "pitch") for f in found.of(dof))
    printed = sorted(PAPER["table2"]["theory"]["tilt_longitudinal"])
    return list(zip(ours, printed, strict=True))


def draw(answer: response.Response, found: eigenmodes.Modes) -> Figure:
    """Draw the transfer function on the paper's axes, with its modes beside those printed."""
    (low, high), (left, right) = PAPER["figure5"]["y_range"], PAPER["figure5"]["x_range"]
    figure = new_figure(5.6, 4.4)
    write_heading(figure, "Longitudinal transfer function of the prototype triple", AXES)
    axes = figure.subplots()
    set_margins(figure, left=0.7, right=0.2, top=HEAD + 0.2 + PEAKS, bottom=0.45)
    axes.set(xscale="log", xlim=(left, right), ylim=(low, high + ROOM))
    axes.set(xlabel="frequency (Hz)", ylabel="transmissibility (dB)")
    axes.set_yticks(np.arange(low, high + 1, 50.0))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "−")))
    rule(axes)
    label_plainly(axes.xaxis)
    level = 20 * np.log10(np.abs(answer.value[:, 0, 0]))
    axes.plot(answer.frequency, np.minimum(level, high), color=PALETTE[0])
    axes.axhline(high, color=NOTE, linewidth=0.6, linestyle=(0, (4, 3)))
    axes.annotate(
        "end of the paper's axis;\nwithout damping peaks have no end",
        (right, high),
        (0, -2),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=7.5,
        color=NOTE,
    )
    tops = [
        (ours, min(float(np.interp(ours, answer.frequency, level)), high), f" ({printed:g})")
        for ours, printed in pair_modes(found)
    ]
    label_peaks(axes, tops, unit="")
    figure.text(
        axes.get_position().x0,
        1 - 0.62 / figure.get_size_inches()[1],
        "modes in Hz, in brackets those of the paper's Table II:",
        fontsize=7.5,
        color=NOTE,
    )
    guide = np.array([20.0, right])
    power = PAPER["figure5"]["asymptote"]
    asymptote = level[-1] + 12 + 20 * power * np.log10(guide / right)
    axes.plot(guide, asymptote, color=NOTE, linestyle="--", linewidth=0.8)
    axes.annotate(
        f"paper: $f^{{{power}}}$",
        (guide[0], asymptote[0]),
        (6, 2),
        textcoords="offset points",
        ha="left",
        va="bottom",
        fontsize=8,
        color=NOTE,
        annotation_clip=False,
    )
    return figure


def main() -> None:
    """Draw the figure."""
    answer, found, origin = solved()
    folder = ROOT / "results"
    folder.mkdir(exist_ok=True)
    write(
        folder / "figure5.h5",
        origin,
        lambda file: stored.write(file.create_group("response"), answer),
    )
    with house_style():
        save(draw(answer, found), folder / "figure5.png")
    print(
        f"results/figure5.png: falls as f^{slope(answer):.3f} above 30 Hz (the paper:"
        f" f^{PAPER['figure5']['asymptote']})"
    )
    here = sorted(f for dof in ("x", "pitch") for f in found.of(dof))
    print("longitudinal and tilt modes (Hz): " + ", ".join(f"{f:.4g}" for f in here))


if __name__ == "__main__":
    main()
