"""Measured transfer functions beside those of a model: ratios, chi^2 and shifts of resonances."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import readings
from suspension_cli.design import measured as tables
from suspension_cli.design.measured import Measured
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.files.declared import INLINE, in_unit
from suspension_cli.linear import damped
from suspension_cli.linear.response import Response
from suspension_cli.linear.signals import bodies_with_signals
from suspension_cli.linear.system import LinearSystem
from suspension_cli.measurements import read
from suspension_cli.measurements.resonances import find_peaks
from suspension_cli.measurements.transfer_function import Channels, MeasuredResponse
from suspension_cli.models.choice import Transfer
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

    from suspension_cli.analyses.response.solve import ClosedTransfer
    from suspension_cli.linear.poles import Poles

NOISY = 1 / 3
"""Uncertainty relative to the value from which a point is no evidence of a deviation."""
RESIDUE = 1e-4
"""Contribution of a mode relative to the largest, from which its pole can explain a peak."""
MODEL_ERROR = 0.1
"""Relative error of a computed frequency before anything was fitted; adds to the half width 1/(2 Q)
of a resonance."""
FARTHEST = 2.0
"""Distance, in these widths, from which a mode does not explain a peak."""
SLIP = 1e3
"""Median ratio of measured to modelled magnitude (or its inverse) that suggests wrong units."""
UNITS = {1e3: "mm", 1e6: "um", 1e9: "nm", 1e-3: "km"}


@dataclass(frozen=True)
class Item:
    """Measured transfer functions; the tables and file that say how they were measured, if any."""

    tables: Measured
    channels: Channels
    file: str = ""


@dataclass(frozen=True)
class Comparison:
    """A measured transfer function and its prediction by a model.

    Attributes
    ----------
    predicted, curve
        By the model, with gains, delays and mixes of the transducers; also on a finer grid.
    peak
        Frequencies of measured resonances, Hz.
    pole, mode
        Frequency (Hz) and label of the mode of the model that contributes there; NaN and "" if
        there is none. No two peaks have one mode.
    """

    data: MeasuredResponse = field(metadata=INLINE)
    predicted: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    curve_frequency: Float[np.ndarray, " curve_frequency"] = field(metadata=in_unit("Hz"))
    curve: Complex[np.ndarray, " curve_frequency"] = field(metadata=in_unit("{unit}"))
    peak: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    pole: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    mode: tuple[str, ...]

    @property
    def ratio(self) -> Complex[np.ndarray, " point"]:
        """Measured over predicted value, (f,) complex."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.data.value / self.predicted

    @property
    def clear(self) -> Bool[np.ndarray, " point"]:
        """Whether the uncertainty of each point is below `NOISY` of its value; all if none is."""
        with np.errstate(invalid="ignore"):
            clear = ~(self.data.uncertainty > NOISY * np.abs(self.data.value))
        return np.isfinite(self.ratio) & (clear | ~clear.any())

    @property
    def median(self) -> float:
        """Median magnitude of the ratio; NaN where the model has no response."""
        size = np.abs(self.ratio)
        return float(np.median(size[np.isfinite(size)])) if np.isfinite(size).any() else np.nan

    @property
    def extreme(self) -> tuple[float, float]:
        """Magnitude of the clear ratio farthest from 1 (in its logarithm), and its frequency."""
        size = np.abs(self.ratio)
        with np.errstate(divide="ignore"):
            far = np.where(self.clear, np.abs(np.log(size)), -1.0)
        n = int(np.argmax(far))
        return float(size[n]), float(self.data.frequency[n])

    @property
    def chi_squared(self) -> float:
        """Chi^2 per number (real and imaginary parts); NaN without uncertainties."""
        sigma = self.data.uncertainty
        known = np.isfinite(sigma) & (sigma > 0)
        if not known.any():
            return np.nan
        off = np.abs(self.data.value - self.predicted)[known] / sigma[known]
        return float(np.mean(off**2) / 2)

    @property
    def shift(self) -> Array:
        """Relative distance of measured resonances from those of the model, (p,)."""
        return self.peak / self.pole - 1


@dataclass(frozen=True)
class ComparedResponse(Response):
    """Responses with the measured transfer functions that they are compared with."""

    measured: tuple[Comparison, ...] = ()


def read_files(
    files: Sequence[str], inputs: Sequence[str], outputs: Sequence[str]
) -> tuple[Item, ...]:
    """Read files of measurements (TOML), and bare files of data from one input to one output."""
    return tuple(_read(file, inputs, outputs) for file in files)


def _read(file: str, inputs: Sequence[str], outputs: Sequence[str]) -> Item:
    """Read one file; raises `InputError`."""
    if Path(file).suffix.lower() == ".toml":
        given = tables.read(file)
        if not given.transfer_function:
            remedy = "add one (docs/measurements.md), or name a file of data"
            raise InputError([Fault("", "has no [[transfer_function]]", remedy)], file)
        return Item(given, Channels.of(given, read.read_all(given, file)), file)
    if not Path(file).is_file():
        problem = "is a directory" if Path(file).is_dir() else "is missing"
        raise InputError([Fault("", problem, "name a file of measurements")], file)
    if len(inputs) != 1 or len(outputs) != 1:
        problem = "does not say what was driven and observed"
        remedy = "give one --input and one --output, or a TOML file of measurements"
        raise InputError([Fault("--measured", problem, remedy, format_value(file))])
    found = read.read_bare(file, input=inputs[0], output=outputs[0])
    if len(found) > 1:
        problem = f"has {len(found)} transfer functions"
        remedy = "name channels in a TOML file of measurements (docs/measurements.md)"
        raise InputError([Fault("", problem, remedy)], file)
    return Item(Measured(), Channels.of(Measured(), found))


def signals(
    items: Sequence[Item], inputs: Sequence[str], outputs: Sequence[str]
) -> tuple[list[str], list[str]]:
    """List all signals: those given, then those that the measurements refer to."""
    sides = [*outputs], [*inputs]
    for item in items:
        for side, names in zip(sides, item.channels.signal, strict=True):
            side += names
    return [*dict.fromkeys(sides[1])], [*dict.fromkeys(sides[0])]


def parse(item: Item, known: tuple[str, ...]) -> readings.Signals:
    """Find the signals of a file; raises `InputError`, in that file, if the design lacks one."""
    with attribute_faults_to(item.file) if item.file else nullcontext():
        return readings.parse(item.channels, item.tables, known)


def default_grid(items: Sequence[Item]) -> Array:
    """2000 frequencies that cover all measurements and a little more, Hz."""
    above = [one.frequency[one.frequency > 0] for item in items for one in item.channels.function]
    low = min((float(f[0]) for f in above if len(f)), default=0.1)
    high = max((float(f[-1]) for f in above if len(f)), default=100.0)
    return np.geomspace(low / 1.2, high * 1.2, 2000)


def compare(
    model: LinearSystem,
    items: Sequence[Item],
    found: Response,
    closed: tuple[ClosedTransfer, Poles] | None = None,
) -> tuple[Comparison, ...]:
    """Compare measured transfer functions with the responses of a model.

    `found` are the responses of all signals on a grid. For closed loops, `closed` solves them, and
    has the poles.
    """
    known = bodies_with_signals(model)
    plain = replace(model, terms=())  # with dampers, whose effect on poles losses do not have
    modes = damped.solve(plain)
    squared = np.where(modes.frequency > 0, modes.omega_squared, np.inf)
    result = []
    for item in items:
        channels, (out, into) = item.channels, parse(item, known)
        rows = [found.output.index(name) for name in channels.signal[0]]
        columns = [found.input.index(name) for name in channels.signal[1]]
        curves = channels.combine(found.value[:, rows][:, :, columns], found.frequency)
        static = np.abs(readings.residues(channels, (out, into), model, modes) / squared)
        for data, own, (sensor, actuator) in zip(
            channels.function, static, channels.pairs, strict=True
        ):
            at, transfer = data.frequency, Transfer([*into], [*out], data.frequency)
            if closed is None:
                poles = np.flatnonzero(own > RESIDUE * own.max(initial=0.0))
                pole, label = modes.frequency[poles], [modes.label[n] for n in poles]
                q = modes.q[poles]
            else:
                transfer = replace(closed[0], inputs=[*into], outputs=[*out])
                resonant = np.abs(closed[1].q) > 0.5
                pole, q = closed[1].frequency[resonant], np.abs(closed[1].q[resonant])
                label = ["closed loop"] * len(pole)
            peaks = np.array([peak.frequency for peak in find_peaks(data)])
            paired = _pair(peaks, pole, pole * (MODEL_ERROR + 1 / (2 * q)))
            result.append(
                Comparison(
                    data,
                    channels.combine(transfer.values(model, at), at)[:, sensor, actuator],
                    found.frequency,
                    curves[:, sensor, actuator],
                    peaks,
                    np.append(pole, np.nan)[paired],
                    tuple([*label, ""][n] for n in paired),
                )
            )
    return tuple(result)


def _pair(peak: Array, pole: Array, width: Array) -> list[int]:
    """Number of the mode of each peak, one to one with the least sum of distances; -1 if none."""
    from scipy.optimize import linear_sum_assignment

    distance = np.abs(peak[:, None] - pole) / width
    cost = np.pad(
        np.minimum(distance, FARTHEST), ((0, 0), (0, len(peak))), constant_values=FARTHEST
    )
    chosen = linear_sum_assignment(cost)[1]
    return [n if row[n] < FARTHEST else -1 for n, row in zip(chosen.tolist(), cost, strict=True)]


def slip(one: Comparison) -> str:
    """Describe a ratio of measured to modelled magnitudes that suggests wrong units; "" if none."""
    median = one.median
    if not np.isfinite(median) or median == 0 or 1 / SLIP < median < SLIP:
        return ""
    factor = 10.0 ** round(np.log10(median))
    unit = UNITS.get(factor)
    advice = f"is the file in {unit}? then " if unit else "check units and gains: "
    return (
        f"{one.data.name}: measured magnitudes are {median:.3g} times those of the model (median);"
        f" {advice}set gain = {1 / factor:g} in its [[transfer_function]]"
    )
