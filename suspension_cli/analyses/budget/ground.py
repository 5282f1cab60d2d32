"""Motion of the support: models of ground noise, a platform, tables of the user.

Peterson's new low and high noise models (J. Peterson, Observations and modeling of seismic
background noise, U.S. Geological Survey Open-File Report 93-322 (1993), Tables 3 and 4) bound the
spectra of a world-wide network of seismic stations. The power spectral density of acceleration in
dB relative to 1 (m/s^2)^2/Hz is A + B log10(T) for periods T from 0.1 s to 10^5 s; the amplitude of
displacement follows by (2 pi f)^-2. Above 10 Hz, where the models end, the acceleration at 10 Hz is
used, so that displacement falls as f^-2.

The platform `aligo-isi` is the in-vacuum active platform of Advanced LIGO's quadruple suspensions,
from 0.01 to 300 Hz, as in the noise budget program gwinc (`seismic_BSC_ISI` in `gwinc/noise/
seismic.py`, "rough seismic noise spectra on aLIGO BSC ISI table"). Between its points gwinc uses
cubic polynomials; here lines are straight in a log-log plot.

The platform `aligo-ham` is that of the smaller chambers (HAM), below Advanced LIGO's triple and
double suspensions, from 0.001 to 1000 Hz: the table of LIGO's MATLAB function `seisHAM`, which
gives as its sources data in the electronic log of LIGO Hanford of 17 July 2008 and the preliminary
design review of the platform.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from suspension_cli.analyses.budget import table
from suspension_cli.analyses.budget.table import Table
from suspension_cli.conventions import DOFS
from suspension_cli.design.faults import suggest
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.scene.arrays import Array

NLNM = np.array(
    [
        (0.10, -162.36, 5.64),
        (0.17, -166.7, 0.0),
        (0.40, -170.0, -8.3),
        (0.80, -166.4, 28.9),
        (1.24, -168.6, 52.48),
        (2.40, -159.98, 29.81),
        (4.30, -141.1, 0.0),
        (5.00, -71.36, -99.77),
        (6.00, -97.26, -66.49),
        (10.0, -132.18, -31.57),
        (12.0, -205.27, 36.16),
        (15.6, -37.65, -104.33),
        (21.9, -114.37, -47.1),
        (31.6, -160.58, -16.28),
        (45.0, -187.5, 0.0),
        (70.0, -216.47, 15.7),
        (101.0, -185.0, 0.0),
        (154.0, -168.34, -7.61),
        (328.0, -217.43, 11.9),
        (600.0, -258.28, 26.6),
        (10000.0, -346.88, 48.75),
    ]
)
"""New low noise model: period (s) from which a line is valid, A, B."""
NHNM = np.array(
    [
        (0.10, -108.73, -17.23),
        (0.22, -150.34, -80.5),
        (0.32, -122.31, -23.87),
        (0.80, -116.85, 32.51),
        (3.80, -108.48, 18.08),
        (4.60, -74.66, -32.95),
        (6.30, 0.66, -127.18),
        (7.90, -93.37, -22.42),
        (15.4, 73.54, -162.98),
        (20.0, -151.52, 10.01),
        (354.8, -206.66, 31.63),
    ]
)
"""New high noise model, likewise."""
PERIODS = (0.1, 1e5)
"""Shortest and longest period of both, s."""
ISI = np.array(
    [
        (0.01, 3e-6, 1e-8),
        (0.03, 1e-6, 3e-8),
        (0.1, 2e-7, 2e-8),
        (0.2, 2e-7, 1e-8),
        (0.5, 8e-10, 4e-10),
        (1.0, 1e-11, 1e-11),
        (10.0, 3e-13, 3e-13),
        (30.0, 3e-14, 3e-14),
        (300.0, 3e-14, 3e-14),
    ]
)
"""Advanced LIGO's platform of test masses: Hz, m/sqrt(Hz) along, rad/sqrt(Hz) about each axis."""
HAM = np.array(
    [
        (1e-3, 1e-6, 1e-6, 1e-7, 1e-7),
        (0.1, 1e-6, 4e-7, 4e-8, 3e-7),
        (0.2, 5e-7, 3e-7, 2e-8, 4e-8),
        (0.3, 1e-7, 1e-7, 5e-9, 1e-8),
        (0.4, 3e-8, 3e-8, 3e-9, 4e-9),
        (0.5, 1e-8, 1e-8, 1e-9, 2e-9),
        (0.6, 2e-9, 2e-9, 8e-10, 8e-10),
        (0.7, 4e-10, 2e-10, 8e-11, 1e-10),
        (0.8, 5e-10, 3e-10, 1e-10, 2e-10),
        (1.0, 3e-10, 4e-10, 8e-11, 1.5e-10),
        (1.4, 6e-11, 1e-10, 1.5e-11, 4e-11),
        (2.0, 2e-11, 3e-11, 1e-11, 3e-11),
        (5.0, 2.2e-11, 4e-11, 7e-12, 2e-11),
        (10.0, 3e-11, 6e-11, 3e-12, 4e-12),
        (13.0, 4e-11, 8e-11, 4e-12, 2e-12),
        (15.0, 5e-11, 1e-10, 6e-12, 1.5e-12),
        (18.0, 4e-11, 6e-11, 4e-12, 1e-12),
        (24.0, 7e-12, 8e-12, 1.5e-12, 6e-13),
        (30.0, 3e-12, 3e-12, 1e-12, 3e-13),
        (60.0, 3e-13, 3e-13, 1.5e-13, 8e-14),
        (100.0, 6e-14, 6e-14, 3e-14, 2e-14),
        (1000.0, 1e-14, 1e-14, 1e-14, 1e-14),
    ]
)
"""Advanced LIGO's platform of smaller chambers: Hz; along x and y, along z, m/sqrt(Hz); roll and
pitch, yaw, rad/sqrt(Hz)."""
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
    """Power spectral density (f,) of acceleration in dB, of `NLNM` or `NHNM` at frequencies in Hz.

    Above 10 Hz it is that at 10 Hz.

    >>> float(round(compute_peterson(NLNM, np.array([0.2]))[0], 1))
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


def _shipped(name: str) -> dict[str, Motion]:
    if name == "aligo-isi":
        at, along, about = ISI.T
        return {dof: _of_table(name, at, along if dof in TRANSLATIONS else about) for dof in DOFS}
    if name == "aligo-ham":
        at, *columns = HAM.T
        own = dict(zip(DOFS, (0, 0, 1, 2, 2, 3), strict=True))
        return {dof: _of_table(name, at, columns[n]) for dof, n in own.items()}
    motion = _peterson(name, {"nlnm": NLNM, "nhnm": NHNM}[name])
    return dict.fromkeys(TRANSLATIONS, motion)


SHIPPED = ("nlnm", "nhnm", "aligo-isi", "aligo-ham")
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
    found: Table = table.read(find(source, folder, option, known), unit)
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
