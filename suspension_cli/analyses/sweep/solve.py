"""Modes, responses and couplings of a design over grids of any of its numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.files.declared import common_unit
from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.named_results import Mode, Ratio, Scalar
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.studies import builds, variants
from suspension_cli.studies.axes import Product
from suspension_cli.studies.builds import Builds, Column, ColumnValues

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

OTHER_COORDINATES = len(builds.STATUS)
STATUS = (*builds.STATUS, "the design has other coordinates than the one swept")
"""Meaning of the status of a point."""


@dataclass(frozen=True)
class ParameterSweep(Product):
    """Grid of designs, whose axes are named by dotted paths.

    Attributes
    ----------
    allow_unstable
        Whether responses about an unstable equilibrium count as valid.
    """

    level: str
    results: tuple[Scalar, ...]
    allow_unstable: bool = False

    @property
    def columns(self) -> tuple[Column, ...]:
        """Datasets of the file: results, status, and modes and responses before tracking.

        `value`, `rank` and `overlap` are filled in by `result.complete`.
        """
        count = len(self.nominal.omega_squared)
        found = [
            Column(
                "value",
                "f8",
                (len(self.results),),
                common_unit((item.unit for item in self.results), "unit"),
                ("result",),
            ),
            Column("status", "u1", (), "1"),
        ]
        if self.ratios:
            found.append(
                Column(
                    "response",
                    "c16",
                    (len(self.ratios),),
                    common_unit((item.unit for item in self.ratios), "response_unit"),
                    ("response_name",),
                )
            )
        if len(self.ratios) < len(self.results):
            found += [
                Column("omega_squared", "f8", (count,), "rad^2/s^2", ("mode_number",)),
                Column(
                    "shape",
                    "f4",
                    (count, len(self.nominal.coordinate)),
                    "1",
                    ("mode_number", "coordinate"),
                ),
                Column("rank", "i2", (count,), "1", ("mode",)),
                Column("overlap", "f8", (count,), "1", ("mode",)),
            ]
        return tuple(found)

    @property
    def ratios(self) -> tuple[Ratio, ...]:
        """Responses and couplings among the results."""
        return tuple(result for result in self.results if isinstance(result, Ratio))

    @cached_property
    def _model(self) -> LinearSystem:
        """Nominal system, without the frequency-dependent terms.

        Modes and coordinates do not need these terms, which cannot be pickled.
        """
        return replace(registry.by_name(self.level).system(self.design), terms=())

    @cached_property
    def nominal(self) -> Modes:
        """Modes of the nominal design; results are named by their labels."""
        return eigenmodes.solve(self._model)

    @cached_property
    def nominal_shape(self) -> Float[np.ndarray, "mode coordinate"]:
        """Shapes of the nominal modes, as in `batch_modes.Spectrum`."""
        return batch_modes.solve(self._model).shape

    def check(self) -> None:
        """Raise `InputError` if a path does not exist or its values give no valid design."""
        self.check_designs("--vary", self.axes, lambda one: registry.choose(one, self.level))

    def compute(self, start: int, stop: int) -> ColumnValues:
        """Compute the `columns` of points start to stop - 1."""
        values = self.values(start, stop)
        result = {column.name: blank_values(column, stop - start) for column in self.columns}
        for found, here in variants.balanced(
            self.text, values, self.level, allow_unstable=self.allow_unstable
        ):
            same = (
                found.model.coordinate == self._model.coordinate
                and (found.model.massless == self._model.massless).all()
            )
            result["status"][here] = found.status if same else OTHER_COORDINATES
            if not same:
                continue
            if "shape" in result:
                solvable = has_modes(found.status)
                solved = batch_modes.solve(found.model.constant.select(np.flatnonzero(solvable)))
                result["omega_squared"][here[solvable]] = solved.omega_squared
                result["shape"][here[solvable]] = solved.shape
            for n, ratio in enumerate(self.ratios):
                result["response"][here, n] = evaluate_ratio(found, ratio)
        return result


def has_modes(status: Int[np.ndarray, "*build"]) -> Bool[np.ndarray, "*build"]:
    """Whether builds have an equilibrium on taut wires, stable or not, from their status."""
    return (status == builds.GOOD) | (status == builds.UNSTABLE)


def evaluate_ratio(found: Builds, ratio: Ratio) -> Complex[np.ndarray, " build"]:
    """Evaluate a response, or a ratio of two, for a batch of builds, SI."""
    outputs = [ratio.over] + ([] if ratio.under is None else [ratio.under])
    with np.errstate(all="ignore"):
        value = builds.transfer(found, np.array([ratio.frequency]), [ratio.input], outputs)[
            :, 0, :, 0
        ]
        if ratio.under is None:
            return value[:, 0]
        return divide(value[:, 0], value[:, 1])


def divide(
    over: Complex[np.ndarray, "*shape"], under: Complex[np.ndarray, "*shape"]
) -> Complex[np.ndarray, "*shape"]:
    """Divide complex responses; exactly 0 where a symmetry makes `over` vanish."""
    with np.errstate(all="ignore"):
        return np.where((over == 0) & (np.abs(under) > 0), 0.0, over / under)


def blank_values(column: Column, count: int) -> np.ndarray:
    """Values of a column for `count` points that are invalid or not yet computed."""
    blank = {"u1": builds.IMPOSSIBLE, "i2": -1, "c16": builds.NOTHING}.get(column.dtype, np.nan)
    return np.full((count, *column.shape), blank, dtype=column.dtype)


def count_failures(
    status: Int[np.ndarray, "*build"], meaning: tuple[str, ...] = builds.STATUS
) -> dict[str, int]:
    """Count builds by reason of failure.

    >>> count_failures(np.zeros(3, dtype=int))
    {}
    """
    return {
        reason: int((status == code).sum())
        for code, reason in enumerate(meaning)
        if code != builds.GOOD and (status == code).any()
    }


def evaluate_results(
    results: tuple[Scalar, ...],
    omega_squared: Float[np.ndarray, "*point mode"] | None,
    rank: Int[np.ndarray, "*point nominal"] | None,
    response: Complex[np.ndarray, "*point response"] | None,
) -> Float[np.ndarray, "*point result"]:
    """Evaluate results: frequencies in Hz and magnitudes of responses in SI units.

    NaN for an unstable mode. `omega_squared`, (rad/s)^2, is ascending, and `rank` the position
    there of each nominal mode, or -1. `response` are the responses among the results, in their
    order.
    """
    columns, responses = [], 0
    for result in results:
        if isinstance(result, Mode):
            assert rank is not None and omega_squared is not None
            place = rank[..., result.number]
            squared = np.take_along_axis(
                omega_squared, np.maximum(place, 0)[..., None].astype(np.intp), -1
            )[..., 0]
            columns.append(
                np.sqrt(np.where((place < 0) | ~(squared >= 0), np.nan, squared)) / (2 * np.pi)
            )
        else:
            assert response is not None
            columns.append(np.abs(response[..., responses]))
            responses += 1
    return np.stack(columns, axis=-1)
