"""Simulated transfer functions for docs/diagnosis.md: a triple with wires clamped too high.

Writes the CSV files of `measured/diagnosis/`: x and pitch of the upper mass over the voltage of
their coils. The simulated suspension differs from the design by `BUILT`, and the sensor of x has
the factor `SENSOR_X`. Run by `make simulated`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import suspension_cli as sus
from suspension_cli.files.atomic import write_bytes
from tools.tables import ROOT

FOLDER = ROOT / "measured" / "diagnosis"
BUILT = {"stage.middle.wires.d": 0.003}
"""The lower ends of the middle stage's wires are 2 mm too high."""
SENSOR_X = -(10**-0.5)
"""Exchanged leads, and an attenuator of 10 dB."""
FREQUENCY = np.geomspace(0.4, 5.0, 60)
SCATTER = 0.03
"""Relative standard deviation of real and imaginary parts, added in squares to the floor."""


@dataclass(frozen=True)
class Channel:
    """A coil and a sensor.

    Attributes
    ----------
    file, drive, signal : str
    gain : float
        um/V or urad/V per m/N or rad/(N m).
    floor : float
        Standard deviation of the noise, um/V or urad/V.
    """

    file: str
    drive: str
    signal: str
    gain: float
    floor: float


CHANNELS = (
    Channel("x.csv", "upper.force_x", "upper.x", 1e6 * 0.016 * SENSOR_X, 0.3),
    Channel("pitch.csv", "upper.torque_pitch", "upper.pitch", 1e6 * 8e-4, 12.0),
)


def simulate(built: sus.Design, channel: Channel, random: np.random.Generator) -> str:
    """Simulate a measurement; returns the text of its CSV file."""
    found = sus.response(
        built,
        inputs=[channel.drive],
        outputs=[channel.signal],
        frequency=FREQUENCY,
        fidelity="beam",
    )
    exact = channel.gain * found.value[:, 0, 0]
    sigma = np.hypot(channel.floor, SCATTER * np.abs(exact))
    scatter = random.normal(size=(2, len(FREQUENCY)))
    value = exact + sigma * (scatter[0] + 1j * scatter[1])
    rows = zip(FREQUENCY, value.real, value.imag, sigma, strict=True)
    lines = [
        "# simulated (tools/simulated_diagnosis.py), not a measurement of hardware",
        "frequency_hz, real, imag, sigma",
        *(", ".join(f"{number:.5g}" for number in row) for row in rows),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the files."""
    built = sus.read(FOLDER / "triple.toml").replace(BUILT)
    random = np.random.default_rng(1)
    for channel in CHANNELS:
        write_bytes(FOLDER / channel.file, simulate(built, channel, random).encode())


if __name__ == "__main__":
    main()
