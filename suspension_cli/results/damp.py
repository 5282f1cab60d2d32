"""The group `damp` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analysis.damp import Damped
from suspension_cli.analysis.margins import Margins
from suspension_cli.analysis.poles import Poles
from suspension_cli.results import Provenance, dataset, scale, write

MARGINS = {"phase": "degree", "phase_frequency": "Hz", "gain_up": "1", "gain_down": "1", "distance": "1"}


def save(path: Path, damped: Damped, origin: Provenance) -> None:
    """Write what local control does to one design."""
    write(path, origin, lambda file: fill(file.create_group("damp"), damped))


def fill(group: h5py.Group, damped: Damped) -> None:
    """Put it into a group."""
    group.attrs["output"], group.attrs["drive"], group.attrs["stable"] = damped.output, damped.drive, damped.stable
    loop = scale(group, "loop", list(damped.loop), "name")
    for name, poles in (("open", damped.open), ("closed", damped.closed)):
        number = scale(group, f"{name}_pole_number", np.arange(1, len(poles.value) + 1), "1")
        dataset(group, f"{name}_pole", poles.value, "rad/s", number)
        dataset(group, f"{name}_state", list(poles.state), "name", number)
    for name, unit in MARGINS.items():
        values = [np.nan] * len(damped.loop) if damped.margin is None else [getattr(margin, name) for margin in damped.margin]
        dataset(group, f"{name}_margin" if name == "phase" else name, values, unit, loop)
    time, frequency = scale(group, "time", damped.time, "s"), scale(group, "frequency", damped.frequency, "Hz")
    dataset(group, "impulse", damped.impulse, "SI, output over unit impulse", time)
    dataset(group, "undamped", damped.undamped, "SI, output over unit impulse", time)
    dataset(group, "noise", damped.noise, "SI/sqrt(Hz)", frequency, loop)
    dataset(group, "loop_gain", damped.gain, "1", frequency, loop)


def load(group: Any) -> Damped:
    """What a group holds."""
    loop = tuple(group["loop"].asstr()[:])
    rows = {name: group[f"{name}_margin" if name == "phase" else name][:] for name in MARGINS}
    closed = Poles(group["closed_pole"][:], tuple(group["closed_state"].asstr()[:]))
    margin = tuple(Margins(**{name: float(values[n]) for name, values in rows.items()}) for n in range(len(loop)))
    return Damped(
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
    )
