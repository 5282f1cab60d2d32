"""Spectra: models of ground noise and platforms, and tables of the user.

Peterson's new low and high noise models (J. Peterson, Observations and modeling of seismic
background noise, U.S. Geological Survey Open-File Report 93-322 (1993), Tables 3 and 4) bound the
spectra of a world-wide network of seismic stations. The power spectral density of acceleration in
dB relative to 1 (m/s^2)^2/Hz is A + B log10(T) for periods T from 0.1 s to 10^5 s; the amplitude of
displacement follows by (2 pi f)^-2. Above 10 Hz, where the models end, the acceleration at 10 Hz is
used, so that displacement falls as f^-2. All this is a power law between the corners.

Shipped models are CSV files beside this module, with their sources: `aligo-isi` (also called
`aligo-bsc`) is the platform of Advanced LIGO's quadruple suspensions, `aligo-ham` that of its
triple and double suspensions, `kamioka-quiet` and `kamioka-noisy` the ground of KAGRA; `vc-a` to
`vc-e` are the limits of laboratory floors in the generic vibration criteria, from a noisy to a
quiet laboratory. They are read like tables of the user. Between points lines are
straight in a log-log plot (gwinc uses cubic polynomials).
"""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.faults import suggest
from suspension_cli.errors import InputError, format_value
from suspension_cli.files import spectra

if TYPE_CHECKING:
    from jaxtyping import Float

PETERSON = ("nlnm", "nhnm")
CRITERIA = ("vc-a", "vc-b", "vc-c", "vc-d", "vc-e")
LONGEST = 1e5
"""Longest period of both, s."""
HIGHEST = 1e12
"""Frequency up to which they are continued, Hz."""
LOWEST = 1e-3
"""Frequency down to which vibration criteria are continued, Hz."""
BESIDE = 1e-9
"""Relative distance from a corner to where its line ends; coefficients are rounded, so lines do not
meet exactly."""
FOLDER = Path(__file__).parent
"""Folder of the shipped models."""
NONE = "none"
TRANSLATIONS = DOFS[:3]
SHIPPED = (
    *(*PETERSON, *CRITERIA, "kamioka-quiet", "kamioka-noisy"),
    *("aligo-isi", "aligo-bsc", "aligo-ham"),
)
"""Names of shipped models."""


def parse(given: Sequence[str], isolation: Sequence[str], folder: Path) -> dict[str, Spectrum]:
    """Parse the given motions of the support by coordinate.

    They are ``SOURCE`` or ``COORDINATES=SOURCE``, and later ones replace earlier ones. A source is
    a shipped model, a file in the current folder or in that of the design, or ``none``. Tables of
    a platform's transmissibility, likewise, multiply the motion (`isolation`).
    """
    motions: dict[str, Spectrum] = {}
    for text in given:
        wanted, source = _split(text, "--ground")
        if source.lower() == NONE:
            for dof in wanted or DOFS:
                motions.pop(dof, None)
        else:
            motions |= _read(text, "--ground", folder, TRANSLATIONS)
    for text in isolation:
        for dof, platform in _read(text, "--isolation", folder, tuple(motions)).items():
            if dof in motions:
                motions[dof] = motions[dof].through(platform)
    return {dof: motions[dof] for dof in DOFS if dof in motions}


def _split(text: str, option: str) -> tuple[list[str], str]:
    """Split ``x,y=SOURCE`` into coordinates ([] if not given) and source."""
    names, equals, source = text.partition("=")
    if not equals:
        return [], text.strip()
    wanted = [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in DOFS:
            remedy = suggest(name, list(DOFS)) + "; write for example z=site.csv"
            raise InputError.of(
                option, "names no motion of the support", remedy, format_value(text)
            )
    return wanted, source.strip()


def _read(text: str, option: str, folder: Path, every: Sequence[str]) -> dict[str, Spectrum]:
    """Read ``x,y=SOURCE``; a column without a coordinate is for those given, or `every` one."""
    wanted, source = _split(text, option)
    found: dict[str, Spectrum]
    if option == "--ground" and source.lower() in PETERSON:
        found = dict.fromkeys(TRANSLATIONS, _peterson(source.lower()))
    elif option == "--ground" and source.lower() in CRITERIA:
        found = dict.fromkeys(TRANSLATIONS, _criterion(source.lower()))
    elif option == "--ground" and source.lower() in SHIPPED:
        found = read(FOLDER / f"{source.lower().replace('bsc', 'isi')}.csv", "m")
    else:
        unit = "rad" if wanted and not {*wanted} & {*TRANSLATIONS} else "m"
        path = find(source, folder, option, SHIPPED if option == "--ground" else ())
        found = read(path, "1" if option == "--isolation" else unit)
        if len(found) == 1 and not {*found} & {*DOFS}:
            found = dict.fromkeys(wanted or every, *found.values())
        for name in found:
            if name not in DOFS:
                remedy = suggest(name, list(DOFS)) + "; name columns x, y, z, roll, pitch, yaw"
                problem = "names no motion of the support"
                raise InputError.of("", problem, remedy, format_value(name)).in_file(str(path))
    lacking = [dof for dof in wanted if dof not in found]
    if lacking:
        problem = f"has no {lacking[0]}: it gives {', '.join(found)}"
        remedy = "give a CSV file with this column, in rad/sqrt(Hz) for rotations"
        raise InputError.of(option, problem, remedy, format_value(text))
    name = source.lower() if source.lower() in SHIPPED else source
    return {dof: replace(found[dof], name=name) for dof in wanted or found}


def _peterson(name: str) -> Spectrum:
    """Displacement of a model of Peterson, m/sqrt(Hz)."""
    rows = np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=3)
    begins = rows[:, 0]
    slope = rows[:, 1:]  # period from which a line is valid, A, B
    ends = np.append(begins[1:] * (1 - BESIDE), LONGEST)
    period = np.stack([begins, ends], axis=1)
    acceleration = slope[:, :1] + slope[:, 1:] * np.log10(period)  # dB
    at = np.append(1 / period.ravel()[::-1], HIGHEST)
    level = np.append(acceleration.ravel()[::-1], acceleration[0, 0])
    return Spectrum(name, at, 10 ** (level / 20) / (2 * np.pi * at) ** 2)


def _criterion(name: str) -> Spectrum:
    """Displacement at a vibration criterion in all one-third octaves, m/sqrt(Hz).

    A one-third octave around f is (2^(1/6) - 2^(-1/6)) f wide.
    """
    with (FOLDER / "vibration-criteria.csv").open(encoding="utf-8") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        [row] = [row for row in rows if row["name"] == name]
    corner = float(row["corner"])
    at = np.array([LOWEST, corner, HIGHEST])
    rms = float(row["velocity"]) * np.minimum(at / corner, 1.0)
    width = (2 ** (1 / 6) - 2 ** (-1 / 6)) * at
    return Spectrum(name, at, rms / np.sqrt(width) / (2 * np.pi * at))


def find(source: str, folder: Path, option: str, known: Sequence[str] = ()) -> Path:
    """Find a file in the current folder or in that of the design; raises `InputError`."""
    for path in (Path(source), folder / source):
        if os.path.isfile(path):  # False for names that are too long, too
            return path
    problem = "is no file" + (f" and no shipped model ({', '.join(known)})" if known else "")
    close = suggest(source, list(known))
    remedy = close if "did you mean" in close else "name a CSV file" + " or a model" * bool(known)
    raise InputError.of(option, problem, remedy, format_value(source))


@dataclass(frozen=True)
class Spectrum:
    """Values, at least 0, at some frequencies; power laws between them.

    Frequencies are in Hz, ascending, above 0; values in m/sqrt(Hz) or rad/sqrt(Hz), 1 for
    transmissibilities. `name` is that of the model or file.
    """

    name: str
    frequency: Float[np.ndarray, " point"]
    value: Float[np.ndarray, " point"]

    def at(self, frequency: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
        """Interpolate at frequencies in Hz by power laws, linearly next to a 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            log = np.interp(np.log(frequency), np.log(self.frequency), np.log(self.value))
        straight = np.interp(frequency, self.frequency, self.value)
        positive = np.interp(frequency, self.frequency, (self.value == 0).astype(float)) == 0
        return np.where(positive, np.exp(log), straight)

    def through(self, platform: Spectrum) -> Spectrum:
        """Multiply by a transmissibility, where both are known."""
        low = max(self.frequency[0], platform.frequency[0])
        high = min(self.frequency[-1], platform.frequency[-1])
        at = np.unique(np.clip(np.union1d(self.frequency, platform.frequency), low, high))
        name = f"{self.name} x {platform.name}"
        return Spectrum(name, at, self.at(at) * platform.at(at))


def read(path: Path, unit: str, arm: float = 0.0) -> dict[str, Spectrum]:
    """Read the spectra of a file by their headings, see `files.spectra.read`."""
    found = spectra.read(path, unit, arm)
    return {name: Spectrum(str(path), *points) for name, points in found.items()}
