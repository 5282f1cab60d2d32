"""Read measured transfer functions from files of data: text, HDF5, DTT XML.

The standard deviation of a magnitude, and of real and imaginary part, relative to the magnitude,
from n averages with coherence g^2 is sqrt((1 - g^2)/(2 n g^2)): Bendat and Piersol, Random Data,
chapter 9 (random errors of the gain factor of single-input, single-output systems).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.measured import Measured, TransferFunction
from suspension_cli.errors import InputError, attribute_faults_to, format_value, gather
from suspension_cli.files import columns, data_files
from suspension_cli.files.columns import WORDS, Columns
from suspension_cli.files.dtt import Dtt
from suspension_cli.files.hdf5 import is_results_file
from suspension_cli.measurements.transfer_function import MeasuredResponse, find_transducer

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    Values = Float[np.ndarray, " frequency"]

LARGEST = 1e100
"""Largest value of a transfer function: squares and ratios of larger ones overflow."""
UNITS = ("m", "rad"), ("N", "N m")
"""Of motions along and about an axis, and of forces and torques."""
LARGEST_PHASE = 1e4
"""In deg or rad; a larger number is hardly a phase, even unwrapped."""
FORMS = (("value",), ("real", "imaginary"), ("magnitude", "phase"))
"""Keys of the columns that give the complex value."""


def read_all(measured: Measured, file: str | Path) -> list[MeasuredResponse]:
    """Read all transfer functions of a file of measurements, in its order.

    Data files are named from the folder of `file`. Raises `InputError` with the faults of all.
    """
    opened = dict[Path, Columns | Dtt]()
    names = [one.name or Path(one.file).stem for one in measured.transfer_function]

    def read(table: TransferFunction) -> MeasuredResponse:
        path = Path(file).parent / table.file
        name = table.name or Path(table.file).stem
        with attribute_faults_to(str(path)):
            source = opened[path] = opened.get(path) or data_files.open_data_file(path)
            values = _values(_columns(source, table), table)
        if names.count(name) > 1:
            name = f"{name} {table.output}/{table.input}"
        unit = _unit_of_value(table, measured)
        return MeasuredResponse(name, table.input, table.output, *values, unit, str(path))

    return gather(read, measured.transfer_function)


def read_bare(path: str | Path, *, input: str = "", output: str = "") -> list[MeasuredResponse]:
    """Read a file of data without a file of measurements; one function, or all of a DTT file.

    Text has headings such as ``f, re, im`` or ``frequency_hz, magnitude_db, phase``, HDF5 such
    datasets. `input` and `output` are signals of the design; default for DTT: the channels. Raises
    `InputError` with the line or column at fault.
    """
    path = Path(path)
    table = TransferFunction(file=path.name, input=input, output=output)
    with attribute_faults_to(str(path)):
        source = data_files.open_data_file(path)
        if is_results_file(path):
            problem = "is a results file of pendsus, not a measurement"
            remedy = "compare it with pendsus compare DESIGN FILE"
            raise InputError.of("", problem, remedy)
        pairs = [*source.transfer] if isinstance(source, Dtt) else []
        found = []
        for into, out in pairs or [("", "")]:
            part = source if isinstance(source, Columns) else source.columns(into, out)
            name = f"{path.stem}: {out} / {into}" if len(pairs) > 1 else path.stem
            ends = (input or into, output or out)
            values = _values(part, table)
            unit = _unit_of_value(table, Measured())
            found.append(MeasuredResponse(name, *ends, *values, unit, str(path)))
        return found


def _columns(source: Columns | Dtt, table: TransferFunction) -> Columns:
    """Return the columns of one transfer function."""
    if isinstance(source, Dtt):
        return source.columns(table.input_channel, table.output_channel)
    for key in ("input_channel", "output_channel"):
        if getattr(table, key) is not None:
            remedy = "remove it, and name columns or datasets"
            problem = "is for XML of the diagnostics test tools, which this file is not"
            raise InputError.of(key, problem, remedy, getattr(table, key))
    return source


def _choose(source: Columns, table: TransferFunction) -> tuple[dict[str, int], tuple[str, ...]]:
    """Choose the columns that a table names, or those recognised by headings.

    Also returns the keys of the columns that give the value, one of `FORMS`. Raises `InputError`
    if a column is missing or a needed one is not recognised.
    """
    named = {role: getattr(table, role) for role in WORDS}
    chosen = {
        role: source.find(role, one) for role, one in named.items() if isinstance(one, (str, int))
    }
    headings = columns.recognise(source.names) if source.headed else {}
    known = columns.recognise_complex(source) | headings
    known = {role: n for role, n in known.items() if n not in chosen.values()} | chosen

    def rank(form: tuple[str, ...]) -> tuple[bool, ...]:
        named = any(role in chosen for role in form)
        complete = all(role in known for role in form)
        return named, complete, any(role in known for role in form)

    form = max(FORMS, key=rank)
    there = f"found here: {', '.join(source.names)}" if source.headed else "it has no headings"
    example = "frequency, real, imaginary" if source.headed else "frequency = 1, real = 2, ..."
    naming = f"name the {source.noun}s in a [[transfer_function]]: {example}"
    here = [role for role in form if role in known]
    if "frequency" not in known:
        problem = f"no {source.noun} of frequencies is recognised ({there})"
        raise InputError.of("frequency", problem, naming)
    if not here:
        problem = f"no {source.noun}s of values are recognised ({there})"
        raise InputError.of("real", problem, naming)
    for missing in set(form) - {*here}:
        problem = f"a transfer function needs the {missing}, too"
        remedy = f"name its {source.noun}: {missing} = ... ({there})"
        raise InputError.of(here[0], problem, remedy, format_value(source.names[known[here[0]]]))
    used = ("frequency", *form, "coherence", "uncertainty")
    return {role: known[role] for role in used if role in known}, form


@np.errstate(over="ignore", invalid="ignore")  # such values are refused
def _values(
    source: Columns, table: TransferFunction
) -> tuple[Values, Complex[np.ndarray, " frequency"], Values, Values]:
    """Frequency, value, uncertainty and coherence in the band, SI.

    Raises `InputError` with the line of the first wrong number.
    """
    chosen, form = _choose(source, table)
    lengths = {role: len(source.read(position)) for role, position in chosen.items()}
    if len({*lengths.values()}) > 1:
        listed = ", ".join(f"{source.names[chosen[role]]} {n}" for role, n in lengths.items())
        raise InputError.of("", f"lengths differ: {listed}", "give all one length")
    per_hertz = {"Hz": 1.0, "rad/s": 2 * np.pi, None: None}[table.frequency_unit]
    frequency = source.frequencies(chosen["frequency"], per_hertz)
    value, per_unit = _complex_value(source, table, chosen, form)
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
        sigma = np.abs(value) * _relative_uncertainty(coherence, averages)
    low, high = table.band or (0.0, np.inf)
    kept = (frequency >= low) & (frequency <= high)
    if not len(frequency):
        raise InputError.of("", "has no points above 0 Hz", "measure again")
    if not kept.any():
        problem = f"no point lies in the band {low:g} to {high:g} Hz"
        remedy = f"the file has {frequency[0]:.4g} to {frequency[-1]:.4g} Hz"
        raise InputError.of("band", problem, remedy)
    for n in np.flatnonzero(kept & ~(np.abs(value) < LARGEST))[:1]:  # so of NaN, too
        problem = f"the value at {frequency[n]:.6g} Hz is no number below {LARGEST:g}"
        raise InputError.of(source.place(n), problem, 'correct it, or leave it out with a "band"')
    return frequency[kept], table.gain * value[kept], abs(table.gain) * sigma[kept], coherence[kept]


def _complex_value(
    source: Columns, table: TransferFunction, chosen: dict[str, int], form: tuple[str, ...]
) -> tuple[Complex[np.ndarray, " frequency"], Values | float]:
    """Value from its columns, and the factor from the unit of its uncertainty to that of it."""

    def read(role: str, *bounds: Any) -> Values:
        return source.numbers(chosen[role], role, *bounds, finite=False)

    if "value" in form:
        return np.asarray(source.read(chosen["value"]), dtype=complex), 1.0
    if "real" in form:
        return read("real") + 1j * read("imaginary"), 1.0
    headings = [columns.words(source.names[chosen[role]]) * source.headed for role in form]
    is_db = "db" in headings[0]
    in_rad = not {"rad", "radians"}.isdisjoint(headings[1])
    phase = read("phase", -LARGEST_PHASE, LARGEST_PHASE, "name the column of the phase")
    phase_unit = table.phase_unit or ("rad" if in_rad else "deg")
    if phase_unit == "deg":
        phase = np.deg2rad(phase)
    magnitude_unit = table.magnitude_unit or ("dB" if is_db else "1")
    if magnitude_unit == "dB":
        size = 10.0 ** (read("magnitude") / 20)
        return size * np.exp(1j * phase), size * np.log(10) / 20
    remedy = 'write magnitude_unit = "dB" if it is in decibels'
    return read("magnitude", 0.0, np.inf, remedy) * np.exp(1j * phase), 1.0


def _relative_uncertainty(coherence: Values, averages: float) -> Values:
    """Standard deviation of real and imaginary part relative to the magnitude.

    Infinite without coherence; NaN for a coherence of 1 to single precision, where the noise is
    unknown.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = np.sqrt((1 - coherence) / (2 * averages * coherence))
    return np.where(coherence < 1 - 1e-7, sigma, np.nan)


def _unit_of_value(table: TransferFunction, measured: Measured) -> str:
    """Unit of the value; "" if a signal is unknown."""
    units = []
    for name, among in ((table.output, measured.sensor), (table.input, measured.actuator)):
        found = find_transducer(name, among)
        motion = found.signal.partition("@")[0].rpartition(".")[2]
        kind, _, dof = motion.rpartition("_")
        si = UNITS[bool(kind)][dof in DOFS[3:]] if dof in DOFS else ""
        units.append(si if found.unit is None else found.unit)
    out, into = units
    if " " in into:
        return f"{out}/({into})"
    return f"{out}/{into}" if into and out else ""
