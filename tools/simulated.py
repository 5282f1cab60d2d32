"""Simulated measurements of two imperfect triple pendulums. Run by `make simulated`.

Writes the data of `measured/triple/`, an example of files of measurements: a CSV of a swept force
along x and an XML as diaggui saves it of pitch and x of the upper mass. The simulated suspension
differs from the design by `IMPERFECT`, its sensors and coils by `TRUTH`.

Writes the CSV files of `measured/diagnosis/` for docs/examples/diagnosis.md: x and pitch of the
upper mass over the voltage of their coils. That suspension differs from the design by `BUILT`, and
its sensor of x by `SENSOR_X`.

Writes the CSV files of `measured/matrices/`: each coil of six OSEMs to all their sensors. That
suspension differs from the design by `TRIMMED`, its OSEMs at random by `OSEM_ERRORS`.
"""

from __future__ import annotations

import base64
import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np

import suspension_cli as sus
from suspension_cli.design import measured, reader
from suspension_cli.design.measured import Measured
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import response, signals
from suspension_cli.measurements.transfer_function import Channels, MeasuredResponse
from suspension_cli.models.registry import BEAM
from tools.tables import ROOT

FOLDER = ROOT / "measured" / "triple"
IMPERFECT = (
    "stage.middle.body.mass=5.72",  # 2 % more
    "stage.upper.blades.stiffness=1.24e3",  # 5 % less
    "stage.test.wires.l=0.284",  # 4 mm longer
    'perturbation=[{wire="test.1", lower_offset=[0.0, 0.0, 0.0015]}]',
)
TRUTH = {"osem-x": 1.03, "coil-x": 0.97, "osem-pitch": 0.98}
"""Factors on the gains of sensors and actuators."""
AVERAGES = 30
NOISE = {"osem-x": 1e-6, "osem-pitch": 3e-5}
"""Of the sensors per unit drive (V), in the bandwidth of one average, m/V and rad/V."""

DIAGNOSIS = ROOT / "measured" / "diagnosis"
BUILT = {"stage.middle.wires.d": 0.003}
"""The lower ends of the middle stage's wires are 2 mm too high."""
SENSOR_X = -(10**-0.5)
"""Exchanged leads, and an attenuator of 10 dB."""
CHANNELS = {
    "x.csv": ("upper.force_x", "upper.x", 1e6 * 0.016 * SENSOR_X, 0.3),
    "pitch.csv": ("upper.torque_pitch", "upper.pitch", 1e6 * 8e-4, 12.0),
}
"""File, coil, sensor, gain (um/V or urad/V per m/N or rad/(N m)) and noise (um/V or urad/V)."""
SCATTER = 0.03
"""Relative standard deviation of real and imaginary parts, added in squares to the noise."""

MATRICES = ROOT / "measured" / "matrices"
TRIMMED = {"stage.middle.body.mass": 5.61, "stage.upper.blades.stiffness": 1.31e3}
OSEM_ERRORS = {"gain": 0.1, "place": 2e-3, "direction": 0.02}
"""Standard deviations: relative, m, rad."""
REVERSED = "SD"
"""OSEM whose coil has exchanged leads."""
FLOOR = 0.01
"""Noise of a reading over the voltage of a coil, um/V."""
SWEPT = 0.005
"""Relative standard deviation of real and imaginary parts, added in squares to the noise."""


def simulate(data: Measured, number: int, frequency: Any, seed: int) -> tuple[Any, Any]:
    """Simulate a transfer function with noise; returns it and the coherence g^2."""
    design = reader.read(FOLDER / "triple.toml", IMPERFECT).design
    model = BEAM.system(design)
    tables = with_true_gains(data)
    known = signals.bodies_with_signals(model)
    table = tables.transfer_function[number]
    one = MeasuredResponse("", table.input, table.output, *4 * (frequency,))
    channels = Channels.of(tables, [one])
    out, into = channels.signal
    value = response.solve(
        model,
        frequency,
        [signals.parse_input(name, known) for name in into],
        [signals.parse_output(name, known) for name in out],
    ).value
    exact = channels.combine(value, frequency)[:, 0, 0]
    noise = NOISE[table.output]
    coherence = np.abs(exact) ** 2 / (np.abs(exact) ** 2 + noise**2)
    random = np.random.default_rng(seed)
    scatter = random.normal(size=(2, len(frequency)))
    return exact + noise / np.sqrt(2 * AVERAGES) * (scatter[0] + 1j * scatter[1]), coherence


def with_true_gains(data: Measured) -> Measured:
    """Return the tables with the true gains of sensors and actuators."""
    import msgspec

    def true(among: list[Any]) -> list[Any]:
        return [
            msgspec.structs.replace(one, gain=one.gain * TRUTH.get(one.name, 1.0)) for one in among
        ]

    return msgspec.structs.replace(data, sensor=true(data.sensor), actuator=true(data.actuator))


def dtt(frequency: Any, values: list[Any], coherences: list[Any], channels: list[str]) -> bytes:
    """Write transfer functions and coherences of a swept sine as diaggui does."""
    root = ElementTree.Element("LIGO_LW", Name="Diagnostics Test")
    for number, (subtype, kind, rows) in enumerate(((3, "<c8", values), (5, "<f4", coherences))):
        result = ElementTree.SubElement(
            root, "LIGO_LW", Name=f"Result[{number}]", Type="TransferFunction"
        )
        parameters = {
            "Subtype": subtype,
            "Averages": AVERAGES,
            "N": len(frequency),
            "M": len(rows),
            "ChannelA": channels[0],
            **{f"ChannelB[{n}]": name for n, name in enumerate(channels[1:])},
        }
        for key, value in parameters.items():
            ElementTree.SubElement(result, "Param", Name=key).text = str(value)
        array = ElementTree.SubElement(result, "Array", Type="float")
        stream = ElementTree.SubElement(array, "Stream", Encoding="LittleEndian,base64")
        data = np.stack([frequency, *rows]).astype(kind).tobytes()
        stream.text = "\n" + base64.encodebytes(data).decode()
    ElementTree.indent(root, " ", 0)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def write_triple() -> None:
    """Write the example of files of measurements."""
    data = measured.read(FOLDER / "measured.toml")
    frequency = np.geomspace(0.3, 12.0, 240)
    value, coherence = simulate(data, 0, frequency, 1)
    lines = [
        "# simulated: swept force on the upper mass, not a measurement of hardware",
        "frequency_hz, real, imag, coherence",
        *(
            f"{f:.6g}, {1e6 * h.real:.6g}, {1e6 * h.imag:.6g}, {g:.7f}"
            for f, h, g in zip(frequency, value, coherence, strict=True)
        ),
    ]
    write_bytes(FOLDER / "x.csv", ("\n".join(lines) + "\n").encode())
    frequency = np.geomspace(0.5, 6.0, 160)
    pairs = [simulate(data, number, frequency, number + 1) for number in (1, 2)]
    channels = ["X1:SUS-TRIPLE_UPPER_DRIVE_P_EXC"]
    channels += [f"X1:SUS-TRIPLE_UPPER_OSEM_{dof}_IN1" for dof in "PL"]
    write_bytes(
        FOLDER / "pitch.xml",
        dtt(frequency, [value for value, _ in pairs], [g for _, g in pairs], channels),
    )


def write_diagnosis() -> None:
    """Write the files of docs/examples/diagnosis.md."""
    built, random = sus.read(DIAGNOSIS / "triple.toml").replace(BUILT), np.random.default_rng(1)
    frequency = np.geomspace(0.4, 5.0, 60)
    for file, (coil, sensor, gain, noise) in CHANNELS.items():
        found = sus.response(
            built, inputs=coil, outputs=sensor, frequency=frequency, fidelity="beam"
        )
        exact = gain * found.value[:, 0, 0]
        sigma = np.hypot(noise, SCATTER * np.abs(exact))
        scatter = random.normal(size=(2, len(frequency)))
        value = exact + sigma * (scatter[0] + 1j * scatter[1])
        lines = [
            "# simulated (tools/simulated.py), not a measurement of hardware",
            "frequency_hz, real, imag, sigma",
        ]
        for row in zip(frequency, value.real, value.imag, sigma, strict=True):
            lines.append(", ".join(f"{number:.5g}" for number in row))
        write_bytes(DIAGNOSIS / file, ("\n".join(lines) + "\n").encode())


def wrong_rows(osems: list[Any], random: Any) -> Any:
    """Readings per motion (or forces of coils) of OSEMs with errors: (OSEM, 6)."""
    rows = []
    for one in osems:
        at = np.array(one.at) + OSEM_ERRORS["place"] * random.normal(size=3)
        along = np.array(one.vector) + OSEM_ERRORS["direction"] * random.normal(size=3)
        gain = 1 + OSEM_ERRORS["gain"] * random.normal()
        rows.append(gain * np.concatenate([along, np.cross(at, along)]))
    return np.array(rows)


def write_matrices() -> None:
    """Write the example of `pendsus fit --matrices`."""
    design = sus.read(MATRICES / "triple.toml")
    control = design.design.control
    assert control is not None
    osems = list(control.osem)
    random = np.random.default_rng(49)
    sensing = wrong_rows(osems, random)
    driving = wrong_rows(osems, random)
    names = [one.name for one in osems]
    driving[names.index(REVERSED)] *= -1
    frequency = np.geomspace(0.3, 12.0, 60)
    dofs = ("x", "y", "z", "roll", "pitch", "yaw")
    forces = [f"upper.{'force' if dof in 'xyz' else 'torque'}_{dof}" for dof in dofs]
    found = sus.response(
        design.replace(TRIMMED),
        inputs=forces,
        outputs=[f"upper.{dof}" for dof in dofs],
        frequency=frequency,
        fidelity="beam",
    )
    exact = 1e6 * 0.015 * (sensing @ found.value @ driving.T)
    sigma = np.hypot(FLOOR, SWEPT * np.abs(exact))
    scatter = random.normal(size=(2, *exact.shape))
    value = exact + sigma * (scatter[0] + 1j * scatter[1])
    coherence = 1 / (1 + 2 * AVERAGES * (sigma / np.abs(value)) ** 2)
    heads = [f"{name} {part}" for name in names for part in ("re", "im", "coh")]
    for n, name in enumerate(names):
        lines = [
            "# simulated (tools/simulated.py), not a measurement of hardware",
            ", ".join(["frequency_hz", *heads]),
        ]
        of_coil = value[:, :, n]
        columns = np.stack([of_coil.real, of_coil.imag, coherence[:, :, n]], axis=2)
        for f, row in zip(frequency, columns.reshape(len(frequency), -1), strict=True):
            lines.append(", ".join(f"{number:.5g}" for number in (f, *row)))
        write_bytes(MATRICES / f"{name}.csv", ("\n".join(lines) + "\n").encode())


if __name__ == "__main__":
    write_triple()
    write_diagnosis()
    write_matrices()
