"""Types of the arrays of a scene, and their axes behind the batch axes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Part = TypeVar("Part", bound="DataclassInstance")
"""Bodies, wires or parts of another kind: a dataclass of arrays."""


class Axes(NamedTuple):
    """Axes of one member in an array, and what its numbers are, see `inner` and `shared`."""

    shape: tuple[int, ...]
    dtype: type = float
    default: int = 0
    shared: bool = False
    frame: str | None = None
    vector: bool = False
    computed: bool = False


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
    own = Axes(shape, frame=frame, vector=vector or frame is not None, computed=computed)
    return {"array": own}


def shared(*shape: int, dtype: type = float, default: int = 0) -> dict[str, Any]:
    """Metadata of a dataclass field of arrays without batch axes, members first."""
    return {"array": Axes(shape, dtype, default, shared=True)}


@cache
def _axes(kind: type[DataclassInstance]) -> dict[str, Axes | None]:
    """Axes of each field; None for a field without array."""
    return {item.name: item.metadata.get("array") for item in fields(kind)}


Row = dict[str, Any]
"""A member of a part, by the names of the fields; a number that it omits is the default, 0."""


def gather(kind: type[Part], lists: Sequence[Sequence[Row]]) -> Part:
    """Pack lists of members of one `topology` into a part with the lists as its batch axis."""
    made: dict[str, Any] = {}
    for name, axes in _axes(kind).items():
        if axes is None:
            made[name] = tuple(row.get(name) for row in lists[0])
            continue
        blank = _blank(axes)
        each = lists[:1] if axes.shared else lists
        values = [[row.get(name, blank) for row in rows] for rows in each]
        packed = np.array(values, axes.dtype).reshape(len(each), -1, *axes.shape)
        made[name] = packed[0] if axes.shared else packed
    return kind(**made)


@cache
def _blank(axes: Axes) -> np.ndarray:
    """Numbers of a member that gives none."""
    return np.full(axes.shape, axes.default, axes.dtype)


def topology(kind: type[DataclassInstance], rows: Sequence[Row]) -> tuple[Hashable, ...]:
    """What members have in common with those of the other scenes of a batch: no numbers."""
    names = [name for name, axes in _axes(kind).items() if axes is None or axes.shared]
    values = [row.get(name) for row in rows for name in names]
    return tuple(one.tobytes() if isinstance(one, np.ndarray) else one for one in values)


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
    each = _axes(kind).items()
    return {name: 1 + len(axes.shape) for name, axes in each if axes and not axes.shared}


@cache
def frames(kind: type[DataclassInstance]) -> dict[str, str]:
    """Name of the field with the numbers of bodies, by that of points in their frames."""
    return {name: axes.frame for name, axes in _axes(kind).items() if axes and axes.frame}


def from_centres(part: Part, centre: np.ndarray) -> Part:
    """Change points from the origins of bodies to points from their COMs.

    `centre` (build, body, 3) are the COMs from the origins, m; the part has one batch axis.
    """
    if not centre.any():
        return part
    points = {
        name: getattr(part, name) - centre[:, getattr(part, frame)]
        for name, frame in frames(type(part)).items()
    }
    return replace(part, **points)


@cache
def signed(kind: type[DataclassInstance]) -> dict[str, tuple[bool, bool]]:
    """Whether each field is a vector in a mirror, and computed, see `inner`."""
    none = Axes(())
    each = ((name, axes or none) for name, axes in _axes(kind).items())
    return {name: (axes.vector, axes.computed) for name, axes in each}
