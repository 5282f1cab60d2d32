"""Results as CSV: one row per frequency, mode or point of a grid, one column per number.

The columns follow from the results file: dimensions whose scale is numeric (frequency, mode, an
axis of a sweep) make rows, those with names (output, input, coordinate) make columns.
"""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from suspension_cli.analyses.labelled import stored_group, values_of
from suspension_cli.files.atomic import write_bytes

if TYPE_CHECKING:
    from suspension_cli.files.hdf5 import Stored


def write(result: Any, path: Path) -> list[Path]:
    """Write the CSV files of an `analysis.Result`, and return their paths.

    For the results file NAME.h5 (`path`), the main results go to NAME.csv; arrays with other rows
    get files of their own, NAME-ROWS.csv.
    """
    with stored_group(result) as group:
        found = dict(_tables(group))
    paths = []
    for n, (rows, text) in enumerate(found.items()):
        stem = f"{path.stem}-{rows}" if n else path.stem
        target = path.with_name(f"{stem}.csv")
        write_bytes(target, text.encode())
        paths.append(target)
    return paths


def _tables(group: Stored, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield the rows of each table (for the name of its file) and its text."""
    members = {name: item for name, item in group.items() if isinstance(item, h5py.Dataset)}
    tables: dict[tuple[str, ...], list[str]] = {}
    for name, data in members.items():
        if data.is_scale or not data.ndim or not data.size:
            continue
        labels = _labels(data, name)
        rows = tuple(label for label in labels if _is_numeric(members.get(label)))
        tables.setdefault(rows or labels[:1], []).append(name)

    def rank(rows: tuple[str, ...]) -> tuple[bool, int, int]:
        return not all(_is_numeric(members.get(row)) for row in rows), len(rows), -len(tables[rows])

    for rows in sorted(tables, key=rank):  # the main results first: points of a sweep, not modes
        names = sorted(
            tables[rows],
            key=lambda n: (_is_numeric(members[n]), n != "value", n),
        )
        if any(_is_numeric(members[name]) for name in names):
            stem = "-".join(part for part in (prefix, *rows) if part)
            yield re.sub(r"[^A-Za-z0-9._-]+", "-", stem), _text(members, rows, names)
    for name, item in group.items():
        if isinstance(item, h5py.Group):
            yield from _tables(item, "-".join(part for part in (prefix, name) if part))


def _labels(data: h5py.Dataset, name: str) -> tuple[str, ...]:
    """Names of the dimensions of a dataset; numbered names where it has no scales."""
    if data.ndim == 1 and not data.dims[0].label:
        return ("row",)
    return tuple(data.dims[n].label or f"{name}_{n}" for n in range(data.ndim))


def _is_numeric(data: h5py.Dataset | None) -> bool:
    return data is None or data.dtype.kind in "iufcb"


def _text(members: dict[str, h5py.Dataset], rows: tuple[str, ...], names: list[str]) -> str:
    """Make the table of some datasets that have the same rows."""
    labels = {name: _labels(members[name], name) for name in names}
    known = {label for own in labels.values() for label in own if label in members}
    scales = {label: values_of(members[label]) for label in known}
    heads, columns, shape = [], [], ()
    for name in names:
        data = members[name]
        own = [label for label in labels[name] if label in rows]
        others = [n for n, label in enumerate(labels[name]) if label not in own]
        order = [labels[name].index(label) for label in own] + others
        values = values_of(data).transpose(order)
        if set(rows) <= set(own):
            shape = tuple(data.shape[labels[name].index(row)] for row in rows)
        wide = values.reshape(int(np.prod(values.shape[: len(own)])), -1)
        places = itertools.product(*(range(data.shape[n]) for n in others))
        for place, column in zip(places, wide.T, strict=True):
            where = {labels[name][n]: k for n, k in zip(others, place, strict=True)}
            which = [str(scales[key][k] if key in scales else k + 1) for key, k in where.items()]
            unit = _unit(members, name, where)
            label = name + (f" [{', '.join(which)}]" if which else "")
            if np.iscomplexobj(column):
                heads += [f"{label} real ({unit})", f"{label} imag ({unit})"]
                columns += [column.real, column.imag]
            else:
                heads.append(_title(label, unit))
                columns.append(column)
    grid = np.indices(shape).reshape(len(shape), -1)
    first = [(row, scales[row][grid[n]]) for n, row in enumerate(rows) if row in scales]
    titles = [_title(row, str(members[row].attrs.get("units", ""))) for row, _ in first]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*titles, *heads])
    cells = [_plain(column) for column in (*(values for _, values in first), *columns)]
    writer.writerows(zip(*cells, strict=True))
    return stream.getvalue()


def _title(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit not in ("", "name") else name


def _unit(members: dict[str, h5py.Dataset], name: str, place: dict[str, int]) -> str:
    """Unit of a column: of the dataset, or the one in the dataset that its unit refers to."""
    given = str(members[name].attrs.get("units", ""))
    found = re.search(r"see (\w+)", given)
    if found is None or found[1] not in members:
        return given
    own = members[found[1]]
    where = tuple(place.get(label, 0) for label in _labels(own, found[1]))
    return str(values_of(own)[where])


def _plain(column: np.ndarray) -> list[float | str]:
    """Numbers with all their digits, "" for NaN."""
    return [
        "" if isinstance(value, float) and value != value else value
        for value in np.asarray(column).tolist()
    ]
