"""Measured designs: one with its free parameters at any values, and what was measured of it.

    one = Experiment(text, "beam", modes, ("stage.test.wires.d",), start, where="", file="")
    frequencies, slopes = one.predict(x)

A search asks for residuals and for derivatives at the same x, so the last few builds are kept.
"""

from __future__ import annotations

import functools
import tomllib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import readings
from suspension_cli.analyses.analysis import Document
from suspension_cli.analyses.fit import measured_values
from suspension_cli.conventions import DOF_BY_NAME, DOFS
from suspension_cli.design import paths, reader
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import MeasuredQuantity, Mode
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.grids import parse_place
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import derivatives
from suspension_cli.studies.response_matrix import Matrices, Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

FORBIDDEN = 1e6
"""Cost of assigning a measurement to a mode that it cannot belong to; others cost the square of
ln(measured / computed)."""
TYPICAL = 0.1
"""Typical change of a parameter without prior, relative to its value."""
SMALL = 1e-3
"""The same of a parameter of value 0, SI."""


@dataclass(frozen=True, eq=False)
class Build:
    """A design (TOML) on a model, with its free parameters (dotted paths) at x."""

    text: str
    level: str
    free: tuple[str, ...]
    x: tuple[float, ...]

    @cached_property
    def document(self) -> Document:
        """Parsed TOML of the design."""
        raw = tomllib.loads(self.text)
        settings = dict(zip(self.free, self.x, strict=True))
        reader.apply_overrides(raw, paths.symmetric_settings(settings))
        return raw

    @cached_property
    def design(self) -> Design:
        """The design; raises `InputError` if it is invalid."""
        return reader.convert(self.document)

    @cached_property
    def plant(self) -> Plant:
        """The design, solved."""
        return Plant.of(self.design, self.level)

    @cached_property
    def changes(self) -> list[Matrices | None]:
        """Derivatives of the matrices; None for a parameter that cannot change alone."""
        return self.plant.changes(self.free)


_build = functools.lru_cache(maxsize=16)(Build)


@functools.lru_cache(maxsize=16)
def _evaluate(build: Build, quantities: tuple[Quantity, ...]) -> Array:
    """Values of quantities of a build, SI; NaN without a value."""
    return measured_values.evaluate([build.design], quantities, build.level)[0]


@functools.lru_cache(maxsize=4)
def _differentiate(build: Build, quantities: tuple[Quantity, ...]) -> Array:
    """Derivatives of quantities of a build by its free parameters (quantity, parameter)."""
    x = np.array(build.x)
    typical = np.where(x != 0, TYPICAL * np.abs(x), SMALL)
    step = measured_values.STEP * typical
    count = len(x)
    sides = np.concatenate([x - np.diag(step), x + np.diag(step)])
    designs = [_design_or_none(replace(build, x=tuple(row.tolist()))) for row in sides]
    values = measured_values.evaluate(designs, quantities, build.level)
    middle = _evaluate(build, quantities)
    return measured_values.differentiate(values[:count], values[count:], middle, step)


def _design_or_none(build: Build) -> Design | None:
    """The design of a build; None if it is invalid."""
    try:
        return build.design
    except InputError:
        return None


@functools.lru_cache(maxsize=3)
def respond(
    build: Build, signals: readings.Signals, grids: tuple[bytes, ...], damping: bytes
) -> list[Responses]:
    """Responses of a build on grids of frequencies (bytes), with added damping of its modes."""
    outputs, inputs = signals
    return [
        build.plant.respond(np.frombuffer(grid), inputs, outputs, np.frombuffer(damping))
        for grid in grids
    ]


@dataclass(frozen=True)
class Experiment:
    """A design (TOML) on a model that supports derivatives, with measured modes and quantities.

    `free` are dotted paths of the free parameters, `start` their starting values (SI), `where` is
    the prefix of the key paths of the modes, and `file` that of the design, in errors. `rates` is
    a build whose derivatives of the matrices, and of quantities, stand for those of all builds (see
    `Problem.held`). `quantities` are what the `measured` ones mean in the design.
    """

    text: str
    level: str
    mode: list[Mode]
    free: tuple[str, ...]
    start: Array
    where: str
    file: str
    rates: Build | None = None
    measured: tuple[MeasuredQuantity, ...] = ()
    quantities: tuple[Quantity, ...] = ()

    @cached_property
    def nominal(self) -> Plant:
        """The design where the search starts; measurements refer to the labels of its modes."""
        return self.plant(self.start)

    @cached_property
    def labels(self) -> list[str]:
        """Labels of the nominal modes."""
        return self.nominal.modes.label

    def at(self, x: Array) -> Build:
        """Put the free parameters into the design."""
        return _build(self.text, self.level, self.free, tuple(x.tolist()))

    def plant(self, x: Array) -> Plant:
        """Solve the design with the free parameters x."""
        with attribute_faults_to(self.file):
            return self.at(x).plant

    def order(self, x: Array) -> Int[np.ndarray, " mode"]:
        """Mode of the plant at x for each nominal mode."""
        overlap = self.nominal.modes.shape @ self.plant(x).modal_forces.T
        return pair_by_overlap(overlap**2)

    def frequencies(self, x: Array) -> Float[np.ndarray, " mode"]:
        """Frequencies in the order of the nominal modes, Hz; NaN for an unstable mode."""
        return self.plant(x).modes.frequency[self.order(x)]

    def changes(self, x: Array) -> list[Matrices]:
        """Differentiate the matrices by the free parameters; 0 where one cannot change alone."""
        system = self.plant(x).system
        nothing = np.zeros((system.size, system.size))
        turn = np.zeros((len(system.body) + 1, 3, 3))
        still = Matrices(nothing, nothing, nothing, nothing, turn)
        return [change or still for change in (self.rates or self.at(x)).changes]

    @cached_property
    def allowed(self) -> Bool[np.ndarray, "measured mode"]:
        """Whether a measurement may be of a nominal mode, by its label or its directions."""
        modes = self.nominal.modes
        rows: list[list[bool]] = []
        taken: set[int] = set()
        for n, item in enumerate(self.mode, 1):
            if item.label is None:
                asked = {DOF_BY_NAME[name] for name in item.dof or DOFS}
                rows.append([dof in asked for _, dof in modes.home])
                continue
            number = self._labelled(item.label, f"{self.where}mode.{n}.label", taken)
            taken.add(number)
            rows.append([mode == number for mode in range(len(modes.home))])
        return np.array(rows, dtype=bool).reshape(len(self.mode), len(modes.home))

    def _labelled(self, label: str, where: str, taken: set[int]) -> int:
        """Find the nominal mode of a label, or of a number from 1, that is not `taken`."""
        modes = self.nominal.modes
        place = parse_place(label, len(modes.home))
        found = modes.with_label(label) if place is None else [place]
        if not found:
            remedy = suggest(label, modes.label)
            raise InputError.of(where, "is the label of no mode", remedy, format_value(label))
        if len(found) != 1 or found[0] in taken:
            problem = "does not name exactly one mode, or names that of another measurement"
            remedy = f"list labels with pendsus modes --fidelity {self.level}"
            raise InputError([Fault(where, problem, remedy, format_value(label))])
        return found[0]

    def values(self, x: Array) -> Float[np.ndarray, " quantity"]:
        """Values of the measured quantities, SI; raises `InputError` if one has none."""
        if not self.quantities:
            return np.zeros(0)
        with attribute_faults_to(self.file):
            found = _evaluate(self.at(x), self.quantities)
        measured_values.demand_values(found, self.quantities, self.where)
        return found

    def value_slopes(self, x: Array) -> Float[np.ndarray, "quantity free"]:
        """Derivatives of the measured quantities by the free parameters."""
        if not self.quantities:
            return np.zeros((0, len(self.free)))
        with attribute_faults_to(self.file):
            return _differentiate(self.rates or self.at(x), self.quantities)

    def predict(self, x: Array) -> tuple[Array, Array]:
        """Frequencies of the measured modes, Hz, and their derivatives; 0 for an unstable mode."""
        modes = self.plant(x).modes
        places = self.order(x)[self.assign_modes(x)]
        rates = [
            derivatives.frequency_rates(modes, one.of_modes(modes))[places]
            for one in self.changes(x)
        ]
        slopes = np.array(rates).reshape(-1, len(places)).T
        return np.nan_to_num(modes.frequency[places]), np.nan_to_num(slopes)

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
        spare = max(len(cost) - len(frequency), 0)
        cost = np.pad(cost, ((0, 0), (0, spare)), constant_values=FORBIDDEN)
        rows, columns = linear_sum_assignment(cost)
        for n in np.flatnonzero(cost[rows, columns] == FORBIDDEN):
            directions = self.mode[n].dof
            where = f"{self.where}mode"
            if directions is None:
                problem = f"the design has only {len(frequency)} modes, fewer than were measured"
                raise InputError.of(where, problem, "remove measurements of other modes")
            problem = "no unassigned mode moves mainly in these degrees of freedom"
            remedy = f"list modes with pendsus modes --fidelity {self.level}"
            fault = Fault(f"{where}.{n + 1}.dof", problem, remedy, format_value(directions))
            raise InputError([fault])
        return columns
