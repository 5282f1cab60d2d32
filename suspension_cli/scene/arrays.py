"""Types of the arrays of a scene, and their axes behind the batch axes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Part = TypeVar("Part", bound="DataclassInstance")
"""Bodies, wires or parts of another kind: a dataclass of arrays."""

_SHAPE, _SHARED, _FRAME, _VECTOR, _COMPUTED = "shape", "shared", "frame", "vector", "computed"


def inner(
    *shape: int, frame: str | None = None, vector: bool = False, computed: bool = False
) -> dict[str, Any]:
    """Metadata of a dataclass field with batch axes, an axis of members, and axes of each member.

    `shape` is that of one member. `frame` names, for points, the field with the numbers of the
    bodies whose frames they are in. The components of a `vector` change sign in a mirror as those
    along x, y, z do (on axes of size 6: x, y, z, roll, pitch, yaw); points do anyway. Numbers that
    are `computed` may differ by rounding between two members that are mirror images.

    Examples
    --------
    >>> from dataclasses import dataclass, field
    >>> @dataclass
    ... class Points:
    ...     label: tuple[str, ...]  # one for the whole batch
    ...     point: Array = field(metadata=inner(3))  # (..., n, 3)
    >>> inner_axes(Points)
    {'point': 2}
    >>> gather(Points, [[{"label": "a"}]]).point
    array([[[0., 0., 0.]]])
    """
    marks = {_FRAME: frame, _VECTOR: vector or frame is not None, _COMPUTED: computed}
    return {_SHAPE: (float, 0, shape)} | marks


def shared(*shape: int, dtype: type = float, default: int = 0) -> dict[str, Any]:
    """Metadata of a dataclass field of arrays without batch axes, members first."""
    return {_SHAPE: (dtype, default, shape), _SHARED: True}


Row = dict[str, Any]
"""A member of a part, by the names of the fields; a number that it omits is the default, 0."""


def gather(kind: type[Part], lists: Sequence[Sequence[Row]]) -> Part:
    """Pack lists of members of one `topology` into a part with the lists as its batch axis."""
    made: dict[str, Any] = {}
    for name, blank in _blanks(kind):
        if blank is None:
            made[name] = tuple(row.get(name) for row in lists[0])
            continue
        each = lists if name in inner_axes(kind) else lists[:1]
        values = [[row.get(name, blank) for row in rows] for rows in each]
        packed = np.array(values, blank.dtype).reshape(len(each), -1, *blank.shape)
        made[name] = packed if name in inner_axes(kind) else packed[0]
    return kind(**made)


def topology(kind: type[DataclassInstance], rows: Sequence[Row]) -> tuple[Hashable, ...]:
    """What members have in common with those of the other scenes of a batch: no numbers."""
    names = [name for name, _ in _blanks(kind) if name not in inner_axes(kind)]
    values = [row.get(name) for row in rows for name in names]
    return tuple(one.tobytes() if isinstance(one, np.ndarray) else one for one in values)


@cache
def _blanks(kind: type[DataclassInstance]) -> list[tuple[str, np.ndarray | None]]:
    """Field and what it is for a member that omits it; None for a field without array."""
    found: list[tuple[str, np.ndarray | None]] = []
    for item in fields(kind):
        dtype, default, shape = item.metadata.get(_SHAPE, (None, 0, ()))
        found.append((item.name, None if dtype is None else np.full(shape, default, dtype)))
    return found


def change_arrays(change: Callable[..., np.ndarray], *parts: Part) -> Part:
    """Replace the arrays of a part that have batch axes by functions of those of several parts.

    `change` gets the number of inner axes, and the array of each part.
    """
    made = {}
    for name, inner in inner_axes(type(parts[0])).items():
        values = [getattr(part, name) for part in parts]
        made[name] = None if values[0] is None else change(inner, *values)
    return replace(parts[0], **made)


@cache
def inner_axes(kind: type[DataclassInstance]) -> dict[str, int]:
    """Number of axes behind the batch axes, by name of the fields with batch axes."""
    marks = {item.name: item.metadata for item in fields(kind)}
    own = {name: mark for name, mark in marks.items() if _SHAPE in mark and _SHARED not in mark}
    return {name: 1 + len(mark[_SHAPE][2]) for name, mark in own.items()}


@cache
def frames(kind: type[DataclassInstance]) -> dict[str, str]:
    """Name of the field with the numbers of bodies, by that of points in their frames."""
    return {item.name: item.metadata[_FRAME] for item in fields(kind) if item.metadata.get(_FRAME)}


@cache
def signed(kind: type[DataclassInstance]) -> dict[str, tuple[bool, bool]]:
    """Whether each field is a vector in a mirror, and computed, see `inner`."""
    marks = {item.name: item.metadata for item in fields(kind)}
    return {
        name: (mark.get(_VECTOR, False), mark.get(_COMPUTED, False)) for name, mark in marks.items()
    }
