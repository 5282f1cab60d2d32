"""JSON documents of results, as the fields of their classes declare.

>>> import suspension_cli as sus
>>> found = sus.sensitivity(sus.template("single"), results="test yaw", fidelity="string")
>>> sorted(found.document()["results"][0])
['change_unit', 'name', 'nominal', 'unit']

Keys are those of results files, followed by the unit where that is in `ENDINGS`: ``frequency_hz``.
A complex array becomes two, ``value_real`` and ``value_imag``. Where a class wants it otherwise, or
wants rows instead of columns, it has a `Layout`, its attribute `in_json`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any

from suspension_cli.files.declared import FINE, Item, items, property_item

Document = dict[str, Any]
"""A JSON document."""
ENDINGS = {"Hz": "_hz", "rad": "_rad", "s": "_s", "1/s": "_per_s"}
"""Ends of the keys of numbers in some units."""


@dataclasses.dataclass(frozen=True)
class Layout:
    """How a class differs in JSON from its declared fields.

    Attributes
    ----------
    rows
        Keys of lists of objects, by dimension: arrays along this dimension, and along no other that
        is listed here, are their columns. The key "" makes the whole document that list.
    names
        Keys of fields that are not called as in results files; of complex numbers, and of a pair
        of numbers, two.
    without
        Names of fields that JSON leaves out.
    also
        Names of properties that JSON has though no results file does.
    only
        Names of all fields and properties that JSON has, in its order, instead of `without` and
        `also`.
    sparse
        Names of fields that are left out where they have no value, or are 0, false or empty, and of
        columns that only those rows have where the element is finite and not 0 or "".
    flat
        Names of records whose keys stand beside the others, not in an object of their own; of
        several records, if there is only one.
    """

    rows: Mapping[str, str] = dataclasses.field(default_factory=dict)
    names: Mapping[str, str] = dataclasses.field(default_factory=dict)
    without: str = ""
    also: str = ""
    only: str = ""
    sparse: str = ""
    flat: str = ""


def document(record: Any) -> Any:
    """Return what a record declares as a document: fields in order, then properties.

    Curves that only pictures need are left out, as are columns of rows that have no values.
    """
    layout: Layout = getattr(record, "in_json", Layout())
    sparse = layout.sparse.split()
    found: Document = {}
    for item in _items(type(record), layout):
        value = getattr(record, item.name)
        listed = [dim for dim in item.dims if dim in layout.rows]
        if len(listed) != 1:
            if item.name not in sparse or _is_given(value):
                found |= _parts(item, value, layout)
        elif value is not None:
            rows = found.setdefault(layout.rows[listed[0]], [])
            elements = _along(value, item.dims, listed[0])
            rows.extend({} for _ in elements[len(rows) :])
            for row, element in zip(rows, elements, strict=True):
                if item.name not in sparse or _is_given(element):
                    row |= _parts(item, element, layout)
    return found.get("", found)


def as_json(part: Any) -> Any:
    """Convert a document: arrays and tuples to lists, numbers that are not finite to null."""
    if isinstance(part, dict):
        return {key: as_json(value) for key, value in part.items()}
    if hasattr(part, "tolist"):  # an array or a number of numpy
        part = part.tolist()
    if isinstance(part, list | tuple):
        return [as_json(value) for value in part]
    return None if isinstance(part, float) and not math.isfinite(part) else part


def _items(kind: type, layout: Layout) -> Iterator[Item]:
    """List the fields and properties that a document has."""
    if layout.only:
        declared = {item.name: item for item in items(kind)}
        for name in layout.only.split():
            yield declared.get(name) or property_item(kind, name)
        return
    without = layout.without.split()
    for item in items(kind):
        if item.name not in without and FINE not in item.dims:
            yield item
    for name in layout.also.split():
        yield property_item(kind, name)


def _parts(item: Item, value: Any, layout: Layout) -> Document:
    """Return one field, or its element in a row, by its keys."""
    import numpy as np

    key = layout.names.get(item.name, item.key + ENDINGS.get(item.unit, ""))
    is_flat = item.name in layout.flat.split()
    if value is None:
        return {key: None}
    if np.iscomplexobj(value):
        real, imag = key.split() if " " in key else (f"{key}_real", f"{key}_imag")
        return {real: np.real(value), imag: np.imag(value)}
    if " " in key:
        return dict(zip(key.split(), value, strict=True))
    if item.form == "axes":
        axes = [{"name": one.name, "unit": one.unit, "values": one.values} for one in value]
        return {key: axes}
    if dataclasses.is_dataclass(value):  # in a row, its columns
        own = document(value)
        return {key: own} if item.form == "record" and not is_flat else own
    if item.form in ("records", "columns"):
        listed = [document(one) for one in value]
        return listed[0] if is_flat and len(listed) == 1 else {key: listed}
    return {key: value}


def _is_given(element: Any) -> bool:
    """Whether a sparse field, or an element of a sparse column, is worth an entry."""
    return bool(element) and not (isinstance(element, float) and not math.isfinite(element))


def _along(values: Any, dims: tuple[str, ...], dim: str) -> Any:
    """Elements of an array along one of its dimensions; only the first may stand for several."""
    import numpy as np

    if not isinstance(values, np.ndarray):
        return values
    return np.moveaxis(values, dims.index(dim) - len(dims), 0)
