"""Results as labelled arrays in other forms than HDF5: CSV files and an `xarray.Dataset`.

CSV has one row per frequency, mode or point of a grid, and one column per number. The columns
follow from the results file: dimensions whose scale is numeric (frequency, mode, an axis of a
sweep) make rows, those with names (output, input, coordinate) make columns.
"""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.files.atomic import write_bytes
from suspension_cli.files.declared import SI, fill_in, items
from suspension_cli.files.hdf5 import in_memory, open_results
from suspension_cli.files.stored import Variable, variables

if TYPE_CHECKING:
    import xarray


@contextlib.contextmanager
def variables_of(result: Any) -> Iterator[dict[str, Variable]]:
    """Open the arrays of an `analysis.Result`: of its file, or as its file would have them."""
    stored = result.stored_file()
    if stored is not None:
        with open_results(stored) as file:
            yield variables(file[result.analysis.name])
    else:
        with in_memory() as file:
            result.analysis.fill(file, result)
            found = variables(file[result.analysis.name])
            heads = {path: path.partition("/")[0] for path in found}
            declared = [item.key for item in items(result.analysis.record_type())]
            order = [path for key in declared for path in found if heads[path] == key]
            yield {path: found[path] for path in order} | found


def to_xarray(result: Any) -> xarray.Dataset:
    """Convert an `analysis.Result`; dimensions and coordinates are the scales of its file.

    Numbers have their `units`, unless these differ between the elements of an array: the array that
    has them is then named by `units_in`. Attributes name design, model and estimated error.
    """
    import xarray  # pyright: ignore[reportMissingImports]

    arrays = {}
    with variables_of(result) as found:
        for path, one in found.items():
            attributes = {} if one.is_text or one.unit == SI else {"units": one.unit}
            if "{" in one.unit:
                attributes = {"units_in": one.unit}
            arrays[_dotted(path)] = ([*map(_dotted, one.dims)], one.read(), attributes)
    about = {
        "design": result.name,
        "model": result.model,
        "estimated_error": result.estimated_error,
    }
    return xarray.Dataset(arrays, attrs=about)


def _dotted(path: str) -> str:
    """A path within a group as the name of a variable."""
    return path.replace("/", ".")


def write_csv(result: Any, path: Path) -> list[Path]:
    """Write the CSV files of an `analysis.Result`, and return their paths.

    For the results file NAME.h5 (`path`), the main results go to NAME.csv; arrays with other rows
    get files of their own, NAME-ROWS.csv.
    """
    with variables_of(result) as arrays:
        found = dict(_tables(arrays))
    paths = []
    for n, (rows, text) in enumerate(found.items()):
        stem = f"{path.stem}-{rows}" if n else path.stem
        target = path.with_name(f"{stem}.csv")
        write_bytes(target, text.encode())
        paths.append(target)
    return paths


def _tables(variables: dict[str, Variable]) -> Iterator[tuple[str, str]]:
    """Yield the rows of each table (for the name of its file) and its text."""
    tables: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for path, one in variables.items():
        if one.dims == (path,) or not one.data.size:
            continue
        rows = tuple(dim for dim in one.dims if _is_numeric(variables.get(dim)))
        tables.setdefault((path.rpartition("/")[0], rows or one.dims[:1]), []).append(path)

    def rank(key: tuple[str, tuple[str, ...]]) -> tuple[Any, ...]:
        home, rows = key  # the main results first: points of a sweep, not modes
        numeric = all(_is_numeric(variables.get(row)) for row in rows)
        return _order(home), not numeric, len(rows), -len(tables[key])

    for key in sorted(tables, key=rank):
        home, rows = key
        paths = sorted(
            tables[key],
            key=lambda path: (_is_numeric(variables[path]), _name(path) != "value", _name(path)),
        )
        if any(_is_numeric(variables[path]) for path in paths):
            stem = "-".join(part for part in (home, *map(_name, rows)) if part)
            yield re.sub(r"[^A-Za-z0-9._-]+", "-", stem), _text(variables, rows, paths)


def _order(home: str) -> list[tuple[int, str]]:
    """Order of groups: by numbers, then names."""
    return [(int(part) if part.isdecimal() else 0, part) for part in home.split("/") if part]


def _name(path: str) -> str:
    return path.rpartition("/")[2]


def _is_numeric(one: Variable | None) -> bool:
    return one is None or not one.is_text


def _text(variables: dict[str, Variable], rows: tuple[str, ...], paths: list[str]) -> str:
    """Make the table of some arrays that have the same rows."""
    known = {dim for path in paths for dim in variables[path].dims if dim in variables}
    scales = {dim: variables[dim].read() for dim in known}
    heads, columns, shape = [], [], ()
    for path in paths:
        one = variables[path]
        own = [dim for dim in one.dims if dim in rows]
        others = [n for n, dim in enumerate(one.dims) if dim not in own]
        values = one.read()
        sizes = values.shape
        values = values.transpose([one.dims.index(dim) for dim in own] + others)
        if set(rows) <= set(own):
            shape = values.shape[: len(own)]
        wide = values.reshape(int(np.prod(values.shape[: len(own)])), -1)
        places = itertools.product(*(range(sizes[n]) for n in others))
        for place, column in zip(places, wide.T, strict=True):
            where = {one.dims[n]: k for n, k in zip(others, place, strict=True)}
            which = [str(scales[key][k] if key in scales else k + 1) for key, k in where.items()]
            unit = _unit(variables, path, where)
            label = _name(path) + (f" [{', '.join(which)}]" if which else "")
            if np.iscomplexobj(column):
                heads += [f"{label} real ({unit})", f"{label} imag ({unit})"]
                columns += [np.real(column), np.imag(column)]
            else:
                heads.append(_title(label, unit))
                columns.append(column)
    grid = np.indices(shape).reshape(len(shape), -1)
    first = [(row, scales[row][grid[n]]) for n, row in enumerate(rows) if row in scales]
    titles = [_title(_name(row), variables[row].unit) for row, _ in first]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*titles, *heads])
    cells = [_plain(column) for column in (*(values for _, values in first), *columns)]
    writer.writerows(zip(*cells, strict=True))
    return stream.getvalue()


def _title(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit not in ("", "name") else name


def _unit(variables: dict[str, Variable], path: str, place: dict[str, int]) -> str:
    """Unit of a column, with those in its braces filled in where the column has one."""
    text = variables[path].unit
    for name in re.findall(r"{(\w+)}", text):
        home = path
        while home and f"{home.rpartition('/')[0]}/{name}".lstrip("/") not in variables:
            home = home.rpartition("/")[0]
        own = variables[f"{home.rpartition('/')[0]}/{name}".lstrip("/")]
        if set(own.dims) <= set(place):
            text = fill_in(text, name, str(own.read()[tuple(place[dim] for dim in own.dims)]))
    return text


def _plain(column: np.ndarray) -> list[float | str]:
    """Numbers with all their digits, "" for NaN."""
    return [
        "" if isinstance(value, float) and value != value else value
        for value in np.asarray(column).tolist()
    ]
