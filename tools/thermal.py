"""Thermal noise of a triple pendulum with a fused-silica final stage, seen by the beam of a 600 m arm.

Writes `results/thermal.png` and `.h5` from `configs/geo-silica-triple.toml`.  Run by `make thermal`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tables import ROOT

from suspension_cli.analysis import thermal
from suspension_cli.design.reader import read
from suspension_cli.models import fidelity, wire_mass
from suspension_cli.plots.style import save
from suspension_cli.plots.thermal import draw
from suspension_cli.results import Provenance
from suspension_cli.results import thermal as files

ARM = 600.0
"""Of GEO 600, m."""
FREQUENCY = np.geomspace(0.1, 3000.0, 6000)


def solved() -> tuple[thermal.Thermal, str, Provenance]:
    """The noise of the mirror along the beam, and the design's title."""
    source = read(ROOT / "configs" / "geo-silica-triple.toml")
    choice = wire_mass.choose(source.design, "auto", FREQUENCY[-1])
    model = fidelity.linear_model(source.design, choice.level)
    tilt = thermal.arm_tilt(ARM)
    signal, row = thermal.observed(model, "test.x", tilt)
    noise = thermal.solve(model, FREQUENCY, row, signal, source.design.constants.temperature)
    return replace(noise, tilt=tilt), source.design.design.title, Provenance(source.text, "make thermal", choice.level, choice.reason)


def main() -> None:
    """Draw the figure."""
    noise, title, origin = solved()
    folder = ROOT / "results"
    folder.mkdir(exist_ok=True)
    files.save(folder / "thermal.h5", [noise], origin)
    save(draw([noise], title), folder / "thermal.png")
    told = ", ".join(f"{value:.2e} at {at:g} Hz" for at, value in zip((10, 100), np.interp((10, 100), FREQUENCY, noise.amplitude), strict=True))
    print(f"results/thermal.png: {told} (m/sqrt(Hz))")


if __name__ == "__main__":
    main()
