"""Optical spring of an arm, by pendsus and by finesse: the numbers of docs/notebooks/cavity.py.

Writes `results/cavity.png`. Run by `make cavity`.
"""

from __future__ import annotations

import os
import runpy
import tempfile
import warnings
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.drawing.panels import Across, Line, Panel, draw
from suspension_cli.drawing.style import PALETTE, format_signed, save
from tools.tables import ROOT
from tools.validation.pictures import DOT, RING, deviation_panel, with_room

CLOSE = 1e-3
"""Relative deviation within which both programs agree."""


@dataclass(frozen=True)
class Detuning:
    """Length of the arm over force, m/N, at one detuning, by both programs.

    `at` are the frequencies of finesse, Hz, a part of those of pendsus.
    """

    name: str
    frequency: np.ndarray
    ours: np.ndarray
    at: np.ndarray
    theirs: np.ndarray

    @property
    def deviation(self) -> np.ndarray:
        """Relative deviation of pendsus from finesse."""
        return self.ours[np.isin(self.frequency, self.at)] / self.theirs - 1


def solved() -> list[Detuning]:
    """Run the script, and read what it draws: a line and dots for each detuning."""
    os.environ["MPLBACKEND"] = "agg"
    script = ROOT / "docs" / "notebooks" / "cavity.py"
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        before = os.getcwd()
        os.chdir(folder)  # the script saves its own picture
        try:
            drawn = runpy.run_path(str(script))["plt"].gca().get_lines()
        finally:
            os.chdir(before)
    return [
        Detuning(
            str(line.get_label()).removeprefix("detuned by "),
            *(np.asarray(part) for part in (*line.get_data(), *dots.get_data())),
        )
        for line, dots in zip(drawn[::2], drawn[1::2], strict=True)
    ]


def draw_arm(found: list[Detuning]) -> Figure:
    """Draw the responses, and the deviations with their sign."""
    curves: list[Line] = []
    deviations: list[Line] = []
    for one, colour in zip(found, PALETTE, strict=False):
        curves.append(Line(one.frequency, one.ours, f"detuned by {one.name}", colour))
        curves.append(Line(one.at, one.theirs, "_", colour, RING))
        deviations.append(Line(one.at, 100 * one.deviation, "_", colour, DOT))
    at = np.concatenate([one.at for one in found])
    every = np.concatenate([one.deviation for one in found])
    close = float((np.abs(every) < CLOSE).mean())
    worst = int(np.abs(every).argmax())
    remark = f"largest: {format_signed(100 * every[worst], 2)} %, at {at[worst]:.2g} Hz by a peak"
    axis = Across(limits=with_room(found[0].frequency))
    panels = [
        Panel("length of the arm over force (m/N)", curves, 2.4, "log"),
        deviation_panel(deviations, (-20.0, 20.0), 1e-4, axis, 100 * CLOSE, [remark]),
    ]
    heading = f"Optical spring: {100 * close:.0f} % of points within 0.1 % of finesse"
    subtitle = "arm between two quadruple pendulums; lines: pendsus, circles: finesse 3"
    return draw(heading, subtitle, panels)


def main() -> None:
    """Draw the picture."""
    save(draw_arm(solved()), ROOT / "results" / "cavity.png")


if __name__ == "__main__":
    main()
