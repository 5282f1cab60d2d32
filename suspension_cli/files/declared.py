"""What the fields of a result declare, and a result as named arrays that follow from it.

A result is a frozen dataclass. The annotation of a field gives the kind of its numbers and its
dimensions, its metadata the unit::

    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    output: tuple[str, ...]
    value: Complex[np.ndarray, "frequency output"] = field(metadata=in_unit("m/N"))

A field with the name of its only dimension is the scale of that dimension; without such a field the
dimension is numbered from 1. Texts in a tuple are a dimension of their own, unless the metadata
names another (`along`, `scale_of`). Properties are stored, too, if they are `derived`. Numbers and
texts alone are attributes. A record in a field is a group, whose dimensions may be those of the
record around it; a tuple of records is a group of columns if these hold numbers and texts alone,
and numbered groups if they hold arrays.

A list of records of one class is stored as one: fields marked `EACH` have the values of all records
along the dimension `OUTPUT`, the second one of arrays; others are the same in all.

Braces in a unit name a field with units: ``in_unit("{unit}/Hz^0.5")``. Units are such that pint
reads them; of texts they are `TEXT`, of numbers with units of their own `SI`.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache, cached_property, partial
from typing import Any, TypeVar, get_args, get_origin

import numpy as np

Metadata = dict[str, Any]
Function = TypeVar("Function", bound=Callable[..., Any])
Record = TypeVar("Record")

NOT_STORED: Metadata = {"stored": False}
"""Of a field that no file holds; it has a default."""
INLINE: Metadata = {"inline": True}
"""Of a record, or tuple of records, whose fields are stored beside it instead of in a group."""
ATTRIBUTE: Metadata = {"attribute": True}
"""Of texts in a tuple that are no dimension."""
AXES: Metadata = {"axes": True}
"""Of a tuple of records with name, values and unit: scales of the dimensions ``*axes``."""
EACH: Metadata = {"each": True}
"""Of a field that differs between the records of a list."""
OUTPUT = "output"
"""Dimension of a list of records."""
TEXT = "name"
"""Unit of texts."""
SI = "SI"
"""Unit of numbers that are in SI, but in units that the program does not know."""
KINDS = {float: "fiu", int: "iu", bool: "b", str: "UO"}
"""Kinds of dtypes of numbers and texts."""


def in_unit(unit: str, along: str = "", name: str = "") -> Metadata:
    """Describe a field: its unit; dimensions that its annotation lacks; another name in files."""
    return {"unit": unit, "dims": tuple(along.split()), "key": name}


def along(dims: str, name: str = "") -> Metadata:
    """Describe texts or records by their dimensions."""
    return in_unit("", dims, name)


def scale_of(dim: str) -> Metadata:
    """Describe texts that are the scale of a dimension, under whose name they are stored."""
    return in_unit("", dim, dim)


def derived(
    unit: str = "", along: str = "", name: str = "", *, each: bool = False
) -> Callable[[Function], Function]:
    """Mark the function of a property that is stored though it follows from the fields."""

    def mark(function: Function) -> Function:
        vars(function)["declared"] = in_unit(unit, along, name) | {"each": each}
        return function

    return mark


@dataclasses.dataclass(frozen=True)
class Variable:
    """One named array.

    Attributes
    ----------
    dims
        Paths of the scales of its axes; its own if it is a scale.
    data
        Numbers or texts, or the HDF5 dataset that holds them.
    unit
        In braces the names of variables with the units of each element.
    """

    dims: tuple[str, ...]
    data: Any
    unit: str

    @property
    def is_text(self) -> bool:
        """Whether it holds texts."""
        return self.data.dtype.kind in "UO"

    def read(self) -> np.ndarray:
        """Return the values."""
        if not isinstance(self.data, np.ndarray) and self.is_text:
            return np.asarray(self.data.asstr()[...] if self.data.size else [], dtype=object)
        return np.asarray(self.data[...])


@dataclasses.dataclass(frozen=True)
class Contents:
    """Arrays and attributes of a result by path, such as ``largest/size``."""

    variables: dict[str, Variable] = dataclasses.field(default_factory=dict)
    attributes: dict[str, Any] = dataclasses.field(default_factory=dict)

    def inside(self, group: str) -> set[str]:
        """Names of the arrays, attributes and groups in a group."""
        paths = (path for path in (*self.variables, *self.attributes) if path.startswith(group))
        return {path[len(group) :].partition("/")[0] for path in paths}


@dataclasses.dataclass(frozen=True)
class _Array:
    """Type of an array: kinds of numpy's dtypes, and names of its dimensions."""

    kinds: str
    dims: tuple[str, ...] = ()

    def __getitem__(self, given: tuple[type, str]) -> _Array:
        return _Array(self.kinds, tuple(given[1].split()))


ARRAYS = {"Float": "fiu", "Complex": "cf", "Inexact": "cf", "Int": "iu", "Bool": "b"}
"""Kinds of dtypes by the name of jaxtyping's annotation."""


@dataclasses.dataclass(frozen=True)
class _Item:
    """What one field or property declares."""

    name: str
    key: str
    type: Any
    dims: tuple[str, ...]
    unit: str
    optional: bool
    derived: bool
    metadata: Mapping[str, Any]

    @property
    def each(self) -> bool:
        """Whether it differs between the records of a list."""
        return bool(self.metadata.get("each"))

    @property
    def is_scale(self) -> bool:
        return self.dims == (self.key,) and self.form == "array"

    @property
    def element(self) -> Any:
        """Type of the elements of a tuple of any length; None for other types."""
        arguments = get_args(self.type)
        return arguments[0] if get_origin(self.type) is tuple and ... in arguments else None

    @property
    def leaf(self) -> Any:
        """Type of the values of tuples, or of tuples in these."""
        kind = self.type
        while get_origin(kind) is tuple:
            kind = get_args(kind)[0]
        return kind

    @property
    def kinds(self) -> str:
        """Kinds of the dtypes of its values."""
        return getattr(self.type, "kinds", "") or KINDS[self.leaf]

    @cached_property
    def form(self) -> str:
        """How it is stored."""
        if "axes" in self.metadata:
            return "axes"
        if isinstance(self.type, _Array):
            return "array"
        if dataclasses.is_dataclass(self.leaf):
            if self.element is None:
                return "record"
            alone = all(item.type in KINDS for item in items(self.element))
            return "columns" if alone else "records"
        return "array" if self.dims else "attribute"


@cache
def items(kind: Any) -> tuple[_Item, ...]:
    """List what a class declares: its fields, then its derived properties."""
    found = []
    for one in dataclasses.fields(kind):
        owner = next(base for base in kind.__mro__ if one.name in vars(base)["__annotations__"])
        if one.metadata.get("stored", True):
            found.append(_item(one.name, str(one.type), owner.__module__, one.metadata, False))
    for name in dict.fromkeys(name for base in kind.__mro__[::-1] for name in vars(base)):
        member = getattr(kind, name, None)
        function = member.func if isinstance(member, cached_property) else None
        function = member.fget if isinstance(member, property) else function
        if function is not None and hasattr(function, "declared"):
            text = function.__annotations__["return"].replace("list[str]", "tuple[str, ...]")
            metadata = vars(function)["declared"]
            found.append(_item(name, text, function.__module__, metadata, True))
    return tuple(found)


def _item(
    name: str, annotation: str, module: str, metadata: Mapping[str, Any], derived: bool
) -> _Item:
    text = annotation.replace(" | None", "")
    known = vars(sys.modules[module]) | {key: _Array(kinds) for key, kinds in ARRAYS.items()}
    kind = eval(text, known)
    dims = metadata.get("dims") or getattr(kind, "dims", ())
    if not dims and kind == tuple[str, ...] and "attribute" not in metadata:
        dims = (name,)
    if metadata.get("each"):
        dims = (*dims[:1], OUTPUT, *dims[1:])
        kind = kind if isinstance(kind, _Array) else tuple[kind, ...]
    key, given = metadata.get("key") or name, metadata.get("unit", "")
    optional = annotation.endswith(" | None")
    return _Item(name, key, kind, dims, given, optional, derived, metadata)


def pack(record: Any) -> Contents:
    """Return all that a record declares, or a list of records of one class."""
    records = record if isinstance(record, list) else [record]
    given = {}
    for item in items(type(records[0])):
        value = getattr(records[0], item.name)
        if item.each:
            values = [getattr(one, item.name) for one in records]
            value = np.stack(values, axis=1) if isinstance(item.type, _Array) else tuple(values)
        given[item.name] = value
    return pack_fields(type(records[0]), given)


def pack_fields(kind: type, given: Mapping[str, Any]) -> Contents:
    """Return what a class declares of those fields that are given."""
    contents = Contents()
    _Packing(contents, "", {}, {}).add_fields(kind, given.get)
    return contents


@dataclasses.dataclass
class _Packing:
    """Adds records to contents: `scales` has the path of each dimension's scale, `units` texts."""

    contents: Contents
    prefix: str
    scales: dict[str, str]
    units: dict[str, Any]

    def add(self, record: Any) -> None:
        self.add_fields(type(record), partial(getattr, record))

    def add_fields(self, kind: type, get: Callable[[str], Any]) -> None:
        values = {item.name: get(item.name) for item in items(kind)}
        chosen = [item for item in items(kind) if values[item.name] is not None]
        self.units |= {item.key: values[item.name] for item in chosen if item.leaf is str}
        self.scales |= {item.key: self.prefix + item.key for item in chosen if item.is_scale}
        for item in sorted(chosen, key=lambda item: not item.is_scale):
            getattr(self, f"_add_{item.form}")(item, values[item.name])

    def _inside(self, item: _Item, number: str = "") -> _Packing:
        if item.metadata.get("inline"):
            return self
        prefix = f"{self.prefix}{item.key}/{number}"
        return _Packing(self.contents, prefix, dict(self.scales), dict(self.units))

    def _variable(self, item: _Item, dims: tuple[str, ...], data: np.ndarray) -> None:
        if data.ndim != len(dims):
            raise ValueError(f"{item.key} has {data.ndim} dimensions, not {len(dims)}")
        for dim, size in zip(dims, data.shape, strict=True):
            if dim not in self.scales:
                path = self.scales[dim] = self.prefix + dim
                self.contents.variables[path] = Variable((path,), np.arange(1, size + 1), "1")
        path, of = self.prefix + item.key, tuple(self.scales[dim] for dim in dims)
        text = TEXT if data.dtype.kind == "U" else self._unit(item.unit)
        self.contents.variables[path] = Variable(of, data, text)

    def _unit(self, text: str) -> str:
        """Fill in units that are the same for all elements."""
        for name in re.findall(r"{(\w+)}", text):
            text = fill_in(text, name, common_unit(np.ravel(self.units[name]), name))
        return text or "1"

    def _add_array(self, item: _Item, value: Any) -> None:
        dims = item.dims
        if dims[0].startswith("*"):
            dims = (*self.units[dims[0]], *dims[1:])
        data = np.asarray(value, dtype=str if item.leaf is str else None)
        if data.ndim < len(dims):  # tuples without elements do not tell their shape
            data = data.reshape([self._size(dim) for dim in dims])
        self._variable(item, dims, data)

    def _size(self, dim: str) -> int:
        """Length of a dimension so far; 0 if it is not known."""
        scale = self.contents.variables.get(self.scales.get(dim, ""))
        return 0 if scale is None else len(scale.data)

    def _add_axes(self, item: _Item, value: Any) -> None:
        self.contents.attributes[self.prefix + item.key] = [axis.name for axis in value]
        self.units["*axes"] = [dim_name(axis.name) for axis in value]
        for axis in value:
            name = dim_name(axis.name)
            path = self.scales[name] = self.prefix + name
            self.contents.variables[path] = Variable((path,), np.array(axis.values), axis.unit)

    def _add_attribute(self, item: _Item, value: Any) -> None:
        value = list(value) if isinstance(value, tuple) else value
        self.contents.attributes[self.prefix + item.key] = value

    def _add_record(self, item: _Item, value: Any) -> None:
        self._inside(item).add(value)

    def _add_records(self, item: _Item, value: Any) -> None:
        for n, record in enumerate(value, 1):
            if record is not None:
                self._inside(item, f"{n}/").add(record)

    def _add_columns(self, item: _Item, value: Any) -> None:
        inside = self._inside(item)
        for column in items(item.element):
            values = [getattr(record, column.name) for record in value]
            data = np.array(values, dtype=column.type)
            inside._variable(column, item.dims or (item.key,), data)


def common_unit(units: Iterable[Any], name: str) -> str:
    """Return the unit of all elements, or if they differ the name of the texts with units."""
    own = {str(one) for one in units}
    return own.pop() if len(own) == 1 else f"{{{name}}}"


def dim_name(parameter: str) -> str:
    """Name of the dimension of a swept parameter: without spaces and slashes."""
    return re.sub(r"[\s/]+", "_", parameter)


def fill_in(text: str, name: str, own: str) -> str:
    """Replace the braces of one name in a unit.

    >>> fill_in("{unit}/Hz^0.5", "unit", "m/s"), fill_in("{unit}^2", "unit", "m/s")
    ('m/s/Hz^0.5', '(m/s)^2')
    """
    first = re.match(rf"{{{name}}}(/|$)", text)
    alone = first or re.fullmatch(r"\w+|%|{.*}", own)
    return text.replace(f"{{{name}}}", own if alone else f"({own})")


def unpack(kind: type[Record], contents: Contents) -> Record:
    """Return the record that contents hold.

    Raises
    ------
    KeyError
        If something is missing.
    ValueError
        If a shape or type is not that which the class declares, or a scale is not finite.
    """
    return _Unpacking(contents, "", {}).record(kind)


def unpack_list(kind: type[Record], contents: Contents) -> list[Record]:
    """Return the list of records that contents hold; raises as `unpack` does."""
    fields, found = _Unpacking(contents, "", {}).fields(kind), []
    for n in range(len(fields[OUTPUT])):
        given = dict(fields)
        for item in items(kind):
            value = fields.get(item.name)
            if item.each and isinstance(value, np.ndarray):
                given[item.name] = value[:, n]
            elif item.each and not item.derived:
                given[item.name] = value[n] if value and n < len(value) else None
        found.append(kind(**given))
    return found


@dataclasses.dataclass
class _Unpacking:
    """Reads records from contents: `sizes` has the length of each dimension."""

    contents: Contents
    prefix: str
    sizes: dict[str, int]

    def record(self, kind: Any) -> Any:
        return kind(**self.fields(kind))

    def fields(self, kind: Any) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for item in items(kind):
            self.sizes.pop(item.key if item.is_scale else "", None)
        for item in items(kind):
            path = self.prefix + item.key
            if item.derived:
                if item.form == "array" and path in self.contents.variables:
                    self._checked(item)
            elif item.optional and not (
                {path} & {*self.contents.variables, *self.contents.attributes}
                or self.contents.inside(f"{path}/")
            ):
                found[item.name] = None
            else:
                found[item.name] = getattr(self, f"_get_{item.form}")(item)
        return found

    def _inside(self, item: _Item, number: str = "") -> _Unpacking:
        if item.metadata.get("inline"):
            return self
        return _Unpacking(self.contents, f"{self.prefix}{item.key}/{number}", dict(self.sizes))

    def _checked(self, item: _Item, dims: tuple[str, ...] = ()) -> Variable:
        """Return a variable whose type and shape are those declared."""
        path, dims = self.prefix + item.key, dims or item.dims
        if dims[0].startswith("*"):
            names = self.contents.attributes[f"{self.prefix}axes"]
            dims = (*(dim_name(str(name)) for name in names), *dims[1:])
        found = self.contents.variables[path]
        if found.data.dtype.kind not in item.kinds:
            raise ValueError(f"{path} has values of another type ({found.data.dtype})")
        if len(found.data.shape) != len(dims):
            raise ValueError(f"{path} has {len(found.data.shape)} dimensions, not {len(dims)}")
        for dim, size in zip(dims, found.data.shape, strict=True):
            if self.sizes.setdefault(dim, size) != size:
                raise ValueError(f"{path} has {size} values where {dim} has {self.sizes[dim]}")
        return found

    def _get_array(self, item: _Item) -> Any:
        values = self._checked(item).read()
        if item.is_scale and values.dtype.kind == "f" and not np.isfinite(values).all():
            raise ValueError(f"{self.prefix}{item.key} has values that are not finite")
        return values if isinstance(item.type, _Array) else _tuples(values.tolist())

    def _get_axes(self, item: _Item) -> Any:
        found = []
        for name in map(str, self.contents.attributes[self.prefix + item.key]):
            path = self.prefix + dim_name(name)
            values = self.contents.variables[path].read()
            if values.ndim != 1 or values.dtype.kind != "f" or not np.isfinite(values).all():
                raise ValueError(f"{path} is no list of finite numbers")
            self.sizes[dim_name(name)] = len(values)
            found.append(item.element(name, tuple(values.tolist())))
        return tuple(found)

    def _get_attribute(self, item: _Item) -> Any:
        path, kinds = self.prefix + item.key, get_args(item.type)
        value = self.contents.attributes[path]
        if not kinds:
            return _plain(path, item.type, value)
        if ... not in kinds and np.shape(value) != (len(kinds),):
            raise ValueError(f"{path} does not have {len(kinds)} values")
        return tuple(_plain(path, kinds[0], one) for one in np.ravel(value))

    def _get_record(self, item: _Item) -> Any:
        return self._inside(item).record(item.type)

    def _get_records(self, item: _Item) -> Any:
        numbers = {int(name) for name in self.contents.inside(f"{self.prefix}{item.key}/")}
        return tuple(
            self._inside(item, f"{n}/").record(item.element) if n in numbers else None
            for n in range(1, max(numbers, default=0) + 1)
        )

    def _get_columns(self, item: _Item) -> Any:
        inside, dims = self._inside(item), item.dims or (item.key,)
        fields = [column for column in items(item.element) if not column.derived]
        columns = [inside._checked(column, dims).read().tolist() for column in fields]
        names = [column.name for column in fields]
        rows = zip(*columns, strict=True)
        return tuple(item.element(**dict(zip(names, row, strict=True))) for row in rows)


def _plain(path: str, kind: type, value: Any) -> Any:
    """Return an attribute as a number or text."""
    known = {
        float: (float, int, np.floating, np.integer),
        int: (int, np.integer),
        bool: (bool, np.bool_),
        str: (str,),
    }
    if not isinstance(value, known[kind]):
        raise ValueError(f"{path} is not of type {kind.__name__}")
    return kind(value)


def _tuples(values: Any) -> Any:
    return tuple(map(_tuples, values)) if isinstance(values, list) else values
