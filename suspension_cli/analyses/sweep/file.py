"""The group `sweep` of a results file."""

from __future__ import annotations

from dataclasses import dataclass
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
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.linear import signals
from suspension_cli.linear.named_results import Mode, Ratio, Scalar, labels
from suspension_cli.linear.response import solve
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.studies import mode_tracking
from suspension_cli.studies.axes import Axis, scale_name

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
    """

    axes: tuple[Axis, ...]
    drawn: tuple[float, ...]
    start: tuple[int, ...]
    result: tuple[str, ...]
    unit: tuple[str, ...]
    degree: tuple[str, ...]
    nominal: Float[np.ndarray, " result"]
    value: Float[np.ndarray, "*axes result"]
    status: Int[np.ndarray, "*axes"]
    overlap: float

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


def fill(group: h5py.Group, job: ParameterSweep, model: LinearSystem) -> None:
    """Write everything but the columns: axes, names and results of the nominal design."""
    for axis in job.axes:
        add_scale(group, scale_name(axis.name), np.array(axis.values), "SI, or its own")
    result = add_scale(group, "result", [item.text for item in job.results], "name")
    add_dataset(group, "result_unit", [item.unit for item in job.results], "name", result)
    add_dataset(group, "result_home", [_home(job, item) for item in job.results], "name", result)
    add_dataset(
        group, "nominal", nominal_results(job, model), "SI, see result_unit; Hz for modes", result
    )
    if job.ratios:
        add_scale(group, "response_name", [item.text for item in job.ratios], "name")
    if len(job.ratios) < len(job.results):
        add_scale(group, "mode", labels(job.nominal), "name")
        add_scale(group, "mode_number", np.arange(1, len(job.nominal.omega_squared) + 1), "1")
        add_scale(group, "coordinate", list(job.nominal.coordinate), "name")
    group.attrs["axis_order"] = [axis.name for axis in job.axes]
    group.attrs["drawn"] = nominal_parameters(job)
    group.attrs["start"] = nearest_point(job)
    group.attrs["status_meaning"] = list(STATUS)


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
            rank, overlap = mode_tracking.follow(
                squared,
                shapes,
                has_modes(group["status"][:]),
                nearest_point(job),
                job.nominal_shape,
            )
            group["rank"][...], group["overlap"][...] = rank, overlap
        group["value"][...] = evaluate_results(
            job.results, squared, rank, group["response"][:] if "response" in group else None
        )


def load(group: Stored) -> SweepResult:
    """Read a finished sweep from the group `sweep`."""
    names = [str(name) for name in group.attrs["axis_order"]]
    result = tuple(group["result"].asstr()[:])
    overlap = 1.0
    if "overlap" in group:
        tracked = [n for n, name in enumerate(group["mode"].asstr()[:]) if name in result]
        overlap = float(np.fmin.reduce(group["overlap"][:][..., tracked], axis=None))
    return SweepResult(
        axes=tuple(Axis(name, tuple(group[scale_name(name)][:].tolist())) for name in names),
        drawn=tuple(float(value) for value in group.attrs["drawn"]),
        start=tuple(int(value) for value in group.attrs["start"]),
        result=result,
        unit=tuple(group["result_unit"].asstr()[:]),
        degree=tuple(group["result_home"].asstr()[:]),
        nominal=group["nominal"][:],
        value=group["value"][:],
        status=group["status"][:],
        overlap=1.0 if np.isnan(overlap) else overlap,
    )
