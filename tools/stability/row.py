"""Row of the stability atlas: errors of several methods along the parameter that drives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BROKEN = 1e-3
"""Relative error above which a method counts as broken: fewer than three correct digits."""
SHIPPED = "pendsus"
"""Prefix of the names of the program's own methods, called through its public functions."""


@dataclass(frozen=True)
class Row:
    """Errors of several methods for one quantity along one parameter.

    Attributes
    ----------
    title : str
    driver : str
        The parameter, with its unit.
    quantity : str
        Quantity that the error is of.
    value : (n,) array
        Values of the parameter, from harmless to extreme.
    error : mapping of str to (n,) array
        Relative errors by method; infinite where a method gives no result.
    finding : str
        Two sentences: why methods fail, and what the program does.
    limit : str
        Limit of the program's own method, and its message there.
    mark : mapping of str to float
        Values of the parameter worth a line in the chart, by their label.
    real : tuple of float
        Smallest and largest value of the parameter in real suspensions; empty if not known.
    """

    title: str
    driver: str
    quantity: str
    value: Array
    error: Mapping[str, Array]
    finding: str
    limit: str
    mark: Mapping[str, float] = field(default_factory=dict)
    real: tuple[float, ...] = ()

    @property
    def shipped(self) -> list[str]:
        """Names of the program's own methods."""
        return [name for name in self.error if name.startswith(SHIPPED)]

    @property
    def others(self) -> list[str]:
        """The other methods."""
        return [name for name in self.error if not name.startswith(SHIPPED)]

    def broken_at(self, method: str) -> float | None:
        """Value of the parameter from which a method stays broken; None if valid to the end."""
        good = np.flatnonzero(self.error[method] <= BROKEN)
        last = int(good[-1]) if len(good) else -1
        return None if last + 1 == len(self.value) else float(self.value[last + 1])

    def is_real(self, value: float | None) -> bool:
        """Whether a value of the parameter occurs in real suspensions."""
        return value is not None and bool(self.real) and self.real[0] <= value <= self.real[1]

    def worst(self, method: str) -> float:
        """Return the largest error of a method along the row."""
        return float(self.error[method].max())


def sample(values: Any, compute: Callable[[float], tuple[Any, dict[str, Any]]]) -> dict[str, Array]:
    """Compute the largest error of each method at some values of a parameter.

    `compute` returns the exact result at a value, and those of the methods by name.
    """
    error: dict[str, list[float]] = {}
    for value in values:
        exact, found = compute(float(value))
        for name, one in found.items():
            error.setdefault(name, []).append(float(np.max(relative(one, exact))))
    return {name: np.array(one) for name, one in error.items()}


def relative(found: object, exact: object) -> Array:
    """Relative errors |found - exact| / |exact|; infinite where nothing was found."""
    with np.errstate(all="ignore"):
        result = np.abs(np.asarray(found) - np.asarray(exact)) / np.abs(np.asarray(exact))
    return np.where(np.isfinite(result), result, np.inf)
