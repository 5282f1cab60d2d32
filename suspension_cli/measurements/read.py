"""Read measured transfer functions from files of data.

The standard deviation of a magnitude, and of real and imaginary part, relative to the magnitude,
from n averages with coherence g^2 is sqrt((1 - g^2)/(2 n g^2)): Bendat and Piersol, Random Data,
chapter 9 (random errors of the gain factor of single-input, single-output systems).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.measured import Measured, TransferFunction
from suspension_cli.errors import InputError, attribute_faults_to, join_errors
from suspension_cli.files import bounded
from suspension_cli.files.hdf5 import is_results_file
from suspension_cli.measurements import columns, dtt, hdf5, text
from suspension_cli.measurements.columns import Columns, Points
from suspension_cli.measurements.dtt import Dtt
from suspension_cli.measurements.prediction import find_transducer
from suspension_cli.measurements.transfer_function import MeasuredResponse

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.design.measured import Transducer


def read_all(measured: Measured, file: str | Path) -> list[MeasuredResponse]:
    """Read all transfer functions of a file of measurements, in its order.

    Data files are named from the folder of `file`. Raises `InputError` with the faults of all.
    """
    found, errors, opened = [], [], {}
    for table, name in zip(measured.transfer_function, titles(measured), strict=True):
        try:
            one = _read(table, Path(file).parent, opened)
        except InputError as error:
            errors.append(error)
            continue
        found.append(replace_labels(one, name, unit_of_value(table, measured)))
    if errors:
        raise errors[0] if len(errors) == 1 else join_errors(errors)
    return found


def read_bare(
    path: str | Path, *, input: str = "", output: str = "", **keys: Any
) -> list[MeasuredResponse]:
    """Read a file of data without a file of measurements.

    Parameters
    ----------
    path
        CSV or text with headings such as ``f, re, im`` or ``frequency_hz, magnitude_db, phase``;
        HDF5 with such datasets; DTT XML.
    input, output
        Signals of the design; default for DTT: the channels.
    **keys
        Keys of `TransferFunction`: ``real="a"``, ``averages=20``, ``input_channel="H1:..."``.

    Returns
    -------
    list of MeasuredResponse
        One of a CSV or HDF5 file; all of a DTT file, unless channels are given.

    Raises
    ------
    InputError
        If the file is at fault, with its line or column.
    """
    path = Path(path)
    table = TransferFunction(file=path.name, input=input, output=output, **keys)
    with attribute_faults_to(str(path)):
        source = _open(path)
        if not keys and is_results_file(path):
            problem = "is a results file of pendsus, not a measurement"
            remedy = "compare it with pendsus compare DESIGN FILE"
            raise InputError.of("", problem, remedy)
        if not isinstance(source, Dtt) or table.input_channel or table.output_channel:
            return [_read(table, path.parent, {path: source})]
        pairs = source.pairs or [("", "")]  # none: the fault is found below
        return [
            MeasuredResponse(
                f"{path.stem}: {out} / {into}" if len(pairs) > 1 else path.stem,
                input or into,
                output or out,
                *_calibrated(source.points(into or None, out or None), table),
                file=str(path),
            )
            for into, out in pairs
        ]


def titles(measured: Measured) -> list[str]:
    """Name all transfer functions distinctly: as given, else by the stem of the file."""
    plain = [one.name or Path(one.file).stem for one in measured.transfer_function]
    return [
        f"{name} {table.output}/{table.input}" if plain.count(name) > 1 else name
        for name, table in zip(plain, measured.transfer_function, strict=True)
    ]


def replace_labels(one: MeasuredResponse, name: str, unit: str) -> MeasuredResponse:
    """Return a transfer function under another name, with its unit."""
    import dataclasses

    return dataclasses.replace(one, name=name, unit=unit)


def _read(
    table: TransferFunction, folder: Path, opened: dict[Path, Columns | Dtt]
) -> MeasuredResponse:
    path = folder / table.file
    with attribute_faults_to(str(path)):
        if path not in opened:
            opened[path] = _open(path)
        source = opened[path]
        if isinstance(source, Dtt):
            points = source.points(table.input_channel, table.output_channel)
        else:
            _refuse_channels(table)
            points = columns.read_points(source, table, columns.units(source, table))
        return MeasuredResponse(
            table.name or Path(table.file).stem,
            table.input,
            table.output,
            *_calibrated(points, table),
            unit=unit_of_value(table, Measured()),
            file=str(path),
        )


def _open(path: Path) -> Columns | Dtt:
    begin = bounded.read_head(path, 512, "a file of data")
    if not begin.strip():
        raise InputError.of("", "is empty", "give a frequency and a value per line")
    if begin.startswith(b"\x89HDF") or path.suffix.lower() in (".h5", ".hdf5", ".hdf"):
        return hdf5.read(path)
    xml = begin.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<")
    if xml or begin.startswith(b"\x1f\x8b") or path.suffix.lower() == ".xml":
        return dtt.read(path)
    return text.read(path)


def _refuse_channels(table: TransferFunction) -> None:
    for key in ("input_channel", "output_channel"):
        if getattr(table, key) is not None:
            remedy = "remove it, and name columns or datasets"
            problem = "is for XML of the diagnostics test tools, which this file is not"
            raise InputError.of(key, problem, remedy, getattr(table, key))


@np.errstate(over="ignore", invalid="ignore")  # such values are refused
def _calibrated(
    points: Points, table: TransferFunction
) -> tuple[
    Float[np.ndarray, " frequency"],
    Complex[np.ndarray, " frequency"],
    Float[np.ndarray, " frequency"],
    Float[np.ndarray, " frequency"],
]:
    """Frequency, value, uncertainty and coherence in the band, SI."""
    frequency, value = points.frequency, table.gain * points.value
    sigma, coherence = abs(table.gain) * points.uncertainty, points.coherence
    averages = table.averages or points.averages
    if isinstance(table.uncertainty, float):
        sigma = table.uncertainty * np.abs(value)
    elif averages is not None and np.isnan(sigma).all():
        sigma = np.abs(value) * relative_uncertainty(coherence, averages)
    if table.band is not None:
        low, high = table.band
        kept = (frequency >= low) & (frequency <= high)
        if not kept.any():
            problem = f"no point lies in the band {low:g} to {high:g} Hz"
            remedy = f"the file has {frequency[0]:.4g} to {frequency[-1]:.4g} Hz"
            raise InputError.of("band", problem, remedy)
        frequency, value, sigma, coherence = (
            values[kept] for values in (frequency, value, sigma, coherence)
        )
    if not len(frequency):
        raise InputError.of("", "has no points above 0 Hz", "measure again")
    usable = np.abs(value) < LARGEST  # false for NaN, too
    if not usable.all():
        problem = f"the value at {frequency[~usable][0]:.6g} Hz is no number below {LARGEST:g}"
        raise InputError.of("", problem, 'leave it out with a "band"')
    return frequency, value, sigma, coherence


LARGEST = 1e100
"""Largest value of a transfer function: squares and ratios of larger ones overflow."""


def relative_uncertainty(
    coherence: Float[np.ndarray, " frequency"], averages: float
) -> Float[np.ndarray, " frequency"]:
    """Standard deviation of real and imaginary part relative to the magnitude.

    Parameters
    ----------
    coherence : (f,) array
        g^2, from 0 to 1.
    averages
        Number of independent averages.

    Returns
    -------
    (f,) array
        sqrt((1 - g^2)/(2 n g^2)); infinite without coherence, NaN for a coherence of 1 to single
        precision: the noise is unknown.

    Examples
    --------
    >>> relative_uncertainty([0.5], 50).tolist()
    [0.1]
    """
    square = np.asarray(coherence, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = np.sqrt((1 - square) / (2 * averages * square))
    return np.where(square < 1 - 1e-7, sigma, np.nan)


def unit_of_value(table: TransferFunction, measured: Measured) -> str:
    """Unit of the value; "" if a signal is unknown."""
    into = _unit_of(table.input, measured.actuator)
    out = _unit_of(table.output, measured.sensor)
    return f"{out}/({into})" if " " in into else f"{out}/{into}" if into and out else ""


def _unit_of(name: str, among: Sequence[Transducer]) -> str:
    found = find_transducer(name, among)
    if found.unit is not None:
        return found.unit
    motion = found.signal.partition("@")[0].rpartition(".")[2]
    kind, _, dof = motion.rpartition("_")
    angular = dof in DOFS[3:]
    if dof not in DOFS:
        return ""
    return ("N m" if angular else "N") if kind else ("rad" if angular else "m")
