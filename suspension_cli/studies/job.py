"""A sweep of one design: points, whose results fill the columns of a file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import lru_cache

from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium import nominal
from suspension_cli.scene.scene import Scene
from suspension_cli.studies.builds import Column, ColumnValues


@dataclass(frozen=True)
class Job(ABC):
    """The points of a sweep, for `run`; picklable.

    Attributes
    ----------
    text
        The design as TOML.
    """

    text: str

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes, the last varying fastest."""

    @property
    @abstractmethod
    def scales(self) -> tuple[str, ...]:
        """Names of the datasets that are the scales of `shape`: columns, or beside them."""

    @property
    @abstractmethod
    def columns(self) -> tuple[Column, ...]:
        """The results stored for each point."""

    @abstractmethod
    def compute(self, start: int, stop: int) -> ColumnValues:
        """Compute the results of points start to stop - 1."""

    @property
    def identity(self) -> str:
        """Text that differs between sweeps of one design."""
        return repr([getattr(self, field.name) for field in fields(self) if field.name != "text"])

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
