"""HDF5 group `damp` of a results file."""

from __future__ import annotations

import h5py
import numpy as np

from suspension_cli.analyses.damp.margins import Margins
from suspension_cli.analyses.damp.sensitivity import SensitivityPeak
from suspension_cli.analyses.damp.solve import LocalControl
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.linear.poles import Poles

UNITS = {
    "phase": "degree",
    "phase_frequency": "Hz",
    "gain_up": "1",
    "gain_down": "1",
    "distance": "1",
    "gain_up_frequency": "Hz",
    "gain_down_frequency": "Hz",
    "delay": "s",
    "delay_frequency": "Hz",
}
"""Fields of `Margins` and their units."""


def fill(group: h5py.Group, damped: LocalControl) -> None:
    """Write the local control of a design into a group."""
    group.attrs["output"] = damped.output
    group.attrs["drive"] = damped.drive
    group.attrs["stable"] = damped.stable
    if damped.sensitivity is not None:
        group.attrs["sensitivity_peak"] = damped.sensitivity.size
        group.attrs["sensitivity_frequency"] = damped.sensitivity.frequency
    loop = add_scale(group, "loop", list(damped.loop), "name")
    for name, poles in (("open", damped.open), ("closed", damped.closed)):
        number = add_scale(group, f"{name}_pole_number", np.arange(1, len(poles.value) + 1), "1")
        add_dataset(group, f"{name}_pole", poles.value, "rad/s", number)
        add_dataset(group, f"{name}_state", list(poles.state), "name", number)
    for name, unit in UNITS.items():
        values = (
            [np.nan] * len(damped.loop)
            if damped.margin is None
            else [getattr(margin, name) for margin in damped.margin]
        )
        add_dataset(group, _dataset(name), values, unit, loop)
    time = add_scale(group, "time", damped.time, "s")
    frequency = add_scale(group, "frequency", damped.frequency, "Hz")
    add_dataset(group, "impulse", damped.impulse, "SI, output over unit impulse", time)
    add_dataset(group, "undamped", damped.undamped, "SI, output over unit impulse", time)
    add_dataset(group, "noise", damped.noise, "SI/sqrt(Hz)", frequency, loop)
    add_dataset(group, "loop_gain", damped.gain, "1", frequency, loop)


def load(group: Stored) -> LocalControl:
    """Read the local control of a design from a group."""
    loop = tuple(group["loop"].asstr()[:])
    rows = {name: group[_dataset(name)][:] for name in UNITS}
    peak = None
    if "sensitivity_peak" in group.attrs:
        peak = SensitivityPeak(
            float(group.attrs["sensitivity_peak"]), float(group.attrs["sensitivity_frequency"])
        )
    closed = Poles(group["closed_pole"][:], tuple(group["closed_state"].asstr()[:]))
    margin = tuple(
        Margins(**{name: float(values[n]) for name, values in rows.items()})
        for n in range(len(loop))
    )
    return LocalControl(
        loop=loop,
        open=Poles(group["open_pole"][:], tuple(group["open_state"].asstr()[:])),
        closed=closed,
        margin=margin if closed.stable else None,
        output=str(group.attrs["output"]),
        drive=str(group.attrs["drive"]),
        time=group["time"][:],
        impulse=group["impulse"][:],
        undamped=group["undamped"][:],
        frequency=group["frequency"][:],
        noise=group["noise"][:],
        gain=group["loop_gain"][:],
        sensitivity=peak,
    )


def _dataset(name: str) -> str:
    return f"{name}_margin" if name in ("phase", "delay") else name
