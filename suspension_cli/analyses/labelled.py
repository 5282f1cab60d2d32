"""Results as labelled arrays in other forms than HDF5: CSV files and an `xarray.Dataset`.

CSV has one row per frequency, mode or point of a grid, and one column per number. The columns
follow from the results file: dimensions whose scale is numeric (frequency, mode, an axis of a
sweep) make rows, those with names (output, input, coordinate) make columns.
"""

from __future__ import annotations

import contextlib
import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from suspension_cli.files import whole_files
from suspension_cli.files.declared import FINE, SI, TEXT, fill_in, items
from suspension_cli.files.hdf5 import in_memory, open_results
from suspension_cli.files.mapped_arrays import release
from suspension_cli.files.stored import Variable, variables

if TYPE_CHECKING:
    import xarray

Variables = dict[str, Variable]
"""By path in the group of the analysis."""
TOGETHER = 10_000
"""Rows of CSV that are made together."""


@contextlib.contextmanager
def variables_of(result: Any) -> Iterator[Variables]:
    """Open the arrays of an `record.Record`: of its file, or as its file would have them.

    Without curves that only its picture needs.
    """
    stored = result.stored_file()
    if stored is not None:
        with open_results(stored) as file:
            yield _without_curves(variables(file[result.run.analysis.name]))
    else:
        with in_memory() as file:
            result.run.analysis.fill(file, result)
            found = _without_curves(variables(file[result.run.analysis.name]))
            declared = [item.key for item in items(result.run.analysis.record_type())]
            order = [path for key in declared for path in found if path.split("/")[0] == key]
            yield {path: found[path] for path in order} | found


def _without_curves(found: Variables) -> Variables:
    """Leave out arrays along `declared.FINE`."""
    fine = {path for path, one in found.items() if any(_name(dim) == FINE for dim in one.dims)}
    return {path: one for path, one in found.items() if path not in fine}


def to_xarray(result: Any) -> xarray.Dataset:
    """Convert an `record.Record`; dimensions and coordinates are the scales of its file.

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
            dims = [dim.replace("/", ".") for dim in one.dims]
            arrays[path.replace("/", ".")] = (dims, one.read(), attributes)
    about = {
        "design": result.run.name,
        "model": result.run.model,
        "estimated_error": result.run.error,
    }
    return xarray.Dataset(arrays, attrs=about)


def write_csv(result: Any, path: Path) -> list[Path]:
    """Write the CSV files of an `record.Record`, and return their paths.

    For the results file NAME.h5 (`path`), the main results go to NAME.csv; arrays with other rows
    get files of their own, NAME-ROWS.csv.
    """
    paths = []
    with variables_of(result) as arrays:
        for n, (rows, texts) in enumerate(_tables(arrays)):
            paths.append(path.with_name(f"{path.stem}-{rows}.csv" if n else f"{path.stem}.csv"))
            with whole_files.writing_to(paths[-1]):
                whole_files.replace_file(paths[-1], partial(_write_texts, texts))
    return paths


def _write_texts(texts: Iterator[str], stream: IO[bytes]) -> None:
    for text in texts:
        stream.write(text.encode())


def _tables(arrays: Variables) -> Iterator[tuple[str, Iterator[str]]]:
    """Yield the rows of each table (for the name of its file) and its text in pieces."""

    def is_numeric(path: str) -> bool:
        return path not in arrays or not arrays[path].is_text

    def rank(key: tuple[str, tuple[str, ...]]) -> tuple[Any, ...]:
        """The main results first: points of a sweep, not modes; groups by numbers, then names."""
        home, rows = key
        order = [(int(part) if part.isdecimal() else 0, part) for part in home.split("/") if part]
        lacks_value = all(_name(path) != "value" for path in tables[key])
        return order, not all(map(is_numeric, rows)), len(rows), -len(tables[key]), lacks_value

    tables: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for path, one in arrays.items():
        if one.dims != (path,) and one.data.size:
            rows = tuple(filter(is_numeric, one.dims)) or one.dims[:1]
            tables.setdefault((path.rpartition("/")[0], rows), []).append(path)
    for home, rows in sorted(tables, key=rank):
        paths = sorted(
            tables[home, rows],
            key=lambda path: (is_numeric(path), _name(path) != "value", _name(path)),
        )
        if any(map(is_numeric, paths)):
            stem = "-".join(part for part in (home, *map(_name, rows)) if part)
            yield re.sub(r"[^A-Za-z0-9._-]+", "-", stem), _text(arrays, rows, paths)


def _name(path: str) -> str:
    return path.rpartition("/")[2]


def _text(arrays: Variables, rows: tuple[str, ...], paths: list[str]) -> Iterator[str]:
    """Yield the heading, then lines, of a table of arrays that have the same rows."""
    scales = {dim: one.read() for dim, one in arrays.items() if one.dims == (dim,)}
    heads = []
    columns: list[tuple[np.ndarray, tuple[int, ...], Callable[[np.ndarray], np.ndarray]]] = []
    for path in paths:
        one = arrays[path]
        own = [dim for dim in one.dims if dim in rows]
        others = [dim for dim in one.dims if dim not in rows]
        values = one.read().transpose([one.dims.index(dim) for dim in own + others])
        for place in np.ndindex(values.shape[len(own) :]):
            where = dict(zip(others, place, strict=True))
            which = [
                str(scales[dim][n]) if dim in scales else str(n + 1) for dim, n in where.items()
            ]
            label = _name(path)
            unit = _unit(arrays, path, where)
            label += f" [{', '.join(which)}]" if which else ""
            if np.iscomplexobj(values):
                heads += [f"{label} real ({unit})", f"{label} imag ({unit})"]
                columns += [(values, place, np.real), (values, place, np.imag)]
            else:
                heads.append(_title(label, unit))
                columns.append((values, place, np.asarray))
    labelled = [row for row in rows if row in scales]
    yield _lines([[*(_title(_name(row), arrays[row].unit) for row in labelled), *heads]])
    count, *inner = columns[0][0].shape[: len(rows)]
    together = max(TOGETHER // math.prod(inner), 1)
    for start in range(0, count, together):
        some = slice(start, min(start + together, count))
        first, *others = np.indices((some.stop - start, *inner))
        of_row = dict(zip(rows, (first + start, *others), strict=True))
        cells = [_cells(scales[row][of_row[row].ravel()]) for row in labelled]
        for values, place, part in columns:
            cells.append(_cells(part(values[(some, ..., *place)]).ravel()))
        yield _lines(zip(*cells, strict=True))
        for used in (*scales.values(), *(values for values, _, _ in columns)):
            release(used)


def _lines(rows: Iterable[Iterable[object]]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def _title(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit not in ("", TEXT) else name


def _unit(arrays: Variables, path: str, place: dict[str, int]) -> str:
    """Unit of a column, with those in its braces filled in where the column has one."""
    text = arrays[path].unit
    for name in re.findall(r"{(\w+)}", text):
        parts = path.split("/")[:-1]
        homes = ("/".join([*parts[:n], name]) for n in range(len(parts), -1, -1))
        own = next(arrays[home] for home in homes if home in arrays)
        if set(own.dims) <= set(place):
            text = fill_in(text, name, str(own.read()[tuple(place[dim] for dim in own.dims)]))
    return text


def _cells(column: np.ndarray) -> list[float | str]:
    """Numbers with all their digits, "" for NaN."""
    return [
        "" if isinstance(value, float) and value != value else value
        for value in np.asarray(column).tolist()
    ]
