"""What becomes of a design's modes, responses and couplings as its parameters change: any dotted paths over grids."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.analysis import builds, modes, spectrum, variants
from suspension_cli.analysis.axes import Axis, Product, of_option
from suspension_cli.analysis.builds import Builds, Column
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.scalars import Mode, Ratio, Scalar
from suspension_cli.design import reader
from suspension_cli.design.scene import Array
from suspension_cli.errors import InputError
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity

OTHER = len(builds.STATUS)
STATUS = (*builds.STATUS, "the design has other coordinates than the one swept")
"""What the status of a point means."""


@dataclass(frozen=True)
class ParameterSweep(Product):
    """A product of values of parameters, as a job for `batch.run`: the first axis turns slowest.

    Attributes
    ----------
    text : str
        The design as TOML.
    axes : tuple of Axis
        Named by dotted paths.
    level : str
        Rung of the ladder of models.
    results : tuple of Scalar
        What is asked of every point.
    allow_unstable : bool
        Whether responses about an unstable equilibrium are as good as any.
    """

    text: str
    axes: tuple[Axis, ...]
    level: str
    results: tuple[Scalar, ...]
    allow_unstable: bool = False

    @property
    def identity(self) -> str:
        """What tells this sweep from another of the same design."""
        return repr((self.axes, self.level, self.results, self.allow_unstable))

    @property
    def columns(self) -> tuple[Column, ...]:
        """How each point went, its modes by rank and its responses; `value`, `rank` and `overlap` are filled in when all points are there."""
        count = len(self.nominal.omega_squared)
        found = [Column("value", "f8", (len(self.results),), "SI, see result_unit; Hz for modes", ("result",)), Column("status", "u1", (), "1")]
        if self.ratios:
            found.append(Column("response", "c16", (len(self.ratios),), "SI, see result_unit", ("response_name",)))
        if len(self.ratios) < len(self.results):
            found += [
                Column("omega_squared", "f8", (count,), "rad^2/s^2", ("mode_number",)),
                Column("shape", "f4", (count, len(self.nominal.coordinate)), "1", ("mode_number", "coordinate")),
                Column("rank", "i2", (count,), "1", ("mode",)),
                Column("overlap", "f8", (count,), "1", ("mode",)),
            ]
        return tuple(found)

    @property
    def ratios(self) -> tuple[Ratio, ...]:
        """The responses and couplings among the results."""
        return tuple(result for result in self.results if isinstance(result, Ratio))

    @cached_property
    def _model(self) -> LinearModel:
        """As drawn, without what depends on frequency: neither modes nor coordinates need it, and processes could not be sent it."""
        return replace(fidelity.linear_model(reader.parse(self.text), self.level), terms=())

    @cached_property
    def nominal(self) -> Modes:
        """The modes of the design as drawn, whose labels the results bear."""
        return modes.solve(self._model)

    @cached_property
    def nominal_shape(self) -> Array:
        """Their shapes as `spectrum.Spectrum` has them."""
        return spectrum.of_one(self._model).shape[0]

    def check(self) -> None:
        """Raise `InputError` now if a path leads nowhere, or none of its first, middle and last value gives a design."""
        for axis in self.axes:
            errors = []
            tried = [axis.values[n] for n in sorted({0, len(axis.values) // 2, len(axis.values) - 1})]
            for value in tried:
                try:
                    fidelity.choose(variants.overridden(self.text, {axis.name: value}), self.level)
                except InputError as error:
                    errors.append(of_option(error, "--vary", axis, value))
            if len(errors) == len(tried):
                raise errors[0]

    def compute(self, start: int, stop: int) -> dict[str, Any]:
        """Results of points start to stop - 1."""
        values = self.values(start, stop)
        result = {column.name: _nothing(column, stop - start) for column in self.columns}
        for found, here in variants.balanced(self.text, values, self.level, allow_unstable=self.allow_unstable):
            same = found.model.coordinate == self._model.coordinate and (found.model.massless == self._model.massless).all()
            result["status"][here] = found.status if same else OTHER
            if not same:
                continue
            if "shape" in result:
                well = (found.status == builds.GOOD) | (found.status == builds.UNSTABLE)
                solved = spectrum.solve(picked(found.model, well))
                result["omega_squared"][here[well]], result["shape"][here[well]] = solved.omega_squared, solved.shape
            for n, ratio in enumerate(self.ratios):
                result["response"][here, n] = ratio_of(found, ratio)
        return result


def picked(model: LinearModel, which: Any) -> LinearModel:
    """The models of a batch for which `which` (p,) holds."""
    count = len(which)

    def cut(matrix: Any) -> Any:
        return np.broadcast_to(matrix, (count, *matrix.shape[-2:]))[which]

    return replace(model, mass=cut(model.mass), stiffness=cut(model.stiffness), lossy=None)


def ratio_of(found: Builds, ratio: Ratio) -> Any:
    """A response or a ratio of two, (p,), complex."""
    outputs = [ratio.over] + ([] if ratio.under is None else [ratio.under])
    with np.errstate(all="ignore"):
        value = builds.transfer(found, np.array([ratio.frequency]), [ratio.input], outputs)[:, 0, :, 0]
        if ratio.under is None:
            return value[:, 0]
        return np.where((value[:, 0] == 0) & (np.abs(value[:, 1]) > 0), 0.0, value[:, 0] / value[:, 1])


def _nothing(column: Column, count: int) -> Any:
    """What stands for points of which there is no design, and for what is filled in at the end."""
    blank = {"u1": builds.IMPOSSIBLE, "i2": -1, "c16": builds.NOTHING}.get(column.dtype, np.nan)
    return np.full((count, *column.shape), blank, dtype=column.dtype)


def scalar(results: tuple[Scalar, ...], omega_squared: Any, rank: Any, response: Any) -> Array:
    """The numbers asked for, (..., r): frequencies in Hz (NaN for an unstable mode) and sizes of responses.

    Parameters
    ----------
    results : tuple of Scalar
    omega_squared : (..., m) array or None
        By rank.
    rank : (..., m) int array or None
        Of the modes as drawn; -1 where there are none.
    response : (..., k) complex array or None
        Of the responses among the results, in their order.
    """
    columns, responses = [], 0
    for result in results:
        if isinstance(result, Mode):
            place = rank[..., result.number]
            squared = np.take_along_axis(omega_squared, np.maximum(place, 0)[..., None].astype(np.intp), -1)[..., 0]
            columns.append(np.sqrt(np.where((place < 0) | ~(squared >= 0), np.nan, squared)) / (2 * np.pi))
        else:
            columns.append(np.abs(response[..., responses]))
            responses += 1
    return np.stack(columns, axis=-1)
