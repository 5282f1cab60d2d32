"""Filters and matrices of control loops for a front end: a filter file and matrix elements.

Each filter of the loops and of the inputs of computed sensors is a module. Readings go through
matrices to modules, and from modules to forces, as the loops of a design do (`loop_network`):

    reading = SENSE osem,    into = READ reading + PASS out,    force = DRIVE out.

SENSE and coils are there if there are OSEMs; PASS if modules read the outputs of others, as those
of estimators do. What is hardware is left out: responses of sensors, of drivers, and delays.

The elements are records of channels (`.snap`, as BURT writes them): a header, then for each channel
its name, the number of its values, 1, and the value.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import msgspec
import numpy as np

from suspension_cli.analyses.export.foton_modules import ORDER, name_module, split, write_sections
from suspension_cli.analyses.export.solve import Written
from suspension_cli.design import foton, foton_file
from suspension_cli.design.foton import Filter
from suspension_cli.design.foton_file import FilterFile, Module
from suspension_cli.errors import InputError
from suspension_cli.files import whole_files
from suspension_cli.files.documents import Layout
from suspension_cli.physics import local_control, model_choice

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.design.control import Control
    from suspension_cli.design.schema import Design
    from suspension_cli.files.hdf5 import Provenance
    from suspension_cli.physics.local_control import Plant
    from suspension_cli.physics.loop_network import Node

PREFIX = "X1:SUS-"
"""First part of the names of channels; X1 is that of test stands."""


@dataclass(frozen=True)
class Matrix:
    """A matrix of a front end.

    Attributes
    ----------
    name
        Of its channels.
    row, column
        What its rows make, and of what.
    value
        SI: m, rad, N, N m.
    """

    in_json: ClassVar = Layout(names={"name": "matrix", "row": "rows", "column": "columns"})
    name: str
    row: tuple[str, ...]
    column: tuple[str, ...]
    value: Float[np.ndarray, "row column"]


@dataclass(frozen=True)
class FrontEnd:
    """Filter modules of loops, and the matrices around them."""

    filters: FilterFile
    matrix: tuple[Matrix, ...]


@dataclass(frozen=True, eq=False, repr=False)
class FrontEndFiles(Written, FrontEnd):
    """What a front end needs for the loops of a design."""

    in_json: ClassVar = Layout(
        only="format file filters matrix", names={"matrix": "matrices"}, flat="filters"
    )
    format: str = "front-end"


def solve(analysis: Analysis, run: Run) -> FrontEndFiles:
    """Make the modules and matrices of the loops of a design; raises `InputError`."""
    setting = run.setting
    local_control.demand_loops(run.design)
    choice, model = model_choice.for_modes(
        run.source, setting["fidelity"], setting["tolerance"], massless=True
    )
    plant = local_control.build_plant(_without_hardware(run.design), model)
    found = make(plant, setting["rate"])
    return FrontEndFiles(found.filters, found.matrix, run=run.origin(analysis, choice))


def _without_hardware(design: Design) -> Design:
    """Leave out responses of sensors, which a front end does not compute, and delays."""
    control: Control | None = design.control
    assert control is not None
    replace: Any = msgspec.structs.replace
    control = replace(
        control,
        loop=[replace(one, sensor_response=None, delay=0.0) for one in control.loop],
        sensor=[replace(one, response=None) for one in control.sensor],
    )
    return replace(design, control=control)


def make(plant: Plant, rate: float) -> FrontEnd:
    """Make the modules and matrices of a plant at a sample rate (Hz).

    Raises `InputError` for a filter of another rate, or of more than ten sections.
    """
    network = plant.network
    modules = list[Module]()
    for number, node in enumerate(network.nodes, 1):
        name = name_module(node.name, [one.name for one in modules])
        parts = _divide(node, rate)
        text = [write_sections(part) for part in parts]
        modules.append(Module(name, node.name, f"row {number} of READ", parts, text))
    names = tuple(one.name for one in modules)
    channels = tuple(channel.name for channel in plant.channels)
    alone = np.flatnonzero(~(plant.driving != 0).any(0)).tolist()
    # forces are the outputs of the filters with the sign turned, u = -v; a 0 stays positive
    forces = 0.0 - np.concatenate([plant.driving, np.eye(len(plant.loops))[alone]])
    pushed = [f"coil {one.name}" for one in plant.osems]
    pushed += [plant.loops[n].actuator for n in alone]
    matrices = [
        Matrix("READ", names, channels, network.of_channels),
        Matrix("PASS", names, names, network.of_nodes),
        Matrix("DRIVE", tuple(pushed), names[: len(plant.loops)], forces),
    ]
    osems = tuple(f"OSEM {one.name}" for one in plant.osems)
    if osems:
        matrices.insert(0, Matrix("SENSE", channels, osems, plant.reading))
    shown = tuple(one for one in matrices if one.name != "PASS" or one.value.any())
    return FrontEnd(FilterFile(rate, None, tuple(modules)), shown)


def _divide(node: Node, rate: float) -> list[Filter]:
    """Make a filter digital as Foton does, and divide it into sections of a module."""
    gain = 1.0
    whole = Filter(1.0, rate=rate)
    for part in node.filter.parts:
        if not part.zeros and not part.poles:
            gain *= part.gain
        elif part.rate in (0.0, rate):
            whole = whole * _digitise(part, rate, node.key)
        else:
            problem = f"has a rate of {part.rate:g} Hz"
            raise InputError.of(node.key, problem, f"give --rate {part.rate:g}")
    gain *= whole.gain
    if len(whole.poles) <= ORDER:
        return [Filter(gain, whole.zeros, whole.poles, rate)]
    gain *= foton.product(whole.zeros) / foton.product(whole.poles)
    zeros, poles = (_half(roots) for roots in (whole.zeros, whole.poles))
    parts = split(zeros, poles, gain)
    if len(parts) > foton_file.SECTIONS:
        problem = f"has {len(whole.poles)} poles, for which ten sections have no room"
        raise InputError.of(node.key, problem, f"give up to {ORDER * foton_file.SECTIONS}")
    return [Filter(one.gain, one.zeros, one.poles, rate) for one in parts]


def _digitise(part: Filter, rate: float, key: str) -> Filter:
    """Make what Foton makes of a filter, with poles for an excess of zeros, as that of dampers."""
    if part.rate:
        return part
    try:
        return foton.parse(foton.format_filter(part), rate)
    except foton.FotonError as error:
        raise InputError.of(key, error.problem, error.remedy) from None


def _half(roots: Sequence[complex]) -> np.ndarray:
    """One root of each conjugate pair."""
    every = np.array(roots, dtype=complex)
    return every[np.imag(every) >= 0]


def write_filters(path: Path, made: FrontEndFiles, origin: Provenance) -> None:
    """Write the filter file, with its design in comments."""
    from suspension_cli.files.hdf5 import comment_design

    lines = foton_file.lines(made.filters, origin.command)
    lines += ["", *_explain(made.matrix), "", *comment_design(origin.design), ""]
    whole_files.write_bytes(path, "\n".join(lines).encode())


def _explain(matrices: Sequence[Matrix]) -> Iterator[str]:
    """List in comments what the rows and columns of matrices are."""
    for one in matrices:
        yield f"# MATRIX {one.name}"
        for kind, names in (("row", one.row), ("column", one.column)):
            yield from (f"#   {kind} {n}: {name}" for n, name in enumerate(names, 1))


def write_matrices(path: Path, made: FrontEndFiles, origin: Provenance) -> None:
    """Write the elements of matrices and the gains of modules, 1, as records of channels."""
    lines = ["--- Start BURT header", f"Comments:  {origin.command}", "Type:     Absolute"]
    lines.append("--- End BURT header")
    lines += [f"{PREFIX}{one.name}_GAIN 1 {1.0:.16e}" for one in made.filters.module]
    for one in made.matrix:
        for (row, column), value in np.ndenumerate(one.value):
            lines.append(f"{PREFIX}{one.name}_{row + 1}_{column + 1} 1 {value:.16e}")
    whole_files.write_bytes(path, "\n".join([*lines, ""]).encode())
