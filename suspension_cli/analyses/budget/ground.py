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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.budget import table
from suspension_cli.conventions import DOFS
from suspension_cli.design.faults import suggest
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float

PERIODS = (0.1, 1e5)
"""Shortest and longest period of both, s."""
FOLDER = Path(__file__).parent
"""Folder of the shipped models."""
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
        lambda frequency: table.interpolate(frequency, at, value),
    )


def load_peterson(name: str) -> Float[np.ndarray, "line 3"]:
    """Load "nlnm" or "nhnm": period (s) from which a line is valid, A, B."""
    return np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=3)


def _shipped(name: str) -> dict[str, Motion]:
    model = {"aligo-bsc": "aligo-isi"}.get(name, name)
    if model in ("nlnm", "nhnm"):
        return dict.fromkeys(TRANSLATIONS, _peterson(name, load_peterson(name)))
    found = table.read(FOLDER / f"{model}.csv", "m")
    return {dof: _of_table(name, found.frequency, value) for dof, value in found.column.items()}


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
    found = table.read(find(source, folder, option, known), unit)
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
