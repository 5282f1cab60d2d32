"""Files of exported systems, in the formats of `pendsus export`; objects of other programs.

`FORMATS` lists the formats. As `--help` prints them, this module imports nothing heavy; the
functions that write the files do.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from importlib import import_module, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from suspension_cli.conventions import SUPPORT
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.documents import as_json
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.version import __version__

if TYPE_CHECKING:
    import h5py
    import numpy as np
    from jaxtyping import Float

    from suspension_cli.analyses.export.front_end import FrontEndFiles
    from suspension_cli.analyses.export.gwinc_tables import GwincTables
    from suspension_cli.analyses.export.solve import Export, Exported
    from suspension_cli.files.hdf5 import Provenance

MAT_HEAD = f"MATLAB 5.0 MAT-file, written by pendsus {__version__}".encode().ljust(116)
"""Header text of a MAT-file, 116 bytes (MAT-File Format, The MathWorks, "Level 5 MAT-File Header").
It replaces that of scipy, which contains the time of day."""
FORCES = ("force_x", "torque_pitch", "torque_yaw")
MOTIONS = ("x", "pitch", "yaw")
"""Forces on a mirror, and its motions, that finesse has."""
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


def format_of(path: Path, made: Export | GwincTables | FrontEndFiles) -> str:
    """Name of the format of a path's ending; of a table for gwinc it is a folder, without ending.

    Raises `InputError` if there is none; only HDF5 has zeros, poles and gain.
    """
    if made.format == "gwinc":
        if path.suffix:
            problem = "is no folder that gwinc reads"
            remedy = "leave out the dot"
            raise InputError.of("--out", problem, remedy, format_value(str(path)))
        return "gwinc"
    alone = {"gwinc", "front-end"}
    if made.format == "front-end":
        suitable = ["front-end"]
    elif cast("Export", made).zpk is not None:
        suitable = ["zpk"]
    else:
        suitable = [name for name in FORMATS if name not in {*alone, "zpk"}]
    endings = {Path(f"x{FORMATS[name].suffix}").suffix: name for name in suitable}
    if path.suffix.lower() not in endings:
        problem = "is of no format of this result"
        remedy = f"end it in {', '.join(endings)}"
        raise InputError.of("--out", problem, remedy, format_value(str(path)))
    return endings[path.suffix.lower()]


def _write_hdf5(path: Path, made: Exported, origin: Provenance) -> None:
    from suspension_cli.files import hdf5

    hdf5.write(path, origin, lambda file: _fill(file, made))


def _write_mat(path: Path, made: Exported, origin: Provenance) -> None:
    import numpy as np
    from scipy.io import savemat

    cells = {
        key: np.array(value, dtype=object).reshape(-1, 1) if isinstance(value, tuple) else value
        for key, value in _fields(made, origin).items()
    }
    stream = io.BytesIO()
    savemat(stream, {"pendsus": cells}, oned_as="column", long_field_names=True)
    write_bytes(path, MAT_HEAD + stream.getvalue()[len(MAT_HEAD) :])


def _write_npz(path: Path, made: Exported, origin: Provenance) -> None:
    import numpy as np

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
        **_orders(made),
        "design": origin.design,
        "command": origin.command,
        "fidelity": origin.fidelity,
        "fidelity_reason": origin.reason,
    }


def _agreement(made: Exported) -> dict[str, Any]:
    """Band of agreement (2,), Hz, NaN if there is none, and the errors in and beyond it."""
    import numpy as np

    band = np.array(made.band or (np.nan, np.nan))
    found = made.agreement
    result: dict[str, Any] = {"band_hz": band, "tolerance": made.tolerance}
    result["worst_error"] = made.worst
    if found is not None:
        result |= {"agreement_model": found.model, "agreement_unknown": found.unknown}
    if made.poles is not None:
        result["pole_difference"] = made.poles.largest(made.tried[1])[0]
        result["pole_q_error"] = made.poles.q_error(made.tried)
    return result


def _bands(made: Exported) -> dict[str, Float[np.ndarray, "tolerance ..."]]:
    """Errors against the most complete model, and the ends of their bands, Hz."""
    import numpy as np

    from suspension_cli.analyses.export.solve import AGREEMENT

    found = made.agreement
    if found is None:
        return {}
    ends = {"agreement_from_hz": found.low, "agreement_to_hz": found.high}
    return {"agreement_tolerance": np.array(AGREEMENT), **ends}


def _orders(made: Exported) -> dict[str, np.ndarray]:
    """Numbers of states and the errors with so many, of a system with losses."""
    found = made.orders
    if found is None:
        return {}
    return {
        "order_states": found.states,
        "order_error": found.worst,
        "order_q_error": found.q_error,
    }


def _fill(file: h5py.File, made: Exported) -> None:
    import numpy as np

    from suspension_cli.files.hdf5 import add_dataset, add_scale

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
    if orders := _orders(made):
        states = add_scale(group, "order_states", orders.pop("order_states"), "1")
        for name, values in orders.items():
            add_dataset(group, name, values, "1", states)
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
    import numpy as np

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


def _write_foton(path: Path, made: Exported, origin: Provenance) -> None:
    """Write a filter file, with its design in comments."""
    from suspension_cli.analyses.export.foton_modules import make_foton
    from suspension_cli.design import foton_file
    from suspension_cli.files.hdf5 import comment_design

    lines = foton_file.lines(made.filters or make_foton(made), origin.command)
    write_bytes(path, "\n".join([*lines, "", *comment_design(origin.design), ""]).encode())


def _write_front_end(path: Path, made: FrontEndFiles, origin: Provenance) -> None:
    from suspension_cli.analyses.export import front_end

    front_end.write_filters(path, made, origin)


def _write_gwinc(path: Path, made: GwincTables, origin: Provenance) -> None:
    from suspension_cli.analyses.export import gwinc_tables

    gwinc_tables.write(path, made, origin)


class Format(NamedTuple):
    """A file format.

    Attributes
    ----------
    suffix
        End of the file name.
    write
        Function that writes the file.
    about
        What it is for, in `--help`.
    """

    suffix: str
    write: Callable[[Path, Any, Provenance], None]
    about: str


FORMATS = {
    "mat": Format(".mat", _write_mat, "MATLAB"),
    "npz": Format(".npz", _write_npz, "numpy"),
    "hdf5": Format(".h5", _write_hdf5, "HDF5"),
    "zpk": Format("-zpk.h5", _write_hdf5, "zeros, poles, gain"),
    "control": Format("-control.json", _write_control, "python-control"),
    "finesse": Format(
        "-finesse.py", _write_finesse, "a Python module with an element of finesse 3"
    ),
    "foton": Format("-foton.txt", _write_foton, "a filter file of a front end"),
    "front-end": Format(
        "-front-end.txt", _write_front_end, "filters and matrices of the loops for a front end"
    ),
    "gwinc": Format("-gwinc", _write_gwinc, "a folder with a noise budget of gwinc"),
}
