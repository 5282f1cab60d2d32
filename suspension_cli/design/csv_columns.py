"""Columns of numbers of the CSV files that a design names; units of columns in their headings.

When a design is read, the columns of each CSV file replace its name, so that its text, which
results embed, is complete.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from suspension_cli.design.tables import Raw
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.files import bounded

EXAMPLES = Path(__file__).parents[1] / "examples"
_SMALL = {"m": 1e3, "u": 1e6, "\u00b5": 1e6, "\u03bc": 1e6, "n": 1e9, "p": 1e12, "f": 1e15}
PER_M = {"m": 1.0, "cm": 1e2} | {f"{prefix}m": number for prefix, number in _SMALL.items()}
PER_RAD = {"rad": 1.0} | {f"{prefix}rad": number for prefix, number in _SMALL.items()}
PER_HZ = {"Hz": 1.0, "hz": 1.0, "mHz": 1e3, "kHz": 1e-3}
"""Numbers of units per SI unit: to divide by them rounds correctly, 400 um are 0.0004 m."""


class BadTable(InputError):
    """Fault of a CSV file: what is wrong, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__([Fault("", problem, remedy)])
        self.problem, self.remedy = problem, remedy


def split_unit(title: str, units: Mapping[str, float]) -> tuple[str, float]:
    """Split the heading of a column into its name and its unit, as the number per SI unit.

    The unit is in brackets, "x (um)", or a word that is one of `units`, position_mm; without either
    it is SI. Raises `BadTable` for another unit in brackets.
    """
    bracketed = re.match(r"(.*?)[\s_]*[(\[]([^)\]]*)", title.strip())
    if bracketed is not None:
        name, unit = bracketed[1], bracketed[2].strip()
        if unit not in units:
            problem = f"has the column {format_value(title)}, whose unit is not known"
            raise BadTable(problem, f"give it in {', '.join(unit for unit in units if unit)}")
        return name, units[unit]
    words = re.split(r"[\s_/]+", title.strip())
    for n, word in reversed([*enumerate(words)]):
        if word in units:
            return " ".join(words[:n]), units[word]
    return title.strip(), 1.0


def read(file: Path) -> tuple[list[str], list[list[float]]]:
    """Read the headings (if any) and the columns of a CSV file.

    Cells are separated by commas or semicolons; what follows # is a comment.

    Raises `BadTable` if it cannot be read, or its lines are not numbers in the same columns.
    """
    try:
        text = bounded.read_text(file, bounded.TOML, "a CSV file")
    except InputError as error:
        remedy = "give its path from the folder of the design file"
        raise BadTable(error.faults[0].problem, remedy) from None
    headings: list[str] = []
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        cells = [cell.strip() for cell in line.partition("#")[0].replace(";", ",").split(",")]
        if not any(cells):
            continue
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            if rows:
                remedy = "write numbers with commas between them"
                raise BadTable(f"has no numbers in line {number}", remedy) from None
            headings = cells
            continue
        if not all(map(math.isfinite, row)) or (rows and len(row) != len(rows[0])):
            raise BadTable(
                f"has {len(row)} numbers in line {number}, or one that is not finite",
                "give every line finite numbers in the same columns",
            )
        rows.append(row)
    return headings, list(map(list, zip(*rows, strict=True)))


def insert_files(raw: Raw, folder: Path, *, of_links: bool = True) -> None:
    """Replace the CSV files that fibres and links name by their columns, in a parsed document.

    Names are from `folder`, that of the design; profiles may also be among the program's examples.
    Raises `InputError` for files that cannot be read or have another form.
    """
    found: list[Fault] = []
    links = [*_tables(raw, "link", "link")] if of_links else []
    for path, table in [(f"{path}.table", link.get("table")) for path, link in links]:
        if not isinstance(table, dict) or not isinstance(table.get("file"), str):
            continue
        given = [name for name in ("frequency", "real", "imaginary") if name in table]
        if given:
            found.append(Fault(f"{path}.{given[0]}", "is also in the file", "remove it, or file"))
            continue
        name, form = table.pop("file"), table.pop("form", "real-imaginary")
        with _reported(found, f"{path}.file", name):
            table |= _stiffness(folder / name, form)
    for where, stage in _tables(raw, "stage", "stage"):
        wires = [(f"{where}.wires", stage.get("wires")), *_tables(stage, "wire", f"{where}.wire")]
        for path, wire in wires:
            own = wire.get("profile") if isinstance(wire, dict) else None
            own = {"file": own} if isinstance(own, str) else own
            if not isinstance(own, dict) or "position" in own or "diameter" in own:
                continue
            if isinstance(name := own.get("file"), str):
                shipped = EXAMPLES / Path(name).name
                local = os.path.exists(folder / name) or not shipped.exists()
                with _reported(found, f"{path}.profile", name):
                    wire["profile"] = own | _diameters(folder / name if local else shipped)
    if found:
        raise InputError(found)


def _tables(raw: Raw, key: str, path: str) -> Iterator[tuple[str, Raw]]:
    """List the tables of an array, each behind its path."""
    rows = raw.get(key)
    for number, row in enumerate(rows if isinstance(rows, list) else [], 1):
        if isinstance(row, dict):
            yield f"{path}.{row.get('name', number)}", row


@contextlib.contextmanager
def _reported(found: list[Fault], key: str, name: str) -> Iterator[None]:
    """Collect the fault of a file that is read inside."""
    try:
        yield
    except BadTable as error:
        found.append(Fault(key, error.problem, error.remedy, format_value(name)))


def _diameters(file: Path) -> Raw:
    """Read positions and diameters (m) from a CSV file of two columns."""
    headings, columns = read(file)
    if len(columns) not in (0, 2):
        raise BadTable(f"has {len(columns)} columns", "write position,diameter in each line")
    if not columns or len(columns[0]) < 2:
        raise BadTable("has fewer than two lines of numbers", "measure more places")
    titles = headings if len(headings) == 2 else ["", ""]
    keys = ("position", "diameter")
    return {
        key: [value / split_unit(title, PER_M)[1] for value in column]
        for key, column, title in zip(keys, columns, titles, strict=True)
    }


def _stiffness(path: Path, form: str) -> Raw:
    """Frequency, real and imaginary parts per axis of a CSV file."""
    _, columns = read(path)
    if len(columns) not in (3, 13):
        remedy = "give frequency and two columns per axis: 3 columns for one axis, 13 for six"
        raise BadTable(f"has {len(columns)} columns", remedy)
    first, second = columns[1::2], columns[2::2]
    if form == "modulus-loss":
        pairs = [list(zip(a, b, strict=True)) for a, b in zip(first, second, strict=True)]
        first = [[k * math.cos(phi) for k, phi in pair] for pair in pairs]
        second = [[k * math.sin(phi) for k, phi in pair] for pair in pairs]
    return {"frequency": columns[0], "real": first, "imaginary": second}
