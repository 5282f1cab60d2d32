"""State-space and zero-pole-gain files for other tools."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli import __version__
from suspension_cli.analysis.export import Exported
from suspension_cli.results import Provenance, dataset, scale, write, write_bytes

MAT_HEAD = f"MATLAB 5.0 MAT-file, written by pendsus {__version__}".encode().ljust(116)
"""What a MAT-file says of itself: 116 bytes of text, where scipy would put the time of day (MAT-File Format, The MathWorks, "Level 5 MAT-File Header")."""


def save(path: Path, form: str, made: Exported, origin: Provenance) -> None:
    """Write an export in one of the formats of `pendsus export`."""
    if form in ("hdf5", "zpk"):
        write(path, origin, lambda file: _fill(file, made))
        return
    fields = _fields(made, origin)
    stream = io.BytesIO()
    if form == "mat":
        from scipy.io import savemat

        cells = {key: np.array(value, dtype=object).reshape(-1, 1) if isinstance(value, tuple) else value for key, value in fields.items()}
        savemat(stream, {"pendsus": cells}, oned_as="column", long_field_names=True)
    elif form == "npz":
        arrays: dict[str, Any] = {key: np.array(value) for key, value in fields.items()}
        np.savez(stream, **arrays)
    else:
        plain = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in fields.items()}
        plain["band_hz"] = made.band
        plain["worst_error"] = made.worst if np.isfinite(made.worst) else None
        stream.write(json.dumps(plain, indent=1, allow_nan=False).encode())
    image = stream.getvalue()
    write_bytes(path, MAT_HEAD + image[len(MAT_HEAD) :] if form == "mat" else image)


def _fields(made: Exported, origin: Provenance) -> dict[str, Any]:
    """Everything by name: matrices, names and units, and what was measured."""
    system = made.system
    return {
        "A": system.a,
        "B": system.b,
        "C": system.c,
        "D": system.d,
        "state": system.state,
        "state_unit": system.state_unit,
        "input": system.input,
        "input_unit": system.input_unit,
        "output": system.output,
        "output_unit": system.output_unit,
        "band_hz": _band(made),
        "tolerance": made.tolerance,
        "worst_error": made.worst,
        "design": origin.design,
        "command": origin.command,
        "fidelity": origin.fidelity,
        "fidelity_reason": origin.reason,
    }


def _band(made: Exported) -> Any:
    """The band (2,), NaN if there is none."""
    return np.array(made.band or (np.nan, np.nan))


def _fill(file: h5py.File, made: Exported) -> None:
    group = file.create_group("statespace" if made.zpk is None else "zpk")
    group.attrs["band_hz"], group.attrs["tolerance"], group.attrs["worst_error"] = _band(made), made.tolerance, made.worst
    system = made.system
    into, out = scale(group, "input", list(system.input), "name"), scale(group, "output", list(system.output), "name")
    dataset(group, "input_unit", list(system.input_unit), "name", into)
    dataset(group, "output_unit", list(system.output_unit), "name", out)
    if made.zpk is not None:
        dataset(group, "gain", made.zpk.gain, "SI, with roots in rad/s", out, into)
        for o, output in enumerate(system.output):
            for i, drive in enumerate(system.input):
                pair = group.create_group(f"{output} from {drive}".replace("/", "_"))
                for name, values in (("zeros", made.zpk.zeros[o][i]), ("poles", made.zpk.poles[o][i])):
                    number = scale(pair, name[:-1], np.arange(1, len(values) + 1), "1")
                    dataset(pair, name, values, "rad/s", number)
        return
    state = scale(group, "state", list(system.state), "name")
    dataset(group, "state_unit", list(system.state_unit), "name", state)
    for name, matrix, axes in (("A", system.a, (state, state)), ("B", system.b, (state, into)), ("C", system.c, (out, state)), ("D", system.d, (out, into))):
        dataset(group, name, matrix, "SI, see the units of states, inputs and outputs", *axes)


def python_control(path: str | Path) -> Any:
    """A `control.StateSpace` from a file that ``pendsus export --format control`` wrote (needs python-control).

    Names have an underscore for every dot, which python-control does not take.
    """
    import control  # pyright: ignore[reportMissingImports]

    given = json.loads(Path(path).read_text())
    matrices = [np.array(given[name]).reshape(shape) for name, shape in _shapes(given).items()]
    states, inputs, outputs = ([name.replace(".", "_") for name in given[key]] for key in ("state", "input", "output"))
    return control.ss(*matrices, states=states, inputs=inputs, outputs=outputs)


def _shapes(given: dict[str, Any]) -> dict[str, tuple[int, int]]:
    n, i, o = (len(given[key]) for key in ("state", "input", "output"))
    return {"A": (n, n), "B": (n, i), "C": (o, n), "D": (o, i)}
