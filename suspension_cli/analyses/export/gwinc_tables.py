"""Tables of a suspension's thermal noise and responses for noise budgets of gwinc."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import registry
from suspension_cli.analyses.analysis import Analysis, Document, Result, Run
from suspension_cli.analyses.export.gwinc_budget import Table, interpolate
from suspension_cli.analyses.export.solve import FAINT
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.conventions import SUPPORT
from suspension_cli.design.bodies import body_mass
from suspension_cli.design.derive import main_chain
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.atomic import write_bytes, writing_to
from suspension_cli.files.hdf5 import Provenance
from suspension_cli.grids import parse_band
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

BAND = "5:3000"
"""Band by default, Hz: that of gwinc."""
POINTS = 2000
"""Frequencies before those near resonances are added."""
NARROWEST = 1e-9
"""Relative distance of neighbours at which bisection ends, far below that of a budget's points."""
RESPONSES = ("horizontal", "vertical", "coupling", "susceptibility")
"""Responses of a table, in its last columns."""
VERTICAL, COUPLING = -3, -2
"""Columns of two of them."""
MODULE, FILE = "__init__.py", "suspension.npz"
"""Names of the files of a budget."""


@dataclass(frozen=True)
class Tables:
    """The table of a suspension, and the interferometer whose budget takes it.

    Attributes
    ----------
    table
        Arrays, as of `gwinc_budget.Table`.
    error
        Largest relative error of an interpolation midway between two frequencies.
    """

    interferometer: str
    table: Table
    error: float

    @property
    def frequency(self) -> Float[np.ndarray, " frequency"]:
        """Frequencies of the table, Hz."""
        return self.table["frequency"]


def solve(analysis: Analysis, run: Run) -> Result:
    """Compute the table of a design.

    Raises `InputError` if the output is not along x of the mirror, and as `thermal` does: for an
    unstable design, and one in which nothing dissipates that moves horizontally or vertically.
    """
    setting, chain = run.setting, main_chain(run.design)
    level, upright = _motions(setting["inputs"], setting["outputs"], chain[-1])
    band = parse_band(setting["band"] or BAND, "--band")
    wanted = {
        "outputs": (level, upright),
        "frequency": "{!r}:{!r}:{}".format(*band, POINTS),
        "arm": 0.0,
        "mirrors": 1.0,
    }
    found = registry.get("thermal").solve(replace(run, setting={**setting, **wanted}))
    model = found.choice.model.system(run.design)
    evaluate = _evaluate(model, chain, (level, upright), run.design.constants.temperature)
    modes = eigenmodes.solve(model.constant).frequency
    modes = modes[(modes > band[0]) & (modes < band[1])]  # bisection would miss narrow ones
    grid = np.union1d(np.geomspace(*band, POINTS), modes)
    frequency, value, error = _tabulate(evaluate, grid, setting["accuracy"])
    joints = 2 * len(chain)
    [mass] = [body_mass(stage.body) for stage in run.design.stage if stage.name == chain[-1]]
    table = {
        "name": np.array(run.name),
        "mass": np.array(mass),
        "frequency": frequency,
        "horizontal_thermal": value[:, :joints].real,
        "vertical_thermal": value[:, joints : 2 * joints].real,
        **dict(zip(RESPONSES, value[:, 2 * joints :].T, strict=True)),
    }
    made = Tables(setting["interferometer"], table, error)
    return Result(
        analysis, run.source, found.choice, made, {"format": "gwinc"}, command=run.command
    )


def _motions(inputs: tuple[str, ...], outputs: tuple[str, ...], mirror: str) -> tuple[str, str]:
    """Name the mirror's motions along x and z, at the point of the output along x."""
    if inputs:
        problem = "is not for gwinc, which takes motions of the support and forces on the mirror"
        raise InputError.of("--input", problem, "leave it out", format_value(inputs[0]))
    name, at, point = (outputs[0] if outputs else f"{mirror}.x").partition("@")
    if len(outputs) > 1 or name != f"{mirror}.x":
        problem = "is not the mirror's motion along the beam, which gwinc takes"
        remedy = f"give {mirror}.x or a point of the mirror, such as {mirror}.x@0,0,0.001"
        raise InputError.of("--output", problem, remedy, format_value(", ".join(outputs)))
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
        noises = thermal.solve(model, frequency, outputs, temperature)
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
) -> tuple[Array, Array, float]:
    """Bisect intervals of frequencies until columns can be interpolated between them.

    Returns frequencies (f,) in Hz, columns (f, c) and the largest error midway between two
    frequencies, relative to each column; that of the coupling to at least `FAINT` of the vertical
    response, as gwinc adds some 1e-3 of that to it.
    """
    value, worst, passed = evaluate(frequency), 0.0, np.zeros(0)
    while True:
        wide = frequency[1:] / frequency[:-1] > 1 + NARROWEST
        middle = np.setdiff1d(np.sqrt(frequency[1:] * frequency[:-1])[wide], passed)
        if not len(middle):
            return frequency, value, worst
        exact = evaluate(middle)
        size = np.abs(exact)
        size[:, COUPLING] = np.maximum(size[:, COUPLING], FAINT * size[:, VERTICAL])
        off = np.abs(interpolate(frequency, value, middle) - exact)
        error = (off / np.maximum(size, 1e-300)).max(1)
        bad = error > accuracy
        worst = max(worst, float(error[~bad].max(initial=0.0)))
        passed = np.append(passed, middle[~bad])
        place = np.searchsorted(frequency, middle[bad])
        frequency = np.insert(frequency, place, middle[bad])
        value = np.insert(value, place, exact[bad], axis=0)


def document(result: Result) -> Document:
    """Return what the table has, for JSON."""
    made: Tables = result.data
    return {
        "format": "gwinc",
        "file": result.extra.get("file"),
        "interferometer": made.interferometer,
        "band_hz": [float(made.frequency[0]), float(made.frequency[-1])],
        "frequencies": len(made.frequency),
        "interpolation_error": made.error,
    }


def text(result: Result) -> str:
    """Return what the table has, and how gwinc reads it."""
    made: Tables = result.data
    low, high = made.frequency[[0, -1]]
    lines = [
        result.choice.line,
        f"{len(made.frequency)} frequencies from {low:g} to {high:g} Hz; interpolation between them"
        f" errs by at most {100 * made.error:.2g} %",
        f"budget of {made.interferometer} with this suspension",
    ]
    if folder := result.extra.get("file"):
        lines[-1] += f": gwinc {folder}"
    return "\n".join(lines)


def write(path: Path, made: Tables, origin: Provenance) -> None:
    """Write a folder with a module for gwinc and the table.

    Raises `InputError` if there is one that is no export.
    """
    if (path / MODULE).exists() and not (path / FILE).exists():
        raise InputError.of("--out", "is a Python package", "name another folder", str(path))
    stream = io.BytesIO()
    np.savez_compressed(stream, **made.table, design=origin.design, command=origin.command)
    text = resources.files(__package__ or "").joinpath("gwinc_budget.py").read_text("utf-8")
    lines = [
        text.replace("import copy\n", "import copy\nimport os\n", 1).rstrip(),
        "",
        "",
        f"# Written by {origin.command}",
        f"INTERFEROMETER = {made.interferometer!r}",
        '"""Name of one of gwinc, or path of a budget or of parameters; may be changed."""',
        "FOLDER = os.path.dirname(os.path.abspath(__file__))",
        f'TABLE = dict(np.load(os.path.join(FOLDER, "{FILE}")))',
        "",
        "",
        "def __getattr__(name: str) -> type:",
        '    """Make the budget when gwinc asks for it, by the name of this folder or a class."""',
        '    if name.startswith("__"):',
        "        raise AttributeError(name)",
        '    is_folder = name in (os.path.basename(FOLDER), ".")',
        "    return suspend(TABLE, INTERFEROMETER, None if is_folder else name)",
        "",
    ]
    with writing_to(path):
        path.mkdir(exist_ok=True)
    write_bytes(path / FILE, stream.getvalue())
    write_bytes(path / MODULE, "\n".join(lines).encode())
