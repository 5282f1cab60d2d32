"""A measured design at any values of its free parameters: plant, modes, and measured modes."""

from __future__ import annotations

import contextlib
import copy
import tomllib
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.analysis import Document
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Mode
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.studies.derivatives import frequency_rates
from suspension_cli.studies.response_matrix import Matrices, Plant

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from suspension_cli.scene.arrays import Array

FORBIDDEN = 1e6
"""Cost of assigning a measurement to a mode that it cannot belong to; others cost the square of
ln(measured / computed)."""
KEPT = 12
"""Plants that are kept."""
NEARBY = 0.5
"""Change of the parameters, over their typical changes, within which the derivatives of the
matrices are not computed again: they are smooth, and a search needs no more."""


@dataclass
class Experiment:
    """A design, its measured modes and its free parameters.

    Attributes
    ----------
    text
        The design as TOML.
    free, start, scale
        Dotted paths of the free parameters, their starting values and typical changes, SI.
    where
        Prefix of the key paths of the modes in errors.
    file
        File of the design, for errors.
    level
        Name of a model that supports derivatives.
    around
        Values of the parameters, and derivatives of the matrices there.
    """

    text: str
    mode: list[Mode]
    free: list[str]
    start: Array
    scale: Array
    where: str
    file: str
    level: str
    around: tuple[Array, list[Matrices]] | None = None
    _plants: dict[bytes, Plant] = field(default_factory=dict)

    @cached_property
    def table(self) -> Document:
        """Parsed TOML of the design."""
        return tomllib.loads(self.text)

    @cached_property
    def nominal(self) -> Plant:
        """The design where the search starts; measurements refer to the labels of its modes."""
        return self.plant(self.start)

    @cached_property
    def labels(self) -> list[str]:
        """Labels of the nominal modes."""
        return named_results.labels(self.nominal.modes)

    @property
    def frequency(self) -> Float[np.ndarray, " measured"]:
        """Measured frequencies, Hz."""
        return np.array([item.frequency for item in self.mode])

    @property
    def uncertainty(self) -> Float[np.ndarray, " measured"]:
        """Standard deviations of the measured frequencies, Hz."""
        return np.array([item.uncertainty for item in self.mode])

    def faults(self) -> contextlib.AbstractContextManager[None]:
        """Attribute errors in the design to its file."""
        return attribute_faults_to(self.file)

    def document(self, x: Array) -> Document:
        """Return the parsed TOML of the design with the free parameters x."""
        raw = copy.deepcopy(self.table)
        values = {name: float(value) for name, value in zip(self.free, x, strict=True)}
        reader.apply_overrides(raw, paths.symmetric_settings(values))
        return raw

    def design(self, x: Array) -> Design:
        """Return the design with the free parameters x."""
        return reader.convert(self.document(x))

    def plant(self, x: Array) -> Plant:
        """Solve the design with the free parameters x; the last `KEPT` plants are kept."""
        key = x.tobytes()
        if key not in self._plants:
            while len(self._plants) >= KEPT:
                del self._plants[next(iter(self._plants))]
            with self.faults():
                self._plants[key] = Plant.of(self.design(x), self.level)
        return self._plants[key]

    def order(self, x: Array) -> Int[np.ndarray, " mode"]:
        """Mode of the plant at x for each nominal mode."""
        overlap = self.nominal.modes.shape @ self.plant(x).modal_forces.T
        return pair_by_overlap(overlap**2)

    def frequencies(self, x: Array) -> Float[np.ndarray, " mode"]:
        """Frequencies in the order of the nominal modes, Hz; NaN for an unstable mode."""
        return self.plant(x).modes.frequency[self.order(x)]

    def linearise(self, x: Array) -> list[Matrices]:
        """Differentiate the matrices of the plant at x by the free parameters."""
        found = self.plant(x).changes(self.free)
        changes = [one for one in found if one is not None]
        if len(changes) < len(found):
            problem = "a change of this number alone unbalances the suspension"
            name = self.free[found.index(None)]
            raise InputError([Fault(f"parameter {name}", problem, "fit another number")])
        self.around = (x.copy(), changes)
        return changes

    def changes(self, x: Array) -> list[Matrices]:
        """Derivatives of the matrices at or near x."""
        if self.around is None or (np.abs(x - self.around[0]) > NEARBY * self.scale).any():
            return self.linearise(x)
        return self.around[1]

    def slopes(self, x: Array) -> Float[np.ndarray, "mode parameter"]:
        """Differentiate `frequencies` by the free parameters; 0 for an unstable mode."""
        modes, order = self.plant(x).modes, self.order(x)
        rates = [frequency_rates(modes, one.of_modes(modes))[order] for one in self.changes(x)]
        return np.nan_to_num(np.array(rates).reshape(-1, len(order)).T)

    def assign_modes(self, x: Array) -> list[int]:
        """Assign a mode to each measurement.

        Measurements without a label share the modes left by the others such that the sum of
        ln(measured / computed)^2 is smallest.
        """
        from scipy.optimize import linear_sum_assignment

        assigned = dict(self.labelled)
        remaining = [n for n in range(len(self.mode)) if n not in assigned]
        if remaining:
            frequency = self.frequencies(x)
            left = np.setdiff1d(np.flatnonzero(frequency > 0), [*assigned.values()])
            cost = np.full((len(remaining), max(len(left), len(remaining))), FORBIDDEN)
            ratio = self.frequency[remaining][:, None] / frequency[left]
            cost[:, : len(left)] = np.log(ratio) ** 2
            for row, n in enumerate(remaining):
                allowed = self.mode[n].dof
                if allowed is not None:
                    dofs = [self.nominal.modes.home[mode][1] for mode in left]
                    cost[row, [k for k, dof in enumerate(dofs) if dof not in allowed]] = FORBIDDEN
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                if cost[row, column] == FORBIDDEN:
                    raise InputError([self._unassigned(remaining[row], len(frequency))])
                assigned[remaining[row]] = int(left[column])
        return [assigned[n] for n in range(len(self.mode))]

    @cached_property
    def labelled(self) -> dict[int, int]:
        """Mode of each measurement that has a label."""
        assigned: dict[int, int] = {}
        for n, item in enumerate(self.mode):
            if item.label is not None:
                where = f"{self.where}mode.{n + 1}.label"
                found = named_results.parse([item.label], self.nominal.modes, (), where)
                numbers = [one.number for one in found if isinstance(one, named_results.Mode)]
                if len(numbers) != 1 or numbers[0] in assigned.values():
                    problem = "does not name exactly one mode, or names that of another measurement"
                    remedy = f"list labels with pendsus modes --fidelity {self.level}"
                    raise InputError([Fault(where, problem, remedy, format_value(item.label))])
                assigned[n] = numbers[0]
        return assigned

    def _unassigned(self, n: int, count: int) -> Fault:
        allowed = self.mode[n].dof
        if allowed is None:
            problem = f"the design has only {count} modes, fewer than were measured"
            return Fault(f"{self.where}mode", problem, "remove measurements of other modes")
        return Fault(
            f"{self.where}mode.{n + 1}.dof",
            "no unassigned mode moves mainly in these degrees of freedom",
            f"list modes with pendsus modes --fidelity {self.level}",
            format_value(allowed),
        )
