"""Reading of the CSV files of links: complex stiffness against frequency."""

from __future__ import annotations

import math
from pathlib import Path

from suspension_cli.design import csv_columns
from suspension_cli.design.csv_columns import BadTable
from suspension_cli.design.units import Raw
from suspension_cli.errors import InputError, format_value

COLUMNS = (3, 13)
"""Numbers of columns of a table of one axis and of six."""


def insert_tables(raw: Raw, folder: Path) -> None:
    """Replace the files named in `[link.table]` of a parsed document by their columns, in place.

    Names are from `folder`, that of the design. Raises `InputError` for a file that cannot be read
    or has another form.
    """
    links = raw.get("link")
    for number, link in enumerate(links if isinstance(links, list) else [], 1):
        table = link.get("table") if isinstance(link, dict) else None
        if not isinstance(table, dict) or not isinstance(table.get("file"), str):
            continue
        key = f"link.{link.get('name', number)}.table"
        given = [name for name in ("frequency", "real", "imaginary") if name in table]
        if given:
            raise InputError.of(f"{key}.{given[0]}", "is also in the file", "remove it, or file")
        name = table.pop("file")
        try:
            table |= _columns(folder / name, table.pop("form", "real-imaginary"))
        except BadTable as error:
            value = format_value(name)
            raise InputError.of(f"{key}.file", error.problem, error.remedy, value) from None


def _columns(path: Path, form: str) -> Raw:
    """Frequency, real and imaginary parts per axis of a CSV file."""
    _, columns = csv_columns.read(path)
    if len(columns) not in COLUMNS:
        remedy = "give frequency and two columns per axis: 3 columns for one axis, 13 for six"
        raise BadTable(f"has {len(columns)} columns", remedy)
    first, second = columns[1::2], columns[2::2]
    if form == "modulus-loss":
        pairs = [list(zip(a, b, strict=True)) for a, b in zip(first, second, strict=True)]
        first = [[k * math.cos(phi) for k, phi in pair] for pair in pairs]
        second = [[k * math.sin(phi) for k, phi in pair] for pair in pairs]
    return {"frequency": columns[0], "real": first, "imaginary": second}
