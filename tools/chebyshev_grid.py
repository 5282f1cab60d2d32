"""Surfaces from a fixed number of Chebyshev points of each axis, to compare with chosen ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np

from suspension_cli.studies.chebyshev import Box, Surface, coefficients, nodes
from suspension_cli.studies.job import Axis


def surface_of(
    axes: Sequence[Axis], compute: Callable[[dict[str, np.ndarray]], Any], intervals: int
) -> Surface:
    """Interpolate functions over a grid, from their values at so many intervals along each axis.

    `compute` gives the functions (point, function) at values of the axes by name.
    """
    low, high = (tuple(axis.values[end] for axis in axes) for end in (0, -1))
    box = Box(low, high, (False,) * len(axes))
    places = np.array(list(product(nodes(intervals), repeat=len(axes))))
    values = {axis.name: box.value(n, places[:, n]) for n, axis in enumerate(axes)}
    shape = (intervals + 1,) * len(axes)
    found = compute(values).reshape(*shape, -1)
    return Surface(box, coefficients(found), len(places))
