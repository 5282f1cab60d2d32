"""What the fields of a result declare; `stored` writes and reads results as it follows from it.

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

Braces in a unit name a field with units: ``in_unit("{unit}/Hz^0.5")``. Units are such that pint
reads them; of texts they are `TEXT`, of numbers with units of their own `SI`.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache, cached_property
from typing import Any, TypeVar, get_args, get_origin

Metadata = dict[str, Any]
Function = TypeVar("Function", bound=Callable[..., Any])

NOT_STORED: Metadata = {"stored": False}
"""Of a field that no file holds; it has a default."""
ADDED: Metadata = {"added": True}
"""Of a field that files of earlier versions lack; it has a default."""
INLINE: Metadata = {"inline": True}
"""Of a record, or tuple of records, whose fields are stored beside it instead of in a group."""
ATTRIBUTE: Metadata = {"attribute": True}
"""Of texts in a tuple that are no dimension."""
AXES: Metadata = {"axes": True}
"""Of a tuple of records with name, values and unit: scales of the dimensions ``*axes``."""
FINE = "fine_frequency"
"""Dimension of curves that only pictures need: more frequencies, which resolve resonances."""
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


def derived(unit: str = "", along: str = "", name: str = "") -> Callable[[Function], Function]:
    """Mark the function of a property that is stored though it follows from the fields."""

    def mark(function: Function) -> Function:
        vars(function)["declared"] = in_unit(unit, along, name)
        return function

    return mark


@dataclasses.dataclass(frozen=True)
class Array:
    """Type of an array: kinds of numpy's dtypes, and names of its dimensions."""

    kinds: str
    dims: tuple[str, ...] = ()

    def __getitem__(self, given: tuple[type, str]) -> Array:
        return Array(self.kinds, tuple(given[1].split()))


_ARRAYS = {
    name: Array(kinds)
    for name, kinds in {
        "Float": "fiu",
        "Complex": "cf",
        "Inexact": "cf",
        "Int": "iu",
        "Bool": "b",
    }.items()
}
"""Types of arrays by the name of jaxtyping's annotation."""


@dataclasses.dataclass(frozen=True, eq=False)
class Item:
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
    def is_scale(self) -> bool:
        """Whether it is the scale of a dimension."""
        return self.dims == (self.key,) and self.form == "array"

    @cached_property
    def leaf(self) -> Any:
        """Type of the values of tuples, or of tuples in these."""
        kind = self.type
        while get_origin(kind) is tuple:
            kind = get_args(kind)[0]
        return kind

    @property
    def kinds(self) -> str:
        """Kinds of the dtypes of its values."""
        return self.type.kinds if isinstance(self.type, Array) else KINDS[self.leaf]

    @cached_property
    def form(self) -> str:
        """How it is stored."""
        if "axes" in self.metadata:
            return "axes"
        if not isinstance(self.leaf, Array) and dataclasses.is_dataclass(self.leaf):
            if self.leaf is self.type:
                return "record"
            return "columns" if all(one.type in KINDS for one in items(self.leaf)) else "records"
        return "array" if self.dims else "attribute"


@cache
def items(kind: Any) -> tuple[Item, ...]:
    """List what a class declares: its fields, then its derived properties."""
    found = []
    for one in dataclasses.fields(kind):
        owner = next(b for b in kind.__mro__ if one.name in vars(b).get("__annotations__", ()))
        if one.metadata.get("stored", True):
            found.append(_item(one.name, str(one.type), owner.__module__, one.metadata, False))
    for name in dict.fromkeys(name for base in kind.__mro__[::-1] for name in vars(base)):
        if hasattr(_function(kind, name), "declared"):
            found.append(property_item(kind, name))
    return tuple(found)


@cache
def property_item(kind: Any, name: str) -> Item:
    """What a property declares; its annotation alone if it is not `derived`."""
    function = _function(kind, name)
    text = function.__annotations__["return"].replace("list[str]", "tuple[str, ...]")
    return _item(name, text, function.__module__, getattr(function, "declared", {}), True)


def _function(kind: Any, name: str) -> Any:
    """Function of a property; None for another attribute."""
    member = getattr(kind, name, None)
    return getattr(member, "fget", None) or getattr(member, "func", None)


def _item(
    name: str, annotation: str, module: str, metadata: Mapping[str, Any], derived: bool
) -> Item:
    kind = eval(annotation.replace(" | None", ""), vars(sys.modules[module]) | _ARRAYS)
    dims = metadata.get("dims") or getattr(kind, "dims", ())
    if not dims and kind == tuple[str, ...] and "attribute" not in metadata:
        dims = (name,)
    key = metadata.get("key") or name
    unit = metadata.get("unit", "")
    optional = annotation.endswith(" | None")
    return Item(name, key, kind, dims, unit, optional, derived, metadata)


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
