"""Mode frequencies of one measured design, with their derivatives by the fitted numbers."""

from __future__ import annotations

import contextlib
import copy
import tomllib
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.analysis import Document
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Mode
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.linear import batch_modes, eigenmodes, mode_pairing, named_results
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import derivatives
from suspension_cli.studies.derivatives import frequency_rates, mode_matrix
from suspension_cli.studies.parameters import Parameter

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.analyses.fit.array_types import ModeValues, Numbers

FORBIDDEN = 1e6
"""Cost of assigning a measurement to a mode that it cannot belong to; others cost the square of
ln(measured / computed)."""


def unbalanced(name: str) -> InputError:
    """Return the error of a number whose change alone unbalances a design."""
    problem = "a change of this number alone unbalances the suspension"
    return InputError([Fault(f"parameter {name}", problem, "fit another number")])


@dataclass
class Experiment:
    """A design, its measured modes and its free numbers.

    Attributes
    ----------
    text
        The design as TOML.
    free, start
        Dotted paths of the free numbers, and their starting values, SI.
    where
        Prefix of the key paths of the modes in errors.
    file
        File of the design, for errors.
    level
        Name of a model that supports derivatives.
    cache
        Frequencies and derivatives by free numbers.
    """

    text: str
    mode: list[Mode]
    free: list[str]
    start: Numbers
    where: str = ""
    file: str = ""
    level: str = registry.STRING.name
    cache: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    @cached_property
    def table(self) -> Document:
        """Parsed TOML of the design."""
        return tomllib.loads(self.text)

    @cached_property
    def nominal_system(self) -> LinearSystem:
        """Linear system of the design where the search starts."""
        with self.faults():
            return registry.by_name(self.level).system(self.design(self.start))

    @cached_property
    def nominal_modes(self) -> eigenmodes.Modes:
        """Modes of `nominal_system`; measurements refer to their labels."""
        return eigenmodes.solve(replace(self.nominal_system, terms=()))

    @cached_property
    def dominant_dof(self) -> list[str]:
        """Dominant degree of freedom of each nominal mode."""
        return [dof for _, dof in self.nominal_modes.home]

    @cached_property
    def shape(self) -> Float[np.ndarray, "mode coordinate"]:
        """Mass-normalised shapes of the nominal modes."""
        return batch_modes.solve_one(self.nominal_system).shape[0]

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

    def document(self, x: Numbers) -> Document:
        """Return the parsed TOML of the design with the free numbers x."""
        raw = copy.deepcopy(self.table)
        values = {name: float(value) for name, value in zip(self.free, x, strict=True)}
        reader.apply_overrides(raw, paths.symmetric_settings(values))
        return raw

    def design(self, x: Numbers) -> Design:
        """Return the design with the free numbers x."""
        return reader.convert(self.document(x))

    def evaluate(self, x: Numbers) -> tuple[ModeValues, Float[np.ndarray, "mode number"]]:
        """Solve for all frequencies, Hz (NaN: unstable), and their derivatives.

        Modes are in the order of `nominal_modes`. Results are cached.
        """
        key = np.asarray(x, dtype=float).tobytes()
        if key not in self.cache:
            with self.faults():
                self.cache[key] = self._solve(x)
        return self.cache[key]

    def _solve(self, x: Numbers) -> tuple[ModeValues, Float[np.ndarray, "mode number"]]:
        design = self.design(x)
        model = registry.by_name(self.level).system(design).constant
        found, shape = eigenmodes.solve(model), batch_modes.solve_one(model).shape[0]
        order = mode_pairing.pair_by_shape(self.shape, shape)[0]
        slope = np.zeros((len(order), len(self.free)))
        numbers = [Parameter(name, float(value)) for name, value in zip(self.free, x, strict=True)]
        around = derivatives.differentiate(
            design,
            numbers,
            self.level,
            lambda builds: mode_matrix(builds, found, massive=False).reshape(-1, len(order) ** 2),
            nominal=np.zeros(len(order) ** 2),
        )
        for n, name in enumerate(self.free):
            if not around.balanced[n]:
                raise unbalanced(name)
            change = around.central[n].reshape(len(order), -1)
            slope[:, n] = frequency_rates(found, change)[order]
        return found.frequency[order], slope

    def predict(
        self, x: Numbers
    ) -> tuple[Float[np.ndarray, " measured"], Float[np.ndarray, "measured number"]]:
        """Frequencies of the measured modes, Hz, and their derivatives; 0 for an unstable mode."""
        if not self.mode:
            return np.zeros(0), np.zeros((0, len(self.free)))
        (frequency, slope), places = self.evaluate(x), self.assign_modes(x)
        return np.nan_to_num(frequency[places], nan=0.0), np.nan_to_num(slope[places])

    def assign_modes(self, x: Numbers) -> list[int]:
        """Assign a mode to each measurement.

        Measurements without a label share the modes left by the others such that the sum of
        ln(measured / computed)^2 is smallest.
        """
        from scipy.optimize import linear_sum_assignment

        assigned = dict(self.labelled)
        remaining = [n for n in range(len(self.mode)) if n not in assigned]
        frequency, _ = self.evaluate(x)
        open_modes = np.setdiff1d(np.flatnonzero(frequency > 0), [*assigned.values()])
        if remaining:
            cost = np.full((len(remaining), max(len(open_modes), len(remaining))), FORBIDDEN)
            ratio = self.frequency[remaining][:, None] / frequency[open_modes]
            cost[:, : len(open_modes)] = np.log(ratio) ** 2
            for row, n in enumerate(remaining):
                allowed = self.mode[n].dof
                if allowed is not None:
                    dofs = [self.dominant_dof[mode] for mode in open_modes]
                    cost[row, [k for k, dof in enumerate(dofs) if dof not in allowed]] = FORBIDDEN
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                if cost[row, column] == FORBIDDEN:
                    raise InputError([self._unassigned(remaining[row], len(frequency))])
                assigned[remaining[row]] = int(open_modes[column])
        return [assigned[n] for n in range(len(self.mode))]

    @cached_property
    def labelled(self) -> dict[int, int]:
        """Mode of each measurement that has a label."""
        assigned: dict[int, int] = {}
        for n, item in enumerate(self.mode):
            if item.label is not None:
                where = f"{self.where}mode.{n + 1}.label"
                found = named_results.parse([item.label], self.nominal_modes, (), where)
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
            return Fault(
                f"{self.where}mode",
                f"the design has only {count} modes, fewer than were measured",
                "remove measurements of other modes",
            )
        return Fault(
            f"{self.where}mode.{n + 1}.dof",
            "no unassigned mode moves mainly in these degrees of freedom",
            f"list modes with pendsus modes --fidelity {self.level}",
            format_value(allowed),
        )
