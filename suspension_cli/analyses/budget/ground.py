"""Motion of the support: models of ground noise, platforms, tables of the user.

Peterson's new low and high noise models (J. Peterson, Observations and modeling of seismic
background noise, U.S. Geological Survey Open-File Report 93-322 (1993), Tables 3 and 4) bound the
spectra of a world-wide network of seismic stations. The power spectral density of acceleration in
dB relative to 1 (m/s^2)^2/Hz is A + B log10(T) for periods T from 0.1 s to 10^5 s; the amplitude of
displacement follows by (2 pi f)^-2. Above 10 Hz, where the models end, the acceleration at 10 Hz is
used, so that displacement falls as f^-2.

Shipped models are CSV files beside this module, with their sources: `aligo-isi` (also called
`aligo-bsc`) is the platform of Advanced LIGO's quadruple suspensions, `aligo-ham` that of its
triple and double suspensions. They are read like tables of the user. Between points lines are
straight in a log-log plot (gwinc uses cubic polynomials).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.csv_columns import PER_HZ, PER_M, PER_RAD, BadTable, split_unit
from suspension_cli.design.faults import suggest
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.measurements import text as text_files
from suspension_cli.measurements.columns import Columns, recognise
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

PERIODS = (0.1, 1e5)
"""Shortest and longest period of both, s."""
FOLDER = Path(__file__).parent
"""Folder of the shipped models."""
UNITS = {"m": PER_M, "rad": PER_RAD, "1": {"1": 1.0, "m/m": 1.0, "rad/rad": 1.0, "%": 100.0}}
"""Units by kind of a column, without "per sqrt(Hz)"; 1 for ratios."""
PER_ROOT_HZ = r"\s*(/\s*(sqrt\s*\(?Hz\)?|rtHz|\u221aHz|Hz\^\(?(1/2|0\.5)\)?)|Hz\^\(?-(1/2|0\.5)\)?)"
NONE = "none"
TRANSLATIONS = DOFS[:3]


@dataclass(frozen=True)
class Motion:
    """Spectrum of one motion of the support.

    Attributes
    ----------
    low, high : float
        Range of frequencies, Hz.
    corner : (n,) array
        Frequencies between which the spectrum is smooth, Hz.
    density : callable
        Amplitude spectral density (f,) at frequencies (f,), m/sqrt(Hz) or rad/sqrt(Hz).
    """

    name: str
    low: float
    high: float
    corner: Array
    density: Callable[[Array], Array]


def compute_peterson(model: Array, frequency: Array) -> Array:
    """Power spectral density (f,) of acceleration in dB, of a model at frequencies in Hz.

    Above 10 Hz it is that at 10 Hz.

    >>> float(round(compute_peterson(load_peterson("nlnm"), np.array([0.2]))[0], 1))
    -141.1
    """
    period = np.maximum(1 / np.asarray(frequency), PERIODS[0])
    row = np.searchsorted(model[:, 0], period * (1 + 1e-12), side="right") - 1
    return model[row, 1] + model[row, 2] * np.log10(period)


def _peterson(name: str, model: Array) -> Motion:
    def density(frequency: Array) -> Array:
        acceleration = 10 ** (compute_peterson(model, frequency) / 20)
        return acceleration / (2 * np.pi * frequency) ** 2

    return Motion(name, 1 / PERIODS[1], np.inf, 1 / model[::-1, 0], density)


def _of_table(name: str, at: Array, value: Array) -> Motion:
    return Motion(
        name,
        float(at[0]),
        float(at[-1]),
        at,
        lambda frequency: interpolate(frequency, at, value),
    )


def load_peterson(name: str) -> Float[np.ndarray, "line 3"]:
    """Load "nlnm" or "nhnm": period (s) from which a line is valid, A, B."""
    return np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=3)


def _shipped(name: str) -> dict[str, Motion]:
    name = {"aligo-bsc": "aligo-isi"}.get(name, name)
    if name in ("nlnm", "nhnm"):
        return dict.fromkeys(TRANSLATIONS, _peterson(name, load_peterson(name)))
    table = read_table(FOLDER / f"{name}.csv", "m")
    return {dof: _of_table(name, table.frequency, value) for dof, value in table.column.items()}


SHIPPED = ("nlnm", "nhnm", "aligo-isi", "aligo-bsc", "aligo-ham")
"""Names of shipped models."""


def parse(given: Sequence[str], isolation: Sequence[str], folder: Path) -> dict[str, Motion]:
    """Parse the given motions of the support by coordinate.

    Parameters
    ----------
    given : sequence of str
        ``SOURCE`` or ``COORDINATES=SOURCE``; later ones replace earlier ones. A source is a shipped
        model, a file, or ``none``.
    isolation : sequence of str
        Tables of a platform's transmissibility, likewise; each multiplies the motion.
    folder : Path
        Folder of the design, searched for files after the current one.
    """
    motions: dict[str, Motion] = {}
    for text in given:
        wanted, source = _split(text, "--ground")
        if source.lower() == NONE:
            for dof in wanted or DOFS:
                motions.pop(dof, None)
            continue
        if source.lower() in SHIPPED:
            found = _shipped(source.lower())
        else:
            at, columns = _read(source, folder, wanted, TRANSLATIONS, "--ground", SHIPPED)
            found = {dof: _of_table(source, at, value) for dof, value in columns.items()}
        lacking = [dof for dof in wanted if dof not in found]
        if lacking:
            problem = f"has no {lacking[0]}: it gives {', '.join(found)}"
            remedy = "give a CSV file with this column, in rad/sqrt(Hz) for rotations"
            raise InputError([Fault("--ground", problem, remedy, format_value(text))])
        motions |= {dof: found[dof] for dof in wanted or found}
    for text in isolation:
        wanted, source = _split(text, "--isolation")
        at, columns = _read(source, folder, wanted, tuple(motions), "--isolation", ())
        for dof, value in columns.items():
            if dof in motions and dof in (wanted or columns):
                motions[dof] = _isolated(motions[dof], _of_table(source, at, value))
    return {dof: motions[dof] for dof in DOFS if dof in motions}


def _isolated(motion: Motion, platform: Motion) -> Motion:
    return replace(
        motion,
        name=f"{motion.name} x {platform.name}",
        low=max(motion.low, platform.low),
        high=min(motion.high, platform.high),
        corner=np.union1d(motion.corner, platform.corner),
        density=lambda frequency: motion.density(frequency) * platform.density(frequency),
    )


def _split(text: str, option: str) -> tuple[list[str], str]:
    """Split ``x,y=SOURCE`` into coordinates ([] if not given) and source."""
    names, equals, source = text.partition("=")
    if not equals:
        return [], text.strip()
    wanted = [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in DOFS:
            remedy = suggest(name, list(DOFS)) + "; write for example z=site.csv"
            raise InputError(
                [Fault(option, "names no motion of the support", remedy, format_value(text))]
            )
    return wanted, source.strip()


def find(source: str, folder: Path, option: str, known: Sequence[str] = ()) -> Path:
    """Find a file in the current folder or in that of the design; raises `InputError`."""
    for path in (Path(source), folder / source):
        if os.path.isfile(path):  # False for names that are too long, too
            return path
    problem = "is no file" + (f" and no shipped model ({', '.join(known)})" if known else "")
    close = suggest(source, list(known))
    remedy = close if "did you mean" in close else "name a CSV file" + " or a model" * bool(known)
    raise InputError([Fault(option, problem, remedy, format_value(source))])


def _read(
    source: str,
    folder: Path,
    wanted: list[str],
    every: tuple[str, ...],
    option: str,
    known: tuple[str, ...],
) -> tuple[Array, dict[str, Array]]:
    """Read frequencies, and a column by coordinate, from a file.

    A single column without a coordinate is for those `wanted`, or for `every` one.
    """
    unit = "rad" if wanted and not {*wanted} & {*TRANSLATIONS} else "m"
    if option == "--isolation":
        unit = "1"
    found = read_table(find(source, folder, option, known), unit)
    names = list(found.column)
    if len(names) == 1 and names[0] not in DOFS:
        return found.frequency, dict.fromkeys(wanted or every, found.column[names[0]])
    for name in names:
        if name not in DOFS:
            remedy = suggest(name, list(DOFS)) + "; name columns x, y, z, roll, pitch, yaw"
            raise InputError(
                [Fault("", "names no motion of the support", remedy, format_value(name))],
                found.file,
            )
    lacking = [dof for dof in wanted if dof not in names]
    if lacking:
        problem = f"has no column {lacking[0]}"
        raise InputError([Fault("", problem, "add it, or leave it out")], found.file)
    return found.frequency, found.column


@dataclass(frozen=True)
class Table:
    """Columns of values, at least 0, against frequency (Hz, ascending, above 0).

    The only column of a file without names is "".
    """

    file: str
    frequency: Array
    column: dict[str, Array]


def read_table(path: Path, unit: str, strain: float = 0.0) -> Table:
    """Read a table of spectra: frequency, then one or more columns (format: `measurements.text`).

    Headings are optional for two columns, and may give units: "f (mHz)", "x (um/sqrt(Hz))".

    Parameters
    ----------
    unit
        SI unit of columns: "m" (coordinates that are rotations have "rad"), "rad", or "1".
    strain
        Length (m) of which columns with the unit "strain" give the fraction; 0 if unknown.

    Raises
    ------
    InputError
        With the line at fault.
    """
    with attribute_faults_to(str(path)):
        columns = text_files.read(path)
        width = len(columns.names)
        if width < 2:
            problem, remedy = "has one column", "write a frequency and a value per line"
            raise InputError([Fault("", problem, remedy)])
        if not columns.headed and width > 2:
            problem = f"has {width} columns without headings"
            raise InputError([Fault("", problem, "begin with a line such as frequency,x,y,z")])
        known = recognise(columns.names) if columns.headed else {}
        if "frequency_unit" in known:
            raise InputError([Fault("", "has frequencies in rad/s", "give them in Hz")])
        first = columns.names.index(known.get("frequency", columns.names[0]))
        titles = columns.names if columns.headed else ["frequency", ""]
        names, scales = zip(
            *(
                _split_title(title, "Hz" if n == first else unit, strain)
                for n, title in enumerate(titles)
            ),
            strict=True,
        )
        for n, name in enumerate(names):
            if name in names[:n]:
                remedy = "give each column a heading of its own"
                raise InputError([Fault("", "has two columns of one name", remedy, name)])
        order = [first, *(n for n in range(width) if n != first)]
        names = [names[n] for n in order]
        values = [np.asarray(columns.read(n)) for n in order]
        _check(np.array(values).T, columns)
        values = [value / scales[n] for n, value in zip(order, values, strict=True)]
        return Table(str(path), values[0], dict(zip(names[1:], values[1:], strict=True)))


def _split_title(title: str, unit: str, strain: float) -> tuple[str, float]:
    """Split a heading into its name, in lower case, and its unit, as the number per SI unit."""
    if unit == "Hz":
        units = PER_HZ
    else:
        title = re.sub(PER_ROOT_HZ, "", title) if unit != "1" else title
        units = UNITS["rad" if unit == "m" and title.lower().startswith(DOFS[3:]) else unit]
        units = units | {"strain": 1 / strain} if strain and unit == "m" else units
    try:
        name, scale = split_unit(title, units)
    except BadTable as error:
        per = " per sqrt(Hz)" if unit in ("m", "rad") else ""
        raise InputError.of("", error.problem, error.remedy + per) from None
    return name.lower(), scale


def _check(rows: Inexact[np.ndarray, "line column"], columns: Columns) -> None:
    """Raise `InputError` for the first line whose frequency or values are at fault."""
    finite = np.isfinite(rows).all(1) & ~np.iscomplex(rows).any(1)
    real = np.real(rows)
    frequency, ascending = real[:, 0], np.diff(real[:, 0], prepend=-np.inf) > 0
    for good, problem, remedy, shown in (
        (finite, "contains something that is no finite number", "remove the line", None),
        (frequency > 0, "has no positive frequency", "give it in Hz", frequency),
        (
            ascending,
            "frequency is not above that of the line before",
            "sort the lines by frequency, each once",
            frequency,
        ),
        (
            (real[:, 1:] >= 0).all(1),
            "has a negative value",
            "give amplitude spectral densities, not dB: 10^(dB/20)",
            real[:, 1:].min(1),
        ),
    ):
        if not good.all():
            n = int(np.argmin(good))
            value = None if shown is None else format_value(float(shown[n]))
            raise InputError([Fault(columns.place(n), problem, remedy, value)])


def interpolate(frequency: Array, at: Array, value: Array) -> Array:
    """Interpolate a spectrum (n,) at frequencies (f,) by power laws, linearly next to a 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.exp(np.interp(np.log(frequency), np.log(at), np.log(value)))
    straight = np.interp(frequency, at, value)
    positive = np.interp(frequency, at, (value == 0).astype(float)) == 0
    return np.where(positive, log, straight)
