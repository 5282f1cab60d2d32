"""Tables of numbers in text files: CSV, or columns separated by blanks, tabs or semicolons."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.files import bounded
from suspension_cli.measurements.columns import Columns, recognise

COMMENTS = ("#", "%")


def read(path: Path) -> Columns:
    """Read a table with or without a line of headings, with comments after # or %.

    Comment lines before the first numbers may hold the headings.

    Raises
    ------
    InputError
        With the line of a word among numbers, or of a wrong number of columns.
    """
    rows, headings = _rows(path)
    if not rows:
        raise InputError.of("", "has no numbers", "give a frequency and a value per line")
    width = len(rows[0][1])
    for line, cells in rows:
        if len(cells) != width:
            problem = f"has {len(cells)} columns, but line {rows[0][0]} has {width}"
            raise InputError.of(f"line {line}", problem, "give every line all columns")
    names = _heading(headings, width)
    values = [[_number(cell, line) for cell in cells] for line, cells in rows]
    lines = [line for line, _ in rows]
    return Columns(
        names or [str(n) for n in range(1, width + 1)],
        lambda n: np.array([row[n] for row in values]),
        lambda n: f"line {lines[n]}",
        headed=names is not None,
    )


def _heading(above: list[tuple[int, list[str]]], width: int) -> list[str] | None:
    """Choose the headings among the lines above the numbers; line 0 is a comment."""
    fitting = [cells for _, cells in above if len(cells) == width]
    for cells in reversed(fitting):
        if "frequency" in recognise(cells):
            return cells
    line, last = above[-1] if above else (0, [])
    if line and len(last) != width:
        problem = f"has {len(last)} headings for {width} columns"
        raise InputError.of(f"line {line}", problem, "give every column a heading")
    return fitting[-1] if line else None


def _rows(path: Path) -> tuple[list[tuple[int, list[str]]], list[tuple[int, list[str]]]]:
    """Split lines with numbers into cells; also the lines above them, comments as line 0."""
    rows: list[tuple[int, list[str]]] = []
    above: list[tuple[int, list[str]]] = []
    delimiter = None
    whole = bounded.read_text(path, bounded.TEXT, "a CSV, HDF5 or DTT XML file")
    for line, text in enumerate(whole.splitlines(), 1):
        bare = text.strip()
        if not bare:
            continue
        if bare.startswith(COMMENTS):
            words = bare.lstrip("#% ")
            above += [] if rows else [(0, _split(words, _delimiter(words)))]
            continue
        if not rows:
            delimiter = _delimiter(bare)
        cells = _split(bare, delimiter)
        (rows if rows or _parsed(cells[0]) is not None else above).append((line, cells))
    return rows, above


def _delimiter(line: str) -> str | None:
    """Return the delimiter of a line: semicolon, comma or tab; None for blanks."""
    return next((mark for mark in (";", ",", "\t") if mark in line), None)


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return [cell.strip() for cell in cells]


def _parsed(cell: str) -> complex | float | None:
    """Return the real or complex number of a cell; None if it is none."""
    for kind, text in ((float, cell), (complex, cell.replace(" ", "").replace("i", "j"))):
        try:
            return kind(text)
        except ValueError:
            continue
    return None


def _number(cell: str, line: int) -> complex | float:
    number = _parsed(cell)
    if number is None:
        problem = f"{format_value(cell)} is not a number"
        remedy = "write numbers with a decimal point, or # before a comment"
        raise InputError.of(f"line {line}", problem, remedy)
    return number
