"""Thermal noise of a triple pendulum with a fused-silica final stage, in a 600 m arm.

Writes `results/thermal.png` and `.h5` from `configs/geo-silica-triple.toml`. Run by `make thermal`.
"""

from __future__ import annotations

import numpy as np

import suspension_cli as sus
from suspension_cli.drawing.style import save
from tools.tables import ROOT

ARM = 600.0
"""Arm length of GEO 600, m."""
FREQUENCY = np.geomspace(0.1, 3000.0, 6000)


def solved() -> sus.Thermal:
    """Compute the noise of the mirror along the beam."""
    return sus.thermal(sus.example("geo-silica-triple"), arm=ARM, frequency=FREQUENCY)


def main() -> None:
    """Draw the figure."""
    result, folder = solved(), ROOT / "results"
    folder.mkdir(exist_ok=True)
    result.save(folder / "thermal.h5")
    save(result.plot(), folder / "thermal.png")
    values = ", ".join(
        f"{value:.2e} at {at:g} Hz"
        for at, value in zip(
            (10, 100), np.interp((10, 100), FREQUENCY, result.amplitude[:, 0]), strict=True
        )
    )
    print(f"results/thermal.png: {values} (m/sqrt(Hz))")


if __name__ == "__main__":
    main()
