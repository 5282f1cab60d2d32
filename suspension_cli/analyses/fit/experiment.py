"""A measured design as a function of its free parameters: matrices, modes, derivatives."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.analysis import Document
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Mode
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.linear.signals import Signal
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import derivatives
from suspension_cli.studies.response_matrix import Matrices, Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

FORBIDDEN = 1e6
"""Cost of assigning a measurement to a mode that it cannot belong to; others cost the square of
ln(measured / computed)."""


@functools.lru_cache(maxsize=16)
def _solve(text: str, free: tuple[str, ...], x: tuple[float, ...], level: str) -> Plant:
    return Plant.of(reader.convert(document(text, free, x)), level)


@functools.lru_cache(maxsize=3)
def _respond(
    plant: tuple[str, tuple[str, ...], tuple[float, ...], str],
    signal: tuple[tuple[Signal, ...], tuple[Signal, ...]],
    grids: tuple[bytes, ...],
    damping: bytes,
) -> list[Responses]:
    outputs, inputs = signal
    return [
        _solve(*plant).respond(np.frombuffer(grid), inputs, outputs, np.frombuffer(damping))
        for grid in grids
    ]


def document(text: str, free: tuple[str, ...], x: tuple[float, ...]) -> Document:
    """Return the parsed TOML of a design with its free parameters at x."""
    raw = tomllib.loads(text)
    reader.apply_overrides(raw, paths.symmetric_settings(dict(zip(free, x, strict=True))))
    return raw


@dataclass(frozen=True)
class Experiment:
    """A design, its measured modes and its free parameters.

    Attributes
    ----------
    text
        The design as TOML.
    free, start
        Dotted paths of the free parameters and their starting values, SI.
    where
        Prefix of the key paths of the modes in errors.
    file
        File of the design, for errors.
    level
        Name of a model that supports derivatives.
    latest
        Where the derivatives of the matrices were computed last, and these; empty without.
    """

    text: str
    mode: list[Mode]
    free: tuple[str, ...]
    start: Array
    where: str
    file: str
    level: str
    latest: list[tuple[Array, list[Matrices]]] = field(default_factory=list)

    @cached_property
    def nominal(self) -> Plant:
        """The design where the search starts; measurements refer to the labels of its modes."""
        return self.plant(self.start)

    @cached_property
    def labels(self) -> list[str]:
        """Labels of the nominal modes."""
        return named_results.labels(self.nominal.modes)

    def document(self, x: Array) -> Document:
        """Return the parsed TOML of the design with the free parameters x."""
        return document(self.text, self.free, tuple(x.tolist()))

    def plant(self, x: Array) -> Plant:
        """Solve the design with the free parameters x."""
        with attribute_faults_to(self.file):
            return _solve(self.text, self.free, tuple(x.tolist()), self.level)

    def respond(
        self,
        x: Array,
        signal: tuple[tuple[Signal, ...], tuple[Signal, ...]],
        grids: Sequence[Array],
        damping: Array,
    ) -> list[Responses]:
        """Solve for the responses of outputs to inputs on each grid, Hz.

        `damping` is added to the modes of the plant at x.
        """
        plant = (self.text, self.free, tuple(x.tolist()), self.level)
        return _respond(plant, signal, tuple(grid.tobytes() for grid in grids), damping.tobytes())

    def order(self, x: Array) -> Int[np.ndarray, " mode"]:
        """Mode of the plant at x for each nominal mode."""
        overlap = self.nominal.modes.shape @ self.plant(x).modal_forces.T
        return pair_by_overlap(overlap**2)

    def frequencies(self, x: Array) -> Float[np.ndarray, " mode"]:
        """Frequencies in the order of the nominal modes, Hz; NaN for an unstable mode."""
        return self.plant(x).modes.frequency[self.order(x)]

    def changes(self, x: Array) -> list[Matrices]:
        """Differentiate the matrices by the free parameters at x."""
        if not self.latest or (x != self.latest[0][0]).any():
            found = []
            for name, one in zip(self.free, self.plant(x).changes(self.free), strict=True):
                if one is None:
                    problem = "a change of this number alone unbalances the suspension"
                    raise InputError([Fault(f"parameter {name}", problem, "fit another number")])
                found.append(one)
            self.latest[:] = [(x.copy(), found)]
        return self.latest[0][1]

    def slopes(self, x: Array) -> Float[np.ndarray, "mode parameter"]:
        """Differentiate `frequencies` by the free parameters; 0 for an unstable mode."""
        modes, order = self.plant(x).modes, self.order(x)
        rates = [
            derivatives.frequency_rates(modes, one.of_modes(modes))[order]
            for one in self.changes(x)
        ]
        return np.nan_to_num(np.array(rates).reshape(-1, len(order)).T)

    @cached_property
    def allowed(self) -> Bool[np.ndarray, "measured mode"]:
        """Whether a measurement may be of a nominal mode, by its label or its directions."""
        modes, rows, taken = self.nominal.modes, [], set[int]()
        for n, item in enumerate(self.mode, 1):
            if item.label is None:
                rows.append([item.dof is None or dof in item.dof for _, dof in modes.home])
                continue
            where = f"{self.where}mode.{n}.label"
            found = named_results.parse([item.label], modes, (), where)
            numbers = {one.number for one in found if isinstance(one, named_results.Mode)}
            if len(numbers) != 1 or numbers & taken:
                problem = "does not name exactly one mode, or names that of another measurement"
                remedy = f"list labels with pendsus modes --fidelity {self.level}"
                raise InputError([Fault(where, problem, remedy, format_value(item.label))])
            taken |= numbers
            rows.append([mode in numbers for mode in range(len(modes.home))])
        return np.array(rows, dtype=bool).reshape(len(self.mode), len(modes.home))

    def assign_modes(self, x: Array) -> Int[np.ndarray, " measured"]:
        """Assign a mode to each measurement.

        Measurements without a label share the modes left by the others such that the sum of
        ln(measured / computed)^2 is smallest.
        """
        from scipy.optimize import linear_sum_assignment

        measured = np.array([item.frequency for item in self.mode]).reshape(-1, 1)
        frequency = self.frequencies(x)
        cost = np.log(measured / np.where(frequency > 0, frequency, np.nan)) ** 2
        cost[[item.label is not None for item in self.mode]] = 0.0
        cost = np.where(self.allowed & np.isfinite(cost), cost, FORBIDDEN)
        spare = np.full((len(cost), max(len(cost) - len(frequency), 0)), FORBIDDEN)
        cost = np.hstack([cost, spare])
        rows, columns = linear_sum_assignment(cost)
        lost = np.flatnonzero(cost[rows, columns] == FORBIDDEN)
        if not len(lost):
            return columns
        directions = self.mode[lost[0]].dof
        if directions is None:
            problem = f"the design has only {len(frequency)} modes, fewer than were measured"
            fault = Fault(f"{self.where}mode", problem, "remove measurements of other modes")
        else:
            problem = "no unassigned mode moves mainly in these degrees of freedom"
            remedy = f"list modes with pendsus modes --fidelity {self.level}"
            where = f"{self.where}mode.{lost[0] + 1}.dof"
            fault = Fault(where, problem, remedy, format_value(directions))
        raise InputError([fault])
