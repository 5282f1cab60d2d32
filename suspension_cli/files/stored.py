"""Results in groups of HDF5 files, written and read as the fields of their class declare."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeVar, get_args

import h5py
import numpy as np

from suspension_cli.files.declared import (
    KINDS,
    TEXT,
    Array,
    Item,
    common_unit,
    dim_name,
    fill_in,
    items,
)
from suspension_cli.files.hdf5 import Reserved, Stored, add_dataset, add_scale
from suspension_cli.files.mapped_arrays import CAN_RELEASE, blocks

Record = TypeVar("Record")
LARGE = 1 << 24
"""Bytes beyond which numbers are mapped to their file instead of read."""


def write(group: h5py.Group, record: Any) -> None:
    """Write all that a record declares."""
    kind = type(record)
    write_fields(group, kind, {item.name: getattr(record, item.name) for item in items(kind)})


def write_fields(group: h5py.Group, kind: type, given: Mapping[str, Any]) -> None:
    """Write what a class declares of those fields that are given, or `Reserved` to be written."""
    _Writer(group, {}, {}).write(kind, given.get)


@dataclass
class _Writer:
    """Writes records into a group.

    `scales` has the scale of each dimension, `texts` the texts that units refer to.
    """

    group: h5py.Group
    scales: dict[str, h5py.Dataset]
    texts: dict[str, Any]

    def write(self, kind: type, get: Callable[[str], Any]) -> None:
        values = {item: value for item in items(kind) if (value := get(item.name)) is not None}
        self.texts |= {item.key: value for item, value in values.items() if item.leaf is str}
        for item in sorted(values, key=lambda item: not item.is_scale):
            getattr(self, f"_write_{item.form}")(item, values[item])

    def _inside(self, item: Item, number: str = "") -> _Writer:
        if item.metadata.get("inline"):
            return self
        home = self.group.require_group(f"{item.key}/{number}")
        return _Writer(home, dict(self.scales), dict(self.texts))

    def _add(self, item: Item, dims: tuple[str, ...], data: np.ndarray | Reserved) -> None:
        if data.ndim != len(dims):
            raise ValueError(f"{item.key} has {data.ndim} dimensions, not {len(dims)}")
        unit = TEXT if item.leaf is str else self._unit(item.unit)
        if dims == (item.key,):
            self.scales[item.key] = add_scale(self.group, item.key, data, unit)
            return
        for dim, size in zip(dims, data.shape, strict=True):
            if dim not in self.scales:
                self.scales[dim] = add_scale(self.group, dim, np.arange(1, size + 1), "1")
        add_dataset(self.group, item.key, data, unit, *(self.scales[dim] for dim in dims))

    def _unit(self, text: str) -> str:
        """Fill in units that are the same for all elements."""
        for name in re.findall(r"{(\w+)}", text):
            text = fill_in(text, name, common_unit(np.ravel(self.texts[name]), name))
        return text or "1"

    def _write_array(self, item: Item, value: Any) -> None:
        dims = item.dims
        if dims[0].startswith("*"):
            dims = (*self.texts[dims[0]], *dims[1:])
        if isinstance(value, Reserved):
            self._add(item, dims, value)
            return
        data = np.asarray(value, dtype=str if item.leaf is str else None)
        if data.ndim < len(dims):  # tuples without elements do not tell their shape
            data = data.reshape([len(self.scales.get(dim, ())) for dim in dims])
        self._add(item, dims, data)

    def _write_axes(self, item: Item, value: Any) -> None:
        self.group.attrs[item.key] = [axis.name for axis in value]
        self.texts["*axes"] = [dim_name(axis.name) for axis in value]
        for axis, name in zip(value, self.texts["*axes"], strict=True):
            self.scales[name] = add_scale(self.group, name, axis.values, axis.unit)

    def _write_attribute(self, item: Item, value: Any) -> None:
        self.group.attrs[item.key] = list(value) if isinstance(value, tuple) else value

    def _write_record(self, item: Item, value: Any, number: str = "") -> None:
        if value is not None:
            self._inside(item, number).write(type(value), partial(getattr, value))

    def _write_records(self, item: Item, value: Any) -> None:
        for n, record in enumerate(value, 1):
            self._write_record(item, record, f"{n}")

    def _write_columns(self, item: Item, value: Any) -> None:
        inside = self._inside(item)
        for column in items(item.leaf):
            values = [getattr(record, column.name) for record in value]
            inside._add(column, item.dims or (item.key,), np.array(values, dtype=column.type))


def read(group: Stored, kind: type[Any], **given: Any) -> Any:
    """Read a record from a group.

    Fields that the group does not have are taken from those `given` by name, if they are not stored
    or were added (`declared.ADDED`). Raises `KeyError` if something is missing, `ValueError` if a
    shape or type is not that which the class declares, or a scale is not finite.
    """
    found = _Reader(group, {}).fields(kind)
    lacking = (one.name for one in dataclasses.fields(kind) if one.name not in found)
    return kind(**found, **{name: given[name] for name in lacking if name in given})


@dataclass
class _Reader:
    """Reads records from a group: `sizes` has the length of each dimension."""

    group: Stored
    sizes: dict[str, int]

    def fields(self, kind: Any) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for item in items(kind):
            if item.is_scale:
                self.sizes.pop(item.key, None)
        for item in items(kind):
            stored = item.key in self.group or item.key in self.group.attrs
            if item.derived:
                if item.form == "array" and stored:
                    self._checked(item, item.dims)
            elif not stored and item.metadata.get("added"):
                continue
            elif stored or not item.optional:
                found[item.name] = getattr(self, f"_read_{item.form}")(item)
            else:
                found[item.name] = None
        return found

    def _inside(self, item: Item, number: str = "") -> _Reader:
        if item.metadata.get("inline"):
            return self
        home = self._get(self.group, f"{item.key}/{number}")
        if not isinstance(home, h5py.Group):
            raise ValueError(f"{self._path(item.key)} is no group")
        return _Reader(home, dict(self.sizes))

    def _path(self, key: str) -> str:
        """Path within the group of the analysis, for messages."""
        return f"{self.group.name}/{key}".split("/", 2)[2]

    def _get(self, home: Any, key: str) -> Any:
        """Return a member or attribute of a group."""
        if key not in home:
            raise KeyError(self._path(key))
        return home[key]

    def _checked(self, item: Item, dims: tuple[str, ...]) -> np.ndarray:
        """Read a dataset whose type and shape are those declared."""
        path = self._path(item.key)
        if dims[0].startswith("*"):
            names = self._get(self.group.attrs, "axes")
            dims = (*(dim_name(str(name)) for name in names), *dims[1:])
        found = self._get(self.group, item.key)
        if found.dtype.kind not in item.kinds:
            raise ValueError(f"{path} has values of another type ({found.dtype})")
        if found.ndim != len(dims):
            raise ValueError(f"{path} has {found.ndim} dimensions, not {len(dims)}")
        for dim, size in zip(dims, found.shape, strict=True):
            if self.sizes.setdefault(dim, size) != size:
                raise ValueError(f"{path} has {size} values where {dim} has {self.sizes[dim]}")
        return read_values(found)

    def _read_array(self, item: Item) -> Any:
        values = self._checked(item, item.dims)
        is_number = item.is_scale and values.dtype.kind == "f"
        if is_number and not all(np.isfinite(values[part]).all() for part in blocks(values)):
            raise ValueError(f"{self._path(item.key)} has values that are not finite")
        return values if isinstance(item.type, Array) else _tuples(values.tolist())

    def _read_axes(self, item: Item) -> Any:
        found = []
        for name in map(str, self._get(self.group.attrs, item.key)):
            values = self._get(self.group, dim_name(name))[...]
            if values.ndim != 1 or values.dtype.kind != "f" or not np.isfinite(values).all():
                raise ValueError(f"{self._path(dim_name(name))} is no list of finite numbers")
            self.sizes[dim_name(name)] = len(values)
            found.append(item.leaf(name, tuple(values.tolist())))
        return tuple(found)

    def _read_attribute(self, item: Item) -> Any:
        path = self._path(item.key)
        kinds = get_args(item.type)
        value = self._get(self.group.attrs, item.key)
        if not kinds:
            return _plain(path, item.type, value)
        if ... not in kinds and np.shape(value) != (len(kinds),):
            raise ValueError(f"{path} does not have {len(kinds)} values")
        return tuple(_plain(path, kinds[0], one) for one in np.ravel(value))

    def _read_record(self, item: Item, number: str = "") -> Any:
        return item.leaf(**self._inside(item, number).fields(item.leaf))

    def _read_records(self, item: Item) -> Any:
        home = self.group.get(item.key)
        numbers = set(map(int, home)) if isinstance(home, h5py.Group) else set()
        return tuple(
            self._read_record(item, str(n)) if n in numbers else None
            for n in range(1, max(numbers, default=0) + 1)
        )

    def _read_columns(self, item: Item) -> Any:
        inside = self._inside(item)
        dims = item.dims or (item.key,)
        fields = [column for column in items(item.leaf) if not column.derived]
        columns = [inside._checked(column, dims).tolist() for column in fields]
        names = [column.name for column in fields]
        rows = zip(*columns, strict=True)
        return tuple(item.leaf(**dict(zip(names, row, strict=True))) for row in rows)


def _plain(path: str, kind: type, value: Any) -> Any:
    """Return an attribute as a number or text."""
    known = isinstance(value, str) if kind is str else np.asarray(value).dtype.kind in KINDS[kind]
    if np.ndim(value) or not known:
        raise ValueError(f"{path} is not of type {kind.__name__}")
    return kind(value)


def _tuples(values: Any) -> Any:
    return tuple(map(_tuples, values)) if isinstance(values, list) else values


def read_values(data: h5py.Dataset) -> np.ndarray:
    """Read the numbers or texts of a dataset."""
    if data.dtype.kind == "O":
        return np.asarray(data.asstr()[...] if data.size else [], dtype=object)
    return map_values(data) if data.nbytes > LARGE else np.asarray(data[...])


def map_values(data: h5py.Dataset) -> np.ndarray:
    """Map the numbers of a dataset, which take memory only while they are used.

    Changes stay in memory. A dataset in chunks, or of a file in memory, is read instead.
    """
    offset = data.id.get_offset()
    name = data.file.filename
    if offset is None or not CAN_RELEASE or not os.path.isfile(name):
        return np.asarray(data[...])
    if offset + data.nbytes > os.path.getsize(name):
        return np.asarray(data[...])
    return np.memmap(name, data.dtype, "c", offset, data.shape)


class Variable(NamedTuple):
    """A dataset, the paths of the scales of its axes (its own if it is a scale), and its unit.

    The unit has in braces the names of variables with the units of each element.
    """

    dims: tuple[str, ...]
    data: h5py.Dataset
    unit: str

    @property
    def is_text(self) -> bool:
        """Whether it holds texts."""
        return self.data.dtype.kind == "O"

    def read(self) -> np.ndarray:
        """Return the values."""
        return read_values(self.data)


def variables(group: Stored) -> dict[str, Variable]:
    """List the datasets of a group by path, such as ``largest/size``."""
    start = len(str(group.name)) + 1
    found = {}

    def add(path: str, data: Stored) -> None:
        if isinstance(data, h5py.Group):
            return
        dims = []
        for n, (size, axis) in enumerate(zip(data.shape, data.dims, strict=True)):
            scale = axis[0] if len(axis) else None
            if scale is not None and scale.size != size:
                raise ValueError(f"{path} has {size} values where its axis has {scale.size}")
            dims.append(f"{path}_{n}" if scale is None else str(scale.name)[start:])
        unit = str(data.attrs.get("units", ""))
        found[path] = Variable((path,) if data.is_scale else tuple(dims), data, unit)

    group.visititems(add)
    return found
