"""Types of the arrays of a scene, and their axes behind the batch axes."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_KEY, _FRAME, _VECTOR, _COMPUTED = "inner axes", "frame", "vector", "computed"


def inner(
    count: int, frame: str | None = None, *, vector: bool = False, computed: bool = False
) -> dict[str, int | str | bool | None]:
    """Metadata of a dataclass field with batch axes in front of `count` axes of its own.

    Parameters
    ----------
    count
        The first of these axes runs over the members of the part.
    frame
        Of points: the field with the numbers of the bodies whose frames they are in.
    vector
        Whether the components change sign in a mirror as those along x, y, z do (on axes of size
        6: along x, y, z, roll, pitch, yaw). Points do anyway.
    computed
        Whether the numbers of two members that are mirror images may differ by rounding.

    Examples
    --------
    >>> from dataclasses import dataclass, field
    >>> @dataclass
    ... class Points:
    ...     label: tuple[str, ...]  # one for the whole batch
    ...     point: Array = field(metadata=inner(2))  # (..., n, 3)
    >>> inner_axes(Points)
    {'point': 2}
    """
    return {_KEY: count, _FRAME: frame, _VECTOR: vector or frame is not None, _COMPUTED: computed}


@cache
def inner_axes(kind: type[DataclassInstance]) -> dict[str, int]:
    """Number of axes behind the batch axes, by name of the fields with batch axes."""
    return {item.name: item.metadata[_KEY] for item in fields(kind) if _KEY in item.metadata}


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
