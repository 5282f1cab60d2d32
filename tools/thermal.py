"""Thermal noise of a triple pendulum with a fused-silica final stage, in a 600 m arm.

Writes `results/thermal.png` and `.h5` from `configs/geo-silica-triple.toml`. Run by `make thermal`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.analyses.thermal import file as files
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.analyses.thermal.picture import draw
from suspension_cli.design.reader import read
from suspension_cli.design.schema import Design
from suspension_cli.drawing.style import save
from suspension_cli.files.hdf5 import Provenance, write
from suspension_cli.models import auto, registry
from tools.tables import ROOT

ARM = 600.0
"""Arm length of GEO 600, m."""
FREQUENCY = np.geomspace(0.1, 3000.0, 6000)


def solved() -> tuple[thermal.Thermal, Design, Provenance]:
    """Compute the noise of the mirror along the beam; also return the design."""
    source = read(ROOT / "configs" / "geo-silica-triple.toml")
    choice = auto.for_thermal_noise(source.design, "auto", FREQUENCY[-1])
    model = registry.by_name(choice.level).system(source.design)
    tilt = thermal.compute_arm_tilt(ARM)
    signal, row = thermal.parse_motion(model, "test.x", tilt)
    noise = thermal.solve(model, FREQUENCY, row, signal, source.design.constants.temperature)
    return (
        replace(noise, tilt=tilt),
        source.design,
        Provenance(source.text, "make thermal", choice.level, choice.reason),
    )


def main() -> None:
    """Draw the figure."""
    noise, design, origin = solved()
    folder = ROOT / "results"
    folder.mkdir(exist_ok=True)
    write(
        folder / "thermal.h5",
        origin,
        lambda file: files.fill(file.create_group("thermal"), [noise]),
    )
    title = f"{design.design.title} · {origin.fidelity} model"
    save(draw([noise], title, [stage.name for stage in design.stage]), folder / "thermal.png")
    values = ", ".join(
        f"{value:.2e} at {at:g} Hz"
        for at, value in zip(
            (10, 100), np.interp((10, 100), FREQUENCY, noise.amplitude), strict=True
        )
    )
    print(f"results/thermal.png: {values} (m/sqrt(Hz))")


if __name__ == "__main__":
    main()
