"""The analyses by name; each is imported only when it is used."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suspension_cli.analyses.analysis import Analysis
from suspension_cli.analyses.record import Origin
from suspension_cli.conventions import ANALYSES

if TYPE_CHECKING:
    import h5py

    from suspension_cli.design.reader import Source

GROUPS = (*ANALYSES, "matrix")
"""Groups of results files, in the order in which they are looked for."""


def get(name: str) -> Analysis:
    """Import an analysis.

    >>> get("modes").name
    'modes'
    """
    if name == "matrix":
        return importlib.import_module("suspension_cli.analyses.xcouple.command").MATRIX
    return importlib.import_module(f"suspension_cli.analyses.{name}.command").ANALYSIS


def loaded(file: h5py.File, name: str, kind: type[Source] | None = None) -> Any:
    """Read a result from an open results file, with its design as a `Source` (or `kind`).

    Raises `InputError` if the file holds no result of an analysis.
    """
    from suspension_cli.design import reader
    from suspension_cli.errors import Fault, InputError
    from suspension_cli.models.registry import Choice

    found = next((group for group in GROUPS if group in file), None)
    if found is None:
        remedy = f"name a file of pendsus {', '.join(n for n in ANALYSES if get(n).result_type)}"
        raise InputError([Fault("", "holds no result of an analysis", remedy)], name)
    known = {key: str(file.attrs[key]) for key in ("design", "fidelity", "fidelity_reason")}
    text = known["design"]
    error = float(str(file.attrs["estimated_error"]))
    choice = Choice(known["fidelity"], known["fidelity_reason"], error)
    source = (kind or reader.Source)(reader.parse(text), text, name)
    command = str(file.attrs["command"])
    warned = tuple(str(one) for one in list(file.attrs.get("warnings", ())))
    analysis = get(found)
    run = Origin(analysis, source, choice, command, warned, file=Path(file.filename))
    extra = dict(json.loads(str(file.attrs.get("extra", "{}"))))
    return analysis.read_result(file, run, extra)
