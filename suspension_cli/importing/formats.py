"""The files of other programs that can be imported, and which of them one is."""

from __future__ import annotations

import re
from pathlib import Path

from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.files import whole_files
from suspension_cli.importing import convert, gwinc_suspension
from suspension_cli.importing.imported import Imported

KINDS = "a save of SUMCON (save$... = {...}) or parameters of gwinc (Suspension: ...)"


def read(
    file: Path,
    name: str,
    reference: str = "",
    *,
    tables: Path | None = None,
    bending_points: bool = False,
) -> Imported:
    """Read a file of another program, whichever it is; the arguments are those of `convert.read`.

    Raises `InputError` if it is of none, or has faults.
    """
    with attribute_faults_to(str(file)):
        text = whole_files.read_text(file, whole_files.TEXT, KINDS)
        if re.search(r"^save\$\w+[ \t]*=", text, re.M):
            return convert.read(file, name, reference, tables=tables, bending_points=bending_points)
        is_yaml = file.suffix.lower() in (".yaml", ".yml")
        if not is_yaml and not re.search(r"^Suspension[ \t]*:", text, re.M):
            raise InputError.of("", "is of none of the known programs", f"name {KINDS}")
    for option, given in (("--tables", tables), ("--bending-points", bending_points)):
        if given:
            problem = f"is for saves of SUMCON; {file} has parameters of gwinc"
            raise InputError.of(option, problem, "leave it out")
    return gwinc_suspension.read(file, name, reference)
