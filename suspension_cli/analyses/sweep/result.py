"""Result of a sweep of parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from suspension_cli.analyses.growth import find_growth
from suspension_cli.analyses.sweep.solve import (
    STATUS,
    ParameterSweep,
    count_failures,
    evaluate_results,
    has_modes,
)
from suspension_cli.design.reader import parse
from suspension_cli.files.declared import (
    ATTRIBUTE,
    AXES,
    Contents,
    along,
    in_unit,
    pack_fields,
)
from suspension_cli.files.hdf5 import Stored
from suspension_cli.linear import mode_pairing, signals
from suspension_cli.linear.named_results import Mode, Ratio, Scalar, labels
from suspension_cli.linear.response import solve
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.studies.axes import Axis

if TYPE_CHECKING:
    from jaxtyping import Float, Int

MAX_BYTES = 1 << 28
"""Largest set of mode shapes that is read into memory; larger ones are read point by point."""


@dataclass(frozen=True)
class SweepResult:
    """A finished sweep.

    Attributes
    ----------
    axes
        Parameters, named by dotted paths, with their values in SI.
    drawn
        Nominal value of each parameter; NaN where the design does not give it.
    start
        Grid point nearest to the nominal design.
    result, unit
        Names and units of the results; ``Hz`` for modes.
    degree
        Dominant motion of each mode in the nominal design, ``test.pitch``; empty for responses.
    nominal
        Results of the nominal design.
    value
        Results; NaN where there is none.
    status
        See `solve.STATUS`.
    overlap
        Smallest overlap of shapes by which a mode among the results was followed from one point to
        the next; 1 without modes.
    mode, mode_number, coordinate
        Labels of the nominal modes, numbers of the modes of each point, and coordinates of shapes;
        None without modes.
    response_name, response_unit
        Responses and couplings among the results; None without these.
    """

    axes: tuple[Axis, ...] = field(metadata=AXES)
    drawn: tuple[float, ...]
    start: tuple[int, ...]
    result: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("result"))
    degree: tuple[str, ...] = field(metadata=along("result"))
    nominal: Float[np.ndarray, " result"] = field(metadata=in_unit("{unit}"))
    value: Float[np.ndarray, "*axes result"] = field(metadata=in_unit("{unit}"))
    status: Int[np.ndarray, "*axes"]
    overlap: float
    mode: tuple[str, ...] | None = None
    mode_number: Int[np.ndarray, " mode_number"] | None = None
    coordinate: tuple[str, ...] | None = None
    response_name: tuple[str, ...] | None = None
    response_unit: tuple[str, ...] | None = field(default=None, metadata=along("response_name"))
    status_meaning: tuple[str, ...] = field(default=STATUS, metadata=ATTRIBUTE)

    @property
    def failures(self) -> dict[str, int]:
        """Number of failed points by reason."""
        return count_failures(self.status, STATUS)

    @property
    def change(self) -> Float[np.ndarray, " result"]:
        """Relative change of each result over the grid, largest over smallest less 1.

        0 where a result has no value; the largest value where the smallest is 0.
        """
        flat = self.value.reshape(-1, len(self.result))
        low, high = np.fmin.reduce(flat, axis=0), np.fmax.reduce(flat, axis=0)
        return np.where(np.isfinite(low), (high - low) / np.where(low > 0, low, 1.0), 0.0)


def nominal_parameters(job: ParameterSweep) -> tuple[float, ...]:
    """Read the nominal value of each swept parameter; NaN where the design does not give it."""
    import tomllib

    from suspension_cli.design.paths import value_at

    raw = tomllib.loads(job.text)
    given = [value_at(raw, axis.name) for axis in job.axes]
    return tuple(
        float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else np.nan
        for value in given
    )


def nearest_point(job: ParameterSweep) -> tuple[int, ...]:
    """Find the grid point nearest to the nominal design; 0 along axes without a nominal value."""
    return tuple(
        0 if np.isnan(at) else int(np.abs(np.array(axis.values) - at).argmin())
        for axis, at in zip(job.axes, nominal_parameters(job), strict=True)
    )


def describe(job: ParameterSweep, model: LinearSystem) -> Contents:
    """Return what a results file has besides the columns: axes, names and nominal results."""
    given = {
        "axes": job.axes,
        "drawn": nominal_parameters(job),
        "start": nearest_point(job),
        "result": tuple(item.text for item in job.results),
        "unit": tuple(item.unit for item in job.results),
        "degree": tuple(_home(job, item) for item in job.results),
        "nominal": nominal_results(job, model),
        "overlap": 1.0,
        "status_meaning": STATUS,
    }
    if job.ratios:
        given["response_name"] = tuple(item.text for item in job.ratios)
        given["response_unit"] = tuple(item.unit for item in job.ratios)
    if len(job.ratios) < len(job.results):
        given["mode"] = labels(job.nominal)
        given["mode_number"] = np.arange(1, len(job.nominal.omega_squared) + 1)
        given["coordinate"] = job.nominal.coordinate
    return pack_fields(SweepResult, given)


def _home(job: ParameterSweep, item: Scalar) -> str:
    return ".".join(job.nominal.home[item.number]) if isinstance(item, Mode) else ""


def nominal_results(job: ParameterSweep, model: LinearSystem) -> Float[np.ndarray, " result"]:
    """Evaluate the results of the nominal design; `model` has its frequency-dependent terms.

    Without a steady state, responses are NaN unless the job allows it.
    """
    steady = not job.ratios or job.allow_unstable
    steady = steady or not find_growth(parse(job.text), registry.by_name(job.level), model)
    return np.array(
        [
            job.nominal.frequency[item.number]
            if isinstance(item, Mode)
            else _magnitude(model, item)
            if steady
            else np.nan
            for item in job.results
        ]
    )


def _magnitude(model: LinearSystem, item: Ratio) -> float:
    outputs = [
        signals.parse_output(signal.text, signals.bodies_with_signals(model))
        for signal in (item.over, item.under)
        if signal is not None
    ]
    value = solve(model, np.array([item.frequency]), [item.input], outputs).value[0, :, 0]
    with np.errstate(all="ignore"):
        return float(np.abs(value[0] if len(value) == 1 else value[0] / value[1]))


def complete(part: Path, job: ParameterSweep) -> None:
    """Track modes over the grid of a file with all points, and fill in the results."""
    with h5py.File(part, "r+", locking=False) as file:
        group: Stored = file["sweep"]
        squared = rank = None
        if "shape" in group:
            stored = group["shape"]
            shapes = stored[:] if stored.size * 4 <= MAX_BYTES else stored
            squared = group["omega_squared"][:]
            rank, overlap = mode_pairing.follow(
                squared,
                shapes,
                has_modes(group["status"][:]),
                nearest_point(job),
                job.nominal_shape,
            )
            group["rank"][...], group["overlap"][...] = rank, overlap
            names = {item.text for item in job.results}
            tracked = [n for n, name in enumerate(labels(job.nominal)) if name in names]
            least = float(np.fmin.reduce(overlap[..., tracked], axis=None))
            group.attrs["overlap"] = 1.0 if np.isnan(least) else least
        group["value"][...] = evaluate_results(
            job.results, squared, rank, group["response"][:] if "response" in group else None
        )
