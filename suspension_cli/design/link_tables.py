"""Reading of the CSV files of links: complex stiffness against frequency.

When a design is read from a file, the columns of each table replace the name of its file, so that
the text of the design, which results files contain, is complete.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from suspension_cli.errors import InputError, format_value

AXES = (1, 6)
"""Numbers of axes that a table may have."""


def insert_tables(raw: dict[str, Any], folder: Path) -> None:
    """Replace the files named in `[link.table]` of a parsed document by their columns, in place.

    Parameters
    ----------
    folder
        Folder of the design file.

    Raises
    ------
    InputError
        If a file cannot be read or has another form.
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
        table |= _columns(folder / name, name, f"{key}.file", table.pop("form", "real-imaginary"))


def _columns(path: Path, name: str, key: str, form: str) -> dict[str, Any]:
    """Frequency, real and imaginary parts per axis of a CSV file."""

    def fault(problem: str, remedy: str) -> InputError:
        return InputError.of(key, problem, remedy, format_value(name))

    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise fault(
            f"cannot be read ({reason})", "give its path from the folder of the design file"
        ) from None
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        try:
            row = [float(cell) for cell in text.replace(";", ",").split(",")]
        except ValueError:
            if rows:
                raise fault(
                    f"has no numbers in line {number}", "write numbers with commas between them"
                ) from None
            continue  # headings
        if not all(map(math.isfinite, row)) or (rows and len(row) != len(rows[0])):
            raise fault(
                f"has {len(row)} numbers in line {number}, or one that is not finite",
                "give every line finite numbers in the same columns",
            )
        rows.append(row)
    if not rows or (len(rows[0]) - 1) / 2 not in AXES:
        count = len(rows[0]) if rows else 0
        raise fault(
            f"has {count} columns",
            "give frequency and two columns per axis: 3 columns for one axis, 13 for six",
        )
    columns = list(map(list, zip(*rows, strict=True)))
    first, second = columns[1::2], columns[2::2]
    if form == "modulus-loss":
        pairs = [list(zip(a, b, strict=True)) for a, b in zip(first, second, strict=True)]
        first = [[k * math.cos(phi) for k, phi in pair] for pair in pairs]
        second = [[k * math.sin(phi) for k, phi in pair] for pair in pairs]
    return {"frequency": columns[0], "real": first, "imaginary": second}
