"""KAGRA's beam splitter and signal recycling mirror: measured transfer functions.

The measurements are not in this repository. `python -m tools.validation.dtt_references FOLDER`
reduces those in a checkout of terrencetec/kontrol to `measured/kagra/*.csv`;
`python -m tools.validation.kagra_measured` then repeats the fits (some minutes of processor time),
draws the pictures, and writes `measured/kagra/found.toml`, from which the page is made. With
`--no-fit` it keeps the fitted numbers.
"""

from __future__ import annotations

import csv
import sys
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.drawing.panels import Across, Line, Panel
from suspension_cli.drawing.panels import draw as draw_panels
from suspension_cli.drawing.style import PALETTE, LineLook, format_signed, save
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tools.tables import ROOT
from tools.validation.page import Section, number_of_percent, percent, table
from tools.validation.pictures import CROSS, DOT, deviation_panel

MEASURED = ROOT / "measured" / "kagra"
FOUND = MEASURED / "found.toml"
SUSPENSIONS = {
    "kagra-srm": ("SRM (Type B), 22 July 2020", "srm"),
    "kagra-bs-2019": ("BS (Type B), 30 July 2020", "bs"),
}
"""Design of each suspension, its title, and stem of its files of measurements."""
MODEL = "string"
GRID = np.geomspace(0.2, 5.0, 600)
TICKS = (0.2, 0.5, 1.0, 2.0, 5.0)
"""Of the frequencies in pictures, Hz."""
POINT: LineLook = {"linestyle": "none", "marker": ".", "markersize": 2.5}
RESONANCES = "modes over measured resonances"


@dataclass(frozen=True)
class Suspension:
    """Measured functions over the model as designed, and as fitted."""

    name: str
    title: str
    designed: list[Any]
    fitted: list[Any]


def evaluate(*, repeat: bool) -> None:
    """Fit both designs, draw them over the measurements, and keep what the page needs."""
    kept: dict[str, Any] = {} if repeat else tomllib.loads(FOUND.read_text("utf-8"))
    for name, (_, stem) in SUSPENSIONS.items():
        if repeat:
            file = str(MEASURED / f"{stem}.toml")
            found = sus.fit(file, _design(name), fidelity=MODEL, explain=False)
            kept[name] = summary(found)
        one = compare(name, kept[name])
        kept[name]["resonance"] = [
            {
                "function": before.data.name,
                "mode": before.mode[n].partition("#")[0] or "none",
                "measured": float(f"{peak:.6g}"),
                "fitted": float(f"{np.nan_to_num(after.pole[n]):.6g}"),
            }
            for before, after in zip(one.designed, one.fitted, strict=True)
            for n, peak in enumerate(before.peak)
        ]
        save(_draw(one, _resonances(name, kept[name])), ROOT / "results" / _picture(name))
    kept["repeated"] = _repeated()
    kept["yaw_phase"] = _yaw_phase()
    head = "# Measured resonances of KAGRA's suspensions, and fits of designs in configs/built/\n"
    head += "# to the transfer functions: see tools/validation/kagra_measured.py.\n\n"
    write_bytes(FOUND, (head + reader.write_toml(kept)).encode())


def summary(found: Any) -> dict[str, Any]:
    """The numbers of a fit that the page shows."""
    parts = found.responses
    values = zip(found.name, found.start, found.value, found.sigma, strict=True)
    points = zip(
        parts.function,
        parts.chi_squared_of(parts.before),
        parts.chi_squared,
        parts.points,
        strict=True,
    )
    channels = zip(parts.nuisance, parts.nuisance_value, parts.nuisance_sigma, strict=True)
    return {
        "chi_squared": float(found.chi_squared),
        "freedom": int(found.freedom),
        "scale": float(found.scale),
        "parameter": _rows(("name", "start", "value", "sigma"), values),
        "function": _rows(("name", "before", "after", "numbers"), points),
        "channel": _rows(("name", "value", "sigma"), channels),
        "determined": list(found.determined),
    }


def _rows(keys: tuple[str, ...], rows: Iterable[tuple[Any, ...]]) -> list[dict[str, Any]]:
    return [
        {
            key: value if isinstance(value, str) else float(f"{value:.6g}")
            for key, value in zip(keys, row, strict=True)
        }
        for row in rows
    ]


def _design(name: str) -> Any:
    return sus.read(str(ROOT / "configs" / "built" / f"{name}.toml"))


def compare(name: str, kept: dict[str, Any]) -> Suspension:
    """Compute the responses of a design, and of the fitted one, at measured frequencies."""
    title, stem = SUSPENSIONS[name]
    design = _design(name)
    changes = {one["name"]: one["value"] for one in kept["parameter"]}
    file = str(MEASURED / f"{stem}-whole.toml")
    parts = [
        list(sus.response(one, measured=[file], frequency=GRID, fidelity=MODEL).measured)
        for one in (design, design.replace(changes))
    ]
    return Suspension(name, title, *parts)


def section() -> Section:
    """Compare both, draw them, and collect the page."""
    result = Section("KAGRA: measured transfer functions")
    kept = tomllib.loads(FOUND.read_text("utf-8"))
    result.lines += [
        "Coils on the recoil mass RM shook the mirrors; optical levers and sensors of the intermediate"
        " mass IM observed them (archive/examples/legacy/data of github.com/terrencetec/kontrol at"
        " c612ebc, MIT licence, (c) 2020-2023 TSANG Terrence Tak Lun). Drives are in counts, so one"
        " factor per drive is free. The designs are SUMCON's saves of August 2019, a year older; which"
        " loops were closed is unknown. In the pictures lines are modelled, scaled by one number each."
        f" Fits are those of `pendsus fit --fidelity {MODEL}`, their uncertainties multiplied by √(χ²/dof)"
        " (a repeated measurement has a χ²/dof of 1 to 2); `tools/validation/kagra_measured.py` repeats"
        " them. `kagra-measured` prints [each resonance](validation_resonances.csv) and all fitted"
        " parameters.",
    ]
    found = {name: _resonances(name, kept[name]) for name in SUSPENSIONS}
    for name in SUSPENSIONS:
        result.lines += _details(name, kept[name])
    result.lines += _older()
    result.lines += _odd(kept)
    rows = [_cells(name, one) for name, several in found.items() for one in several]
    result.files["validation_resonances.csv"] = [RESONANCES_HEAD, *rows]
    return result


def printed() -> list[str]:
    """Lines of the section, its table, and the numbers of the fits and of repeated runs."""
    kept = tomllib.loads(FOUND.read_text("utf-8"))
    parts = [(name, key) for name in SUSPENSIONS for key in ("parameter", "channel")]
    tables = [(f"{name}, {key}s", kept[name][key]) for name, key in parts]
    tables.append(("repeated runs, over the first ones", kept["repeated"]))
    lines = section().printed()
    for title, rows in tables:
        cells = [[str(value) for value in row.values()] for row in rows]
        lines += [title, *table(list(rows[0]), cells)]
    return lines


@dataclass(frozen=True)
class Resonance:
    """A measured resonance, and the mode of the design and of the fitted one, Hz (NaN: none)."""

    function: str
    mode: str
    measured: float
    designed: float
    fitted: float


def _resonances(name: str, kept: dict[str, Any]) -> list[Resonance]:
    """Modes of the design beside measured resonances."""
    found = eigenmodes.solve(registry.by_name(MODEL).system(_design(name).design))
    modes = list(zip(found.motion, found.frequency.tolist(), strict=True))

    def nearest(mode: str, measured: float) -> float:
        own = [frequency for label, frequency in modes if label == mode]
        return min(own, key=lambda frequency: abs(frequency - measured), default=np.nan)

    return [
        Resonance(
            one["function"],
            one["mode"],
            one["measured"],
            nearest(one["mode"], one["measured"]),
            one["fitted"] or np.nan,
        )
        for one in kept["resonance"]
    ]


WHY = {
    "kagra-srm": (
        "in the mode that deviates most, IM and RM rock against each other on the wires of RM. The fit"
        " has softer wires, which nobody has measured."
    ),
    "kagra-bs-2019": "the same mode deviates most.",
}
"""What explains the largest deviation of each."""


def _picture(name: str) -> str:
    return f"validation_{name.replace('-', '_')}_measured.png"


def _details(name: str, kept: dict[str, Any]) -> list[str]:
    title, stem = SUSPENSIONS[name]
    per = kept["chi_squared"] / kept["freedom"]
    determined = kept["determined"][0]
    return [
        "",
        f"### {title}, measured",
        "",
        f"`configs/built/{name}.toml`, channels and free parameters `measured/kagra/{stem}.toml`:"
        f" {WHY[name]}",
        "",
        f"![{title}, measured]({_picture(name)})",
        "",
        f"Fitted with χ² per degree of freedom of {per:.3g} ({kept['freedom']} degrees of freedom)."
        f" {determined[0].upper()}{determined[1:]}. {REST[name]}",
    ]


REST = {
    "kagra-srm": (
        "Pitch comes within 0.4 %, but the ends of RM's wires rise by 8 mm and the inertias of TM and"
        " RM by 13 and 11 %, four times their priors. Of these the data determine that of TM alone, and"
        " only together with the factor of the drive. They do determine the stiffness of pitch between"
        " IM and RM over their inertia: 28 % below the save's."
    ),
    "kagra-bs-2019": (
        "Pitch comes within 0.7 % (F1: 1.9 %), but the ends of RM's wires rise by 9.5 mm and the inertia"
        " of IM falls by 16 %, five times their priors: parameters absorb something that the model"
        " lacks, such as closed loops, cables between IM and RM, or clamps. The stiffness of pitch"
        " between IM and RM over their inertia is 13 % below the save's. Below 0.4 Hz, which is not"
        " fitted, pitch is a quarter larger than modelled."
    ),
}
"""What the fit of each says."""


RESONANCES_HEAD = [
    "design",
    "function",
    "mode",
    "measured_hz",
    "design_hz",
    "design_off_percent",
    "fitted_hz",
    "fitted_off_percent",
]


def _cells(name: str, one: Resonance) -> list[str]:
    cells = [name, one.function, one.mode, f"{one.measured:.4f}"]
    for value in (one.designed, one.fitted):
        off = number_of_percent(value / one.measured - 1) if np.isfinite(value) else ""
        cells += [f"{value:.4f}" if off else "", off]
    return cells


COLUMNS = {
    "kagra-srm": [("srm-pitch", "pit", 0), ("srm-pitch", "im_pit", 1)],
    "kagra-bs-2019": [("bs-pitch", "pit", 0), ("bs-pitch", "im_pit", 1), ("bs-length", "len", 2)],
}
"""File, column and number of the function for each line of the pictures."""
NAMES = {"pit": "pitch of TM", "im_pit": "pitch of IM", "len": "TM along the beam"}


def _read(file: str) -> np.ndarray:
    lines = (MEASURED / f"{file}.csv").read_text("utf-8").splitlines()
    return np.genfromtxt([line for line in lines if line[0] != "#"], delimiter=",", names=True)


def _draw(one: Suspension, found: list[Resonance]) -> Figure:
    """Draw the functions, and the deviations of modes from measured resonances."""
    looks: tuple[tuple[str, str, LineLook], ...] = (
        ("design", PALETTE[1], {"linestyle": (0, (4, 2))}),
        ("fitted", PALETTE[0], {}),
    )
    panels: list[Panel] = []
    for file, column, number in COLUMNS[one.name]:
        data = _read(file)
        seen = data[f"{column}_coherence"] > 0.3
        size = abs(data[f"{column}_re"] + 1j * data[f"{column}_im"])
        lines = [Line(data["frequency"][seen], size[seen], "measured", "#737373", POINT)]
        for parts, (name, colour, look) in zip((one.designed, one.fitted), looks, strict=True):
            function = parts[number]
            curve = abs(function.curve) * function.median * 1e6
            lines.append(Line(function.curve_frequency, curve, name, colour, look))
        limits = (0.3 * size[seen].min(), 5 * size[seen].max())
        unit = "µm" if column == "len" else "µrad"
        key = None if not panels else ()
        panels.append(
            Panel(f"{unit} per count", lines, 1.4, "log", limits, remarks=[NAMES[column]], key=key)
        )
    known = np.array([row.measured for row in found])
    deviations = [
        Line(known, 100 * (np.array(values) / known - 1), "_", colour, look)
        for values, colour, look in (
            ([row.designed for row in found], PALETTE[1], CROSS),
            ([row.fitted for row in found], PALETTE[0], DOT),
        )
    ]
    ticks = {tick: f"{tick:g}" for tick in TICKS}
    across = Across(limits=(GRID[0], GRID[-1]), ticks=ticks)
    panels.append(deviation_panel(deviations, (-40.0, 40.0), 0.1, across, remarks=[RESONANCES]))
    designed, fitted = (max(_deviations(found, name), key=abs) for name in ("designed", "fitted"))
    sizes = [f"{format_signed(100 * value)} %" for value in (designed, fitted)]
    heading = f"Modes: design off by up to {sizes[0]}, fitted {sizes[1]}"
    return draw_panels(heading, f"{one.title}; string model", panels)


def _deviations(found: list[Resonance], name: str) -> list[float]:
    """Relative deviations of modes of the design, or of the fitted one, from measured ones."""
    values = [getattr(row, name) / row.measured - 1 for row in found]
    return [value for value in values if np.isfinite(value)]


def _older() -> list[str]:
    """Pitch of the other save of BS."""
    modes = sus.modes(_design("kagra-bs"), fidelity=MODEL)
    pitch = [
        float(value)
        for value, label in zip(modes.frequency, modes.label, strict=True)
        if label.startswith("IM pitch") and 1 < value < 5
    ]
    known = 2.745
    error = pitch[-1] / known - 1
    return [
        "",
        "The other save of BS (`configs/built/kagra-bs.toml`) has RM on steel wires of 0.5 mm instead of"
        f" tungsten wires of 0.65 mm, and this mode at {pitch[-1]:.3f} Hz ({percent(error)} of the"
        f" measured {known} Hz).",
    ]


def _repeated() -> list[dict[str, Any]]:
    """Second runs over the first, as `dtt_references` writes them."""
    with (MEASURED / "repeated.csv").open(newline="") as stream:
        rows = csv.DictReader(line for line in stream if line[0] != "#")
        keys = ("drive", "output"), ("from_hz", "to_hz", "points", "ratio", "chi2")
        return [
            {key: row[key] for key in keys[0]} | {key: float(row[key]) for key in keys[1]}
            for row in rows
        ]


def _yaw_phase() -> list[list[float]]:
    """Frequency (Hz) and phase (degrees) of yaw of BS pushed along the beam, over its own sign."""
    data, found = _read("bs-length"), []
    value = data["yaw_re"] + 1j * data["yaw_im"]
    for at, sign in ((0.45, 1), (1.0, 1), (2.0, -1), (4.0, -1)):
        near = abs(data["frequency"] - at) < 0.06
        unit = sign * value[near] / abs(value[near])
        found.append([at, float(f"{np.angle(unit.mean(), deg=True):.1f}")])
    return found


def _odd(kept: dict[str, Any]) -> list[str]:
    """What is odd in the data."""

    def range_of(drive: str, output: str, key: str) -> list[float]:
        own = (row for row in kept["repeated"] if (row["drive"], row["output"]) == (drive, output))
        return [row[key] for row in own]

    pitch, yaw = range_of("bs-pitch", "pit", "ratio"), range_of("bs-pitch", "yaw", "ratio")
    along = range_of("bs-length", "len", "chi2") + range_of("bs-length", "yaw", "chi2")
    phase = [f"{angle:.0f}° at {at:g} Hz" for at, angle in kept["yaw_phase"]]
    return [
        "",
        "### Unexplained features",
        "",
        "- **Both fits.** RM's tungsten wires are 21 and 26 % softer than in the saves: a modulus of"
        " 3.1 × 10¹¹ Pa instead of 4.11 × 10¹¹ Pa (bulk), or compliant clamps. The sensors of IM read"
        " 32 and 31 % less than modelled.",
        "- **Drive in pitch of BS.** A second run that day is "
        f"{100 * (min(pitch) - 1):.0f} to {100 * (max(pitch) - 1):.0f} % larger in pitch of TM "
        f"and {100 * (1 - max(yaw[1:])):.0f} to {100 * (1 - min(yaw[1:])):.0f} % smaller in yaw, up"
        " to 50 times the variance: coils were rebalanced, or a filter changed. Along the beam it"
        f" repeats from 0.45 Hz on ({min(along):.1f} to {max(along):.1f} of the variance).",
        f"- **Yaw of BS pushed along the beam** has a phase of {', '.join(phase)}, where bodies"
        " alone give 0 or 180°, as if one of the four coils had a pole or zero near 1.3 Hz (not"
        " fitted).",
        "- **Phase.** Driven in pitch, BS lags behind the model as by a pole and a zero below 1 Hz, SRM"
        " as by a delay of 4 to 5 ms.",
    ]


if __name__ == "__main__":
    evaluate(repeat="--no-fit" not in sys.argv)
