"""One design and what was measured of it: its frequencies, and their derivatives, as functions of the numbers to be learned."""

from __future__ import annotations

import contextlib
import copy
import tomllib
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.analysis import differences, modes, scalars, spectrum
from suspension_cli.analysis.parameters import Parameter, twins
from suspension_cli.analysis.sensitivity import frequencies
from suspension_cli.design import reader
from suspension_cli.design.measured import Mode
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, faults_of, shown
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity

FAR = 1e6
"""Distance, in the assignment of modes, of one that a measurement cannot be of."""


@dataclass
class Experiment:
    """A design, what was measured of it, and the numbers of it that are free.

    Attributes
    ----------
    text : str
        The design as TOML.
    mode : list of Mode
    free : list of str
        Dotted paths.
    start : (q,) array
        Where the search begins.
    where : str
        Before key paths of the modes, in faults.
    file : str
        The design's, for faults.
    level : str
        ``string``, whose derivatives are exact, or ``beam`` (`differences`).
    known : dict
        What was solved already.
    """

    text: str
    mode: list[Mode]
    free: list[str]
    start: Array
    where: str = ""
    file: str = ""
    level: str = "string"
    known: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    @cached_property
    def raw(self) -> dict[str, Any]:
        """The parsed text."""
        return tomllib.loads(self.text)

    @cached_property
    def drawn(self) -> LinearModel:
        """The model that the search starts from."""
        with self.faults():
            return fidelity.linear_model(self.design(self.start), self.level)

    @cached_property
    def names(self) -> modes.Modes:
        """Its modes, whose labels measurements bear."""
        return modes.solve(replace(self.drawn, terms=()))

    @cached_property
    def home(self) -> list[str]:
        """What moves most in each."""
        return [dof for _, dof in self.names.home]

    @cached_property
    def shape(self) -> Array:
        """Their shapes, by which they are followed."""
        return spectrum.of_one(self.drawn).shape[0]

    @property
    def frequency(self) -> Array:
        """What was measured, Hz, (k,)."""
        return np.array([item.frequency for item in self.mode])

    @property
    def uncertainty(self) -> Array:
        """Standard deviations, Hz, (k,)."""
        return np.array([item.uncertainty for item in self.mode])

    def faults(self) -> contextlib.AbstractContextManager[None]:
        """Tell faults of the design as those of its file."""
        return faults_of(self.file)

    def document(self, x: Array) -> dict[str, Any]:
        """The parsed design with these numbers."""
        raw = copy.deepcopy(self.raw)
        reader.apply_overrides(raw, tuple(f"{path}={float(value)!r}" for name, value in zip(self.free, x, strict=True) for path in twins(name)))
        return raw

    def design(self, x: Array) -> Design:
        """The design with these numbers."""
        return reader.convert(self.document(x))

    def solved(self, x: Array) -> tuple[Array, Array]:
        """All frequencies (m,) in the order of the design as drawn, and their derivatives (m, q)."""
        key = np.asarray(x, dtype=float).tobytes()
        if key not in self.known:
            with self.faults():
                self.known[key] = self._solved(x)
        return self.known[key]

    def _solved(self, x: Array) -> tuple[Array, Array]:
        design = self.design(x)
        model = replace(fidelity.linear_model(design, self.level), terms=())
        found, shape = modes.solve(model), spectrum.of_one(model).shape[0]
        order = spectrum.matched(self.shape, shape)[0]
        slope = np.zeros((len(order), len(self.free)))
        numbers = [Parameter(name, float(value)) for name, value in zip(self.free, x, strict=True)]
        changes = differences.changes(design, numbers, self.level)[1]
        for n, name in enumerate(self.free):
            change = changes[name]
            if change is None:
                raise InputError([Fault(f"parameter {name}", "cannot change alone: the suspension would not balance", "fit another number")])
            slope[:, n] = frequencies(found, change)[order]
        return found.frequency[order], slope

    def measured(self, x: Array) -> tuple[Array, Array]:
        """Frequencies (k,) of the modes measured, 0 of an unstable one, and their derivatives (k, q)."""
        (frequency, slope), places = self.solved(x), self.places(x)
        return np.nan_to_num(frequency[places], nan=0.0), np.nan_to_num(slope[places])

    def places(self, x: Array) -> list[int]:
        """Which mode each measurement is of: by its label, or the nearest frequencies that are left, all together."""
        from scipy.optimize import linear_sum_assignment

        given = dict(self.labelled)
        left = [n for n in range(len(self.mode)) if n not in given]
        frequency, _ = self.solved(x)
        open_modes = [m for m in range(len(frequency)) if m not in given.values() and frequency[m] > 0]
        if left:
            apart = np.full((len(left), max(len(open_modes), len(left))), FAR)
            apart[:, : len(open_modes)] = np.abs(np.log(self.frequency[left][:, None] / frequency[open_modes])) ** 2
            for row, n in enumerate(left):
                allowed = self.mode[n].dof
                if allowed is not None:
                    apart[row, [m for m, mode in enumerate(open_modes) if self.home[mode] not in allowed]] = FAR
            rows, columns = linear_sum_assignment(apart)
            for row, column in zip(rows, columns, strict=True):
                if apart[row, column] == FAR:
                    raise InputError([self._too_many(left[row], len(frequency))])
                given[left[row]] = open_modes[column]
        return [given[n] for n in range(len(self.mode))]

    @cached_property
    def labelled(self) -> dict[int, int]:
        """Measurements with a label, and the mode that each is of."""
        given: dict[int, int] = {}
        for n, item in enumerate(self.mode):
            if item.label is not None:
                where = f"{self.where}mode.{n + 1}.label"
                found = scalars.parse([item.label], self.names, (), where)
                numbers = [one.number for one in found if isinstance(one, scalars.Mode)]
                if len(numbers) != 1 or numbers[0] in given.values():
                    raise InputError([Fault(where, "is not one mode, or was measured before", f"see pendsus modes --fidelity {self.level}", shown(item.label))])
                given[n] = numbers[0]
        return given

    def _too_many(self, n: int, count: int) -> Fault:
        allowed = self.mode[n].dof
        if allowed is None:
            return Fault(f"{self.where}mode", f"the design has {count} modes, fewer than were measured", "leave some out")
        return Fault(f"{self.where}mode.{n + 1}.dof", "no mode is left that lives there", f"see pendsus modes --fidelity {self.level}", shown(allowed))
