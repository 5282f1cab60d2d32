"""Jobs: many builds of one design, on a grid or at random, whose results `run` computes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design import reader
from suspension_cli.design.imperfections import swept
from suspension_cli.design.paths import DISPLAYED, displayed_unit, settings, unit_of
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium import nominal
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float, Int


@dataclass(frozen=True)
class Job:
    """Many builds of one design, as TOML; see `run.Job`."""

    text: str

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design."""
        return repr([getattr(self, field.name) for field in fields(self) if field.name != "text"])

    @property
    def is_analytic(self) -> bool:
        """Whether it is `interpolated.Analytic`, so that a map of it may be interpolated."""
        return False

    @property
    def design(self) -> Design:
        """Parsed design."""
        return parse(self.text)

    @property
    def scene(self) -> Scene:
        """Scene of the design."""
        return expand(self.text)


# jobs of one design that differ in other fields share these
@lru_cache(maxsize=4)
def parse(text: str) -> Design:
    """Parse a design."""
    return reader.parse(text)


@lru_cache(maxsize=4)
def expand(text: str) -> Scene:
    """Expand a design into its scene."""
    return nominal.expand(parse(text))


@lru_cache(maxsize=8)
def nominal_system(text: str, level: str) -> LinearSystem:
    """Build the linear system of a design in the model of that name."""
    return registry.by_name(level).system(parse(text))


@dataclass(frozen=True)
class Axis:
    """A swept parameter and its values, SI.

    Its name is that of an imperfection (`design.imperfections.swept`) or a dotted path.
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
        """Unit in which the values are displayed, "" for factors, and the factor to it."""
        if self.name in swept():
            return DISPLAYED.get(self.unit, ("", 1.0))
        return displayed_unit(self.name, float(np.max(np.abs(self.values))))

    @property
    def displayed(self) -> Float[np.ndarray, " value"]:
        """The values in that unit."""
        return np.array(self.values) * self.displayed_unit[1]

    def describe(self, value: float) -> str:
        """Write a value in that unit, for figures: ``−2 mm``."""
        unit, factor = self.displayed_unit
        return f"{value * factor:.4g} {unit}".rstrip().replace("-", "−")


@dataclass(frozen=True)
class Grid(Job):
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

    def values(self, start: int, stop: int) -> dict[str, Float[np.ndarray, " stop-start"]]:
        """Values of every parameter at points start to stop - 1."""
        return self.values_at(np.arange(start, stop))

    def values_at(
        self, points: Int[np.ndarray, " point"]
    ) -> dict[str, Float[np.ndarray, " point"]]:
        """Values of every parameter at points given by number."""
        chosen = np.unravel_index(points, self.shape)
        return {
            axis.name: np.array(axis.values)[pick]
            for axis, pick in zip(self.axes, chosen, strict=True)
        }

    @property
    def corners(self) -> Int[np.ndarray, " point"]:
        """Points at the ends and middles of the first three axes, and the middles of others."""
        chosen = np.ix_(
            *(_ends_and_middle(n, len(axis.values)) for n, axis in enumerate(self.axes))
        )
        return np.ravel_multi_index(chosen, self.shape).ravel()

    def on_grid(self, columns: dict[str, Any]) -> dict[str, Any]:
        """Reshape results of all points to the axes of the grid."""
        return {name: one.reshape(*self.shape, *one.shape[1:]) for name, one in columns.items()}

    def check_designs(
        self, option: str, axes: Iterable[Axis], check: Callable[[Design], object]
    ) -> None:
        """Raise `InputError` if a path does not exist, or none of three values is valid.

        `check` raises it for invalid designs.
        """
        for axis in axes:
            tried = ends_and_middle(axis)
            errors = list[InputError]()
            for value in tried.values:
                try:
                    check(reader.parse_with_overrides(self.text, settings({axis.name: value})))
                except InputError as error:
                    errors.append(_of_option(error, option, axis, value))
            if len(errors) == len(tried.values):
                raise errors[0]


def distinct(axes: list[Axis], option: str, given: str) -> tuple[Axis, ...]:
    """Return axes of an option; raises `InputError` if two are of one parameter."""
    if len({axis.name for axis in axes}) < len(axes):
        problem = "names a parameter twice"
        raise InputError.of(option, problem, "give each once", format_value(given))
    return tuple(axes)


def ends_and_middle(axis: Axis) -> Axis:
    """Reduce an axis to its ends and middle.

    >>> ends_and_middle(Axis("k", (1.0, 2.0, 3.0, 4.0, 5.0)))
    Axis(name='k', values=(1.0, 3.0, 5.0))
    """
    chosen = _ends_and_middle(0, len(axis.values))
    return Axis(axis.name, tuple(axis.values[i] for i in chosen))


def _ends_and_middle(number: int, length: int) -> list[int]:
    """Places of ends and middle of an axis; of the middle of those after the third."""
    half = length // 2
    return sorted({0, half, length - 1}) if number < 3 else [half]


def _of_option(error: InputError, option: str, axis: Axis, value: float) -> InputError:
    """Attribute faults of a design at a value of an axis to the option that gave it."""
    found = []
    last = axis.name.rpartition(".")[2]
    for fault in error.faults:
        if fault.key.startswith("--") and fault.key != "--set":
            found.append(fault)
            continue
        problem = fault.problem
        if fault.key not in ("", "--set") and fault.key.rpartition(".")[2] != last:
            problem = f"{fault.key}: {problem}"
        found.append(Fault(f"{option} {axis.name}", problem, fault.remedy, f"{value:g}"))
    return InputError(found, error.file)
