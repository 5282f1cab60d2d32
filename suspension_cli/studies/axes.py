"""Axes of a sweep: parameters with their values, and the product of several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.imperfections import swept
from suspension_cli.design.path_units import displayed_unit, unit_of
from suspension_cli.errors import Fault, InputError
from suspension_cli.files.declared import dim_name

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Axis:
    """A swept parameter and its values.

    Its name is that of an imperfection (`analyses.xcouple.solve.PARAMETERS`) or a dotted path.
    """

    name: str
    values: tuple[float, ...]

    @property
    def unit(self) -> str:
        """SI unit of the values."""
        known = swept()
        return known[self.name][0].unit if self.name in known else unit_of(self.name) or "1"

    @property
    def displayed_unit(self) -> tuple[str, float]:
        """Unit in which the values are displayed, and the factor to it."""
        return displayed_unit(self.name, float(np.max(np.abs(self.values))))


class Product:
    """A job over the product of some axes; the first varies slowest."""

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
        """Names of the datasets with the values of the axes."""
        return tuple(dim_name(axis.name) for axis in self.axes)

    def values(self, start: int, stop: int) -> dict[str, Float[np.ndarray, " stop-start"]]:
        """Values of every parameter at points start to stop - 1."""
        chosen = np.unravel_index(np.arange(start, stop), self.shape)
        return {
            axis.name: np.array(axis.values)[pick]
            for axis, pick in zip(self.axes, chosen, strict=True)
        }


def ends_and_middle(axes: tuple[Axis, ...]) -> tuple[Axis, ...]:
    """Reduce axes to the corners and middles of a grid; those after the third to their middle.

    >>> ends_and_middle((Axis("k", (1.0, 2.0, 3.0, 4.0, 5.0)),))
    (Axis(name='k', values=(1.0, 3.0, 5.0)),)
    """
    return tuple(
        Axis(axis.name, tuple(axis.values[i] for i in chosen))
        for axis, chosen in zip(axes, _chosen(axes), strict=True)
    )


def _chosen(axes: tuple[Axis, ...]) -> list[list[int]]:
    """Choose the first, middle and last value of each axis; after the third axis, the middle."""
    last = [len(axis.values) - 1 for axis in axes]
    middle = [len(axis.values) // 2 for axis in axes]
    return [
        sorted({0, half, end}) if n < 3 else [half]
        for n, (half, end) in enumerate(zip(middle, last, strict=True))
    ]


def of_option(error: InputError, option: str, axis: Axis, value: float) -> InputError:
    """Attribute faults of a design at a value of an axis to the option that gave it."""
    found = []
    for fault in error.faults:
        if fault.key.startswith("--") and fault.key != "--set":
            found.append(fault)
            continue
        same = (
            fault.key in ("", "--set")
            or fault.key.rpartition(".")[2] == axis.name.rpartition(".")[2]
        )
        found.append(
            Fault(
                f"{option} {axis.name}",
                fault.problem if same else f"{fault.key}: {fault.problem}",
                fault.remedy,
                f"{value:g}",
            )
        )
    return InputError(found, error.file)
