"""Types of the arrays of a scene, and their axes behind the batch axes."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_KEY, _FRAME = "inner axes", "frame"


def inner(count: int, frame: str | None = None) -> dict[str, Any]:
    """Metadata of a dataclass field with batch axes in front of `count` axes of its own.

    For points, `frame` is the field with the numbers of the bodies whose frames they are in.

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
    return {_KEY: count, _FRAME: frame}


@cache
def inner_axes(kind: type[Any]) -> dict[str, int]:
    """Number of axes behind the batch axes, by name of the fields with batch axes."""
    return {item.name: item.metadata[_KEY] for item in fields(kind) if _KEY in item.metadata}


@cache
def frames(kind: type[Any]) -> dict[str, str]:
    """Name of the field with the numbers of bodies, by that of points in their frames."""
    return {item.name: item.metadata[_FRAME] for item in fields(kind) if item.metadata.get(_FRAME)}
