"""Read measured transfer functions from files of data: text, HDF5, DTT XML.

The standard deviation of a magnitude, and of real and imaginary part, relative to the magnitude,
from n averages with coherence g^2 is sqrt((1 - g^2)/(2 n g^2)): Bendat and Piersol, Random Data,
chapter 9 (random errors of the gain factor of single-input, single-output systems).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.measured import Measured, TransferFunction
from suspension_cli.errors import InputError, attribute_faults_to, format_value, join_errors
from suspension_cli.files import bounded, columns
from suspension_cli.files.columns import WORDS, Columns
from suspension_cli.files.hdf5 import is_results_file, open_data
from suspension_cli.measurements import dtt
from suspension_cli.measurements.dtt import Dtt
from suspension_cli.measurements.transfer_function import MeasuredResponse, find_transducer

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.design.measured import Transducer
    from suspension_cli.files.hdf5 import Stored

    Values = Float[np.ndarray, " frequency"]

LARGEST = 1e100
"""Largest value of a transfer function: squares and ratios of larger ones overflow."""
LARGEST_PHASE = 1e4
"""In deg or rad; a larger number is hardly a phase, even unwrapped."""
PAIRS = (("real", "imaginary"), ("magnitude", "phase"), ("value",))
"""Keys of the columns that give the complex value."""


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
        found.append(replace(one, name=name, unit=unit_of_value(table, measured)))
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
                *_values(source.columns(into or None, out or None), table),
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


def _read(
    table: TransferFunction, folder: Path, opened: dict[Path, Columns | Dtt]
) -> MeasuredResponse:
    path = folder / table.file
    with attribute_faults_to(str(path)):
        if path not in opened:
            opened[path] = _open(path)
        source = opened[path]
        if isinstance(source, Dtt):
            source = source.columns(table.input_channel, table.output_channel)
        else:
            _refuse_channels(table)
        return MeasuredResponse(
            table.name or Path(table.file).stem,
            table.input,
            table.output,
            *_values(source, table),
            unit=unit_of_value(table, Measured()),
            file=str(path),
        )


def _open(path: Path) -> Columns | Dtt:
    begin = bounded.read_head(path, 512, "a file of data")
    if not begin.strip():
        raise InputError.of("", "is empty", "give a frequency and a value per line")
    if begin.startswith(b"\x89HDF") or path.suffix.lower() in (".h5", ".hdf5", ".hdf"):
        return read_hdf5(path)
    xml = begin.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<")
    if xml or begin.startswith(b"\x1f\x8b") or path.suffix.lower() == ".xml":
        return dtt.read(path)
    return columns.read(path)


def _refuse_channels(table: TransferFunction) -> None:
    for key in ("input_channel", "output_channel"):
        if getattr(table, key) is not None:
            remedy = "remove it, and name columns or datasets"
            problem = "is for XML of the diagnostics test tools, which this file is not"
            raise InputError.of(key, problem, remedy, getattr(table, key))


def read_hdf5(path: Path) -> Columns:
    """List the one-dimensional datasets of numbers of a file, by their paths.

    Complex numbers are compounds of two numbers, as h5py and MATLAB write them. A series with
    attributes ``x0`` and ``dx``, as gwpy writes a FrequencySeries, also gives a column
    ``frequency`` and, if it is the only dataset, ``value``. Raises `InputError` if the file is not
    HDF5 or has no such dataset.
    """
    import h5py

    names: list[str] = []
    series: list[tuple[str, float, float]] = []

    def visit(name: str, item: Stored) -> None:
        if isinstance(item, h5py.Dataset) and item.size and max(item.shape, default=0) == item.size:
            names.append(name)
            if {"x0", "dx"} <= set(item.attrs):
                start, step = (_attribute(name, key, item.attrs[key]) for key in ("x0", "dx"))
                series.append((name, start, step))

    with open_data(path) as file:
        file.visititems(visit)
    if not names:
        problem = "has no one-dimensional dataset"
        raise InputError.of("", problem, "write frequency and value as datasets")

    stored = list(names)
    if series and "frequency" not in names:
        names += ["frequency", "value"] if len(stored) == 1 else ["frequency"]
        stored += [series[0][0]] * (len(names) - len(stored))

    def column(position: int) -> np.ndarray:
        with open_data(path) as file:
            values = np.asarray(file[stored[position]]).ravel()
        if names[position] == "frequency" and stored[position] != "frequency":
            return series[0][1] + series[0][2] * np.arange(len(values))
        if values.dtype.names and len(values.dtype.names) == 2:
            first, second = values.dtype.names
            values = values[first] + 1j * values[second]
        if values.dtype.kind not in "iufc":
            problem = f"dataset holds {values.dtype}, not numbers"
            raise InputError.of("", problem, "name another", format_value(names[position]))
        return values

    return Columns(names, column, lambda n: f"element {n}", noun="dataset")


def _attribute(name: str, key: str, value: Stored) -> float:
    """Return the attribute of a series as a number; raises `InputError` for anything else."""
    values = np.asarray(value)
    if values.size != 1 or values.dtype.kind not in "iuf":
        raise InputError.of(f"{name}.{key}", "must be one number", "write it as one, in Hz")
    return float(values.item())


def choose(source: Columns, table: TransferFunction) -> dict[str, int]:
    """Choose the columns that a table names, or those recognised by headings.

    Raises `InputError` if a column is missing or a needed one is not recognised.
    """
    named = {role: getattr(table, role) for role in WORDS}
    named = {role: one for role, one in named.items() if one is not None}
    chosen = {
        role: source.find(role, one) for role, one in named.items() if not isinstance(one, float)
    }
    given = [pair for pair in PAIRS if any(role in named for role in pair)]
    complete = any(all(role in named for role in pair) for pair in given)
    for role, position in columns.recognise(source.names if source.headed else []).items():
        other = role in sum(PAIRS, ()) and (complete or (given and role not in given[0]))
        if role not in named and position not in chosen.values() and not other:
            chosen[role] = position
    there = f"found here: {', '.join(source.names)}" if source.headed else "it has no headings"
    example = "frequency, real, imaginary" if source.headed else "frequency = 1, real = 2, ..."
    naming = f"name the {source.noun}s in a [[transfer_function]]: {example}"
    if "frequency" not in chosen:
        problem = f"no {source.noun} of frequencies is recognised ({there})"
        raise InputError.of("frequency", problem, naming)
    for first, second in PAIRS[:2]:
        for here, other in ((first, second), (second, first)):
            if here in chosen and other not in chosen and "value" not in chosen:
                problem = f"a transfer function needs the {other}, too"
                remedy = f"name its {source.noun}: {other} = ... ({there})"
                shown = format_value(source.names[chosen[here]])
                raise InputError.of(here, problem, remedy, shown)
    if not {"real", "magnitude", "value"} & {*chosen}:
        problem = f"no {source.noun}s of values are recognised ({there})"
        raise InputError.of("real", problem, naming)
    return chosen


@np.errstate(over="ignore", invalid="ignore")  # such values are refused
def _values(
    source: Columns, table: TransferFunction
) -> tuple[Values, Complex[np.ndarray, " frequency"], Values, Values]:
    """Frequency, value, uncertainty and coherence in the band, SI.

    Raises `InputError` with the line of the first wrong number.
    """
    chosen = choose(source, table)
    lengths = {role: len(source.read(position)) for role, position in chosen.items()}
    if len({*lengths.values()}) > 1:
        listed = ", ".join(f"{source.names[chosen[role]]} {n}" for role, n in lengths.items())
        raise InputError.of("", f"lengths differ: {listed}", "give all one length")
    per_hertz = {"Hz": 1.0, "rad/s": 2 * np.pi, None: None}[table.frequency_unit]
    frequency = source.frequencies(chosen["frequency"], per_hertz)
    value, per_unit = _complex_value(source, table, chosen)
    coherence = sigma = np.full(len(frequency), np.nan)
    if "coherence" in chosen:
        coherence = source.numbers(
            chosen["coherence"], "coherence", 0.0, 1 + 1e-6, "name another column", finite=False
        )
    averages = table.averages or source.averages
    if isinstance(table.uncertainty, float):
        sigma = table.uncertainty * np.abs(value)
    elif "uncertainty" in chosen:
        sigma = per_unit * source.numbers(
            chosen["uncertainty"], "standard deviation", 0.0, finite=False
        )
    elif averages is not None:
        sigma = np.abs(value) * relative_uncertainty(coherence, averages)
    low, high = table.band or (0.0, np.inf)
    kept = (frequency >= low) & (frequency <= high)
    if not len(frequency):
        raise InputError.of("", "has no points above 0 Hz", "measure again")
    if not kept.any():
        problem = f"no point lies in the band {low:g} to {high:g} Hz"
        remedy = f"the file has {frequency[0]:.4g} to {frequency[-1]:.4g} Hz"
        raise InputError.of("band", problem, remedy)
    wrong = kept & ~(np.abs(value) < LARGEST)  # so of NaN, too
    if wrong.any():
        n = int(np.argmax(wrong))
        problem = f"the value at {frequency[n]:.6g} Hz is no number below {LARGEST:g}"
        raise InputError.of(source.place(n), problem, 'correct it, or leave it out with a "band"')
    return frequency[kept], table.gain * value[kept], abs(table.gain) * sigma[kept], coherence[kept]


def _complex_value(
    source: Columns, table: TransferFunction, chosen: dict[str, int]
) -> tuple[Complex[np.ndarray, " frequency"], Values | float]:
    """Value from its columns, and the factor from the unit of its uncertainty to that of it."""

    def read(role: str, *bounds: Any) -> Values:
        return source.numbers(chosen[role], role, *bounds, finite=False)

    if "magnitude" not in chosen and "real" not in chosen:
        return np.asarray(source.read(chosen["value"]), dtype=complex), 1.0
    if "real" in chosen and "imaginary" in chosen:
        return read("real") + 1j * read("imaginary"), 1.0
    headings = {
        role: columns.words(source.names[chosen[role]]) if source.headed else []
        for role in ("magnitude", "phase")
    }
    named = "rad" if {"rad", "radians"} & {*headings["phase"]} else "deg"
    phase = read("phase", -LARGEST_PHASE, LARGEST_PHASE, "name the column of the phase")
    phase = phase if (table.phase_unit or named) == "rad" else np.deg2rad(phase)
    if (table.magnitude_unit or ("dB" if "db" in headings["magnitude"] else "1")) == "dB":
        size = 10.0 ** (read("magnitude") / 20)
        return size * np.exp(1j * phase), size * np.log(10) / 20
    remedy = 'write magnitude_unit = "dB" if it is in decibels'
    return read("magnitude", 0.0, np.inf, remedy) * np.exp(1j * phase), 1.0


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
