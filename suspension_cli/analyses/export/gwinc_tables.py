"""Tables of a suspension's thermal noise and responses for noise budgets of gwinc."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.analyses import known_analyses
from suspension_cli.analyses.analysis import Analysis, Run
from suspension_cli.analyses.export import gwinc_budget
from suspension_cli.analyses.export.gwinc_budget import Table, interpolate
from suspension_cli.analyses.export.relaxation import count_wire_modes
from suspension_cli.analyses.export.solve import FAINT, Written
from suspension_cli.conventions import SUPPORT
from suspension_cli.design.bodies import body_mass
from suspension_cli.design.derive import main_chain
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.documents import Layout
from suspension_cli.files.hdf5 import Provenance
from suspension_cli.files.whole_files import write_bytes, writing_to
from suspension_cli.grids import parse_band
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.linear.system import LinearSystem
from suspension_cli.physics import thermal_noise
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex

DENSITY = 300
"""Frequencies per decade, before bisection."""
MOST_WIRE_MODES = 3000
"""Most modes of wires in a table: each takes some ten frequencies."""
NARROWEST = 1e-9
"""Relative distance of neighbours at which bisection ends, far below that of a budget's points."""
RESPONSES = ("horizontal", "vertical", "coupling", "susceptibility")
"""Responses of a table, in its last columns."""


@dataclass(frozen=True)
class Tables:
    """The table of a suspension (`gwinc_budget.Table`), for the budget of an interferometer."""

    interferometer: str
    table: Table
    accuracy: float

    @property
    def frequencies(self) -> int:
        """Number of frequencies."""
        return len(self.table["frequency"])

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency, Hz."""
        low, high = self.table["frequency"][[0, -1]].tolist()
        return low, high

    def describe(self, folder: Path | None) -> str:
        """Return what the table has, and how gwinc reads it from a folder, if it was written."""
        low, high = self.band
        return (
            f"{self.frequencies} frequencies from {low:g} to {high:g} Hz; interpolation between"
            f" them errs by about {100 * self.accuracy:.2g} % at most\n"
            f"budget of {self.interferometer}" + (f": gwinc {folder}" if folder else "")
        )


@dataclass(frozen=True, eq=False, repr=False)
class GwincTables(Written, Tables):
    """The table of a suspension for gwinc, and the format that was asked for."""

    in_json: ClassVar = Layout(
        only="format file interferometer frequencies band accuracy", names={"band": "band_hz"}
    )
    format: str = "gwinc"


def solve(analysis: Analysis, run: Run) -> GwincTables:
    """Compute the table of a design; raises `InputError`, also where `thermal` does."""
    setting = run.setting
    chain = main_chain(run.design)
    level, upright = _motions(setting["inputs"], setting["outputs"], chain[-1])
    band = parse_band(setting["band"] or "5:3000", "--band")  # gwinc's own
    few = "{!r}:{!r}:20".format(*band)  # enough for the choice of the model, and checks of losses
    wanted = {"outputs": (level, upright), "frequency": few, "arm": 0.0, "mirrors": 1.0}
    found = known_analyses.get("thermal").solve(replace(run, setting={**setting, **wanted}))
    model = found.run.choice.model.system(run.design)
    if (count := count_wire_modes(model, band[1])) > MOST_WIRE_MODES:
        problem = f"contains {count:,} modes of wires (at most {MOST_WIRE_MODES:,})"
        remedy = "end it at a lower frequency"
        raise InputError.of("--band", problem, remedy, format_value(setting["band"]))
    evaluate = _evaluate(model, chain, (level, upright), run.design.constants.temperature)
    modes = eigenmodes.solve(model.constant).frequency
    modes = modes[(modes > band[0]) & (modes < band[1])]  # bisection would miss narrow ones
    points = np.geomspace(*band, 2 + round(DENSITY * np.log10(band[1] / band[0])))
    frequency, value = _tabulate(evaluate, np.union1d(points, modes), setting["accuracy"])
    joints = 2 * len(chain)
    [mass] = [body_mass(stage.body) for stage in run.design.stage if stage.name == chain[-1]]
    table = {
        "name": np.array(run.name),
        "mass": np.array(mass),
        "frequency": frequency,
        "horizontal_thermal": np.real(value[:, :joints]),
        "vertical_thermal": np.real(value[:, joints : 2 * joints]),
        **dict(zip(RESPONSES, value[:, 2 * joints :].T, strict=True)),
    }
    origin = run.origin(analysis, found.run.choice)
    return GwincTables(setting["interferometer"], table, setting["accuracy"], run=origin)


def _motions(inputs: tuple[str, ...], outputs: tuple[str, ...], mirror: str) -> tuple[str, str]:
    """Name the mirror's motions along x and z, at the point of the output along x."""
    name, at, point = (outputs[0] if outputs else f"{mirror}.x").partition("@")
    if inputs or len(outputs) > 1 or name != f"{mirror}.x":
        problem = "is not for gwinc, which takes motions of the support, and x of the mirror"
        remedy = f"leave it out, or give a point of the mirror as output: {mirror}.x@0,0,0.001"
        shown = format_value(", ".join(inputs or outputs))
        raise InputError.of("--input" if inputs else "--output", problem, remedy, shown)
    return f"{mirror}.x{at}{point}", f"{mirror}.z{at}{point}"


def _evaluate(
    model: LinearSystem, chain: list[str], motions: tuple[str, str], temperature: float
) -> Callable[[Array], Complex[np.ndarray, "frequency column"]]:
    """Make the function of frequencies (Hz) that solves for the columns of a table."""
    known = signals.bodies_with_signals(model)
    outputs = [signals.parse_output(text, known) for text in motions]
    drives = (f"{SUPPORT}.x", f"{SUPPORT}.z", motions[0].replace(".x", ".force_x", 1))
    inputs = [signals.parse_input(text, known) for text in drives]

    def solve(frequency: Array) -> Complex[np.ndarray, "frequency column"]:
        density = np.zeros((2, len(frequency), 2 * len(chain)))
        noises = thermal_noise.solve(model, frequency, outputs, temperature)
        for upright, noise in enumerate(noises):
            for source, power in zip(noise.source, noise.density, strict=True):
                stage, _, cause = source.rpartition(".")
                joint = 2 * chain.index(stage) if stage in chain else 0
                # gwinc ignores the last lower joint where it moves vertically
                density[upright, :, joint + (cause == "bending-lower" and not upright)] += power
        value = response.solve(model, frequency, inputs, outputs).value
        responses = [value[:, 0, 0], value[:, 1, 1], value[:, 0, 1], value[:, 0, 2]]
        return np.column_stack([*np.sqrt(density), *responses])

    return solve


def _tabulate(
    evaluate: Callable[[Array], Complex[np.ndarray, "frequency column"]],
    frequency: Array,
    accuracy: float,
) -> tuple[Array, Complex[np.ndarray, "frequency column"]]:
    """Bisect intervals of frequencies (Hz) until columns can be interpolated between them.

    Errors midway are at most half of `accuracy`, as they may be larger beside the middle. They are
    relative to each column; that of the coupling to at least `FAINT` of the vertical response, of
    which gwinc adds some 1e-3 to it.
    """
    value = evaluate(frequency)
    passed = np.zeros(0)
    while True:
        wide = frequency[1:] / frequency[:-1] > 1 + NARROWEST
        middle = np.setdiff1d(np.sqrt(frequency[1:] * frequency[:-1])[wide], passed)
        if not len(middle):
            return frequency, value
        exact = evaluate(middle)
        size = np.abs(exact)
        size[:, -2] = np.maximum(size[:, -2], FAINT * size[:, -3])
        off = np.abs(interpolate(frequency, value, middle) - exact)
        bad = (off > accuracy / 2 * size).any(1)
        passed = np.append(passed, middle[~bad])
        place = np.searchsorted(frequency, middle[bad])
        frequency = np.insert(frequency, place, middle[bad])
        value = np.insert(value, place, exact[bad], axis=0)


def write(path: Path, made: Tables, origin: Provenance) -> None:
    """Write a folder with a module for gwinc and the table; raises `InputError`."""
    module = path / "__init__.py"
    file = path / "suspension.npz"
    if module.exists() and not file.exists():
        raise InputError.of("--out", "is a Python package", "name another folder", str(path))
    stream = io.BytesIO()
    arrays: dict[str, Any] = {**made.table, "design": origin.design, "command": origin.command}
    np.savez_compressed(stream, **arrays)
    text = resources.files(__package__ or "").joinpath("gwinc_budget.py").read_text("utf-8")
    text = text.replace(f"= {gwinc_budget.INTERFEROMETER!r}", f"= {made.interferometer!r}", 1)
    with writing_to(path):
        path.mkdir(exist_ok=True)
    write_bytes(file, stream.getvalue())
    write_bytes(module, text.encode())
