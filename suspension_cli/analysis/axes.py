"""What is swept: parameters and their values, and the product of several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Axis:
    """One swept parameter: a name of an imperfection (`coupling.PARAMETERS`) or a dotted path of the design file, and its values."""

    name: str
    values: tuple[float, ...]


class Product:
    """A job over the product of some axes, of which the first turns slowest."""

    axes: tuple[Axis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def count(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape, dtype=int))

    @property
    def scales(self) -> tuple[str, ...]:
        """Datasets that hold the values of the axes."""
        return tuple(scale_name(axis.name) for axis in self.axes)

    def values(self, start: int, stop: int) -> dict[str, Any]:
        """Values (stop - start,) of every parameter at some points."""
        chosen = np.unravel_index(np.arange(start, stop), self.shape)
        return {axis.name: np.array(axis.values)[pick] for axis, pick in zip(self.axes, chosen, strict=True)}


def scale_name(axis: str) -> str:
    """The dataset that holds the values of an axis."""
    return f"axis {axis}".replace("/", "_")
