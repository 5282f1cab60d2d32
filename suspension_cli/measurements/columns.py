"""Columns of numbers: which are frequency, value or coherence, and in what units."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.csv_columns import PER_HZ, BadTable, split_unit
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import TransferFunction
from suspension_cli.errors import Fault, InputError, format_value

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

ROLES = ("frequency", "real", "imaginary", "magnitude", "phase", "value", "coherence")
"""Keys of `TransferFunction` that name columns; `uncertainty` may be a number too."""

_WORDS = {
    "frequency": ("f", "freq", "frequency", "frequencies", "hz", "omega"),
    "real": ("re", "real"),
    "imaginary": ("im", "imag", "imaginary"),
    "magnitude": ("mag", "magnitude", "abs", "amplitude", "gain", "db"),
    "phase": ("phase", "deg", "arg", "angle"),
    "value": ("value", "h", "tf"),
    "coherence": ("coh", "coherence"),
    "uncertainty": ("sigma", "uncertainty", "err", "error", "std"),
}
_UNITS = {
    "frequency": ("frequency_unit", {"rad": "rad/s", "omega": "rad/s"}),
    "magnitude": ("magnitude_unit", {"db": "dB"}),
    "phase": ("phase_unit", {"rad": "rad", "radians": "rad"}),
}


@dataclass(frozen=True)
class Columns:
    """Named columns of numbers of one file.

    Attributes
    ----------
    names
        Headings, or names of datasets; numbers from 1 where a text has no headings.
    read
        Returns the column of a position in `names`.
    place
        Name of a row (from 0) in messages: ``line 7``.
    numbered
        Whether columns may be given by number.
    headed
        Whether `names` are headings, from which columns can be recognised.
    noun
        Name of a column in messages.
    """

    names: list[str]
    read: Callable[[int], np.ndarray]
    place: Callable[[int], str]
    numbered: bool = True
    headed: bool = True
    noun: str = "column"

    def find(self, key: str, wanted: str | int) -> int:
        """Return the position of a column given by heading or number; raises `InputError`."""
        if isinstance(wanted, int) and self.numbered:
            if 1 <= wanted <= len(self.names):
                return wanted - 1
            remedy = f"the file has columns 1 to {len(self.names)}"
        elif wanted in self.names:
            return self.names.index(str(wanted))
        elif not self.headed:
            remedy = f"it has no headings: give a number from 1 to {len(self.names)}"
        else:
            remedy = suggest(str(wanted), self.names)
        raise InputError.of(key, f"names no {self.noun}", remedy, format_value(wanted))


def recognise(names: list[str]) -> dict[str, str]:
    """Recognise columns and their units by headings.

    Returns
    -------
    dict
        Headings by key of `TransferFunction`; units by ``magnitude_unit``, ...

    Examples
    --------
    >>> recognise(["freq [Hz]", "mag_dB", "phase"])
    {'frequency': 'freq [Hz]', 'magnitude': 'mag_dB', 'magnitude_unit': 'dB', 'phase': 'phase'}
    """
    found: dict[str, str] = {}
    for name in names:
        words = [word for word in re.split(r"[^a-z]+", name.lower()) if word]
        role = next((r for word in words for r, known in _WORDS.items() if word in known), None)
        if role is None or role in found:
            continue
        found[role] = name
        key, units = _UNITS.get(role, ("", {}))
        unit = next((units[word] for word in words if word in units), None)
        if unit is not None:
            found[key] = unit
    return found


def choose(columns: Columns, table: TransferFunction) -> dict[str, int]:
    """Choose the columns that a table names, or those recognised by headings.

    Raises `InputError` if a column is missing or a needed one is not recognised.
    """
    given = {role: getattr(table, role) for role in ROLES if getattr(table, role) is not None}
    if isinstance(table.uncertainty, (str, int)):
        given["uncertainty"] = table.uncertainty
    chosen = {role: columns.find(role, wanted) for role, wanted in given.items()}
    if columns.headed:
        known = {k: v for k, v in recognise(columns.names).items() if not k.endswith("_unit")}
        taken = {*chosen.values()}
        pairs = ("real", "imaginary"), ("magnitude", "phase"), ("value",)
        complete = any(all(role in given for role in pair) for pair in pairs)
        started = next((pair for pair in pairs if any(role in given for role in pair)), ())
        for role, name in known.items():
            position = columns.names.index(name)
            of_value = role in ("real", "imaginary", "magnitude", "phase", "value")
            if role in chosen or position in taken or (of_value and complete):
                continue
            if of_value and started and role not in started:
                continue
            if role == "uncertainty" and table.uncertainty is not None:
                continue
            chosen[role] = position
    _check_chosen(columns, chosen)
    return chosen


def _check_chosen(columns: Columns, chosen: Mapping[str, int]) -> None:
    there = f"found here: {', '.join(columns.names)}" if columns.headed else "it has no headings"
    example = "frequency, real, imaginary" if columns.headed else "frequency = 1, real = 2, ..."
    if "frequency" not in chosen:
        raise InputError.of(
            "frequency",
            f"no {columns.noun} of frequencies is recognised ({there})",
            f"name the {columns.noun}s in a [[transfer_function]]: {example}",
        )
    for first, second in (("real", "imaginary"), ("magnitude", "phase")):
        for here, other in ((first, second), (second, first)):
            if here in chosen and other not in chosen and "value" not in chosen:
                raise InputError.of(
                    here,
                    f"a transfer function needs the {other}, too",
                    f"name its {columns.noun}: {other} = ... ({there})",
                    format_value(columns.names[chosen[here]]),
                )
    if not {"real", "magnitude", "value"} & {*chosen}:
        raise InputError.of(
            "real",
            f"no {columns.noun}s of values are recognised ({there})",
            f"name the {columns.noun}s in a [[transfer_function]]: {example}",
        )


def units(columns: Columns, table: TransferFunction) -> dict[str, str]:
    """Return the units of frequency, magnitude, phase: given, of headings, or Hz, 1, deg."""
    found = recognise(columns.names) if columns.headed else {}
    return {
        key: getattr(table, key) or found.get(key, default)
        for key, default in (
            ("frequency_unit", "Hz"),
            ("magnitude_unit", "1"),
            ("phase_unit", "deg"),
        )
    }


def read_points(columns: Columns, table: TransferFunction, unit: Mapping[str, str]) -> Points:
    """Read frequency, complex value, coherence and uncertainty of a transfer function.

    Raises `InputError` with the line of the first wrong number.
    """
    chosen = choose(columns, table)
    data = {role: np.asarray(columns.read(position)) for role, position in chosen.items()}
    lengths = {role: len(values) for role, values in data.items()}
    if len({*lengths.values()}) > 1:
        listed = ", ".join(f"{columns.names[chosen[role]]} {n}" for role, n in lengths.items())
        raise InputError.of("", f"lengths differ: {listed}", "give all one length")
    for role, values in data.items():
        _check_finite(values, columns, columns.names[chosen[role]])
        if role != "value" and np.iscomplexobj(values):
            name = format_value(columns.names[chosen[role]])
            fault = Fault(role, "the column holds complex numbers", "name it as value", name)
            raise InputError([fault])
    frequency = data["frequency"].astype(float)
    if unit["frequency_unit"] == "rad/s":
        frequency = frequency / (2 * np.pi)
    elif columns.headed and table.frequency_unit is None:
        frequency = frequency / _per_hertz(columns.names[chosen["frequency"]])
    sigma = data.get("uncertainty")
    if "value" in data and "real" not in data and "magnitude" not in data:
        value = data["value"].astype(complex)
    elif "real" in data and "imaginary" in data:
        value = data["real"] + 1j * data["imaginary"]
    else:
        value, sigma = _polar(data, sigma, columns, unit)
    unknown = np.full(len(frequency), np.nan)
    if sigma is not None and (sigma < 0).any():
        where = columns.place(int(np.argmax(sigma < 0)))
        raise InputError.of(where, "a standard deviation is negative", "correct it")
    coherence = data.get("coherence", unknown).astype(float)
    points = Points(frequency, value, unknown if sigma is None else sigma, coherence)
    check_points(points, columns.place)
    return points


def _per_hertz(heading: str) -> float:
    """Find the number per Hz of the unit in the heading of frequencies: "f (kHz)"; 1 for none."""
    try:
        return split_unit(heading, PER_HZ)[1]
    except BadTable as error:
        raise InputError.of("frequency", error.problem, error.remedy) from None


@dataclass(frozen=True)
class Points:
    """Numbers of a transfer function as in its file, frequency in Hz.

    Attributes
    ----------
    frequency, uncertainty, coherence : (f,) array
    value : (f,) complex array
    averages
        Number of averages, if the file says.
    """

    frequency: Float[np.ndarray, " frequency"]
    value: Complex[np.ndarray, " frequency"]
    uncertainty: Float[np.ndarray, " frequency"]
    coherence: Float[np.ndarray, " frequency"]
    averages: float | None = None


def check_points(points: Points, place: Callable[[int], str]) -> None:
    """Raise `InputError` unless frequencies ascend from 0 and coherences are within 0 to 1."""
    frequency, coherence = points.frequency, points.coherence
    if not len(frequency):
        raise InputError.of("", "has no points", "give a frequency and a value per line")
    if not np.isfinite(frequency).all():
        n = int(np.argmin(np.isfinite(frequency)))
        problem = f"the frequency {frequency[n]:g} Hz is not finite"
        raise InputError.of(place(n), problem, "remove the point or correct it")
    if (frequency < 0).any():
        n = int(np.argmax(frequency < 0))
        problem = f"the frequency {frequency[n]:g} Hz is negative"
        raise InputError.of(place(n), problem, "give frequencies from 0 up")
    wrong = np.flatnonzero(np.diff(frequency) <= 0)
    if len(wrong):
        n = int(wrong[0]) + 1
        equal = frequency[n] == frequency[n - 1]
        problem = "is given twice" if equal else f"follows {frequency[n - 1]:.10g} Hz"
        remedy = "remove one of them" if equal else "sort by ascending frequency"
        fault = Fault(place(n), f"the frequency {frequency[n]:.10g} Hz {problem}", remedy)
        raise InputError([fault])
    outside = (coherence < 0) | (coherence > 1 + 1e-6)
    if outside.any():
        n = int(np.argmax(outside))
        problem = f"the coherence {coherence[n]:g} is outside 0 to 1"
        raise InputError.of(place(n), problem, "name another column, or correct it")


def _check_finite(values: np.ndarray, columns: Columns, name: str) -> None:
    finite = np.isfinite(values)
    if not finite.all():
        n = int(np.argmin(finite))
        problem = f"{columns.noun} {format_value(name)} holds {values[n]}, which is not a number"
        raise InputError.of(columns.place(n), problem, "remove the point or correct it")


@np.errstate(over="ignore", invalid="ignore")  # such values are refused with the others
def _polar(
    data: Mapping[str, Float[np.ndarray, " frequency"]],
    sigma: Float[np.ndarray, " frequency"] | None,
    columns: Columns,
    unit: Mapping[str, str],
) -> tuple[Complex[np.ndarray, " frequency"], Float[np.ndarray, " frequency"] | None]:
    """Complex value from magnitude and phase, and its uncertainty in the same unit."""
    size, phase = data["magnitude"], data["phase"]
    far = np.abs(phase) > LARGEST_PHASE
    if far.any():
        n = int(np.argmax(far))
        problem = f"the phase {phase[n]:g} is beyond {LARGEST_PHASE:g}"
        raise InputError.of(columns.place(n), problem, "name the column of the phase")
    if unit["magnitude_unit"] == "dB":
        size = 10.0 ** (np.asarray(size) / 20)
        if sigma is not None:
            sigma = size * sigma * np.log(10) / 20
    elif (size < 0).any():
        n = int(np.argmax(size < 0))
        problem = f"the magnitude {size[n]:g} is negative"
        remedy = 'write magnitude_unit = "dB" if it is in decibels'
        raise InputError.of(columns.place(n), problem, remedy)
    angle = phase if unit["phase_unit"] == "rad" else np.deg2rad(phase)
    return size * np.exp(1j * angle), sigma


LARGEST_PHASE = 1e4
"""In deg or rad; a larger number is hardly a phase, even unwrapped."""
