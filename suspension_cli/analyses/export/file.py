"""Files of exported systems, in the formats of `pendsus export`; objects of other programs.

A Foton filter file has a module per response, with at most ten of its sections. Of the zeros and
poles of a response those are removed first that change it least in the band: a pole with the zero
nearest to it, or one alone. Roots above a quarter of the sample rate go anyway. The rest is made
digital as Foton does. What all this changes is measured on the coefficients as written, against the
state space, off resonance.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Sequence
from importlib import import_module, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import h5py
import numpy as np

from suspension_cli.analyses.export import gwinc_tables
from suspension_cli.analyses.export.solve import (
    AGREEMENT,
    GRID,
    Exported,
    compute_zero_pole_gain,
    off_resonance,
)
from suspension_cli.analyses.record import as_json
from suspension_cli.conventions import SUPPORT
from suspension_cli.design import foton, foton_file
from suspension_cli.design.foton import Filter
from suspension_cli.design.foton_file import FilterFile, Module
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.hdf5 import Provenance, add_dataset, add_scale, comment_design, write
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.version import __version__

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    Units = Complex[np.ndarray, " unit"]

MAT_HEAD = f"MATLAB 5.0 MAT-file, written by pendsus {__version__}".encode().ljust(116)
"""Header text of a MAT-file, 116 bytes (MAT-File Format, The MathWorks, "Level 5 MAT-File Header").
It replaces that of scipy, which contains the time of day."""
FORCES = ("force_x", "torque_pitch", "torque_yaw")
MOTIONS = ("x", "pitch", "yaw")
"""Forces on a mirror, and its motions, that finesse has."""
ORDER = 2 * foton_file.BIQUADS
"""Most poles of a section."""
FAINT = 1e-4
"""Change of a response up to which roots are removed that a section has room for."""
STRIDE = 4
"""Every fourth frequency is enough to choose them."""
REAL = 1e-3
"""Imaginary over real part up to which a pair of roots is a double real one."""
SHARE = 0.25
"""Largest frequency of a root over the sample rate."""
LONGEST = 35
"""Letters of the name of a module; front ends read 39."""
SUSPEND = '''
def _matrix(shape, row, column, value):
    result = np.zeros(shape)
    result[row, column] = value
    return result


PLANT = {{
{plant}
}}


def suspend(name, mirror, facing=1):
    """Suspend a mirror of finesse as the {mirror} of this design."""
    return Suspension(name, mirror, facing, PLANT)
'''
"""End of the module for finesse."""


def format_of(path: Path, made: Exported | gwinc_tables.Tables) -> str:
    """Name of the format of a path's ending; of a table for gwinc it is a folder, without ending.

    Raises `InputError` if there is none; only HDF5 has zeros, poles and gain.
    """
    if isinstance(made, gwinc_tables.Tables):
        if path.suffix:
            problem = "is no folder that gwinc reads"
            remedy = "leave out the dot"
            raise InputError.of("--out", problem, remedy, format_value(str(path)))
        return "gwinc"
    endings = {
        Path(f"x{form.suffix}").suffix: name
        for name, form in FORMATS.items()
        if name != "gwinc" and (name == "zpk") == (made.zpk is not None)
    }
    if path.suffix.lower() not in endings:
        problem = "is of no format" if made.zpk is None else "is of no format with zeros and poles"
        remedy = f"end it in {', '.join(endings)}"
        raise InputError.of("--out", problem, remedy, format_value(str(path)))
    return endings[path.suffix.lower()]


def _write_hdf5(path: Path, made: Exported, origin: Provenance) -> None:
    write(path, origin, lambda file: _fill(file, made))


def _write_mat(path: Path, made: Exported, origin: Provenance) -> None:
    from scipy.io import savemat

    cells = {
        key: np.array(value, dtype=object).reshape(-1, 1) if isinstance(value, tuple) else value
        for key, value in _fields(made, origin).items()
    }
    stream = io.BytesIO()
    savemat(stream, {"pendsus": cells}, oned_as="column", long_field_names=True)
    write_bytes(path, MAT_HEAD + stream.getvalue()[len(MAT_HEAD) :])


def _write_npz(path: Path, made: Exported, origin: Provenance) -> None:
    arrays: dict[str, Any] = _fields(made, origin)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    write_bytes(path, stream.getvalue())


def _write_control(path: Path, made: Exported, origin: Provenance) -> None:
    document = _fields(made, origin) | {"band_hz": made.band, "worst_error": made.worst}
    write_bytes(path, json.dumps(as_json(document), indent=1, allow_nan=False).encode())


def _fields(made: Exported, origin: Provenance) -> dict[str, Any]:
    """Fields of a file: matrices, names, units, band and error, provenance."""
    system = made.system
    names = ("state", "state_unit", "input", "input_unit", "output", "output_unit")
    return {
        **{name.upper(): getattr(system, name) for name in "abcd"},
        **{name: getattr(system, name) for name in names},
        **_agreement(made),
        **_bands(made),
        "design": origin.design,
        "command": origin.command,
        "fidelity": origin.fidelity,
        "fidelity_reason": origin.reason,
    }


def _agreement(made: Exported) -> dict[str, Any]:
    """Band of agreement (2,), Hz, NaN if there is none, and the errors in and beyond it."""
    band = np.array(made.band or (np.nan, np.nan))
    found = made.agreement
    result: dict[str, Any] = {"band_hz": band, "tolerance": made.tolerance}
    result["worst_error"] = made.worst
    if found is not None:
        result |= {"agreement_model": found.model, "agreement_unknown": found.unknown}
    return result


def _bands(made: Exported) -> dict[str, Float[np.ndarray, "tolerance ..."]]:
    """Errors against the most complete model, and the ends of their bands, Hz."""
    found = made.agreement
    if found is None:
        return {}
    ends = {"agreement_from_hz": found.low, "agreement_to_hz": found.high}
    return {"agreement_tolerance": np.array(AGREEMENT), **ends}


def _fill(file: h5py.File, made: Exported) -> None:
    group = file.create_group("statespace" if made.zpk is None else "zpk")
    group.attrs.update(_agreement(made))
    system = made.system
    into = add_scale(group, "input", list(system.input), "name")
    out = add_scale(group, "output", list(system.output), "name")
    add_dataset(group, "input_unit", list(system.input_unit), "name", into)
    add_dataset(group, "output_unit", list(system.output_unit), "name", out)
    if bands := _bands(made):
        error = add_scale(group, "agreement_tolerance", bands.pop("agreement_tolerance"), "1")
        for name, values in bands.items():
            add_dataset(group, name, values, "Hz", error, out, into)
    if made.zpk is not None:
        add_dataset(group, "gain", made.zpk.gain, "SI, with roots in rad/s", out, into)
        for o, i in np.ndindex(made.zpk.gain.shape):
            name = f"{system.output[o]} from {system.input[i]}"
            pair = group.create_group(name.replace("/", "_"))
            for name in ("zeros", "poles"):
                values = getattr(made.zpk, name)[o, i]
                number = add_scale(pair, name[:-1], np.arange(1, len(values) + 1), "1")
                add_dataset(pair, name, values, "rad/s", number)
        return
    state = add_scale(group, "state", list(system.state), "name")
    add_dataset(group, "state_unit", list(system.state_unit), "name", state)
    units = "SI, see the units of states, inputs and outputs"
    add_dataset(group, "A", system.a, units, state, state)
    add_dataset(group, "B", system.b, units, state, into)
    add_dataset(group, "C", system.c, units, out, state)
    add_dataset(group, "D", system.d, units, out, into)


def python_control(made: Exported) -> Any:
    """Convert a state space to a `control.StateSpace`.

    Needs python-control, which rejects dots in names: they become underscores.
    """
    control = import_module("control")  # type checkers trip over its sources

    system = made.system
    states, inputs, outputs = (
        [name.replace(".", "_") for name in names]
        for names in (system.state, system.input, system.output)
    )
    matrices = (system.a, system.b, system.c, system.d)
    return control.ss(*matrices, states=states, inputs=inputs, outputs=outputs)


def finesse_signals(chain: list[str]) -> tuple[list[str], list[str]]:
    """Inputs and outputs by default: the support's motions, forces on stages, and their motions."""
    moved = [f"{SUPPORT}.{dof}" for dof in MOTIONS]
    return (
        moved + [f"{body}.{force}" for body in chain for force in FORCES],
        [f"{body}.{dof}" for body in chain for dof in MOTIONS],
    )


def check_names(inputs: Sequence[str], outputs: Sequence[str], mirror: str) -> None:
    """Raise `InputError` for signals that are no nodes of finesse."""
    for option, names in (("--input", inputs), ("--output", outputs)):
        for name in names:
            body, _, kind = name.rpartition(".")
            remedy = ""
            if not name.replace(".", "").replace("-", "").isidentifier():
                remedy = f"take motions of and forces on the COM of one body, such as {mirror}.x"
            elif body == mirror and kind not in (*FORCES, *MOTIONS):
                remedy = f"finesse's mirrors have {', '.join((*MOTIONS, *FORCES))}"
            if remedy:
                raise InputError.of(option, "is no node of finesse", remedy, name)


def _plant(made: Exported) -> dict[str, Any]:
    """State space with the names of signals, as `finesse.Suspension` takes it."""
    system = made.system.balanced()
    found: dict[str, Any] = {key: getattr(system, key) for key in "abcd"}
    for key in ("input", "output"):
        found[key] = [name.replace("-", "_") for name in getattr(system, key)]
    return found | {"mirror": made.mirror.replace("-", "_")}


def _write_finesse(path: Path, made: Exported, origin: Provenance) -> None:
    """Write a Python module with the element and its numbers."""
    text = resources.files(__package__ or "").joinpath("finesse.py").read_text("utf-8")
    lines = []
    for key, value in _plant(made).items():
        shown = repr(value)
        if key in "abcd":
            row, column = np.nonzero(value)
            numbers = row.tolist(), column.tolist(), value[row, column].tolist()
            shown = f"_matrix({value.shape}, {', '.join(map(str, numbers))})"
        lines.append(f"    {key!r}: {shown},")
    end = SUSPEND.format(plant="\n".join(lines), mirror=made.mirror)
    write_bytes(path, f"{text}\n\n# Written by {origin.command}\n{end}".encode())


def suspend(made: Exported, name: str, mirror: Any, facing: int) -> Any:
    """Make the element of finesse."""
    module = import_module("suspension_cli.analyses.export.finesse")
    return module.Suspension(name, mirror, facing, _plant(made))


def make_foton(
    made: Exported,
    rate: float = 16384.0,
    band: tuple[float, float] = (0.1, 100.0),
    accuracy: float = 0.01,
) -> FilterFile:
    """Make a module of each response that is not 0, of as few sections as the accuracy allows.

    Raises `InputError` if the band ends above a quarter of the rate.
    """
    if band[1] > SHARE * rate:
        problem = f"is not four times the end of the band, {band[1]:g} Hz"
        raise InputError.of("--rate", problem, "give a higher rate, or --band", f"{rate:g}")
    form = compute_zero_pole_gain(made.system)
    frequency = np.geomspace(*band, GRID)
    whole = made.system.at(frequency)
    modules = []
    for o, i in np.argwhere(form.gain != 0):
        exact = whole[:, o, i]
        tried = []
        for count in range(1, foton_file.SECTIONS + 1):
            zeros, poles = (_units(r[o, i], SHARE * rate) for r in (form.zeros, form.poles))
            parts = _reduce(zeros, poles, frequency[::STRIDE], exact[::STRIDE], count * ORDER)
            text = [_digitise(part, rate) for part in parts]
            value = np.prod([foton.parse(one, rate).at(frequency) for one in text], axis=0)
            off = np.abs(value / exact - 1)[:, None, None]
            tried.append((float(off_resonance(off, frequency).max()), parts, text))
            if tried[-1][0] <= accuracy or len(parts) < count:
                break
        error, parts, text = min(tried, key=lambda one: one[0])
        signals = made.system.output[o], made.system.input[i]
        name = re.sub(r"\W+", "_", "_".join(signals)).upper()[:LONGEST]
        same = sum(one.name.startswith(name) for one in modules)
        name += f"_{same}" if same else ""
        modules.append(Module(name, *signals, parts, text, error))
    return FilterFile(rate, band, tuple(modules))


def _units(roots: Complex[np.ndarray, " root"], limit: float) -> Units:
    """Roots in Hz, positive in the left half plane, one of each pair, below a limit."""
    own = -np.asarray(roots, dtype=complex) / (2 * np.pi)
    own = np.where(np.abs(np.imag(own)) <= REAL * np.abs(np.real(own)), np.real(own), own)
    return own[(np.imag(own) >= 0) & (np.abs(own) < limit)]


def _count(units: Any) -> Any:
    """Number of roots that units stand for."""
    return 1 + (np.imag(units) > 0)


def _roots(unit: complex) -> tuple[complex, ...]:
    """The roots of a unit."""
    return (unit, unit.conjugate()) if np.imag(unit) else (unit,)


def _reduce(
    zeros: Units,
    poles: Units,
    frequency: Float[np.ndarray, " frequency"],
    exact: Complex[np.ndarray, " frequency"],
    most: int,
) -> list[Filter]:
    """Remove units until at most `most` poles are left, and no more zeros, and split the rest."""
    undamped = np.real(poles) < 0  # by rounding errors
    poles = np.where(undamped, 1j * np.imag(poles), poles)
    one = np.ones((1, len(frequency)))  # a row for no zero and no pole
    above, below = (
        np.array([*(foton.normalised(1.0, _roots(u), ()).at(frequency) for u in units), *one])
        for units in (zeros, poles)
    )
    rest = exact * below.prod(0) / above.prod(0)
    while True:
        counts = [np.append(_count(units), 0) for units in (zeros, poles)]
        order = counts[1].sum()
        spare = counts[1].sum() - counts[0].sum()
        pairs = [(-1, n) for n in range(len(poles))] + [(n, -1) for n in range(len(zeros))]
        for n, count in enumerate(counts[1][:-1]):
            apart = np.where(counts[0][:-1] == count, np.abs(zeros - poles[n]), np.inf)
            pairs += [(int(apart.argmin()), n)] if np.isfinite(apart).any() else []
        left = [spare + counts[0][z] - counts[1][p] for z, p in pairs]
        pairs = [pair for pair, n in zip(pairs, left, strict=True) if n >= 0 or n > spare]
        change = np.array([rest * above[z] / below[p] for z, p in pairs])
        size = _deviation(change)[1] if pairs else np.array([np.inf])
        chosen = int(size.argmin())
        if spare >= 0 and (not pairs or (order <= most and size[chosen] > FAINT)):
            return _split(zeros, poles, float(_deviation(rest)[0]))
        z, p = pairs[chosen]
        rest = change[chosen]
        if z >= 0:
            zeros = np.delete(zeros, z)
            above = np.delete(above, z, 0)
        if p >= 0:
            poles = np.delete(poles, p)
            below = np.delete(below, p, 0)


def _deviation(values: Complex[np.ndarray, "*change frequency"]) -> tuple[np.ndarray, np.ndarray]:
    """Real constants nearest to values along the last axis, and their largest distances."""
    size = np.abs(values)
    constant = np.sqrt(size.max(-1) * size.min(-1)) * np.sign(np.real(values).sum(-1))
    return constant, np.abs(values / constant[..., None] - 1).max(-1)


def _split(zeros: Units, poles: Units, gain: float) -> list[Filter]:
    """Split into filters of up to `ORDER` poles, pairs first, with the zeros next to them."""
    zeros, poles = (some[np.lexsort((np.abs(some), -_count(some)))] for some in (zeros, poles))
    ordered = [root for unit in poles for root in _roots(unit)]
    below = [ordered[n : n + ORDER] for n in range(0, len(ordered), ORDER)] or [[]]
    above: list[list[complex]] = [[] for _ in below]
    for unit in zeros:
        room = [n for n in range(len(below)) if len(below[n]) >= len(above[n]) + _count(unit)]
        nearest = min(room, key=lambda n: min(abs(abs(unit) - abs(pole)) for pole in below[n]))
        above[nearest] += _roots(unit)
    made = [foton.normalised(1.0, tuple(z), tuple(p)) for z, p in zip(above, below, strict=True)]
    return [made[0] * Filter(gain), *made[1:]]


def _digitise(part: Filter, rate: float) -> str:
    """Second-order sections of a filter at a sample rate, as a design string."""
    from scipy import signal

    made = foton.change_rate(part, rate)
    zeros, poles = (-2 * np.pi * np.array(some) for some in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    rows = signal.zpk2sos(*signal.bilinear_zpk(zeros, poles, gain, rate))
    gain = float(rows[:, 0].prod())
    numbers = np.column_stack([rows[:, 4:], rows[:, 1:3] / rows[:, :1]]).ravel().tolist()
    return f'sos({gain!r},[{";".join(map(repr, numbers))}],"o")'


def _write_foton(path: Path, made: Exported, origin: Provenance) -> None:
    """Write a filter file, with its design in comments."""
    lines = foton_file.lines(made.filters or make_foton(made), origin.command)
    write_bytes(path, "\n".join([*lines, "", *comment_design(origin.design), ""]).encode())


class Format(NamedTuple):
    """A file format: the end of the file name, and the function that writes the file."""

    suffix: str
    write: Callable[[Path, Any, Provenance], None]


FORMATS = {
    "mat": Format(".mat", _write_mat),
    "npz": Format(".npz", _write_npz),
    "hdf5": Format(".h5", _write_hdf5),
    "zpk": Format("-zpk.h5", _write_hdf5),
    "control": Format("-control.json", _write_control),
    "finesse": Format("-finesse.py", _write_finesse),
    "foton": Format("-foton.txt", _write_foton),
    "gwinc": Format("-gwinc", gwinc_tables.write),
}
